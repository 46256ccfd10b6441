// Low pass for the six components of a wrench, for irregular sample times: two equal first-order stages, each with the exact
// step response over the time since the last sample. It has no overshoot; the group delay at low frequencies is 0.205 /
// cutoff.
#pragma once
#include <array>
#include <cmath>
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
    // The group delay at low frequencies; 0 if the filter is off.
    [[nodiscard]] double delay_s() const noexcept { return is_on() ? 2 / corner_rad_s() : 0; }
    [[nodiscard]] bool is_on() const noexcept { return cutoff_Hz_ > 0; }
    // Restarts with the next value. Called after a discontinuity, a tare, or a sample without a value. rt: wait-free
    void reset() noexcept { empty_ = true; }

    // rt: wait-free
    void apply(std::array<double, 6>& value, std::uint64_t t_ns) noexcept {
        if (!is_on()) return;
        if (empty_) first_ = second_ = value;
        const double gain = empty_ || t_ns <= t_ns_ ? 0 : -std::expm1(-corner_rad_s() * double(t_ns - t_ns_) * 1e-9);
        for (std::size_t i = 0; i < value.size(); ++i) {
            first_[i] += gain * (value[i] - first_[i]);
            second_[i] += gain * (first_[i] - second_[i]);
            value[i] = second_[i];
        }
        t_ns_ = t_ns;
        empty_ = false;
    }

private:
    // Each stage has -1.5 dB at the cutoff. The corner of a stage is therefore 1 / sqrt(sqrt(2) - 1) times the cutoff.
    [[nodiscard]] double corner_rad_s() const noexcept {
        return 2 * 3.14159265358979323846 * cutoff_Hz_ * 1.5537739740300374;
    }

    double cutoff_Hz_ = 0;
    bool empty_ = true;
    std::uint64_t t_ns_ = 0;
    std::array<double, 6> first_{}, second_{};
};

}  // namespace tactiled
