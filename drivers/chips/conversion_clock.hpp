// When to ask a chip whether its next conversion is ready. The chip's clock is its own, up to 10 % off and drifting; each
// question costs bus time, and each late one age. The chip's period is therefore learned from the moments at which it turned
// out to be ready, and the question put a little after the moment that they predict.
#pragma once
#include <algorithm>
#include <cstdint>

namespace tactiled {

class ConversionClock {
public:
    // A conversion of `nominal_ns` begins now, and others follow it by themselves where it `repeats`. What was learned about
    // the chip's clock stays. rt: wait-free
    void begin(std::uint64_t now_ns, std::uint64_t nominal_ns, bool repeats) noexcept {
        base_ns_ = now_ns;
        nominal_ns_ = double(nominal_ns);
        not_ready_ns_ = poll_ns_ = mark_ns_ = 0;
        since_mark_ = in_a_row_ = 0;
        is_single_ = !repeats;
    }
    // The chip may be another one by now. rt: wait-free
    void forget() noexcept {
        scale_ = kFastest;
        is_learned_ = false;
    }

    [[nodiscard]] std::uint64_t next_poll_ns() const noexcept {
        return poll_ns_ != 0 ? poll_ns_ : base_ns_ + std::uint64_t(period_ns() - kCreep * nominal_ns_);
    }

    // Asked from `before_ns` to `after_ns`, and it was not. rt: wait-free
    void not_ready(std::uint64_t before_ns, std::uint64_t after_ns) noexcept {
        not_ready_ns_ = before_ns;
        poll_ns_ = after_ns + std::uint64_t(nominal_ns_ * kStep);
        in_a_row_ = 0;
    }

    // Asked at `before_ns`, and it was; its value was taken at `taken_ns`. Returns how many conversions ended since the last
    // one that was taken: 1, or more where some were missed; `known` where the chip itself says so, else 0. rt: wait-free
    std::uint32_t ready(std::uint64_t before_ns, std::uint64_t taken_ns, std::uint32_t known) noexcept {
        const bool seen = not_ready_ns_ != 0;  // that it became ready, between two questions
        const double elapsed = before_ns > base_ns_ ? double(before_ns - base_ns_) : 0;
        const double held = taken_ns > base_ns_ ? double(taken_ns - base_ns_) : 0;
        const double period = is_learned_ ? period_ns() : nominal_ns_;
        // `base_ns_` is late by up to a step. Where this end was seen, it was half way between the two questions, or so.
        const double ended = seen ? elapsed - double(before_ns - not_ready_ns_) / 2 + period / 2 : 0;
        const double max = std::max(held + kLate * period, ended) / period;
        const std::uint32_t passed = known != 0 ? known : std::uint32_t(std::clamp(max, 1.0, 1e6));
        since_mark_ += passed;
        if (seen && passed == 1) {
            if (is_single_)
                learn(elapsed / nominal_ns_);
            else
                follow(not_ready_ns_, before_ns);
            // Long ago where the thread was held up between the two: then what is predicted is better.
            const bool is_close = double(before_ns - not_ready_ns_) < kClose * period;
            base_ns_ = is_close ? before_ns : std::clamp(base_ns_ + std::uint64_t(period), not_ready_ns_, before_ns);
            in_a_row_ = 0;
        } else if (++in_a_row_ > kMaxLate && passed == 1) {  // the chip is faster than was learned
            forget();
            base_ns_ = before_ns - std::uint64_t(nominal_ns_ * kStep);
            mark_ns_ = in_a_row_ = 0;
        } else {
            // It may have been ready for long. As each question comes a little earlier than the last one, it once is not.
            if (is_single_) learn(std::min(scale_, elapsed / nominal_ns_));
            // The value may be of a conversion that ended after the question.
            const bool is_later = double(passed) * period > elapsed && passed > 1;
            base_ns_ = std::min(base_ns_ + std::uint64_t(passed * period), is_later ? taken_ns : before_ns);
            if (passed > 1) mark_ns_ = 0;
        }
        not_ready_ns_ = poll_ns_ = 0;
        return passed;
    }

    [[nodiscard]] double period_ns() const noexcept { return nominal_ns_ * scale_; }

private:
    // The first question comes early enough for a clock that is 12 % fast, so that the first conversion shows its rate.
    static constexpr double kFastest = 0.88, kSlowest = 1.25;
    static constexpr double kStep = 1.0 / 32;    // of a conversion, between two questions: the age that is accepted
    static constexpr double kCreep = 1.0 / 128;  // four good guesses for each question too early
    static constexpr double kLate = 0.1;
    static constexpr double kClose = 0.4;          // a slow bus needs 0.3 for a question
    static constexpr std::uint32_t kMaxLate = 64;  // good guesses in a row: a slow bus takes up to 40
    static constexpr std::uint32_t kLong = 64;     // conversions that a rate is averaged over

    void learn(double scale) noexcept { scale_ = std::clamp(scale, kFastest, kSlowest); }

    // A conversion ended after `from_ns` and before `to_ns`. With the last one known so that gives a period which the chip's
    // is not shorter than, and hardly longer once it is the mean of many: an estimate that erred to the long side would lose
    // conversions without a sign.
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

    std::uint64_t base_ns_ = 0;       // when the last conversion ended, or this one was begun
    std::uint64_t not_ready_ns_ = 0;  // the last question to which this one was not ready; 0: none
    std::uint64_t poll_ns_ = 0;       // when to ask again after that; 0: as predicted
    std::uint64_t mark_ns_ = 0;       // an end that the period is measured from; 0: none
    double nominal_ns_ = 1, scale_ = kFastest;
    std::uint32_t since_mark_ = 0, in_a_row_ = 0;
    bool is_learned_ = false;  // from many conversions
    bool is_single_ = false;   // begun by us, so that its beginning is known; none follows by itself
};

}  // namespace tactiled
