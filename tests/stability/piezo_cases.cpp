// Model "piezo" and what integrates over time: leaks, offsets for days, spikes, clocks that stand, go back or jump.
#include <cmath>

#include "decoupling/piezo/charge.hpp"
#include "tests/stability/hard_case.hpp"
#include "tests/stability/methods.hpp"

namespace tactiled::stability {
namespace {

constexpr double kGain_V_per_N = 0.2917, kZero_V = 0.0768, kZero_pF = 1.3039, kCn_pF_per_N = 0.0405;
constexpr std::uint64_t kMs = 1'000'000;

// Straight curves, so that a closed form is one.
Calibration straight() {
    Calibration c = calibration_of("piezo/fused");
    c.parameters["gain_a"] = c.parameters["normal_a"] = 0;
    return c;
}

Estimate feed(Decoupler& decoupler, std::uint64_t t_ns, double V, double press_N) {
    const std::vector<double> channel{kZero_V + V, kZero_pF + kCn_pF_per_N * press_N};
    return decoupler.decouple({.channel = channel, .t_ns = t_ns});
}

// The press that Cn says, with what the rounding of its zero leaves.
double slow_of(double press_N) { return ((kZero_pF + kCn_pF_per_N * press_N) - kZero_pF) / kCn_pF_per_N; }

void add_leak_steps(Cases& cases) {
    // H19: 1 - exp(-x) at x = 1e-12.
    const LeakStep small(1e-12, 1);
    const Real x(1e-12);
    cases.value("H19", "gain of a step of 1e-12 of the leak's time",
                {(1 - std::exp(-1e-12)) / 1e-12, small.gain, (1 - exp(-x)) / x});
    // H32: exp(-10) twenty times; its condition is its exponent. The textbook steps forward: 1 - T / tau.
    const LeakStep stiff(1e-3, 1e-4);
    double ours = 1, naive = 1;
    for (int i = 0; i < 20; ++i) ours *= stiff.decay, naive *= 1 - 1e-3 / 1e-4;
    cases.value("H32", "a leak ten times faster than the samples, 20 of them",
                {naive, ours, exp(-20 * Real(1e-3) / Real(1e-4)), 200, 2});
}

void add_days(Cases& cases) {
    // H36: an offset of 0.1 mV for 30 days, a sample every half second. With the drive of an offset e rising by r = e / tau
    // a second and a fusion of g = 1 - exp(-T / tau) a step, what is left for ever is r (window / 2 + T (1 - g) / g).
    const auto decoupler = made(straight());
    const double e = 1e-4;
    const std::uint64_t steps = 30ull * 86400 * 2;
    double ours = 0, film_V = 0;
    for (std::uint64_t i = 0; i <= steps; ++i) {
        ours = feed(*decoupler, (i + 1) * 500 * kMs, i == 0 ? 0 : e, 2).wrench_S[2];
        film_V += i == 0 ? 0 : e * 0.5;
    }
    const double V = (kZero_V + e) - kZero_V;  // value in the model
    const Real left = Real(V) * (Real(0.05) + Real(0.5) / (exp(Real(0.5)) - 1));
    const Real reference = -(Real(slow_of(2)) + left / Real(kGain_V_per_N));
    // The running sum reaches V t / tau = 259 V beside a result of 0.58 V; that is what its rounding is relative to. Its
    // roundings are forgotten within tau (4 a window and sum): 16 of them.
    const double kappa = V * 30 * 86400 / (2 * kGain_V_per_N);
    cases.value("H36", "an offset of 0.1 mV of the film for 30 days: fz",
                {-(2 + film_V / kGain_V_per_N), ours, reference, kappa, 16});

    // H21: one spike of 1e17 V; a running sum never loses it.
    const auto spiked = made(straight());
    double after = 0, sum = 4 * kGain_V_per_N, last = 0;
    for (int i = 0; i < 60'000; ++i) {
        const double spike = i == 1000 ? 1e17 : 0;
        sum += spike - last;
        last = spike;
        after = feed(*spiked, std::uint64_t(i + 1) * kMs, spike, 4).wrench_S[2];
    }
    // Cut at 20 ranges = 58 V beside 1.2 V, forgotten by exp(-58 s / tau); the sum that is left is rounded once in each of
    // the tau / T = 1000 samples that the fusion averages.
    cases.value("H21", "58 s after a spike of 1e17 V of the film: fz",
                {-sum / kGain_V_per_N, after, -Real(slow_of(4)), 50 * 20, 8});

    // H14: one NaN; the textbook's filter has it for ever.
    const auto poisoned = made(straight());
    double value = 0, state = 0;
    for (int i = 0; i < 60'000; ++i) {
        const double read = i == 500 ? kNaN : 0;
        state += 0.01 * (4 + read - state);
        value = feed(*poisoned, std::uint64_t(i + 1) * kMs, read, 4).wrench_S[2];
    }
    cases.value("H14", "59 s after one NaN of the film: fz", {-state, value, -Real(slow_of(4)), 1000, 8});
}

void add_clocks(Cases& cases) {
    // Two samples of one time: a jump of the force; dV/dt would be 0.1 V / 0 s.
    const auto stands = made(straight());
    for (std::uint64_t i = 1; i <= 1000; ++i) (void)feed(*stands, i * kMs, 0, 1);
    const double jump = feed(*stands, 1000 * kMs, kGain_V_per_N, 1).wrench_S[2];
    const double V = (kZero_V + kGain_V_per_N) - kZero_V;
    cases.value("P1", "two samples of one time, 1 N apart: fz",
                {-(V / 0.0), jump, -(Real(slow_of(1)) + Real(V) / Real(kGain_V_per_N)), 4, 64});
    // A clock that goes back by 1 s (NTP's step), and one that jumps by a minute: the past is not known.
    const auto back = made(straight());
    Estimate estimate;
    for (std::uint64_t i = 1; i <= 3000; ++i) (void)feed(*back, i * kMs, 0, 1);
    estimate = feed(*back, 2000 * kMs, 0, 1);
    cases.marked("P2", "a clock that goes back by 1 s",
                 {as_good(1 - 1e3), published(estimate, 2), TACTILED_UNKNOWN_UNCERTAINTY, -1.0, 1e-12});
    estimate = feed(*back, 62000 * kMs, 0.2, 3);
    cases.marked("P3", "a gap of a minute",
                 {as_good(-1 - 0.2 / kGain_V_per_N), published(estimate, 2), TACTILED_UNKNOWN_UNCERTAINTY, -3.0, 1e-12});
    estimate = feed(*back, ~std::uint64_t{0}, 0.2, 3);
    estimate = feed(*back, 5, 0.2, 3);  // 64 bits of nanoseconds wrap
    cases.marked("P4", "a clock that wraps",
                 {as_good(kNaN), published(estimate, 2), TACTILED_UNKNOWN_UNCERTAINTY, -3.0, 1e-12});
    estimate = estimate_of(straight(), {kNaN, kZero_pF + kCn_pF_per_N * 3});
    cases.marked("P5", "the film is not a number",
                 {as_good(kNaN), published(estimate, 2), TACTILED_MISSING_CHANNEL, -3.0, 1e-12});
}

}  // namespace

void add_piezo_cases(Cases& cases) {
    add_leak_steps(cases);
    add_days(cases);
    add_clocks(cases);
}

}  // namespace tactiled::stability
