#include "tests/bench/grasp_slip.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "tests/bench/grasp_session.hpp"

namespace tactiled::bench {
namespace {

constexpr double kRate_Hz = 1000, kReported = 0.6;
constexpr int kSerials = 8;
constexpr double kClock_s = 0.002;  // by which a simulated clock may be off: a sample of then is one of the slip

std::array<std::unique_ptr<Decoupler>, kSerials> sensors() {
    std::array<std::unique_ptr<Decoupler>, kSerials> made;
    for (int s = 0; s < kSerials; ++s) made[std::size_t(s)] = decoupler(calibrate("calibrate_hair_wide.toml", s + 1));
    return made;
}

std::string head(std::uint64_t seed, int serial, double friction, double kinetic) {
    return fmt::format(
        "format = 1\ntitle = \"slip\"\nseed = {}\nrate_Hz = {}\n[body]\nfriction = {}\nkinetic_friction = {}\n"
        "[effects.self_heating]\nrise_K = 0\n[[sensor]]\nname = \"jaw\"\nmodel = \"hair\"\nserial = {}\nfull_scale_N = "
        "0.34\n",
        seed, kRate_Hz, friction, kinetic, serial);
}

grasp::Grasp estimator(double friction) {
    grasp::Setup setup;
    setup.jaws_of_gripper = 2;
    setup.gravity_G = {0, -9.80665, 0};
    setup.friction = friction;
    setup.jaws.emplace_back();
    setup.jaws[0].contact_on_N = 0.02;
    setup.jaws[0].contact_off_N = 0.012;
    return grasp::Grasp(setup);
}

struct Random {
    std::mt19937_64 bits;
    double operator()(double from, double to) { return from + (to - from) * double(bits() >> 11) * 0x1p-53; }
};

double begin_of(const sim::Scene& scene, const std::string& kind) {
    for (const sim::Segment& s : scene.motion.segments())
        if (s.kind == kind) return s.begin_s;
    return 0;
}

}  // namespace

SlipFigures slips(std::uint64_t seed, int n, double told_off, double kinetic_from, double kinetic_to) {
    const auto made = sensors();
    Random uniform{std::mt19937_64(seed * 7919 + 3)};
    SlipFigures f{.n = n};
    std::vector<double> late_ms;
    double squares = 0;
    for (int i = 0; i < n; ++i) {
        const int serial = i % kSerials;
        const double reported = told_off < 1 ? kReported : 0,
                     mu = kReported * uniform(1 - std::min(told_off, 0.2), 1 + std::min(told_off, 0.2));
        const double kinetic = mu * uniform(kinetic_from, kinetic_to), press_N = uniform(0.1, 0.3);
        const double limit_N = mu * press_N;
        const std::string text =
            head(seed * 100003 + std::uint64_t(i), serial + 1, mu, kinetic) +
            fmt::format(
                "[[motion]]\ndo = \"hold\"\nfor_s = 0.5\n[[motion]]\ndo = \"press\"\nto_N = {0}\nin_s = 0.3\ncourse = "
                "\"smooth\"\n"
                "[[motion]]\ndo = \"hold\"\nfor_s = 0.2\n[[motion]]\ndo = \"shear\"\nto_N = {1}\ndirection_deg = 270\nin_s "
                "= 0.2\n"
                "course = \"smooth\"\n[[motion]]\ndo = \"hold\"\nfor_s = 0.3\n"
                "[[motion]]\ndo = \"shake\"\non = \"shear\"\namplitude_N = {2}\nfrom_Hz = 20\nfor_s = 0.2\n"
                "[[motion]]\ndo = \"shear\"\nto_N = {3}\nin_s = {4}\n[[motion]]\ndo = \"slip\"\nspeed_m_s = {5}\nfor_s = "
                "0.15\n"
                "[[motion]]\ndo = \"hold\"\nfor_s = 0.1\n",
                press_N, limit_N / 1.5, 0.02 * limit_N, limit_N, uniform(0.05, 0.6), uniform(0.005, 0.05));
        const sim::Scene scene = parse_scene(text);
        const double slip_s = begin_of(scene, "slip"), pull_s = slip_s - 0.6;
        const Recording r = record(scene, *made[std::size_t(serial)]);
        grasp::Grasp g = estimator(reported);
        bool found = false, early = false, incipient = false, at_rest = false;
        for (std::size_t k = 0; k < r.samples.size(); ++k) {
            g.sample(0, r.samples[k]);
            const double t_s = double(k) / kRate_Hz;
            const tactiled_grasp s = g.state();
            const auto now = s.slip_state[0];
            early |= t_s < slip_s - kClock_s && now == TACTILED_SLIP_GROSS;
            incipient |= t_s < slip_s && now == TACTILED_SLIP_INCIPIENT;
            at_rest |= t_s < pull_s && t_s > 0.6 && now == TACTILED_SLIP_INCIPIENT;
            if (found || t_s < slip_s - kClock_s || now != TACTILED_SLIP_GROSS) continue;
            found = true;
            late_ms.push_back(std::max(0.0, t_s - slip_s) * 1e3);
            squares += std::pow(double(s.friction) / mu - 1, 2);
        }
        f.found += found;
        f.early += early;
        f.incipient_before += incipient && found;
        f.incipient_at_rest += at_rest;
        f.in_10_ms += found && late_ms.back() <= 10;
    }
    if (late_ms.empty()) return f;
    f.friction_error = std::sqrt(squares / double(late_ms.size()));
    std::sort(late_ms.begin(), late_ms.end());
    f.p50_ms = late_ms[late_ms.size() / 2];
    f.p99_ms = late_ms[late_ms.size() * 99 / 100];
    return f;
}

TransportFigures transport(std::uint64_t seed, double hours, double g, bool reported) {
    const auto made = sensors();
    Random uniform{std::mt19937_64(seed * 104729 + 11)};
    TransportFigures f;
    constexpr double kTrip_s = 180;
    while (f.hours < hours) {
        const int serial = int(uniform(0, kSerials));
        const double mu = kReported * uniform(0.9, 1.1), press_N = uniform(0.1, 0.3), weight_N = mu * press_N / 1.5;
        std::string text = head(std::uint64_t(uniform(0, 1e9)), serial + 1, mu, mu * 0.85) +
                           fmt::format(
                               "[[motion]]\ndo = \"hold\"\nfor_s = 0.5\n[[motion]]\ndo = \"press\"\nto_N = {}\nin_s = 0.3\n"
                               "[[motion]]\ndo = \"hold\"\nfor_s = 0.2\n[[motion]]\ndo = \"shear\"\nto_N = {}\n"
                               "direction_deg = 270\nin_s = 0.2\n[[motion]]\ndo = \"hold\"\nfor_s = 0.3\n",
                               press_N, weight_N);
        for (double t_s = 0; t_s < kTrip_s;) {
            const double for_s = uniform(2, 15), part = uniform(0, g);
            const bool on_press = uniform(0, 1) < 0.25;
            text += fmt::format(
                "[[motion]]\ndo = \"shake\"\non = \"{}\"\namplitude_N = {}\nfrom_Hz = {}\nto_Hz = {}\nfor_s = {}\n"
                "[[motion]]\ndo = \"hold\"\nfor_s = {}\n",
                on_press ? "press" : "shear", part * (on_press ? press_N : weight_N), uniform(5, 60), uniform(5, 60), for_s,
                uniform(0.1, 2));
            t_s += for_s + 1;
        }
        const sim::Scene scene = parse_scene(text);
        const Recording r = record(scene, *made[std::size_t(serial)]);
        grasp::Grasp estimate = estimator(reported ? kReported : 0);
        std::uint16_t before = TACTILED_SLIP_NONE;
        for (std::size_t k = 0; k < r.samples.size(); ++k) {
            estimate.sample(0, r.samples[k]);
            const std::uint16_t now = estimate.state().slip_state[0];
            f.gross += now == TACTILED_SLIP_GROSS && before != now;
            f.incipient += now == TACTILED_SLIP_INCIPIENT && before == TACTILED_SLIP_NONE;
            before = now;
        }
        f.hours += double(r.samples.size()) / kRate_Hz / 3600;
    }
    return f;
}

}  // namespace tactiled::bench
