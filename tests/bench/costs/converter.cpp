// The AD7746's rate against its resolution, as force and delay of the capacitive sensor.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "drivers/sim/simulation.hpp"
#include "tests/bench/costs/cost.hpp"

namespace tactiled::ctl {
namespace {

// Data sheet AD7745/AD7746, Rev. 0 (2005), table 5, "Typical Capacitive Input Noise and Effective Resolution vs. Conversion
// Time". The noise is that of the chip; a board and its wires add to it.
struct Conversion {
    double time_ms, rate_Hz, noise_aF;
};
constexpr Conversion kConversions[] = {{11.0, 90.9, 40.0}, {11.9, 83.8, 27.3}, {20.0, 50.0, 12.2}, {38.0, 26.3, 7.3},
                                       {62.0, 16.1, 5.4},  {77.0, 13.0, 4.9},  {92.0, 10.9, 4.4},  {109.6, 9.1, 4.2}};
constexpr double kAccuracy_fF = 4, kElectrodesInTurn = 5;
constexpr double kPress_N = 2, kShear_N = 0.3;

// C1 C2 C3 C4 Cn, pF, by the curves of the calibration.
std::vector<double> reading(const Calibration& calibration, double fx_N, double press_N) {
    std::vector<double> result = calibration.zero;
    const auto& side = calibration.tables.at("side");
    const auto& p = calibration.parameters;
    for (std::size_t k = 0; k < 2; ++k) {
        const double towards_N = k == 0 ? fx_N : -fx_N;
        result[k] += side[k][0] * towards_N + side[k][1] * towards_N * towards_N;
    }
    result[4] += p.at("normal_b") * press_N + p.at("normal_a") * press_N * press_N;
    return result;
}

struct ForceNoise {
    double fx_N, fz_N;
};
ForceNoise force_noise(const Calibration& calibration, double noise_pF, std::size_t samples) {
    const auto decoupler = make_decoupler(calibration);
    const auto rest = reading(calibration, kShear_N, kPress_N);
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal(0, noise_pF);
    double fx2 = 0, fz2 = 0;
    for (std::size_t i = 0; i < samples; ++i) {
        auto channel = rest;
        for (double& c : channel) c += normal(random);
        const Estimate e = decoupler->decouple({.channel = channel, .t_ns = i + 1});
        fx2 += std::pow(e.wrench_S[0] - kShear_N, 2);
        fz2 += std::pow(e.wrench_S[2] + kPress_N, 2);
    }
    return {std::sqrt(fx2 / double(samples)), std::sqrt(fz2 / double(samples))};
}

// By how much the simulator's converter reads a ramp late.
double delay_ms(double window_s) {
    Problems problems;
    const auto scene = sim::read_scene(
        Options::parse_text(
            fmt::format("format = 1\ntitle = \"ramp\"\nrate_Hz = 1000\n[effects.converter_window]\nwindow_s = {}\n"
                        "[[sensor]]\nname = \"tip\"\nmodel = \"capacitive\"\n"
                        "[[motion]]\ndo = \"press\"\nto_N = 1\nin_s = 1\n",
                        window_s),
            "converter", problems),
        problems);
    problems.throw_if_any();
    sim::Simulation windowed(scene, "converter_window"), direct(scene, "none");
    double late = 0, slope = 0, last = 0;
    for (std::size_t done = 0; done < 900;) {
        const auto &a = windowed.advance(0), &b = direct.advance(0);
        late = b.channel[4][b.n - 1] - a.channel[4][a.n - 1];
        slope = (b.channel[4][b.n - 1] - last) / double(b.n);
        last = b.channel[4][b.n - 1];
        done += b.n;
    }
    return late / slope;  // samples of 1 ms
}

Cost measure(const CostSetup& setup) {
    const Calibration calibration = shipped_calibration(setup, "capacitive_documents.toml");
    Cost cost;
    cost.columns = {"conversion", "rate_Hz", "noise_aF", "fz_sd_mN", "fx_sd_mN", "delay_ms", "five_electrodes_in_turn_ms"};
    Figure::Series fz{"press", Symbol::circle, Stroke::solid}, fx{"shear, from a pair", Symbol::square, Stroke::solid};
    for (const auto& c : kConversions) {
        const ForceNoise noise = force_noise(calibration, c.noise_aF * 1e-6, setup.samples_or(40'000));
        cost.rows.push_back({fmt::format("{:g} ms", c.time_ms),
                             {c.rate_Hz, c.noise_aF, noise.fz_N * 1e3, noise.fx_N * 1e3, delay_ms(c.time_ms * 1e-3),
                              kElectrodesInTurn * c.time_ms}});
        const auto& v = cost.rows.back().values;
        fz.points.push_back({v[4], v[2], fmt::format("{:g} Hz", c.rate_Hz)});
        fx.points.push_back({v[4], v[3], ""});
    }
    // The chip's accuracy, which averaging does not improve, as a press.
    const auto decoupler = make_decoupler(calibration);
    auto off = reading(calibration, kShear_N, kPress_N);
    off[4] += kAccuracy_fF * 1e-3;
    const double accuracy_mN = (-decoupler->decouple({.channel = off, .t_ns = 1}).wrench_S[2] - kPress_N) * 1e3;
    // The fastest setting whose noise is negligible beside it; else the quietest.
    const auto quiet = std::find_if(cost.rows.begin(), cost.rows.end() - 1,
                                    [&](const auto& row) { return row.values[2] <= 0.1 * accuracy_mN; });
    const auto &fast = quiet->values, &slow = cost.rows.back().values;
    const Figure::Series accuracy{"accuracy of 4 fF, as a press",
                                  Symbol::none,
                                  Stroke::dashed,
                                  {{cost.rows.front().values[4], accuracy_mN, ""}, {slow[4], accuracy_mN, ""}},
                                  kInk};
    cost.figure = {"AD7746: noise against delay, capacitive sensor",
                   {"delay of one electrode by its conversion, ms", true},
                   {"noise of the force, one sd, mN", true},
                   {fz, fx, accuracy}};
    cost.advice = fmt::format(
        "Convert at {:g} Hz: its noise of {:.2f} mN is {:.0f} times below the chip's accuracy of {:.0f} mN, and it "
        "is {:.1f} ms late, not {:.0f} ms as at {:g} Hz (five electrodes in turn: a round of {:.0f} ms, not {:.0f} "
        "ms).",
        fast[0], fast[2], accuracy_mN / fast[2], accuracy_mN, fast[4], slow[4], slow[0], fast[5], slow[5]);
    return cost;
}

}  // namespace

extern const CostEntry converter_cost;
const CostEntry converter_cost{"converter", "AD7746: rate against resolution, as force and delay",
                               "decoupling/costs_converter.svg", measure};

}  // namespace tactiled::ctl
