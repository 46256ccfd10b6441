#include "node/gpio_outputs.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tactiled {
namespace {

constexpr std::uint64_t kMs = 1'000'000;
constexpr std::uint64_t kCycleNs = 2 * kMs;  // shorter than the input filters of PLCs, 3 ms and more
// repeated to detect a removed chip, and to correct a line that another program has set
constexpr std::uint64_t kSetAgainNs = 100 * kMs;
constexpr std::uint64_t kLookAgainNs = 100 * kMs;  // retry interval if there is no segment
constexpr std::uint64_t kRepeatNs = 10'000 * kMs;  // minimum interval between equal log lines
constexpr std::uint64_t kMinPauseNs = 50 * kMs, kMaxPauseNs = 1000 * kMs;

}  // namespace

GpioSigns GpioJudge::judge(const tactiled_node* node, std::uint64_t now_ns) noexcept {
    if (node == nullptr) {
        seen_ = false;
        slip_until_ns_ = 0;
        return {};
    }
    const tactiled_grasp& grasp = node->grasp;
    if (seen_ && grasp.slips != slips_) slip_until_ns_ = now_ns + slip_ns_;
    slips_ = grasp.slips;
    seen_ = true;
    GpioSigns signs;
    signs.fault = (node->status & TACTILED_READY) == 0 || (node->status & TACTILED_FAULT) != 0;
    signs.grasped = grasp.state >= TACTILED_GRIP_GRASPED && grasp.state <= TACTILED_GRIP_SLIPPING;
    signs.slip = grasp.state == TACTILED_GRIP_SLIPPING || now_ns < slip_until_ns_;
    signs.alive = (node->heartbeat & 1u) != 0;
    return signs;
}

GpioOutputs::GpioOutputs(std::string node_name, const GpioSettings& settings)
    : node_name_(std::move(node_name)), chip_(settings.chip), judge_(settings.slip_ms) {
    const auto add = [&](const char* key, const std::string& line, bool GpioSigns::*sign, bool high_means) {
        if (!line.empty()) lines_.push_back({.key = key, .name = line, .sign = sign, .high_means = high_means});
    };
    add("fault", settings.fault, &GpioSigns::fault, settings.fault_is == "high");
    add("grasped", settings.grasped, &GpioSigns::grasped, true);
    add("slip", settings.slip, &GpioSigns::slip, true);
    add("alive", settings.alive, &GpioSigns::alive, true);
    thread_.start("gpio", 0, -1, [this] { run(); });
}

GpioOutputs::~GpioOutputs() {
    stop_.store(true, std::memory_order_release);
    thread_.join();
}

void GpioOutputs::run() noexcept {
    while (!stop_.load(std::memory_order_acquire)) {
        const std::uint64_t now_ns = monotonic_ns();
        try {
            cycle(now_ns);
        } catch (const std::exception&) {  // no memory
            signs_ = {};
            set_ns_ = 0;
            (void)set_driven();
        }
        sleep_until(driven() > 0 ? now_ns + kCycleNs : std::min(open_ns_, now_ns + kMinPauseNs));
    }
    signs_ = {};
    (void)set_driven();
    for (auto& line : lines_) line.output.close();
}

void GpioOutputs::cycle(std::uint64_t now_ns) {
    if (now_ns >= open_ns_ && driven() < lines_.size()) {
        pause_ns_ = std::clamp(2 * pause_ns_, kMinPauseNs, kMaxPauseNs);
        open_ns_ = now_ns + pause_ns_;
        if (open_missing()) set_ns_ = 0;
    }
    if (driven() == 0) return;
    const GpioSigns signs = look(now_ns);
    if (set_ns_ != 0 && signs == signs_ && now_ns - set_ns_ < kSetAgainNs) return;
    signs_ = signs;
    set_ns_ = now_ns;
    if (set_driven()) return;
    pause_ns_ = 0;
    open_ns_ = now_ns + kMinPauseNs;
    log_unless_repeated(logged_disconnected_, LogLevel::warning,
                        fmt::format("GPIO chip \"{}\" is disconnected; waiting for it to return", chip_));
}

GpioSigns GpioOutputs::look(std::uint64_t now_ns) {
    if ((!segment_.is_open() || !segment_.is_current()) && now_ns - segment_tried_ns_ >= kLookAgainNs) {
        segment_tried_ns_ = now_ns;
        std::string why;
        if (Segment fresh = Segment::try_open(node_name_, why); fresh.is_open()) segment_ = std::move(fresh);
    }
    tactiled_node node;
    const bool fresh = segment_.is_open() && segment_.is_current() && segment_.latest_node(node) &&
                       tactiled_is_fresh(node.t_ns, monotonic_ns(), segment_.header().watchdog_ms) != 0;
    return judge_.judge(fresh ? &node : nullptr, now_ns);
}

bool GpioOutputs::open_missing() {
    bool more = false;
    for (auto& line : lines_) {
        if (line.driven) continue;
        const bool sign = GpioSigns{}.*line.sign;  // shows a fault until the first evaluation
        const std::string wrong = line.output.open({chip_, line.name}, sign == line.high_means);
        line.driven = wrong.empty();
        more |= line.driven;
        if (!line.driven)
            log_unless_repeated(line.logged_refused, LogLevel::warning, fmt::format("{}: {}", line.key, wrong));
    }
    if (more)
        log_unless_repeated(logged_driving_, LogLevel::info,
                            fmt::format("drives {} of {} lines of chip \"{}\"", driven(), lines_.size(), chip_));
    return more;
}

bool GpioOutputs::set_driven() {
    bool all = true;
    for (auto& line : lines_) {
        if (!line.driven || line.output.set(signs_.*line.sign == line.high_means)) continue;
        line.output.close();
        line.driven = all = false;
    }
    return all;
}

std::size_t GpioOutputs::driven() const noexcept {
    return std::size_t(std::count_if(lines_.begin(), lines_.end(), [](const Line& line) { return line.driven; }));
}

void GpioOutputs::log_unless_repeated(LastLogged& last, LogLevel level, const std::string& text) {
    const std::uint64_t now_ns = monotonic_ns();
    if (text == last.text && now_ns - last.t_ns < kRepeatNs) return;
    log_line(level, "[gpio]: {}", text);
    last = {text, now_ns};
}

}  // namespace tactiled
