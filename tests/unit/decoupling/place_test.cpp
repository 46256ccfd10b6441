#include "decoupling/place.hpp"

#include <gtest/gtest.h>

#include <random>

namespace tactiled {
namespace {

constexpr std::array<double, 2> kIndependent{};

// A press of 2 N at (3, -1) mm.
Wrench press() { return {0.3, 0.1, -2, -1e-3 * -2, -3e-3 * -2, 0.01}; }
Wrench sds(double force_N, double moment_Nm) { return {force_N, force_N, force_N, moment_Nm, moment_Nm, moment_Nm}; }

TEST(Place, IsWhereTheForceHasTheMoments) {
    const PressPlace place = place_of(press(), sds(0.02, 1e-5), kIndependent);
    EXPECT_NEAR(place.cop_S_m[0], 3e-3, 1e-18);
    EXPECT_NEAR(place.cop_S_m[1], -1e-3, 1e-18);
    EXPECT_NEAR(place.sd_m[0], std::hypot(1e-5, 3e-3 * 0.02) / 2, 1e-15);
    EXPECT_NEAR(place.sd_m[1], std::hypot(1e-5, 1e-3 * 0.02) / 2, 1e-15);
}

TEST(Place, NeedsAPressAboveFiveSd) {
    Wrench wrench = press();
    EXPECT_TRUE(std::isnan(place_of(wrench, sds(0.4001, 1e-5), kIndependent).cop_S_m[0]));
    EXPECT_FALSE(std::isnan(place_of(wrench, sds(0.3999, 1e-5), kIndependent).cop_S_m[0]));
    EXPECT_TRUE(std::isnan(place_of(wrench, sds(kNaN, 1e-5), kIndependent).cop_S_m[0]));
    for (double& w : wrench) w = -w;  // a pull
    EXPECT_TRUE(std::isnan(place_of(wrench, sds(0.02, 1e-5), kIndependent).cop_S_m[0]));
    wrench[2] = kNaN;
    EXPECT_TRUE(std::isnan(place_of(wrench, sds(0.02, 1e-5), kIndependent).cop_S_m[0]));
}

TEST(Place, HasOnlyTheCoordinatesOfTheMomentsThatAreMeasured) {
    Wrench wrench = press(), sd = sds(0.02, 1e-5);
    wrench[3] = sd[3] = kNaN;
    const PressPlace place = place_of(wrench, sd, kIndependent);
    EXPECT_NEAR(place.cop_S_m[0], 3e-3, 1e-18);
    EXPECT_FALSE(std::isnan(place.sd_m[0]));
    EXPECT_TRUE(std::isnan(place.cop_S_m[1]) && std::isnan(place.sd_m[1]));
}

TEST(Place, IsFinite) {
    const PressPlace place = place_of({0, 0, -1e-320, 0, 1, 0}, Wrench{}, kIndependent);
    EXPECT_TRUE(std::isnan(place.cop_S_m[0]));
}

// Correlated errors: the sd is that of the errors, at each place and from the limit on.
TEST(Place, StatesTheSdOfItsErrors) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> one(0, 1);
    const double sd_N = 0.1, sd_Nm = 4e-4;
    const std::array<double, 2> correlation{0.6, -0.8};
    Correlations correlations;
    for (std::size_t i = 0; i < 2; ++i) correlations.between[Correlations::index(2, 3 + i)] = float(correlation[i]);
    for (const double press_N : {0.7, 1., 5.})
        for (const double at_m : {-9e-3, 0., 4e-3}) {
            std::array<int, 2> within{}, beyond{};
            int n = 0;
            for (int k = 0; k < 20000; ++k) {
                const double of_force = one(random);
                Wrench wrench{0, 0, -press_N + sd_N * of_force, -at_m * press_N, at_m * press_N, 0};
                for (std::size_t i = 0; i < 2; ++i)
                    wrench[3 + i] +=
                        sd_Nm * (correlation[i] * of_force + std::sqrt(1 - correlation[i] * correlation[i]) * one(random));
                const PressPlace place = place_of(wrench, sds(sd_N, sd_Nm), covariance_of(correlations, sds(sd_N, sd_Nm)));
                if (std::isnan(place.cop_S_m[0])) continue;
                ++n;
                for (std::size_t i = 0; i < 2; ++i) {
                    const double error = std::abs(place.cop_S_m[i] - at_m);
                    within[i] += error <= place.sd_m[i] ? 1 : 0;
                    beyond[i] += error > 5 * place.sd_m[i] ? 1 : 0;
                }
            }
            for (std::size_t i = 0; i < 2; ++i) {
                EXPECT_NEAR(100. * within[i] / n, 68, 8) << press_N << " N at " << at_m;  // 60 .. 76 %
                EXPECT_LE(beyond[i], 0.005 * n) << press_N << " N at " << at_m;
            }
        }
}

// The place of a model is published under the same limit, with what zero and delay add to its sd.
TEST(Place, OfAModelHasTheSdOfTheZeroAsWell) {
    const PressPlace own{{3e-3, -1e-3}, {1e-4, 1e-4}};
    const Wrench of_model = sds(0.02, 1e-5);
    EXPECT_EQ(published(own, press(), of_model, of_model).sd_m, own.sd_m);
    const PressPlace drifted = published(own, press(), sds(0.2, 1e-3), of_model);
    EXPECT_EQ(drifted.cop_S_m, own.cop_S_m);
    EXPECT_NEAR(drifted.sd_m[0], std::hypot(1e-4, std::hypot(std::sqrt(1e-6 - 1e-10), 3e-3 * std::sqrt(0.04 - 0.0004)) / 2),
                1e-9);
    EXPECT_TRUE(std::isnan(published(own, press(), sds(0.41, 1e-3), of_model).cop_S_m[0]));
    EXPECT_TRUE(std::isnan(published(own, press(), sds(kNaN, kNaN), of_model).cop_S_m[0]));
}

}  // namespace
}  // namespace tactiled
