// Converts timestamps of other clocks to CLOCK_MONOTONIC. Pure: times are arguments, so that tests of hours take
// milliseconds.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tactiled {

// Software timestamps: the kernel's CLOCK_REALTIME, which may be set to any time.
//
// A message in the socket arrived after the socket was last seen empty and before now. The result is between these
// two times, whatever the wall clock does; the timestamp selects the time in between.
class ArrivalTime {
public:
    // Takes readings of both clocks, made one after the other. Returns false if the wall clock was set since the last
    // call: then only the bounds are valid. rt: wait-free
    bool look(std::uint64_t monotonic_ns, std::uint64_t realtime_ns) noexcept {
        const std::uint64_t was_ns = realtime_ns_ - now_ns_, is_ns = realtime_ns - monotonic_ns;  // modulo 2^64
        const bool first = realtime_ns_ == 0;
        now_ns_ = monotonic_ns;
        realtime_ns_ = realtime_ns;
        return first || is_ns - was_ns + kSet_ns < 2 * kSet_ns;
    }
    // Notes that the socket was empty at `monotonic_ns`. rt: wait-free
    void seen_empty(std::uint64_t monotonic_ns) noexcept { empty_ns_ = monotonic_ns; }

    // rt: wait-free
    [[nodiscard]] std::uint64_t of(std::uint64_t timestamp_ns) const noexcept {
        const std::uint64_t age_ns = realtime_ns_ > timestamp_ns ? realtime_ns_ - timestamp_ns : 0;
        const std::uint64_t earliest_ns = empty_ns_ > kBeforeQueue_ns ? empty_ns_ - kBeforeQueue_ns : 0;
        return std::max(age_ns < now_ns_ ? now_ns_ - age_ns : 0, std::min(earliest_ns, now_ns_));
    }

private:
    // The timestamp is taken at the end of the adapter's interrupt, and the message is queued by a soft interrupt
    // later. A real-time thread such as this one can run in between.
    static constexpr std::uint64_t kBeforeQueue_ns = 10'000'000;
    static constexpr std::uint64_t kSet_ns = 1'000'000;  // a smaller step is an interruption between the two readings

    std::uint64_t now_ns_ = 0, realtime_ns_ = 0, empty_ns_ = 0;
};

// An adapter's clock, which measures the time between two messages but has its own origin and rate.
//
// arrival = adapter's timestamp + offset + delay, delay >= 0. The minimum of arrival - timestamp is the offset plus
// the minimum delay, that of the messages that were not delayed. The clocks drift apart by at most kMaxDrift, so the
// estimate rises at that rate until a message is below it. The result is therefore never before the message was on
// the bus, as far as the drift is bounded, and never after it arrived.
class ClockFit {
public:
    // Returns the time of a message on the bus, plus the minimum delay of the path. rt: wait-free
    std::uint64_t monotonic_ns(std::uint64_t timestamp_ns, std::uint64_t arrival_ns) noexcept {
        const std::uint64_t offset_ns = arrival_ns - timestamp_ns;  // modulo 2^64, as all values computed from it
        if (fitted_) {
            min_ns_ += double(arrival_ns > last_ns_ ? arrival_ns - last_ns_ : 0) * kMaxDrift;
            last_ns_ = arrival_ns;
            const double above_ns = above_base_ns(offset_ns);
            const double late_ns = above_ns - min_ns_;
            if (late_ns < kHeldUp_ns) {
                fitting_ns_ = arrival_ns;
                held_up_ = 0;
            } else {
                ++held_up_;
            }
            // A clock that was set forward shows at once, because the minimum falls. A clock that was set back delays
            // all messages.
            fitted_ = above_ns > -kMaxBelow_ns && (held_up_ < kMaxHeldUp || arrival_ns < fitting_ns_ + kHeldUpFor_ns);
            if (fitted_ && late_ns > kMaxDelay_ns) return arrival_ns;
        }
        if (!fitted_) {
            base_ns_ = offset_ns;  // the difference to it fits a double to the nanosecond
            min_ns_ = 0;
            fitting_ns_ = arrival_ns;
            held_up_ = 0;
        }
        min_ns_ = std::min(min_ns_, above_base_ns(offset_ns));
        last_ns_ = arrival_ns;
        fitted_ = true;
        return timestamp_ns + base_ns_ + std::uint64_t(std::int64_t(std::floor(min_ns_)));
    }
    void reset() noexcept { fitted_ = false; }

    static constexpr double kMaxDrift = 200e-6;  // two crystals of 100 ppm
    // USB batches were 10 ms late, an emulated machine's 130 ms. If only late ones arrive for a while, the clock was
    // set.
    static constexpr double kHeldUp_ns = 20e6;
    static constexpr unsigned kMaxHeldUp = 20;
    static constexpr std::uint64_t kHeldUpFor_ns = 500'000'000;
    static constexpr double kMaxDelay_ns = 1e9;  // a message with a larger delay is dated by its arrival

private:
    static constexpr double kMaxBelow_ns = 1e15;  // a double still resolves the nanosecond

    [[nodiscard]] double above_base_ns(std::uint64_t offset_ns) const noexcept {
        return double(std::int64_t(offset_ns - base_ns_));
    }

    bool fitted_ = false;
    std::uint64_t base_ns_ = 0, last_ns_ = 0;
    std::uint64_t fitting_ns_ = 0;  // time of the last message that was not delayed
    unsigned held_up_ = 0;          // delayed messages since then
    double min_ns_ = 0;             // above base_ns_: estimate of the minimum offset
};

}  // namespace tactiled
