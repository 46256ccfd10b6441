// When to ask a chip whether its next conversion is ready. The chip's clock is its own, up to 10 % off and drifting; each
// question costs bus time, and each late one age. So the chip's period is learned from the moments at which it turned out
// to be ready, and the question put a little after the moment that they predict.
#pragma once
#include <algorithm>
#include <cstdint>

namespace tactiled {

class ConversionClock {
public:
    // A conversion of `nominal_ns` begins now. What was learned about the chip's clock stays. rt: wait-free
    void begin(std::uint64_t now_ns, std::uint64_t nominal_ns) noexcept {
        base_ns_ = now_ns;
        nominal_ns_ = double(nominal_ns);
        not_ready_ns_ = poll_ns_ = mark_ns_ = 0;
        since_mark_ = in_a_row_ = 0;
        begun_ = true;
    }
    // The chip may be another one by now. rt: wait-free
    void forget() noexcept {
        scale_ = kFastest;
        sure_ = 1;
    }

    [[nodiscard]] std::uint64_t next_poll_ns() const noexcept {
        return poll_ns_ != 0 ? poll_ns_ : base_ns_ + std::uint64_t(period_ns());
    }

    // Asked from `before_ns` to `after_ns`, and it was not. rt: wait-free
    void not_ready(std::uint64_t before_ns, std::uint64_t after_ns) noexcept {
        not_ready_ns_ = before_ns;
        poll_ns_ = after_ns + std::uint64_t(nominal_ns_ * kStep);
        in_a_row_ = 0;
    }

    // Asked at `before_ns`, and it was. Returns how many conversions ended since the last one that was taken: 1, or more
    // where some were missed. rt: wait-free
    std::uint32_t ready(std::uint64_t before_ns) noexcept {
        const bool seen = not_ready_ns_ != 0;  // that it became ready, between two questions
        const double period = period_ns();
        const double elapsed = before_ns > base_ns_ ? double(before_ns - base_ns_) : 0;
        const auto passed = std::uint32_t(std::clamp(elapsed / period, 1.0, 1e6));
        if (seen && passed == 1) {
            if (begun_) learn((elapsed - double(before_ns - not_ready_ns_) / 2) / nominal_ns_, 0.5);
            follow(before_ns);
            base_ns_ = before_ns;
            in_a_row_ = 0;
        } else {
            // It may have been ready for long: ask earlier each time, until once it is not. By more where that does not
            // come: then the chip is faster than it should be.
            const double earlier = kCreep * (++in_a_row_ > 2 * kStep / kCreep ? 8 : 1);
            if (begun_) learn(scale_ - earlier, 1);
            base_ns_ = std::min(base_ns_ + std::uint64_t(passed * period), before_ns) - std::uint64_t(earlier * nominal_ns_);
            since_mark_ += passed;
            if (passed > 1) mark_ns_ = 0;
        }
        begun_ = false;
        not_ready_ns_ = poll_ns_ = 0;
        return passed;
    }

    [[nodiscard]] double period_ns() const noexcept { return nominal_ns_ * scale_; }

private:
    // The first question comes early enough for a clock that is 12 % fast, so that the first conversion shows its rate.
    static constexpr double kFastest = 0.88, kSlowest = 1.25;
    static constexpr double kStep = 1.0 / 32;    // of a conversion, between two questions: the age that is accepted
    static constexpr double kCreep = 1.0 / 128;  // four good guesses for each question too early
    static constexpr std::uint32_t kSure = 16, kLong = 64;  // conversions that a rate is averaged over, at least, at most

    void learn(double scale, double weight) noexcept {
        scale_ = std::clamp(scale_ + weight * (scale - scale_), kFastest, kSlowest);
    }

    // A conversion ended just before `edge_ns`: with the last such mark that gives the chip's period, better the longer ago.
    void follow(std::uint64_t edge_ns) noexcept {
        ++since_mark_;
        if (mark_ns_ != 0 && since_mark_ >= sure_) {
            learn(double(edge_ns - mark_ns_) / since_mark_ / nominal_ns_, 1);
            sure_ = std::min(since_mark_, kSure);
        }
        if (mark_ns_ == 0 || since_mark_ >= kLong) {
            mark_ns_ = edge_ns;
            since_mark_ = 0;
        }
    }

    std::uint64_t base_ns_ = 0;       // when the last conversion ended, or this one was begun
    std::uint64_t not_ready_ns_ = 0;  // the last question to which this one was not ready; 0: none
    std::uint64_t poll_ns_ = 0;       // when to ask again after that; 0: as predicted
    std::uint64_t mark_ns_ = 0;       // an end that the period is measured from; 0: none
    double nominal_ns_ = 1, scale_ = kFastest;
    std::uint32_t since_mark_ = 0, in_a_row_ = 0, sure_ = 1;
    bool begun_ = false;  // `base_ns_` is exact: we began this conversion
};

}  // namespace tactiled
