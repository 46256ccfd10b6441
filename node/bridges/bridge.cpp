#include "node/bridges/bridge.hpp"

#include <fmt/format.h>
#include <systemd/sd-daemon.h>

#include <cctype>
#include <ctime>

#include "node/ctl/command_line.hpp"

namespace tactiled::bridges {
namespace {

constexpr std::uint64_t kSecond = 1'000'000'000;
constexpr std::uint64_t kLogEachNs = 10 * kSecond;

std::string text_of(const Follower& follower, const Counts& counts, const std::string& state) {
    return fmt::format("{}{}; sent {}, dropped {}, missed {}", state,
                       follower.is_alive() ? "" : "; no daemon: " + follower.why(), counts.sent, counts.dropped,
                       follower.missed());
}

}  // namespace

void add_common_options(ctl::Command app, Common& common) {
    app.version(TACTILED_VERSION);
    ctl::add_node_option(app, common.node);
    app.add_option("--sensor", common.sensors, "name of a sensor; again for more; default: all of the node");
    app.add_option("--rate-Hz", common.rate_Hz, "messages of a sensor in a second at most; 0: every sample")
        .number_in(0, 10000)
        .show_default();
}

std::string topic_word(const std::string& name) {
    std::string word;
    for (const char c : name) word += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
    return word.empty() || std::isdigit(static_cast<unsigned char>(word.front())) != 0 ? "_" + word : word;
}

std::vector<std::string> reason_words(std::uint32_t reasons) {
    std::vector<std::string> words;
    for (std::size_t bit = 0; bit < ctl::kReasonWords.size(); ++bit)
        if ((reasons >> bit & 1u) != 0) words.emplace_back(ctl::kReasonWords[bit]);
    return words;
}

double wall_s(std::uint64_t t_ns) {
    timespec wall{};
    ::clock_gettime(CLOCK_REALTIME, &wall);
    const auto age_ns = std::int64_t(monotonic_ns() - t_ns);
    return double(wall.tv_sec) + (double(wall.tv_nsec) - double(age_ns)) / 1e9;
}

bool Pace::passes(std::uint64_t t_ns, std::uint32_t quality) {
    const bool changed = std::exchange(quality_, quality) != quality;
    if (period_ns_ == 0 || changed || t_ns >= due_ns_ || due_ns_ - t_ns > period_ns_) {
        // A multiple of the period, so that a sample that is a little late does not slow the stream down.
        const bool late = changed || t_ns >= due_ns_ + period_ns_ || due_ns_ > t_ns;
        due_ns_ = (late ? t_ns : due_ns_) + period_ns_;
        return true;
    }
    return false;
}

void Report::ready(const std::string& text) const {
    fmt::print(stderr, "{}: {}\n", program_, text);
    ::sd_notify(0, "READY=1");
}

void Report::tick(const Follower& follower, const Counts& counts, const std::string& state) {
    const std::uint64_t now_ns = monotonic_ns();
    if (now_ns - told_ns_ < kSecond) return;
    told_ns_ = now_ns;
    ::sd_notify(0, fmt::format("WATCHDOG=1\nSTATUS={}", text_of(follower, counts, state)).c_str());
    const bool alive = std::exchange(alive_, follower.is_alive()) == follower.is_alive();
    const bool same = std::exchange(said_, state) == state && alive;
    const std::uint64_t dropped = counts.dropped - dropped_, missed = follower.missed() - missed_;
    if (same && (dropped + missed == 0 || now_ns - logged_ns_ < kLogEachNs)) return;
    logged_ns_ = now_ns;
    dropped_ = counts.dropped;
    missed_ = follower.missed();
    fmt::print(stderr, "{}: {}\n", program_, text_of(follower, counts, state));
}

void Report::ended(const Follower& follower, const Counts& counts) const {
    ::sd_notify(0, "STOPPING=1");
    fmt::print(stderr, "{}: ended; sent {}, dropped {}, missed {}\n", program_, counts.sent, counts.dropped,
               follower.missed());
}

}  // namespace tactiled::bridges
