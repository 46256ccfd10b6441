// Finds the samples that leave the motion of a force before a second one confirms that it has changed: a damaged reading
// shows a wrong force once, a real step twice.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "decoupling/decoupler.hpp"

namespace tactiled {

// A confirmed force, and by how much the same force may differ from it later; NaN = not measured, or without an sd.
// `stepped`: what restarts before may have moved the zero.
struct LastForce {
    Wrench raw_S = kUnseen, tolerance = kUnseen, stepped{};
};

// Each component is predicted from the last confirmed sample and the step before it. The difference, the innovation, may be
// as large as the stated noise and the recent innovations explain; a sample that differs more has left the motion. It is
// confirmed if enough samples before it have left the same motion in the same components, in whatever direction, so that
// ringing is one motion and a glitch of one channel beside the step of another is none. A sample that continues the motion,
// and is not nearer to the one that had left it, shows that it was a glitch.
class JumpCheck {
public:
    // Ends the motion at a discontinuity: the next sample may have the value of the last one, or else begins a motion that
    // the sample after it must continue. rt: wait-free
    void end_motion() noexcept {
        if (!std::exchange(is_over_, true)) settled_ = recent_;
        step_ = recent_ = {};
        left_ = steps_ = 0;
    }
    // A sample had no value. rt: wait-free
    void miss() noexcept {
        steps_ = std::min(steps_ + 1, kMaxSteps);
        left_ = 0;
    }

    // Remembers the motion before an event, or the force at the end of an earlier run. rt: wait-free
    void mark() noexcept {
        marked_ = last();
        marked_step_ = step_;
    }
    void mark(const LastForce& last) noexcept { marked_ = last; }
    [[nodiscard]] const LastForce& marked() const noexcept { return marked_; }
    [[nodiscard]] bool has_value() const noexcept { return has_value_; }
    // Returns the last confirmed force. rt: wait-free
    [[nodiscard]] LastForce last() const noexcept {
        LastForce last;
        for (std::size_t i = 0; i < value_.size(); ++i) {
            const double noise = is_over_ ? settled_[i] : recent_[i];
            last.raw_S[i] = value_[i];
            last.tolerance[i] = std::min(kSame * sd_[i], sd_[i] + kRecent * noise);
        }
        return last;
    }
    // Returns true if the next sample, before confirm(), goes on from the marked motion in all components that are checked,
    // or from where the motion has ended on its way. rt: wait-free
    [[nodiscard]] bool agrees(const Wrench& wrench_S, std::uint32_t lost) const noexcept {
        const std::uint32_t steps = std::min(steps_ + 1 + std::min(lost, kMaxSteps), kMaxSteps);
        bool is_known = false;
        for (std::size_t i = 0; i < value_.size(); ++i) {
            const double moved = wrench_S[i] - marked_.raw_S[i], motion = steps * marked_step_[i];
            const double difference = std::abs(moved - std::clamp(moved, std::min(motion, 0.0), std::max(motion, 0.0)));
            if (difference > marked_.tolerance[i]) return false;  // not with NaN
            is_known |= difference <= marked_.tolerance[i];
        }
        return is_known;
    }

    // Takes the next sample, of which `lost` samples directly before it are missing. A component that is NaN, or has not had
    // an sd yet, is not checked. Returns true if the sample is confirmed. rt: wait-free
    [[nodiscard]] bool confirm(const Wrench& wrench_S, const Wrench& sd, std::uint64_t t_ns, std::uint32_t lost) noexcept {
        count(t_ns);
        steps_ = std::min(steps_ + 1 + std::min(lost, kMaxSteps), kMaxSteps);
        const std::uint32_t leaving = leaving_components(wrench_S);
        if (is_over_ && (!has_value_ || leaving != 0)) {
            end_motion();
            follow(wrench_S, sd, 0);
            step_ = recent_ = {};
            is_over_ = false;
            has_value_ = true;
            return std::all_of(sd_.begin(), sd_.end(), [](double each) { return std::isnan(each); });
        }
        is_over_ = false;
        if (left_ == 0) leaving_ = leaving;
        const bool is_same = (leaving & ~(leaving_ | kNearer)) == 0;
        if (leaving != 0 && (!is_same || left_ < (is_frequent() ? kConfirmingGlitches : kConfirming))) {
            left_ = is_same ? left_ + 1 : 1;
            leaving_ |= leaving;
            before_ = wrench_S;
            return false;
        }
        if (leaving == 0 && left_ == 1) ++glitches_;
        follow(wrench_S, sd, leaving);
        return true;
    }

    // True while more than 1 % of the samples of the last 10 s were glitches, and more than two samples. rt: wait-free
    [[nodiscard]] bool is_frequent() const noexcept { return glitches_ > std::max(kFrequent * samples_, kFew); }

    // Continues the count of `before`, which another check has counted. rt: wait-free
    void succeed(const JumpCheck& before) noexcept {
        samples_ = before.samples_;
        glitches_ = before.glitches_;
        t_ns_ = before.t_ns_;
    }

private:
    static constexpr double kFrequent = 0.01, kFew = 2, kMemory_ns = 10e9;
    static constexpr std::uint32_t kConfirming = 1, kConfirmingGlitches = 3;
    // Innovations of white noise have sqrt(6) of its sd. Together with the recent ones, this is exceeded by one sample in a
    // million.
    static constexpr double kNoise = 6;
    // A component of a device that has gone on differs by more once in 200 times if its sd is white noise. It may differ by
    // one sd and the recent innovations if that is less.
    static constexpr double kSame = 4;
    // The largest recent innovation counts twice; it sinks to 1/e in 7 samples.
    static constexpr double kRecent = 2, kDecay = 0.875;
    static constexpr std::uint32_t kNearer = 1u << 6;
    static constexpr std::uint32_t kMaxSteps = 4;  // a motion is not extrapolated over a longer gap

    void count(std::uint64_t t_ns) noexcept {
        const double passed = t_ns > t_ns_ ? double(t_ns - t_ns_) / kMemory_ns : 0;
        samples_ = samples_ / (1 + passed) + 1;
        glitches_ /= 1 + passed;
        t_ns_ = std::max(t_ns_, t_ns);
    }

    // The innovation of component i; NaN if it is not known.
    [[nodiscard]] double innovation(const Wrench& wrench_S, std::size_t i) const noexcept {
        return std::abs(wrench_S[i] - value_[i] - steps_ * step_[i]);
    }
    // Returns the components that are farther from the motion than is explained, as bits, and kNearer if all are nearer to
    // the sample that left it; 0: the motion continues.
    [[nodiscard]] std::uint32_t leaving_components(const Wrench& wrench_S) const noexcept {
        double from_motion = 0, from_before = 0;  // the largest, in multiples of the limit
        std::uint32_t leaving = 0;
        for (std::size_t i = 0; i < value_.size(); ++i) {
            const double limit = kNoise * sd_[i] + kRecent * recent_[i];
            const double motion = innovation(wrench_S, i) / limit, before = std::abs(wrench_S[i] - before_[i]) / limit;
            if (motion > 1) leaving |= 1u << i;              // false with NaN
            if (motion > from_motion) from_motion = motion;  // likewise
            if (before > from_before) from_before = before;
        }
        return leaving | (left_ > 0 && from_before < from_motion ? kNearer : 0);
    }

    // Each component goes on from the motion or, if that is nearer, from the sample that had left it. One without a value or
    // an sd keeps the last one.
    void follow(const Wrench& wrench_S, const Wrench& sd, std::uint32_t leaving) noexcept {
        for (std::size_t i = 0; i < value_.size(); ++i) {
            const double innovated = innovation(wrench_S, i), from_before = std::abs(wrench_S[i] - before_[i]);
            const bool is_new = leaving != 0 && from_before < innovated;
            const double step = is_new ? wrench_S[i] - before_[i] : (wrench_S[i] - value_[i]) / steps_;
            const double recent = is_new || (leaving >> i & 1) != 0 ? from_before : innovated;
            step_[i] = std::isfinite(step) ? step : 0;
            recent_[i] = std::max(std::isfinite(recent) ? recent : 0, recent_[i] * kDecay);
            if (!std::isnan(wrench_S[i])) value_[i] = wrench_S[i];
            if (!std::isnan(sd[i])) sd_[i] = sd[i];
        }
        left_ = steps_ = 0;
    }

    bool has_value_ = false, is_over_ = true;
    std::uint32_t left_ = 0;                          // samples that have left the motion, up to the last one
    std::uint32_t leaving_ = 0;                       // the components in which they have, as bits
    std::uint32_t steps_ = 0;                         // samples since the last confirmed one
    Wrench value_ = kUnseen, step_{}, sd_ = kUnseen;  // the last confirmed sample and its step from the one before
    LastForce marked_;
    Wrench marked_step_{}, settled_{};   // settled_: recent_ before the motion has ended
    Wrench recent_{};                    // innovations
    Wrench before_{};                    // the last one that has left
    double samples_ = 0, glitches_ = 0;  // during the last kMemory_ns
    std::uint64_t t_ns_ = 0;
};

}  // namespace tactiled
