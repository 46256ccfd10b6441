#include "drivers/chips/station.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace tactiled {
namespace {

constexpr std::uint64_t kUs = 1000, kMs = 1'000'000;
constexpr unsigned kMinPauseMs = 10, kMaxPauseMs = 1000;
// A chip that reports for this long and this often that no conversion is ready has stopped. Both limits are needed,
// because the process itself may have been stopped.
constexpr std::uint64_t kPatience = 3;  // conversions, and
constexpr std::uint64_t kMinPatienceNs = 20 * kMs;
constexpr unsigned kMinAsked = 10;
// Share of a conversion: a value that was read so soon after an edge belongs to that edge, even if the chip's clock
// is 12 % fast.
constexpr double kOfThisEdge = 0.8;
// If the line delivers edges, the poll by the clock waits for this share of a conversion longer, so that it does not
// precede the edge. A missed edge costs this age.
constexpr std::uint64_t kWaitForEdge = 8;
// After this many polls without a result since the last conversion, edges no longer cause polls, so that a noisy line
// costs a limited number of transfers.
constexpr unsigned kMaxHastened = 4;
// A triggered conversion is read after this multiple of its time, even if the chip's clock is slow, plus kBus_ns for a slow
// bus with other chips.
constexpr double kLongest = 1.125;
constexpr std::uint64_t kBus_ns = 10 * kMs;

}  // namespace

void Station::start() noexcept {
    was_set_up_ = false;
    pause_ms_ = 0;
    clock_.forget();
    set_up_again();
}

void Station::set_up_again() noexcept {
    state_ = State::setting_up;
    step_ = 0;
    lost_ = 0;
    edge_ns_ = 0;
    waited_ns_ = 0;
    is_retry_ = is_wrong_ = has_edges_ = false;
    due_ns_ = port_.now_ns();
}

Station::Outcome Station::fail(Answer answer) noexcept {
    if (answer == Answer::disconnected) return Outcome::disconnected;
    if (answer == Answer::timeout) return Outcome::hangs;
    set_up_again();
    pause_ms_ = std::clamp(2 * pause_ms_, kMinPauseMs, kMaxPauseMs);
    due_ns_ += pause_ms_ * kMs;
    return Outcome::nothing;
}

// A chip answers, but its answers are not those of the configured chip.
Station::Outcome Station::give_up() noexcept {
    ++counts_[TACTILED_LINK_BUS_ERROR];
    return fail(Answer::failed);
}

// Configures the chip again immediately. If the chip had just been configured, it does not keep its settings, and the fault
// is reported.
Station::Outcome Station::restart() noexcept {
    if (!has_converted_) return give_up();
    set_up_again();
    return Outcome::nothing;
}

Station::Outcome Station::step(Frame& frame) noexcept { return state_ == State::setting_up ? set_up() : convert(frame); }

void Station::look() noexcept {
    std::uint64_t t_ns = 0;
    if (ready_ == nullptr || !ready_->take(t_ns)) return;
    has_edges_ = true;
    if (state_ != State::converting || !has_converted_) return;
    if (t_ns != 0 && t_ns <= taken_ns_) {
        // The edge belongs to the value read last, and the next edge is a period later. On a slow bus a transfer that began
        // before the edge may find the value, and the clock alone would keep this early phase.
        const auto next_ns = t_ns + std::uint64_t(clock_.period_ns()) + chip_->conversion_ns() / kWaitForEdge;
        due_ns_ = std::max({due_ns_, predicted_ns(), next_ns});
        return;
    }
    if (asked_ >= kMaxHastened) return;
    edge_ns_ = t_ns;
    is_hastened_ = true;
    due_ns_ = std::min(due_ns_, port_.now_ns());
}

std::uint64_t Station::predicted_ns() const noexcept {
    return clock_.next_poll_ns() + (has_edges_ ? chip_->conversion_ns() / kWaitForEdge : 0);
}

// Returns the timestamp of the edge of the value that was read from `before_ns` to `now_ns`; 0 if that edge is not
// certain.
std::uint64_t Station::ended_ns(std::uint64_t before_ns, std::uint64_t now_ns) noexcept {
    const std::uint64_t edge_ns = std::exchange(edge_ns_, 0);
    const bool is_this = edge_ns > taken_ns_ && edge_ns <= before_ns &&
                         double(now_ns - edge_ns) < kOfThisEdge * double(chip_->conversion_ns());
    return is_this ? edge_ns : 0;
}

Station::Outcome Station::set_up() noexcept {
    const Chip::Progress progress = chip_->set_up(port_, step_);
    if (progress.answer != Answer::ok) return fail(progress.answer);
    if (progress.kind == Chip::Progress::wrong) {
        const Outcome step = give_up();
        is_wrong_ = true;
        found_ = progress.found;
        return step;
    }
    ++step_;
    due_ns_ = port_.now_ns() + progress.wait_us * kUs;
    if (progress.kind == Chip::Progress::more) return Outcome::nothing;
    if (std::exchange(was_set_up_, true)) {
        ++counts_[TACTILED_LINK_RESTARTED];
        was_restarted_ = true;
    }
    state_ = State::converting;
    has_converted_ = false;  // edges before may belong to conversions that are still settling
    begin_conversion();
    due_ns_ += progress.wait_us * kUs;
    return Outcome::nothing;
}

void Station::begin_conversion() noexcept {
    began_ns_ = port_.now_ns();
    asked_ = 0;
    clock_.begin(began_ns_, chip_->conversion_ns(), chip_->pace() != Pace::triggered);
    due_ns_ = chip_->pace() == Pace::timed ? began_ns_ + chip_->conversion_ns() : clock_.next_poll_ns();
    latest_ns_ = began_ns_ + std::uint64_t(kLongest * double(chip_->conversion_ns())) + kBus_ns;
}

Station::Outcome Station::convert(Frame& frame) noexcept {
    const std::uint64_t before_ns = port_.now_ns();
    const Chip::Reading reading = chip_->read(port_, frame);
    if (reading.answer != Answer::ok) {
        // A single failure may be a disturbance, so the chip is read again immediately. The data that are read with the
        // value show whether the chip was reset meanwhile.
        const bool hard = reading.answer == Answer::disconnected || reading.answer == Answer::timeout;
        if (hard || is_retry_) return fail(reading.answer);
        is_retry_ = true;
        return Outcome::nothing;
    }
    is_retry_ = false;
    switch (reading.kind) {
        case Chip::Reading::was_reset: return restart();
        case Chip::Reading::bad: ++counts_[TACTILED_LINK_BAD_CHECKSUM]; [[fallthrough]];
        case Chip::Reading::nothing: {
            const std::uint64_t now_ns = port_.now_ns();
            edge_ns_ = 0;
            if (std::exchange(is_hastened_, false) && now_ns < clock_.next_poll_ns()) {
                due_ns_ = predicted_ns();  // the edge was noise or late: continue as without it
            } else {
                clock_.not_ready(before_ns, now_ns);
                due_ns_ = clock_.next_poll_ns();
            }
            const std::uint64_t patience_ns = kPatience * chip_->conversion_ns() + kMinPatienceNs;
            if (++asked_ < kMinAsked || now_ns - began_ns_ < patience_ns) return Outcome::nothing;
            return restart();
        }
        case Chip::Reading::part:
        case Chip::Reading::frame: return take(reading, before_ns, frame);
    }
    return Outcome::nothing;
}

Station::Outcome Station::take(const Chip::Reading& reading, std::uint64_t before_ns, Frame& frame) noexcept {
    const bool is_first = !std::exchange(has_converted_, true);
    pause_ms_ = 0;
    const std::uint64_t now_ns = port_.now_ns();
    const std::uint64_t edge_ns = ended_ns(before_ns, now_ns);
    std::uint32_t lost = reading.lost;
    if (chip_->pace() == Pace::timed) {
        const std::uint64_t period_ns = chip_->conversion_ns();
        lost = before_ns > due_ns_ ? std::uint32_t((before_ns - due_ns_) / period_ns) : 0;
        due_ns_ += (1 + lost) * period_ns;
    } else {
        const bool is_counted = chip_->pace() == Pace::counted;
        const std::uint32_t known = is_counted ? 1 + lost : 0;
        if (edge_ns != 0) clock_.not_ready(edge_ns - 1, edge_ns);  // the edge shows when the conversion became ready
        const std::uint32_t passed = edge_ns != 0 ? clock_.ready(edge_ns, edge_ns, known)
                                                  : clock_.ready(before_ns, std::max(before_ns, reading.taken_ns), known);
        if (chip_->pace() == Pace::continuous) lost = passed - 1;
        if (reading.began) clock_.begin(now_ns, chip_->conversion_ns(), false);
        has_edges_ = edge_ns != 0;
        due_ns_ = predicted_ns();
    }
    // The thread was not scheduled, so the conversion waited in the chip.
    if (chip_->pace() == Pace::triggered && now_ns > latest_ns_) waited_ns_ += now_ns - latest_ns_;
    latest_ns_ = now_ns + std::uint64_t(kLongest * double(chip_->conversion_ns())) + kBus_ns;
    began_ns_ = taken_ns_ = now_ns;
    is_hastened_ = false;
    asked_ = 0;
    if (is_first) lost = 0;  // other chips were configured meanwhile; there was no previous frame
    lost_ += lost;
    counts_[TACTILED_LINK_LOST] += lost;
    if (reading.kind == Chip::Reading::part) return Outcome::nothing;
    frame.t_ns = edge_ns != 0 ? edge_ns : now_ns;
    frame.taken_ns = now_ns;
    frame.since_ns = now_ns - std::exchange(waited_ns_, 0);
    frame.device = device_;
    frame.lost = std::exchange(lost_, 0);
    frame.restarted = std::exchange(was_restarted_, false);
    ++counts_[TACTILED_LINK_FRAMES];
    return Outcome::frame;
}

std::string Station::place() const {
    const Place& at = port_.place();
    std::string text = fmt::format("{} at 0x{:02x}", name_, at.address);
    if (at.mux != 0) text += fmt::format(" behind 0x{:02x} channel {}", at.mux, at.channel);
    return text;
}

std::string Station::complaint() const {
    if (!is_wrong_) return place() + " does not answer; check its supply, its wires, address and mux";
    const Chip::Identity identity = chip_->identity();
    return fmt::format("{}: {} {:#x}, should be {:#x}: another chip, or another chip's address", place(), identity.what,
                       found_, identity.expected);
}

}  // namespace tactiled
