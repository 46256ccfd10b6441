// The low pass and its sd, for cutoffs and sampling rates over four decades.
#include "node/low_pass.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace tactiled {
namespace {

constexpr double kCutoffs_Hz[] = {0.01, 0.1, 1, 10, 100};
constexpr double kSamplesPerCutoff[] = {10, 100, 1000};

TEST(LowPass, ItsLagIsTheSameAtEverySamplingRate) {
    for (const double cutoff_Hz : kCutoffs_Hz)
        for (const double ratio : kSamplesPerCutoff) {
            LowPass filter;
            filter.set_cutoff(cutoff_Hz);
            double lag_s = 0;
            for (int i = 0; i <= 4 * ratio; ++i) {
                const double t_s = i / (cutoff_Hz * ratio);
                std::array<double, 6> value{t_s}, sd{};
                filter.apply(value, sd, std::uint64_t(t_s * 1e9) + 1);
                lag_s = t_s - value[0];
            }
            EXPECT_NEAR(lag_s * cutoff_Hz, 0.20486, 0.0005) << cutoff_Hz << " Hz, " << ratio;
        }
}

TEST(LowPass, TheStandardDeviationContainsItsLag) {
    constexpr double kSd = 0.01;
    const std::function<double(double)> forces[] = {
        [](double periods) { return periods < 3 ? 0.0 : -0.8; },
        [](double periods) { return periods < 3 ? 0.0 : -0.025; },
        [](double periods) { return periods < 3 ? 0.0 : 0.3 * (periods - 3); },
        [](double periods) { return periods < 3 ? 0.0 : 0.27 * (periods - 3); },  // late by 5.5 sd
        [](double periods) { return 2 * std::sin(2 * std::numbers::pi * periods); },
        [](double periods) { return 2 * std::sin(0.3 * periods * periods); },
    };
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    for (const double cutoff_Hz : kCutoffs_Hz)
        for (const double ratio : kSamplesPerCutoff)
            for (std::size_t k = 0; k < std::size(forces); ++k) {
                LowPass filter;
                filter.set_cutoff(cutoff_Hz);
                double worst = 0;
                for (int i = 0; i < 10 * ratio; ++i) {
                    const double periods = i / ratio, force = forces[k](periods);
                    std::array<double, 6> value{force + kSd * normal(random)}, sd{kSd};
                    filter.apply(value, sd, std::uint64_t(periods / cutoff_Hz * 1e9) + 1);
                    worst = std::max(worst, std::abs(value[0] - force) / sd[0]);
                }
                EXPECT_LT(worst, 5) << "force " << k << ", " << cutoff_Hz << " Hz, " << ratio;
            }
}

TEST(LowPass, NoiseAtRestIsNoLag) {
    constexpr double kSd = 0.01;
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal(0, kSd);
    LowPass filter;
    filter.set_cutoff(1);
    double sum = 0;
    for (std::uint64_t i = 1; i <= 2000; ++i) {
        std::array<double, 6> value{normal(random)}, sd{kSd};
        filter.apply(value, sd, i * 1'000'000);
        sum += sd[0];
    }
    EXPECT_LT(sum / 2000, 1.1 * kSd);
}

}  // namespace
}  // namespace tactiled
