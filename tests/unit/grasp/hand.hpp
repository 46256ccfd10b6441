// Two jaws with a sensor each, driven by forces that a test specifies, at 1 kHz by default.
#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "decoupling/grasp/grasp.hpp"

namespace tactiled::grasp {

inline constexpr double kG = 9.80665;

// The hand points down: z of G is the direction of gravity. Both skins have y up.
inline Setup two_jaws() {
    Setup s;
    s.gravity_G = {0, 0, kG};
    s.friction = 0.6;
    s.lift_accelerates_ms = 150;
    s.jaws.resize(2);
    s.jaws[0].S_from_G = {{{0, -1, 0}, {0, 0, -1}, {1, 0, 0}}};
    s.jaws[1].S_from_G = {{{0, 1, 0}, {0, 0, -1}, {-1, 0, 0}}};
    for (std::uint32_t j = 0; j < 2; ++j) s.jaws[j].sensor = j;
    return s;
}

inline Setup hairs() {
    Setup setup = two_jaws();
    for (JawSetup& jaw : setup.jaws) jaw.errs_by_gain = true;
    return setup;
}

class Hand {
public:
    explicit Hand(const Setup& setup = two_jaws()) : grasp(setup), jaws_(setup.jaws.size()) {}

    // Moves linearly from the present state to this one, in that time; both jaws alike.
    Hand& go(double seconds, double press_N, double load_N, double across_N = 0) {
        const double from[] = {press_N_, load_N_, across_N_}, to[] = {press_N, load_N, across_N};
        const int n = std::max(1, int(std::lround(seconds * rate_hz)));
        for (int i = 1; i <= n; ++i) {
            const double u = double(i) / n;
            press_N_ = from[0] + u * (to[0] - from[0]);
            load_N_ = from[1] + u * (to[1] - from[1]);
            across_N_ = from[2] + u * (to[2] - from[2]);
            step();
        }
        return *this;
    }
    Hand& stay(double seconds) { return go(seconds, press_N_, load_N_, across_N_); }
    Hand& close() { return go(0.5, 0, 0).go(0.2, 2, 0).stay(0.2); }  // 2 N per jaw
    Hand& lift(double mass_kg) { return go(0.15, press_N_, mass_kg * kG / 2).stay(0.4); }

    [[nodiscard]] tactiled_grasp now() const { return grasp.state(); }
    [[nodiscard]] double t_s() const { return double(t_ns_) * 1e-9; }

    void step() {
        t_ns_ += std::uint64_t(1e9 / rate_hz);
        for (std::size_t j = 0; j < jaws_; ++j) {
            JawSample s{.t_ns = t_ns_, .quality = TACTILED_GOOD};
            s.force_S_N = {across_N_ + noise(), -load_N_ + noise(), -press_N_ + noise()};
            s.sd_N = {0.005, 0.005, 0.005};
            if (spoil) spoil(j, s);
            grasp.sample(j, s);
        }
        if (each) each(now());
    }

    Grasp grasp;
    std::function<void(std::size_t, JawSample&)> spoil;
    std::function<void(const tactiled_grasp&)> each;
    double noise_N = 0.001, rate_hz = 1000;

private:
    double noise() { return noise_N * (double(random_() >> 11) * 0x1p-53 - 0.5) * 3.46; }

    std::size_t jaws_;
    std::mt19937_64 random_{1};
    std::uint64_t t_ns_ = 1'000'000'000;
    double press_N_ = 0, load_N_ = 0, across_N_ = 0;
};

}  // namespace tactiled::grasp
