// A piezoelectric film with a leak, and its fusion with a slow, absolute reading. The film's charge is proportional
// to a drive q (here in V: the signal without a leak) and leaks with the time constant tau = R C:
//
//     dV/dt = dq/dt - V / tau,     V/q = s tau / (1 + s tau)
//
// The thesis' eq. X and XI, V proportional to F, are valid only far above 1 / (2 pi tau) (errata 1.11).
#pragma once
#include <array>
#include <cmath>
#include <cstddef>

namespace tactiled {

// One step of T seconds, exact for a drive that is linear in between:
//     V[n] = decay V[n-1] + gain (q[n] - q[n-1]),    decay = exp(-T/tau),  gain = -expm1(-T/tau) tau / T
// The staircase form, gain = 1, has an error of T / 2 tau on a ramp.
struct LeakStep {
    double decay = 1, gain = 1;  // T = 0: a jump

    LeakStep(double T_s, double tau_s) noexcept {
        const double x = T_s / tau_s;
        if (!(x > 0)) return;
        decay = std::exp(-x);
        gain = -std::expm1(-x) / x;
    }
    [[nodiscard]] double voltage(double last_V, double change_of_drive) const noexcept {
        return decay * last_V + gain * change_of_drive;
    }
    // Returns the inverse of a step. Its sum has a pole at z = 1 and drifts with any offset (hard case H36).
    [[nodiscard]] double change_of_drive(double last_V, double V) const noexcept { return (V - decay * last_V) / gain; }
};

// Estimates the drive q from the film's V and a slow reading c of the same quantity. c is the mean over the last `window_s`,
// new once per window and constant in between (the thesis: AD7746 at 10 Hz). With W the window's mean,
//
//     q_est = q_film + L (c - W q_film),    L = 1 / (1 + s tau_c)
//
// q_film, the running sum of the film's changes, is right except for a slow drift. c - W q_film compares the same window of
// both, so it contains only that drift; gain and phase of q are 1 and 0 at every frequency. A complementary filter of c
// alone would omit the window's delay. An offset e of V becomes e tau_c / tau, permanently.
class ChargeFusion {
public:
    ChargeFusion(double leak_s, double fusion_s, double window_s) noexcept
        : leak_s_(leak_s), fusion_s_(fusion_s), window_s_(window_s) {}

    void forget() noexcept { started_ = false; }

    // `slow` is c; `is_new`: it was measured since the last call. T_s >= 0 since the last call.
    // rt: wait-free, at most kMax steps
    double update(double T_s, double V, double slow, bool is_new) noexcept;

    // True from one window after the start on; before, the history of the film is unknown.
    [[nodiscard]] bool is_settled() const noexcept { return started_ && time_s_ >= window_s_; }
    [[nodiscard]] double window_s() const noexcept { return window_s_; }
    // Returns the difference of the two readings that is not corrected yet, in units of the drive. rt: wait-free
    [[nodiscard]] double difference() const noexcept { return drift_ - correction_; }

private:
    static constexpr std::size_t kMax = 256;  // points of the window that are kept
    struct Point {
        double t_s, film;
    };
    void start(double V, double slow) noexcept;
    void keep(double t_s, double film) noexcept;
    [[nodiscard]] double mean_of_window() const noexcept;

    double leak_s_, fusion_s_, window_s_;
    bool started_ = false;
    double time_s_ = 0, last_V_ = 0, film_ = 0, drift_ = 0, correction_ = 0;
    std::array<Point, kMax> ring_{};
    std::size_t newest_ = 0, held_ = 0;
};

}  // namespace tactiled
