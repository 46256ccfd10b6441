// Predicts when to poll a chip for its next conversion. The chip's clock is up to 10 % off and drifts. Each poll costs bus
// time, and each late poll adds to the age of the value. The chip's period is therefore estimated from the times at which
// conversions were ready, and the poll is sent shortly after the predicted time.
#pragma once
#include <algorithm>
#include <cstdint>

namespace tactiled {

class ConversionClock {
public:
    // Records that a conversion of `nominal_ns` begins now; with `repeats`, further conversions follow automatically. The
    // learned rate of the chip's clock is kept. rt: wait-free
    void begin(std::uint64_t now_ns, std::uint64_t nominal_ns, bool repeats) noexcept {
        base_ns_ = now_ns;
        nominal_ns_ = double(nominal_ns);
        not_ready_ns_ = poll_ns_ = mark_ns_ = 0;
        since_mark_ = in_a_row_ = 0;
        is_single_ = !repeats;
    }
    // Forgets the learned rate, because the chip may have been replaced. rt: wait-free
    void forget() noexcept {
        scale_ = kFastest;
        is_learned_ = false;
    }

    [[nodiscard]] std::uint64_t next_poll_ns() const noexcept {
        return poll_ns_ != 0 ? poll_ns_ : base_ns_ + std::uint64_t(period_ns() - kCreep * nominal_ns_);
    }

    // Records that a poll from `before_ns` to `after_ns` found no conversion ready. rt: wait-free
    void not_ready(std::uint64_t before_ns, std::uint64_t after_ns) noexcept {
        not_ready_ns_ = before_ns;
        poll_ns_ = after_ns + std::uint64_t(nominal_ns_ * kStep);
        in_a_row_ = 0;
    }

    // Records that a poll at `before_ns` found a conversion, whose value was read at `taken_ns`. Returns how many
    // conversions ended since the last one that was read: 1, or more if some were missed. `known` is the number that the
    // chip reports; 0 if it reports none. rt: wait-free
    std::uint32_t ready(std::uint64_t before_ns, std::uint64_t taken_ns, std::uint32_t known) noexcept {
        const bool seen = not_ready_ns_ != 0;  // the conversion ended between two polls
        const double elapsed = before_ns > base_ns_ ? double(before_ns - base_ns_) : 0;
        const double held = taken_ns > base_ns_ ? double(taken_ns - base_ns_) : 0;
        const double period = is_learned_ ? period_ns() : nominal_ns_;
        // `base_ns_` is late by up to a step. If the end was observed, it was about half way between the two polls.
        const double ended = seen ? elapsed - double(before_ns - not_ready_ns_) / 2 + period / 2 : 0;
        const double max = std::max(held + kLate * period, ended) / period;
        const std::uint32_t passed = known != 0 ? known : std::uint32_t(std::clamp(max, 1.0, 1e6));
        since_mark_ += passed;
        if (seen && passed == 1) {
            if (is_single_)
                learn(elapsed / nominal_ns_);
            else
                follow(not_ready_ns_, before_ns);
            // A long time between the two polls shows that the thread was interrupted; the prediction is then the better
            // estimate.
            const bool is_close = double(before_ns - not_ready_ns_) < kClose * period;
            base_ns_ = is_close ? before_ns : std::clamp(base_ns_ + std::uint64_t(period), not_ready_ns_, before_ns);
            in_a_row_ = 0;
        } else if (++in_a_row_ > kMaxLate && passed == 1) {  // the chip is faster than the estimate
            forget();
            base_ns_ = before_ns - std::uint64_t(nominal_ns_ * kStep);
            mark_ns_ = in_a_row_ = 0;
        } else {
            // The conversion may have been ready for a long time. Each poll is sent a little earlier than the previous one,
            // until a poll finds no conversion ready.
            if (is_single_) learn(std::min(scale_, elapsed / nominal_ns_));
            // The value may belong to a conversion that ended after the poll began.
            const bool is_later = double(passed) * period > elapsed && passed > 1;
            base_ns_ = std::min(base_ns_ + std::uint64_t(passed * period), is_later ? taken_ns : before_ns);
            if (passed > 1) mark_ns_ = 0;
        }
        not_ready_ns_ = poll_ns_ = 0;
        return passed;
    }

    [[nodiscard]] double period_ns() const noexcept { return nominal_ns_ * scale_; }

private:
    // The first poll is early enough for a clock that is 12 % fast, so that the first conversion shows the rate.
    static constexpr double kFastest = 0.88, kSlowest = 1.25;
    // step between two polls, as a share of a conversion: the accepted age
    static constexpr double kStep = 1.0 / 32;
    static constexpr double kCreep = 1.0 / 128;  // each poll that is too early is followed by four good predictions
    static constexpr double kLate = 0.1;
    static constexpr double kClose = 0.4;          // a poll takes 0.3 of a conversion on a slow bus
    static constexpr std::uint32_t kMaxLate = 64;  // consecutive good predictions; a slow bus takes up to 40
    static constexpr std::uint32_t kLong = 64;     // conversions over which the rate is averaged

    void learn(double scale) noexcept { scale_ = std::clamp(scale, kFastest, kSlowest); }

    // Updates the estimated period with a conversion that ended between `from_ns` and `to_ns`. Together with the previous
    // known end, the interval gives a lower bound of the chip's period; the mean of many such intervals is close to the
    // period. An estimate that is too long would lose conversions undetected.
    void follow(std::uint64_t from_ns, std::uint64_t to_ns) noexcept {
        const bool is_long = since_mark_ >= kLong;
        if (mark_ns_ != 0 && from_ns > mark_ns_) {
            const double scale = double(from_ns - mark_ns_) / since_mark_ / nominal_ns_;
            if (is_long || scale > scale_) learn(scale);
            is_learned_ |= is_long;
        }
        if (mark_ns_ != 0 && !is_long) return;
        mark_ns_ = to_ns;
        since_mark_ = 0;
    }

    std::uint64_t base_ns_ = 0;       // end of the last conversion, or begin of this one
    std::uint64_t not_ready_ns_ = 0;  // time of the last poll that found no conversion; 0: none
    std::uint64_t poll_ns_ = 0;       // time of the poll after that; 0: as predicted
    std::uint64_t mark_ns_ = 0;       // a known end from which the period is measured; 0: none
    double nominal_ns_ = 1, scale_ = kFastest;
    std::uint32_t since_mark_ = 0, in_a_row_ = 0;
    bool is_learned_ = false;  // the rate is learned from many conversions
    bool is_single_ = false;   // a triggered conversion: its begin is known, and no other follows automatically
};

}  // namespace tactiled
