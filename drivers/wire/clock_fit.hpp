// Stamps of other clocks as CLOCK_MONOTONIC. Pure: time comes from outside, so that hours are tested in moments.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tactiled {

// Software stamps: the kernel's CLOCK_REALTIME, which may be set to any time at any moment.
//
// A message found in the socket now came after the socket was last seen empty. The result therefore lies between the two,
// whatever the wall clock does; in between, the stamp says where.
class ArrivalTime {
public:
    // Both clocks, read one after the other now. False where the wall clock was set since the last look: then only the
    // bounds are good for anything. rt: wait-free
    bool look(std::uint64_t monotonic_ns, std::uint64_t realtime_ns) noexcept {
        const std::uint64_t was_ns = realtime_ns_ - now_ns_, is_ns = realtime_ns - monotonic_ns;  // modulo 2^64
        const bool first = realtime_ns_ == 0;
        now_ns_ = monotonic_ns;
        realtime_ns_ = realtime_ns;
        return first || is_ns - was_ns + kSet_ns < 2 * kSet_ns;
    }
    // There was nothing in the socket at `monotonic_ns`. rt: wait-free
    void seen_empty(std::uint64_t monotonic_ns) noexcept { empty_ns_ = monotonic_ns; }

    // rt: wait-free
    [[nodiscard]] std::uint64_t of(std::uint64_t timestamp_ns) const noexcept {
        const std::uint64_t age_ns = realtime_ns_ > timestamp_ns ? realtime_ns_ - timestamp_ns : 0;
        const std::uint64_t earliest_ns = empty_ns_ > kBeforeQueue_ns ? empty_ns_ - kBeforeQueue_ns : 0;
        return std::max(age_ns < now_ns_ ? now_ns_ - age_ns : 0, std::min(earliest_ns, now_ns_));
    }

private:
    // The stamp is taken when the adapter's interrupt ends, the message queued a soft interrupt later; a thread that has
    // the CPU at a real-time priority, as ours, can come between.
    static constexpr std::uint64_t kBeforeQueue_ns = 10'000'000;
    static constexpr std::uint64_t kSet_ns = 1'000'000;  // less is a thread that was held up between its two clocks

    std::uint64_t now_ns_ = 0, realtime_ns_ = 0, empty_ns_ = 0;
};

// An adapter's clock, which counts the true time between two messages but from anywhere and at a rate of its own.
//
// arrival = adapter's stamp + offset + delay, delay >= 0. The least arrival - stamp seen is the offset plus the least delay:
// that of the messages that nothing held up. As the clocks drift apart by at most kMaxDrift, what was the least is so for
// less and less long: it rises at that rate until a message comes below it. The result is therefore never before the message
// was on the bus, as far as the drift is bounded, and never after it arrived.
class ClockFit {
public:
    // The time of a message on the bus, but for the least delay that the way from there ever has. rt: wait-free
    std::uint64_t monotonic_ns(std::uint64_t timestamp_ns, std::uint64_t arrival_ns) noexcept {
        const std::uint64_t offset_ns = arrival_ns - timestamp_ns;  // modulo 2^64, as all that is made of it
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
            // A clock that was set on is seen at once: the least falls. One that was set back makes all messages late.
            fitted_ = above_ns > -kMaxBelow_ns && (held_up_ < kMaxHeldUp || arrival_ns < fitting_ns_ + kHeldUpFor_ns);
            if (fitted_ && late_ns > kMaxDelay_ns) return arrival_ns;
        }
        if (!fitted_) {
            base_ns_ = offset_ns;  // the rest then fits a double to the nanosecond
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
    // USB batches were 10 ms late, an emulated machine's 130 ms. When nothing but late ones came for a while, the clock was
    // set.
    static constexpr double kHeldUp_ns = 20e6;
    static constexpr unsigned kMaxHeldUp = 20;
    static constexpr std::uint64_t kHeldUpFor_ns = 500'000'000;
    static constexpr double kMaxDelay_ns = 1e9;  // what seems later has no time but that of its arrival

private:
    static constexpr double kMaxBelow_ns = 1e15;  // a double still has the nanosecond

    [[nodiscard]] double above_base_ns(std::uint64_t offset_ns) const noexcept {
        return double(std::int64_t(offset_ns - base_ns_));
    }

    bool fitted_ = false;
    std::uint64_t base_ns_ = 0, last_ns_ = 0;
    std::uint64_t fitting_ns_ = 0;  // when the last one came that was not held up
    unsigned held_up_ = 0;          // since then
    double min_ns_ = 0;             // above base_ns_: the least offset, as far as known now
};

}  // namespace tactiled
