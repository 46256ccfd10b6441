// The part of the standard deviation that the delay of the measuring chain makes: the value of a sample is the load of some
// milliseconds before its timestamp, which is off by delay * dF/dt while the load moves. The timestamp stays that of the
// frame.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "decoupling/decoupler.hpp"

namespace tactiled {

class Latency {
public:
    // From the middle of what was measured to the timestamp of the frame; 0 = nothing is added. rt: wait-free
    void set_delay(double delay_s) noexcept {
        delay_s_ = delay_s;
        count_ = 0;
    }
    [[nodiscard]] double delay_s() const noexcept { return delay_s_; }
    // Discards the past samples: after a discontinuity or a change of method. rt: wait-free
    void forget() noexcept { count_ = 0; }

    // Makes each sd hypot(sd, late). In steady motion late is delay * slope, with the slope over the last four samples. It
    // is at least |difference| min(2, delay / interval) of two neighbouring ones of them: a vibration may begin and end at
    // the same force, and of a step within the conversion, which lasts twice the delay, only a part shows at first. The
    // samples are at least a third of the delay apart: over less, noise alone would be a slope. rt: wait-free
    void widen(const Wrench& wrench_S, std::uint64_t t_ns, Wrench& sd) noexcept {
        if (delay_s_ <= 0) return;
        if (count_ > 0 && t_ns <= newest().t_ns) count_ = 0;  // another clock, or a sample that came twice
        Wrench step{};
        if (count_ == 0) {
            for (Past& past : past_) past.step = {};
        } else {
            const Past& oldest = past_[(next_ + kPast - count_) % kPast];
            const double of_step = std::min(kStep, part(t_ns, newest().t_ns)), of_all = part(t_ns, oldest.t_ns);
            Wrench late{};
            for (std::size_t c = 0; c < sd.size(); ++c) {
                step[c] = of_step * std::abs(wrench_S[c] - newest().wrench_S[c]);
                late[c] = std::max(of_all * std::abs(wrench_S[c] - oldest.wrench_S[c]), step[c]);
            }
            for (const Past& past : past_) {
                if (&past == &oldest) continue;  // its step leads to a sample before it
                for (std::size_t c = 0; c < sd.size(); ++c) late[c] = std::max(late[c], past.step[c]);
            }
            // Two sums are faster than hypot() by a multiple. NaN: not measured, or sd not known.
            for (std::size_t c = 0; c < sd.size(); ++c)
                if (late[c] <= kMaxLate) sd[c] = std::sqrt(sd[c] * sd[c] + late[c] * late[c]);
        }
        if (count_ == 0 || double(t_ns - newest().t_ns) * 1e-9 >= delay_s_ / kPast) {
            past_[next_] = {t_ns, wrench_S, step};
            next_ = (next_ + 1) % kPast;
            count_ = std::min(count_ + 1, kPast);
        }
    }

private:
    static constexpr std::size_t kPast = 3;  // with the present one four samples
    static constexpr double kStep = 2;       // a conversion lasts twice the delay
    static constexpr double kMaxLate = 1e150;
    struct Past {
        std::uint64_t t_ns = 0;
        Wrench wrench_S{}, step{};  // step: from the one before
    };
    [[nodiscard]] double part(std::uint64_t t_ns, std::uint64_t before_ns) const noexcept {
        return delay_s_ / (double(t_ns - before_ns) * 1e-9);
    }
    [[nodiscard]] const Past& newest() const noexcept { return past_[(next_ + kPast - 1) % kPast]; }

    double delay_s_ = 0;
    std::array<Past, kPast> past_{};
    std::size_t next_ = 0, count_ = 0;
};

}  // namespace tactiled
