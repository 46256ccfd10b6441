// The part of the standard deviation due to the delay of the measuring chain. A sample has the load of some milliseconds
// before its timestamp, so while the load moves its error is delay * dF/dt. The timestamp stays that of the frame.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>

#include "decoupling/decoupler.hpp"

namespace tactiled {

// Returns the time over which the channels `mask` (bit k) were measured. Channels are converted successively, so the first
// has the largest delay, and the last half of its conversion. 0 if no delay is known. rt: wait-free
[[nodiscard]] inline double measured_over_s(std::span<const double> delay_of_channel_s, std::uint32_t mask = ~0u) noexcept {
    double min = 0, max = 0;
    bool any = false;
    for (std::size_t k = 0; k < delay_of_channel_s.size(); ++k) {
        if ((mask >> k & 1u) == 0) continue;
        min = any ? std::min(min, delay_of_channel_s[k]) : delay_of_channel_s[k];
        max = std::max(max, delay_of_channel_s[k]);
        any = true;
    }
    return min + max;
}

// Returns the delay of each component: half of the time over which its channels were measured. rt: wait-free
[[nodiscard]] inline Wrench delay_of_components_s(const Decoupler& decoupler,
                                                  std::span<const double> delay_of_channel_s) noexcept {
    Wrench delay_s{};
    for (std::size_t c = 0; c < delay_s.size(); ++c)
        delay_s[c] = measured_over_s(delay_of_channel_s, decoupler.timed_by(c)) / 2;
    return delay_s;
}

class Latency {
public:
    // Sets the delay of each component, from the middle of the measurement to the frame's timestamp; 0 = none.
    // rt: wait-free
    void set_delay(const Wrench& delay_s) noexcept {
        for (std::size_t c = 0; c < delay_s.size(); ++c) component_[c] = {.delay_s = delay_s[c]};
    }
    // Discards the past samples but not the noise, after a discontinuity or a change of method. rt: wait-free
    void forget() noexcept {
        for (Component& each : component_) each.count = each.in_block = 0, each.block_squared = 0;
    }
    // Replaces each sd by hypot(sd, late). rt: wait-free
    void widen(const Wrench& wrench_S, std::uint64_t t_ns, Wrench& sd) noexcept {
        for (std::size_t c = 0; c < sd.size(); ++c) {
            Component& component = component_[c];
            if (!(component.delay_s > 0) || std::isnan(wrench_S[c])) continue;  // NaN: not measured
            const double late = component.late(wrench_S[c], t_ns), squared = sd[c] * sd[c];
            // A motion that is present from the start looks like noise. At most sd^2 is subtracted, so that at least max(sd,
            // late) remains. Squares are several times faster than hypot(). NaN: not finite, or sd unknown.
            const double noise_squared = std::min(component.noise_squared, squared);
            if (late <= kMaxLate) sd[c] = std::sqrt(squared + std::max(0.0, late * late - noise_squared));
        }
    }

private:
    static constexpr std::size_t kPast = 3;  // four samples with the present one
    static constexpr double kStep = 2;       // a conversion lasts twice the delay
    static constexpr double kMaxLate = 1e150;
    static constexpr std::size_t kBlock = 64;  // steps
    static constexpr double kNoise = 2;        // the largest of four differences of noise rarely exceeds it, in rms
    struct Past {
        std::uint64_t t_ns = 0;
        double value = 0, step = 0;  // step: from the previous sample
    };
    struct Component {
        double delay_s = 0;
        std::array<Past, kPast> past{};
        std::size_t next = 0, count = 0;
        // noise_squared: kNoise^2 times the mean square of `step` over the quietest block so far. block_squared: sum of the
        // squares of the present block.
        double noise_squared = 0, block_squared = 0;
        std::size_t in_block = 0;
        bool is_noise_known = false;

        // Returns delay * slope in steady motion, with the slope over the last four samples, and at least weight *
        // |difference| of two neighbouring samples, because a vibration may begin and end at the same force. The samples are
        // at least a third of the delay apart; over a shorter time, noise alone would be a slope.
        [[nodiscard]] double late(double value, std::uint64_t t_ns) noexcept {
            if (count > 0 && t_ns <= newest().t_ns) count = 0;  // another clock, or a repeated sample
            double step = 0, most = 0;
            if (count > 0) {
                const Past& oldest = past[(next + kPast - count) % kPast];
                step = weight(part(t_ns, newest().t_ns)) * std::abs(value - newest().value);
                most = std::max(part(t_ns, oldest.t_ns) * std::abs(value - oldest.value), step);
                // The step of the oldest sample is from a sample before it.
                for (std::size_t i = 1; i < count; ++i) most = std::max(most, past[(next + kPast - i) % kPast].step);
            }
            if (count == 0 || double(t_ns - newest().t_ns) * 1e-9 >= delay_s / kPast) {
                if (count > 0) learn_noise(step);
                past[next] = {t_ns, value, step};
                next = (next + 1) % kPast;
                count = std::min(count + 1, kPast);
            }
            return most;
        }
        // The rms of a vibration is its largest difference over sqrt(2). A step during a conversion, which lasts twice the
        // delay and thus several samples, is only partly visible at first.
        [[nodiscard]] static double weight(double part) noexcept {
            return part < kStep ? part / std::numbers::sqrt2 : kStep;
        }
        void learn_noise(double step) noexcept {
            block_squared += step * step;
            if (++in_block < kBlock) return;
            noise_squared =
                std::min(is_noise_known ? noise_squared : kMaxLate, kNoise * kNoise * block_squared / double(kBlock));
            is_noise_known = true;
            block_squared = 0;
            in_block = 0;
        }
        [[nodiscard]] double part(std::uint64_t now_ns, std::uint64_t before_ns) const noexcept {
            return delay_s / (double(now_ns - before_ns) * 1e-9);
        }
        [[nodiscard]] const Past& newest() const noexcept { return past[(next + kPast - 1) % kPast]; }
    };

    std::array<Component, 6> component_{};
};

}  // namespace tactiled
