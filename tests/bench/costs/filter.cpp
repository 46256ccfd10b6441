// Remaining noise and added delay of the low-pass: node/low_pass.hpp on white noise and on a ramp.
#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <random>

#include "node/low_pass.hpp"
#include "tests/bench/costs/cost.hpp"

namespace tactiled::ctl {
namespace {

constexpr double kRate_Hz = 1000, kStep_s = 1 / kRate_Hz, kMaxDelay_ms = 10;  // one cycle of a loop at 100 Hz
constexpr std::uint64_t kStep_ns = 1'000'000;

// sd out / sd in, all six components together.
double noise_left(double cutoff_Hz, std::size_t samples) {
    LowPass filter;
    filter.set_cutoff(cutoff_Hz);
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    const auto settled = std::size_t(2 * kRate_Hz / cutoff_Hz);  // twenty time constants
    double squares_in = 0, squares_out = 0;
    for (std::size_t i = 0; i < settled + samples; ++i) {
        std::array<double, 6> value, sd{};
        for (double& v : value) v = normal(random);
        for (const double v : value) squares_in += i < settled ? 0 : v * v;
        filter.apply(value, sd, (i + 1) * kStep_ns);
        for (const double v : value) squares_out += i < settled ? 0 : v * v;
    }
    return std::sqrt(squares_out / squares_in);
}

// Returns the delay of a ramp: the group delay at low frequencies.
double delay_ms(double cutoff_Hz) {
    LowPass filter;
    filter.set_cutoff(cutoff_Hz);
    const auto settled = std::uint64_t(4 * kRate_Hz / cutoff_Hz);
    std::array<double, 6> value{}, sd{};
    double t_s = 0;
    for (std::uint64_t i = 0; i <= settled; ++i) {
        t_s = double(i) * kStep_s;
        value.fill(t_s);
        filter.apply(value, sd, (i + 1) * kStep_ns);
    }
    return (t_s - value[0]) * 1e3;
}

// Two equal stages dy/dt = w (u - y), u linear between samples. The response to one sample is the second difference of the
// twice integrated impulse response w^2 t exp(-w t); the noise that is left is the root of the sum of its squares.
double corner_rad_s(double cutoff_Hz) { return 2 * std::numbers::pi * cutoff_Hz / std::sqrt(std::sqrt(2.0) - 1); }
double theory_delay_ms(double cutoff_Hz) { return 2e3 / corner_rad_s(cutoff_Hz); }
double theory_noise(double cutoff_Hz) {
    const double w = corner_rad_s(cutoff_Hz);
    const auto twice = [&](double n) {
        const double t_s = std::max(n, 0.0) * kStep_s;
        return t_s + (2 / w + t_s) * std::exp(-w * t_s) - 2 / w;
    };
    double squares = 0;
    for (double n = 0; w * n * kStep_s < 40; ++n)
        squares += std::pow((twice(n + 1) - 2 * twice(n) + twice(n - 1)) / kStep_s, 2);
    return std::sqrt(squares);
}

Cost measure(const CostSetup& setup) {
    Cost cost;
    cost.columns = {"filter", "cutoff_Hz", "delay_ms", "delay_theory_ms", "noise_left", "noise_left_theory"};
    Figure::Series measured{"measured", Symbol::circle, Stroke::none},
        theory{"theory", Symbol::none, Stroke::solid, {}, kGrey};
    const Cost::Row* best = nullptr;
    for (const double cutoff_Hz : {1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0}) {
        cost.rows.push_back({fmt::format("{:g} Hz", cutoff_Hz),
                             {cutoff_Hz, delay_ms(cutoff_Hz), theory_delay_ms(cutoff_Hz),
                              noise_left(cutoff_Hz, setup.samples_or(400'000)), theory_noise(cutoff_Hz)}});
        const auto& v = cost.rows.back().values;
        measured.points.push_back({v[1], 100 * v[3], cost.rows.back().name});
    }
    for (double cutoff_Hz = 0.8; cutoff_Hz < 250; cutoff_Hz *= 1.1)
        theory.points.push_back({theory_delay_ms(cutoff_Hz), 100 * theory_noise(cutoff_Hz), ""});
    for (const auto& row : cost.rows)
        if (row.values[1] <= kMaxDelay_ms && (best == nullptr || row.values[3] < best->values[3])) best = &row;
    cost.figure = {"Low-pass: noise against delay, samples at 1 kHz",
                   {"group delay, ms", true},
                   {"white noise that is left, % of its sd", true},
                   {theory, measured}};
    const auto &slow = cost.rows[0].values, &fast = cost.rows[2].values;
    cost.advice = fmt::format(
        "For at most {:g} ms of delay choose filter_hz = {:g}: {:.0f} % of the noise is left, {:.1f} ms late; from "
        "{:g} down to {:g} Hz the noise falls {:.1f} times and the delay grows {:.1f} times.",
        kMaxDelay_ms, best->values[0], 100 * best->values[3], best->values[1], fast[0], slow[0], fast[3] / slow[3],
        slow[1] / fast[1]);
    return cost;
}

}  // namespace

extern const CostEntry filter_cost;
const CostEntry filter_cost{"filter", "filter bandwidth: noise against group delay", "node/costs_filter.svg", measure};

}  // namespace tactiled::ctl
