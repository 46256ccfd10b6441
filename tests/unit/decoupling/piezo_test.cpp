#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstdio>
#include <cstring>
#include <functional>
#include <limits>
#include <numbers>
#include <random>

#include "decoupling/piezo/charge.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

constexpr double kWindow_s = 0.1;

// The thesis, eq. XXXIII and XXXV; the time constants are assumed.
Calibration piezo_calibration(double tau_s = 1.0) {
    Calibration calibration;
    calibration.path = "piezo.toml";
    calibration.model = "piezo";
    calibration.method = "fused";
    calibration.channels = {"Vp", "Cn"};
    calibration.zero = {0.0768, 1.3039};
    calibration.components = {"fz"};
    calibration.parameters = {{"gain_b", 0.2917},   {"gain_a", 0.0092},       {"normal_b", 0.0405},
                              {"normal_a", 0.0008}, {"normal_range_N", 10.0}, {"leak_tau_s", tau_s}};
    calibration.sd = {0.05};
    return calibration;
}

double film_V(double N) { return 0.0092 * N * N + 0.2917 * N; }
double centre_pF(double N) { return 0.0008 * N * N + 0.0405 * N + 1.3039; }

// Linear curves, so that a sine remains one.
Calibration linear_calibration(double tau_s) {
    Calibration calibration = piezo_calibration(tau_s);
    calibration.parameters["gain_a"] = calibration.parameters["normal_a"] = 0;
    return calibration;
}

double press_of(Decoupler& decoupler, double t_s, double V, double pF, Estimate* out = nullptr) {
    const std::vector<double> channel{V, pF};
    const Estimate estimate = decoupler.decouple({.channel = channel, .t_ns = std::uint64_t(std::llround(1e9 + t_s * 1e9))});
    if (out != nullptr) *out = estimate;
    return -estimate.wrench_S[2];
}

// ---- the recurrences
TEST(LeakStep, IsExactOnARampAndOnAJump) {
    const double tau = 1, T = 2e-3;
    const LeakStep step(T, tau);
    double v = 0, staircase = 0;
    for (int n = 1; n <= 1000; ++n) {
        v = step.voltage(v, 3 * T);
        staircase = step.decay * staircase + 3 * T;
    }
    const double exact = 3 * tau * -std::expm1(-1000 * T / tau);  // response of s tau / (1 + s tau) to 3 N/s
    EXPECT_NEAR(v / exact, 1, 2e-14);
    EXPECT_NEAR(staircase / exact - 1, 1e-3, 2e-5);  // T / 2 tau
    EXPECT_EQ(LeakStep(0, tau).voltage(2, 3), 5);
    EXPECT_NEAR(LeakStep(1e-12, 1).gain, 1 - 5e-13, 1e-16);
    EXPECT_NEAR(step.change_of_drive(1.5, step.voltage(1.5, 0.7)), 0.7, 1e-15);
    EXPECT_EQ(LeakStep(1e300, 1).decay, 0);
}

// ---- gain and phase
using Complex = std::complex<double>;

struct Response {
    Complex capacitive, film, fused;
};

// F = 5 + sin(2 pi f t); Vp is the exact steady state of s tau / (1 + s tau), Cn the exact mean of each tenth of a
// second, valid from its end on. `tau_true` may differ from the calibration. 1 kHz.
Response response(double f, double tau_s, double tau_true) {
    const auto decoupler = make_decoupler(linear_calibration(tau_s));
    const double w = 2 * std::numbers::pi * f, rate = 1000;
    const Complex high_pass = Complex(0, w * tau_true) / Complex(1, w * tau_true);
    // A period that does not lock to the 10 Hz conversions; the start decays for 20 time constants.
    const int settle = int(20 * std::max(tau_s, 1.0) * rate);
    const int n = int(std::ceil(20 / f) / 1 * rate) > 20000 ? int(20 / f * rate) : 20000;
    Complex sums[3];
    int counted = 0;
    for (int i = 0; i < settle + n; ++i) {
        const double t = i / rate;
        const double V = 0.2917 * std::imag(high_pass * std::polar(1.0, w * t));
        const double end = std::floor((t + 1e-9) / kWindow_s) * kWindow_s;
        const double mean = 5 + (std::cos(w * (end - kWindow_s)) - std::cos(w * end)) / (w * kWindow_s);
        const double fused = press_of(*decoupler, t, V + 0.0768, 0.0405 * mean + 1.3039);
        if (i < settle) continue;
        const Complex turn = std::polar(1.0, -w * t) * Complex(0, 2);  // for sin: amplitude 1, phase 0
        sums[0] += (mean - 5) * turn;
        sums[1] += V / 0.2917 * turn;
        sums[2] += (fused - 5) * turn;
        ++counted;
    }
    for (auto& sum : sums) sum /= double(counted);
    return {sums[0], sums[1], sums[2]};
}

double phase_deg(Complex z) { return std::arg(z) * 180 / std::numbers::pi; }

TEST(Piezo, FusedGainIsOneAndPhaseIsZeroFromATenthTo100Hz) {
    std::printf(
        "tau = 1 s, 1 kHz            capacitive          film               fused        fused, tau 20 %% off\n"
        "    f_Hz                 gain  phase_deg     gain  phase_deg    gain   phase_deg    gain   phase_deg\n");
    for (const double f : {0.1, 0.15, 0.25, 0.55, 1.05, 2.05, 4.05, 7.05, 15.05, 30.05, 60.05, 99.05}) {
        const Response exact = response(f, 1, 1), off = response(f, 1, 0.8);
        std::printf("%8.2f              %7.4f %8.2f     %7.4f %8.2f   %7.4f %8.3f   %7.4f %8.3f\n", f,
                    std::abs(exact.capacitive), phase_deg(exact.capacitive), std::abs(exact.film), phase_deg(exact.film),
                    std::abs(exact.fused), phase_deg(exact.fused), std::abs(off.fused), phase_deg(off.fused));
        EXPECT_NEAR(std::abs(exact.fused), 1, 0.01) << f;
        EXPECT_NEAR(phase_deg(exact.fused), 0, 1) << f;
        EXPECT_NEAR(std::abs(off.fused), 1, 0.15) << f;
        if (f > 3) { EXPECT_LT(std::abs(exact.capacitive), 0.9) << f; }
        if (f < 0.2) { EXPECT_LT(std::abs(exact.film), 0.8) << f; }
    }
}

// The thesis' film returns to 0 within a half period of 1.66 Hz, so its tau is at most 0.1 s: not longer than the
// window.
TEST(Piezo, AShortLeakIsFusedToo) {
    for (const double f : {0.1, 0.55, 1.66, 4.05, 15.05, 60.05}) {
        const Response exact = response(f, 0.1, 0.1);
        EXPECT_NEAR(std::abs(exact.fused), 1, 0.02) << f;
        EXPECT_NEAR(phase_deg(exact.fused), 0, 2) << f;
    }
}

// 10 N square wave of 1.66 Hz, 1 kHz; noise of a 10-bit converter of 5 V and 4 fF. The curves are those of the thesis.
TEST(Piezo, IsWithinTwoPercentOfFullScaleOnTheThesisCurves) {
    const auto decoupler = make_decoupler(piezo_calibration(1.0));
    std::mt19937 random(5);
    std::normal_distribution<double> noise(0, 1);
    double squares = 0, worst = 0, V = 0, last = 0, held = centre_pF(0), sum = 0;
    int n = 0;
    for (int i = 0; i < 60000; ++i) {
        const double t = i * 1e-3, level = 2 + 2 * std::floor(std::fmod(t, 20.0) / 4);  // 2 .. 10 N
        const double N = i < 1000 || std::fmod(t * 1.66, 1.0) < 0.5 ? 0 : level;
        V = LeakStep(1e-3, 1.0).decay * V + (film_V(N) - last);  // a jump between frames
        last = film_V(N);
        sum += centre_pF(N);
        if (i % 100 == 99) {
            held = sum / 100 + 0.004 * noise(random);
            sum = 0;
        }
        const double read = std::round((V + 0.0768 + 1.0) / (5.0 / 1024)) * (5.0 / 1024) - 1.0;
        const double error = press_of(*decoupler, t, read, held) - N;
        if (i < 1000) continue;
        squares += error * error;
        worst = std::max(worst, std::abs(error));
        ++n;
    }
    const double rms = std::sqrt(squares / n);
    std::printf("piezo, fused, thesis' curves: rms %.3f %% of 10 N, worst %.2f %%\n", 10 * rms, 10 * worst);
    EXPECT_LT(10 * rms, 2.07);
    EXPECT_LT(10 * worst, 4.6);
}

// Hard case H36: the inverse filter alone reads 1234 N after this hour.
TEST(Piezo, AnOffsetForAnHourStaysBounded) {
    const auto decoupler = make_decoupler(linear_calibration(1.0));
    double press = 0;
    Estimate estimate;
    for (int i = 0; i < 3'600'000; ++i) press = press_of(*decoupler, i * 1e-3, 0.0768 + 1e-4, 1.3039, &estimate);
    EXPECT_LT(std::abs(press), 1.2 * 1e-4 / 0.2917);  // N: offset * fusion_tau / leak_tau, and the window's delay
    EXPECT_EQ(estimate.quality(), TACTILED_GOOD);
}

TEST(Piezo, FollowsASteadyForceAndAStepAtOnce) {
    const auto decoupler = make_decoupler(piezo_calibration(1.0));
    const double tau = 1.0;
    for (int i = 0; i < 4000; ++i) {
        const double t = i * 1e-3, N = t < 2 ? 1 : 6;
        const double V = t < 2 ? 0 : (film_V(6) - film_V(1)) * std::exp(-(t - 2) / tau);
        const int windows = int(std::floor((t + 1e-9) / kWindow_s));
        const double seen = centre_pF(windows * kWindow_s <= 2.0 + 1e-9 ? 1 : 6);
        const double press = press_of(*decoupler, t, V + 0.0768, seen);
        EXPECT_NEAR(press, N, 0.01) << t;  // N; the step is between two frames: half of 1 ms of leak
    }
}

// The force steps from 1 to 6 N at 2 s and rests; one of the two channels sticks at 1.5 s.
TEST(Piezo, AChannelThatSticksContradictsTheOther) {
    for (const bool film_sticks : {true, false}) {
        const auto decoupler = make_decoupler(piezo_calibration(1.0));
        for (int i = 0; i < 4000; ++i) {
            const double t = i * 1e-3;
            const double V = t < 2 || film_sticks ? 0 : (film_V(6) - film_V(1)) * std::exp(-(t - 2));
            const int windows = int(std::floor((t + 1e-9) / kWindow_s));
            const double seen = centre_pF(windows * kWindow_s <= 2.0 + 1e-9 || !film_sticks ? 1 : 6);
            Estimate estimate;
            const double press = press_of(*decoupler, t, V + 0.0768, seen, &estimate);
            if (t < 0.1) continue;
            if (t < 2) { EXPECT_EQ(estimate.quality(), TACTILED_GOOD) << t; }
            if (t < 2.21) continue;  // one window has shown it; a Cn that repeats its number counts after two
            EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN) << t;
            EXPECT_NE(estimate.reasons & TACTILED_DISAGREEMENT, 0u);
            EXPECT_LT(std::abs(press - 6), 2 * estimate.sd[2]) << t;
        }
    }
}

// A film that sticks before a step of four standard deviations: too small a difference to contradict Cn.
TEST(Piezo, ASmallDifferenceOfTheChannelsIsInTheStandardDeviation) {
    const Calibration calibration = piezo_calibration(1.0);
    const auto decoupler = make_decoupler(calibration);
    const double sd = calibration.sd.at(0), after = 1 + 4 * sd;
    for (int i = 0; i < 2600; ++i) {
        const double t = i * 1e-3;
        const int windows = int(std::floor((t + 1e-9) / kWindow_s));
        Estimate estimate;
        const double press =
            press_of(*decoupler, t, 0.0768, centre_pF(windows * kWindow_s <= 2.0 + 1e-9 ? 1 : after), &estimate);
        if (t < 1) continue;
        EXPECT_EQ(estimate.quality(), TACTILED_GOOD) << t;
        if (t < 2) { EXPECT_NEAR(estimate.sd[2], sd, 0.1 * sd) << t; }
        if (t > 2.11) { EXPECT_LT(std::abs(press - after), 2.1 * estimate.sd[2]) << t; }
    }
}

TEST(Piezo, FramesMayComeUnevenly) {
    const auto decoupler = make_decoupler(linear_calibration(1.0));
    const double w = 2 * std::numbers::pi * 3.3, tau = 1;
    const Complex high_pass = Complex(0, w * tau) / Complex(1, w * tau);
    std::mt19937 random(11);
    std::uniform_real_distribution<double> step_s(1e-4, 5e-3);
    double worst = 0;
    for (double t = 0; t < 30; t += step_s(random)) {
        t = std::round(t * 1e9) * 1e-9;
        const double V = 0.2917 * std::imag(high_pass * std::polar(1.0, w * t));
        const double end = std::floor((t + 1e-9) / kWindow_s) * kWindow_s;
        const double mean = 5 + (std::cos(w * (end - kWindow_s)) - std::cos(w * end)) / (w * kWindow_s);
        const double press = press_of(*decoupler, t, V + 0.0768, 0.0405 * mean + 1.3039);
        if (t > 20) worst = std::max(worst, std::abs(press - 5 - std::sin(w * t)));
    }
    // N for an amplitude of 1; a frame comes up to 5 ms after the conversion ended, which the window cannot know.
    EXPECT_LT(worst, 0.05);
    std::printf("uneven frames, 0.1 to 5 ms: worst %.4f of the amplitude\n", worst);
}

// ---- irregular times
TEST(Piezo, ADiscontinuityARepeatedOrABackwardTimeDoesNotPoisonIt) {
    const auto reference = make_decoupler(linear_calibration(1.0));
    const auto decoupler = make_decoupler(linear_calibration(1.0));
    const auto feed = [&](double t, double V, double pF) { return press_of(*decoupler, t, V + 0.0768, pF + 1.3039); };
    for (int i = 0; i < 1000; ++i) feed(i * 1e-3, 0, 0.0405);
    EXPECT_NEAR(feed(0.999, 0.2917, 0.0405), 2, 1e-6);  // same time: a jump of 1 N
    EXPECT_NEAR(feed(0.5, 0, 0.081), 2, 1e-9);          // back in time: restarts from Cn
    EXPECT_NEAR(feed(50, 1.0, 0.1215), 3, 1e-9);        // a gap longer than the leak: restarts
    Estimate estimate;
    press_of(*decoupler, 50.001, 1.0, 1.3039 + 0.1215, &estimate);
    EXPECT_NE(estimate.reasons & TACTILED_UNKNOWN_UNCERTAINTY, 0u);  // until a window has passed
    // ... and from then on equal to one without any of it.
    double press = 0, wanted = 0;
    for (int i = 0; i < 20000; ++i) {
        press = feed(50.002 + i * 1e-3, 0, 0.0405);
        wanted = press_of(*reference, i * 1e-3, 0.0768, 1.3039 + 0.0405);
    }
    EXPECT_NEAR(press, 1, 1e-6);
    EXPECT_NEAR(wanted, 1, 1e-12);
}

TEST(Piezo, RunsOnCnAloneWhileTheFilmIsMissing) {
    const auto decoupler = make_decoupler(piezo_calibration());
    const std::vector<double> channel{kNaN, centre_pF(3)};
    const Estimate estimate = decoupler->decouple({.channel = channel, .t_ns = 5});
    EXPECT_NEAR(estimate.wrench_S[2], -3, 1e-12);
    EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_MISSING_CHANNEL | TACTILED_UNKNOWN_UNCERTAINTY});
    EXPECT_TRUE(std::isnan(estimate.sd[2]));
    const std::vector<double> without{0.1, kNaN};
    EXPECT_EQ(decoupler->decouple({.channel = without, .t_ns = 6}).quality(), TACTILED_BAD);
}

TEST(Piezo, IsFiniteOrBadForAnyBitsAndRecoversFromThem) {
    const auto decoupler = make_decoupler(piezo_calibration(1.0));
    std::mt19937_64 random(20260303);
    const double inf = std::numeric_limits<double>::infinity();
    const double kinds[] = {0.5, 1.4, kNaN, inf, -inf, 1e308, -1e308, 1e17, 5e-324, -0.0};
    double t = 0;
    for (int round = 0; round < 40; ++round) {
        for (int i = 0; i < 500; ++i) {
            const auto bits = random();
            double any;
            static_assert(sizeof any == sizeof bits);
            std::memcpy(&any, &bits, sizeof any);
            const std::vector<double> channel{i % 3 == 0 ? any : kinds[random() % 10],
                                              i % 5 == 0 ? any : kinds[random() % 10]};
            const Estimate estimate =
                decoupler->decouple({.channel = channel,
                                     .missing = std::uint32_t(random() & random() & random()),
                                     .saturated = std::uint32_t(random() & random()),
                                     .t_ns = i % 7 == 0 ? random() : 1'000'000'000 + random() % 1'000'000'000});
            ASSERT_EQ(std::isfinite(estimate.wrench_S[2]), estimate.quality() != TACTILED_BAD);
            if (estimate.quality() == TACTILED_GOOD) { ASSERT_LT(std::abs(estimate.wrench_S[2]), 11); }
        }
        // Valid readings again: within 20 time constants the state is as if nothing had happened.
        t += 100;
        double press = 0;
        for (int i = 0; i < 25000; ++i) press = press_of(*decoupler, t + i * 1e-3, 0.0768, centre_pF(4));
        ASSERT_NEAR(press, 4, 1e-5);
    }
}

// No gap and no BAD sample in between: a running sum would never lose the error (hard case H21).
TEST(Piezo, ASpikeOfOneSampleIsForgotten) {
    for (const double spike : {1e17, -1e200}) {
        const auto decoupler = make_decoupler(piezo_calibration(1.0));
        double press = 0;
        for (int i = 0; i < 30000; ++i)
            press = press_of(*decoupler, i * 1e-3, i == 1000 ? spike : 0.0768, i == 2000 ? spike : centre_pF(4));
        EXPECT_NEAR(press, 4, 1e-5);
    }
}

TEST(Piezo, RefusesCalibrationsThatItCannotUse) {
    Calibration calibration = piezo_calibration();
    calibration.channels = {"Vp", "C1"};
    EXPECT_NE(refusal(calibration).find("needed are Vp Cn"), std::string::npos);
    calibration = piezo_calibration();
    calibration.parameters["fusion_tau_s"] = 2;
    EXPECT_NE(refusal(calibration).find("above leak_tau_s"), std::string::npos);
    calibration = piezo_calibration();
    calibration.parameters["leak_tau"] = 2;
    EXPECT_NE(refusal(calibration).find("did you mean leak_tau_s?"), std::string::npos);
    calibration = piezo_calibration();
    calibration.parameters.erase("gain_b");
    EXPECT_NE(refusal(calibration).find("gain_b is missing"), std::string::npos);
    calibration = piezo_calibration();
    calibration.components = {"fx"};
    EXPECT_NE(refusal(calibration).find("fz"), std::string::npos);
}

}  // namespace
}  // namespace tactiled
