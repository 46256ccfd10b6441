#include "node/web/player.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "config/options.hpp"
#include "node/ctl/sample_message.hpp"
#include "tactiled/reader.hpp"

namespace tactiled::web {
namespace {

constexpr std::uint64_t kLookAhead = 16u << 20;       // bytes in which plan() looks for a sample of each sensor
constexpr std::uint64_t kBeatEachNs = 10'000'000;     // the daemon's interval
constexpr std::uint32_t kStaleMs = 2000;              // the recording says itself where a sensor was stale
constexpr std::uint64_t kMaxPauseNs = 2'000'000'000;  // longer pauses of the recorder are cut

// A file may come from anywhere: what no configuration would allow in a name becomes a question mark, so that the segment
// is valid UTF-8 and has no control characters.
template <std::size_t N>
void put(char (&to)[N], const std::string& text) {
    std::size_t n = 0;
    for (const char c : text)
        if (n < N - 1) to[n++] = c >= ' ' && c < '\x7f' ? c : '?';
    to[n] = '\0';
}

std::string word(const mcap::Channel& channel, std::string_view key) {
    const auto found = channel.metadata.find(std::string(key));
    return found == channel.metadata.end() ? "" : found->second;
}

// "pick.mcap" is node "pick-1234": a name that no daemon has.
std::string name_of(const std::string& path) {
    std::string name;
    for (const char c : std::filesystem::path(path).stem().string())
        if (name.size() < 20) name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '-';
    return fmt::format("{}-{}", name, ::getpid());
}

std::uint32_t components_of(const tactiled_sample& s) {
    std::uint32_t bits = 0;
    for (std::uint32_t i = 0; i < 6; ++i)
        if (std::isfinite(i < 3 ? s.raw_force_S_N[i] : s.raw_torque_S_Nm[i - 3])) bits |= 1u << i;
    return bits;
}

}  // namespace

Player::Player(const std::string& path) {
    plan(path);
    writer_ = std::make_unique<SegmentWriter>(plan_);
    for (std::uint32_t i = 0; i < plan_.links.size(); ++i) writer_->set_link_state(i, TACTILED_LINK_OPEN);
    last_.resize(plan_.sensors.size());
    writer_->set_state(TACTILED_RUNNING);
    thread_ = std::thread([this, path] { run(path); });
}

Player::~Player() {
    stop_ = true;
    thread_.join();
}

void Player::plan(const std::string& path) {
    mcap::MessageFile file;
    if (const std::string wrong = file.open(path); !wrong.empty()) throw SetupError(fmt::format("{}: {}", path, wrong));
    file.declare_all();
    plan_.name = name_of(path);
    plan_.version = TACTILED_VERSION;
    for (const auto& [number, channel] : file.reader().channels()) {
        if (channel.schema != ctl::kSampleSchema) continue;
        const std::string name = word(channel, ctl::kSensorKey);
        const auto [known, is_new] = index_.emplace(name, int(plan_.sensors.size()));
        if (!is_new) continue;
        if (plan_.sensors.size() == TACTILED_MAX_SENSORS) {
            index_.erase(known);
            continue;
        }
        tactiled_sensor sensor{};
        put(sensor.name, name);
        const auto is_taken = [&] {
            return std::any_of(plan_.sensors.begin(), plan_.sensors.end(),
                               [&](const tactiled_sensor& other) { return std::strcmp(other.name, sensor.name) == 0; });
        };
        // Long or odd names may be the same after put().
        if (sensor.name[0] == '\0' || is_taken()) put(sensor.name, fmt::format("sensor-{}", plan_.sensors.size()));
        put(sensor.model, word(channel, "model"));
        put(sensor.method, word(channel, "method"));
        put(sensor.serial, word(channel, "serial"));
        put(sensor.link, word(channel, "link"));
        sensor.stale_ms = kStaleMs;
        for (float& scale : sensor.full_scale) scale = std::numeric_limits<float>::quiet_NaN();
        plan_.sensors.push_back(sensor);
        const bool has_link = std::any_of(plan_.links.begin(), plan_.links.end(),
                                          [&](const tactiled_link& l) { return std::strcmp(l.name, sensor.link) == 0; });
        if (has_link || plan_.links.size() == TACTILED_MAX_LINKS) continue;
        tactiled_link link{};
        put(link.name, sensor.link);
        put(link.driver, "recording");
        link.simulated = 1;
        plan_.links.push_back(link);
    }
    if (plan_.sensors.empty()) throw SetupError(fmt::format("{}: has no samples of tactilectl record", path));
    std::size_t unknown = plan_.sensors.size();
    while (unknown > 0 && file.bytes_read() < kLookAhead) {
        const auto message = file.next(kLookAhead);
        if (!message) break;
        tactiled_sample sample;
        const int i = sensor_of(*message, sample);
        if (i < 0 || plan_.sensors[std::size_t(i)].components != 0) continue;
        plan_.sensors[std::size_t(i)].components = components_of(sample);
        if (plan_.sensors[std::size_t(i)].components != 0) --unknown;
    }
}

int Player::sensor_of(const mcap::Message& message, tactiled_sample& sample) const {
    if (message.channel->schema != ctl::kSampleSchema || !ctl::decode_sample(message.data, sample)) return -1;
    const auto found = index_.find(word(*message.channel, ctl::kSensorKey));
    return found == index_.end() ? -1 : found->second;
}

void Player::run(const std::string& path) {
    while (!stop_) {
        mcap::MessageFile file;
        if (file.open(path).empty()) play(file);
        ++rounds_;
        wait_until(monotonic_ns() + 1'000'000'000);  // its end is seen, and an unreadable file causes no load
    }
}

void Player::play(mcap::MessageFile& file) {
    std::uint64_t due_ns = monotonic_ns(), last_ns = 0;
    while (!stop_) {
        const auto message = file.next();
        if (!message) return;
        tactiled_sample sample;
        const int i = sensor_of(*message, sample);
        if (i < 0) continue;
        if (last_ns != 0 && sample.t_ns > last_ns) due_ns += std::min(sample.t_ns - last_ns, kMaxPauseNs);
        last_ns = std::max(last_ns, sample.t_ns);
        wait_until(due_ns);
        // A file may say anything; the page and other readers rely on this.
        if (sample.quality >= TACTILED_BAD) tactiled_invalidate(&sample, 0);
        sample.t_published_ns = monotonic_ns();
        sample.t_ns = std::min(due_ns, sample.t_published_ns);
        sample.sequence = node_.count[i]++;
        sample.epoch = writer_->epoch() << 16 | ((sample.epoch + rounds_) & 0xFFFFu);
        writer_->publish(std::uint32_t(i), sample);
        last_[std::size_t(i)] = sample;
        if (sample.t_published_ns - beat_ns_ >= kBeatEachNs) beat(sample.t_published_ns);
    }
}

void Player::wait_until(std::uint64_t t_ns) {
    while (!stop_) {
        const std::uint64_t now_ns = monotonic_ns();
        if (now_ns - beat_ns_ >= kBeatEachNs) beat(now_ns);
        if (now_ns >= t_ns) return;
        tactiled_sleep_until(std::min(t_ns, now_ns + kBeatEachNs));
    }
}

void Player::beat(std::uint64_t now_ns) {
    beat_ns_ = now_ns;
    if (now_ns - heartbeat_ns_ >= 100'000'000) {
        heartbeat_ns_ = now_ns;
        ++node_.heartbeat;
    }
    node_.t_ns = now_ns;
    node_.status = TACTILED_SIMULATED | TACTILED_READY;
    for (const tactiled_sample& s : last_) {
        if (s.quality != TACTILED_GOOD && s.quality != TACTILED_UNCERTAIN) node_.status &= ~std::uint32_t(TACTILED_READY);
        if ((s.state & TACTILED_CONTACT) != 0) node_.status |= TACTILED_ANY_CONTACT;
    }
    tactiled_forget_grasp(&node_.grasp);
    writer_->publish(node_);
    ++node_.sequence;
}

}  // namespace tactiled::web
