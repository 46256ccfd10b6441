#include "node/known_weight.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>

#include "config/text_file.hpp"
#include "node/log.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {
namespace {

constexpr std::int64_t kFormat = 1;
constexpr double kMost_N = 1e6, kMonth_s = 30 * 86400.0;
constexpr std::uint64_t kLook_ns = 100'000'000, kAgain_ns = 10'000'000'000;

grasp::Leak read_leak(Options& table) {
    grasp::Leak leak;
    leak.press_N = table.number("press_N", {1e-9, kMost_N});
    leak.sd_N = table.number("sd_N", {0, kMost_N});
    leak.followed = table.flag("followed", false);
    const char* const keys[] = {"x_N", "y_N"};
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const auto knots = table.numbers(keys[axis], {-kMost_N, kMost_N}, {grasp::Leak::kKnots, grasp::Leak::kKnots});
        for (std::size_t k = 0; k < knots.size() && k < grasp::Leak::kKnots; ++k) leak.shear_N[k][axis] = knots[k];
    }
    return leak;
}

std::string text_of(const grasp::Leak& leak, std::size_t jaw) {
    std::array<double, grasp::Leak::kKnots> x{}, y{};
    for (std::size_t k = 0; k < x.size(); ++k) x[k] = leak.shear_N[k][0], y[k] = leak.shear_N[k][1];
    return fmt::format("\n[[leak]]\njaw = {}\npress_N = {}\nsd_N = {}\nfollowed = {}\nx_N = [{}]\ny_N = [{}]\n", jaw,
                       leak.press_N, leak.sd_N, leak.followed, fmt::join(x, ", "), fmt::join(y, ", "));
}

}  // namespace

std::int64_t calendar_s() noexcept { return std::time(nullptr); }

std::optional<grasp::Check> load_check(const std::string& path, std::uint32_t belongs_to, std::int64_t now_s,
                                       std::string& why_not) {
    constexpr char kRemedy[] = "show the known weight again (tactilectl weigh known)";
    if (::access(path.c_str(), F_OK) != 0) return std::nullopt;
    Problems problems;
    Options file = Options::parse_file(path, problems, 65536);
    if (problems.empty() && file.integer("format", {1, 1e9}) != kFormat)
        file.problem("format", fmt::format("this tactiled reads format = {}", kFormat));
    if (!problems.empty()) {
        why_not = fmt::format("{}; not used, {}", problems.lines().front(), kRemedy);
        return std::nullopt;
    }
    grasp::Check check;
    const std::string of = file.text("belongs_to");
    check.mass_kg = file.number("mass_kg", {1e-9, 1000});
    check.scale = file.number("scale", {1e-3, 1e3});
    const double shown_s = file.number("shown_unix_s", {0, 1e12});
    auto leaks = file.tables("leak", grasp::kMostJaws);
    if (file.integer("leaks", {0, double(grasp::kMostJaws)}) != std::int64_t(leaks.size()))
        file.problem("leaks", "the file is cut off");
    for (auto& table : leaks) {
        const auto jaw = std::size_t(table.integer("jaw", {0, double(grasp::kMostJaws - 1)}));
        check.leak[std::min(jaw, grasp::kMostJaws - 1)] = read_leak(table);
    }
    file.finish();
    if (!problems.empty()) {
        why_not = fmt::format("{}; not used, {}", problems.lines().front(), kRemedy);
        return std::nullopt;
    }
    if (of != fmt::format("{:08x}", belongs_to)) {
        why_not = fmt::format("{}: of other jaws, or other calibrations of their sensors; not used, {}", path, kRemedy);
        return std::nullopt;
    }
    check.age_s = double(now_s) - shown_s;
    if (check.age_s < 0) check.age_s = kMonth_s;  // a clock that forgot the date
    return check;
}

void store_check(const std::string& path, const KeptCheck& kept, std::int64_t now_s) {
    if (!(kept.check.mass_kg > 0)) {
        ::unlink(path.c_str());
        return;
    }
    std::string text = fmt::format(
        "# The known weight that this gripper was shown last, and what it taught. Written by the daemon; remove it to "
        "forget.\n"
        "format = {}\nbelongs_to = \"{:08x}\"\nmass_kg = {}\nscale = {}\nshown_unix_s = {}\nleaks = {}\n",
        kFormat, kept.belongs_to, kept.check.mass_kg, kept.check.scale, now_s - std::int64_t(kept.check.age_s),
        std::count_if(kept.check.leak.begin(), kept.check.leak.end(), [](const auto& leak) { return leak.press_N > 0; }));
    for (std::size_t jaw = 0; jaw < kept.check.leak.size(); ++jaw)
        if (kept.check.leak[jaw].press_N > 0) text += text_of(kept.check.leak[jaw], jaw);
    replace_file(path, text);
}

CheckKeeper::CheckKeeper(std::string path, Ring<KeptCheck>& checks) : path_(std::move(path)), checks_(checks) {
    thread_.start("known", 0, -1, [this] { run(); });
}

CheckKeeper::~CheckKeeper() {
    stop_.store(true);
    thread_.join();
}

void CheckKeeper::run() noexcept {
    std::uint64_t next_ns = 0;
    for (;;) {
        const bool stop = stop_.load();
        const std::uint64_t now_ns = monotonic_ns();
        while (const KeptCheck* kept = stop || now_ns >= next_ns ? checks_.front() : nullptr) {
            if (!store(*kept) && !stop) {  // the disk is full, or read-only: it may get better
                next_ns = now_ns + kAgain_ns;
                break;
            }
            checks_.pop();
        }
        if (stop) return;
        sleep_until(now_ns + kLook_ns);
    }
}

bool CheckKeeper::store(const KeptCheck& kept) noexcept try {
    store_check(path_, kept, calendar_s());
    told_ = false;
    return true;
} catch (const std::exception& error) {
    if (!told_) log_line(LogLevel::warning, "the known weight will be forgotten at the end: {}", error.what());
    told_ = true;
    return false;
}

}  // namespace tactiled
