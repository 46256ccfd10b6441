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

    // Makes each sd hypot(sd, delay * slope) of its component. The slope is taken over the last four samples, and over the
    // length of the delay where that is longer: over less, noise alone would be a slope. rt: wait-free
    void widen(const Wrench& wrench_S, std::uint64_t t_ns, Wrench& sd) noexcept {
        if (delay_s_ <= 0) return;
        if (count_ > 0 && t_ns <= newest().t_ns) count_ = 0;  // another clock, or a sample that came twice
        if (count_ > 0) {
            const Past& oldest = past_[(next_ + kPast - count_) % kPast];
            const double share = delay_s_ / (double(t_ns - oldest.t_ns) * 1e-9);
            for (std::size_t c = 0; c < sd.size(); ++c) {
                const double late = share * (wrench_S[c] - oldest.wrench_S[c]);
                // Two sums are faster than hypot() by a multiple. NaN: not measured, or sd not known.
                if (std::abs(late) <= kMaxLate) sd[c] = std::sqrt(sd[c] * sd[c] + late * late);
            }
        }
        if (count_ == 0 || double(t_ns - newest().t_ns) * 1e-9 >= delay_s_ / kPast) {
            past_[next_] = {t_ns, wrench_S};
            next_ = (next_ + 1) % kPast;
            count_ = std::min(count_ + 1, kPast);
        }
    }

private:
    static constexpr std::size_t kPast = 3;  // with the present one four samples
    static constexpr double kMaxLate = 1e150;
    struct Past {
        std::uint64_t t_ns = 0;
        Wrench wrench_S{};
    };
    [[nodiscard]] const Past& newest() const noexcept { return past_[(next_ + kPast - 1) % kPast]; }

    double delay_s_ = 0;
    std::array<Past, kPast> past_{};
    std::size_t next_ = 0, count_ = 0;
};

}  // namespace tactiled
