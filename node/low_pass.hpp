// Low pass for the six components of a wrench, for irregular sample times: two equal first-order stages, exact for a force
// that is linear between samples. It has no overshoot; the group delay at low frequencies is 0.205 / cutoff at any rate.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace tactiled {

class LowPass {
public:
    // -3 dB at `cutoff_Hz`; 0 = off. rt: wait-free
    void set_cutoff(double cutoff_Hz) noexcept {
        cutoff_Hz_ = cutoff_Hz;
        empty_ = true;
    }
    [[nodiscard]] double cutoff_Hz() const noexcept { return cutoff_Hz_; }
    [[nodiscard]] bool is_on() const noexcept { return cutoff_Hz_ > 0; }
    // Restarts with the next value. Called after a discontinuity, a tare, or a sample without a value. rt: wait-free
    void reset() noexcept { empty_ = true; }

    // Replaces each value by the filtered one and adds the lag to its sd. The error of the filtered value is that of the
    // value plus value - filtered, whatever the force does. Noise explains the difference up to sqrt(3) sd, the ends of a
    // uniform distribution; twice the difference of the stages is the lag in steady motion, with little noise. rt: wait-free
    void apply(std::array<double, 6>& value, std::array<double, 6>& sd, std::uint64_t t_ns) noexcept {
        if (!is_on()) return;
        if (empty_) input_ = first_ = second_ = value;
        // A stage with the corner w follows dy/dt = w (u - y). x: the time since the last sample, times w.
        const double x = empty_ || t_ns <= t_ns_ ? 0 : corner_rad_s() * double(t_ns - t_ns_) * 1e-9;
        const double gain = -std::expm1(-x), decay = x * (1 - gain), ramp = x > 0 ? 1 - gain / x : 0;
        for (std::size_t i = 0; i < value.size(); ++i) {
            const double step = value[i] - input_[i];
            second_[i] += gain * (input_[i] - second_[i]) + decay * (first_[i] - input_[i]) + (2 * ramp - gain) * step;
            first_[i] += gain * (input_[i] - first_[i]) + ramp * step;
            input_[i] = value[i];
            const double late = value[i] - second_[i], lag = 2 * (first_[i] - second_[i]), squared = sd[i] * sd[i];
            sd[i] = std::sqrt(squared + std::max(late * late - 3 * squared, lag * lag));
            value[i] = second_[i];
        }
        t_ns_ = t_ns;
        empty_ = false;
    }

    // Replaces a value that is not confirmed by the last filtered one, if there is one, whose sd gets the difference. rt:
    // wait-free
    void hold(std::array<double, 6>& value, std::array<double, 6>& sd) const noexcept {
        if (!is_on() || empty_) return;
        for (std::size_t i = 0; i < value.size(); ++i) {
            sd[i] = std::hypot(sd[i], value[i] - second_[i]);
            value[i] = second_[i];
        }
    }

private:
    // Each stage has -1.5 dB at the cutoff. The corner of a stage is therefore 1 / sqrt(sqrt(2) - 1) times the cutoff.
    [[nodiscard]] double corner_rad_s() const noexcept {
        return 2 * 3.14159265358979323846 * cutoff_Hz_ * 1.5537739740300374;
    }

    double cutoff_Hz_ = 0;
    bool empty_ = true;
    std::uint64_t t_ns_ = 0;
    std::array<double, 6> input_{}, first_{}, second_{};
};

}  // namespace tactiled
