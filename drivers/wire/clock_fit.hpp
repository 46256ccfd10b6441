// Converts timestamps of other clocks to CLOCK_MONOTONIC. Pure: times are arguments, so that tests of hours take
// milliseconds.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tactiled {

// Software timestamps: the kernel's CLOCK_REALTIME, which may be set to any time.
//
// A message in the socket arrived after the socket was last seen empty and before now. The result is always between these
// two times; the timestamp selects the time in between.
class ArrivalTime {
public:
    // Takes successive readings of both clocks. Returns false if the wall clock was set since the last call: then only the
    // bounds are valid. rt: wait-free
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
// arrival = adapter's timestamp + offset + delay, delay >= 0. The smallest arrival - timestamp seen is the offset plus the
// smallest delay, that of messages that were not held up. The clocks drift apart by at most kMaxDrift, so this minimum rises
// at that rate until a message comes below it. The result is therefore never before the message was on the bus, as far as
// the drift is bounded, and never after it arrived. Messages that stay late are never taken for messages on time.
class ClockFit {
public:
    // Returns the time of a message on the bus, plus the minimum delay of its path. rt: wait-free
    std::uint64_t monotonic_ns(std::uint64_t timestamp_ns, std::uint64_t arrival_ns) noexcept {
        const std::uint64_t offset_ns = arrival_ns - timestamp_ns;  // modulo 2^64, as all values computed from it
        if (fitted_) {
            const std::uint64_t waited_ns = arrival_ns > last_ns_ ? arrival_ns - last_ns_ : 0;
            const bool is_held_up = late_ns_ >= kHeldUp_ns;
            min_ns_ += double(waited_ns) * (is_held_up ? kMaxDrift * kHeldShare : kMaxDrift);
            const double above_ns = above_base_ns(offset_ns);
            const bool set_back = std::int64_t(timestamp_ns - timestamp_ns_) < 0;
            const bool set_on = above_ns < min_ns_ - kHeldUp_ns;
            if (is_held_up && (set_back || set_on))  // the clock was set, and the messages are as late as before
                base_ns_ = offset_ns - std::uint64_t(std::int64_t(std::floor(std::min(min_ns_ + late_ns_, 9e18))));
            else
                fitted_ = !set_back && above_ns > -kMaxBelow_ns;
        }
        if (!fitted_) {
            base_ns_ = offset_ns;  // keeps differences small enough for a double to resolve the nanosecond
            min_ns_ = 0;
        }
        min_ns_ = std::min(min_ns_, above_base_ns(offset_ns));
        late_ns_ = above_base_ns(offset_ns) - min_ns_;
        last_ns_ = arrival_ns;
        timestamp_ns_ = timestamp_ns;
        fitted_ = true;
        return timestamp_ns + base_ns_ + std::uint64_t(std::int64_t(std::floor(min_ns_)));
    }
    void reset() noexcept { fitted_ = false; }

    static constexpr double kMaxDrift = 200e-6;  // two crystals of 100 ppm
    static constexpr double kHeldUp_ns = 20e6;   // USB batches were 10 ms late, an emulated machine's 130 ms
    static constexpr double kHeldShare = 0.125;  // share of the drift by which the minimum rises while messages are held up

private:
    static constexpr double kMaxBelow_ns = 1e15;  // a double still resolves the nanosecond

    [[nodiscard]] double above_base_ns(std::uint64_t offset_ns) const noexcept {
        return double(std::int64_t(offset_ns - base_ns_));
    }

    bool fitted_ = false;
    std::uint64_t base_ns_ = 0, last_ns_ = 0, timestamp_ns_ = 0;
    double min_ns_ = 0;   // smallest offset known now, relative to base_ns_
    double late_ns_ = 0;  // lateness of the last message
};

}  // namespace tactiled
