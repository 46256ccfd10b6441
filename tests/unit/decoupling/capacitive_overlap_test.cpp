// Methods "ratio" and "overlap" of model "capacitive".
#include <gtest/gtest.h>

#include <cmath>

#include "capacitive_pads.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

TEST(Capacitive, OverlapSolvesGapAndShiftTogether) {
    const Calibration calibration = overlap_calibration();
    const auto decoupler = make_decoupler(calibration);
    for (const double u : {0.9, 1.0, 1.2, 1.6})
        for (const double shift_mm : {0.0, 0.01, 0.5, 1.2})
            for (double azimuth = 0; azimuth < 2 * kHalfTurn_rad; azimuth += 0.3) {
                const double dx = shift_mm * std::cos(azimuth), dy = shift_mm * std::sin(azimuth);
                const Estimate estimate = decouple(*decoupler, pad_reading(calibration, u, dx, dy));
                const Pad force = pad_force(u, dx, dy);
                SCOPED_TRACE(testing::Message() << u << " " << shift_mm << " " << azimuth);
                ASSERT_NEAR(estimate.wrench_S[0], force.fx, 3e-5);
                ASSERT_NEAR(estimate.wrench_S[1], force.fy, 3e-5);
                ASSERT_NEAR(estimate.wrench_S[2], force.fz, 1e-4);
                ASSERT_EQ(estimate.quality(), TACTILED_GOOD);
            }
}

// The disc's edge crosses the sectors' inner and outer radius, and uncovers the centre.
TEST(Capacitive, OverlapFollowsShiftsThatUncoverElectrodes) {
    const Calibration calibration = overlap_calibration();
    const auto decoupler = make_decoupler(calibration);
    for (const double shift_mm : {1.8, 2.4, 3.0})
        for (double azimuth = 0; azimuth < 2 * kHalfTurn_rad; azimuth += 0.1) {
            const double dx = shift_mm * std::cos(azimuth), dy = shift_mm * std::sin(azimuth);
            const Estimate estimate = decouple(*decoupler, pad_reading(calibration, 1.2, dx, dy));
            const Pad force = pad_force(1.2, dx, dy);
            ASSERT_NEAR(estimate.wrench_S[0], force.fx, 0.005) << shift_mm << " " << azimuth;
            ASSERT_NEAR(estimate.wrench_S[1], force.fy, 0.005) << shift_mm << " " << azimuth;
            ASSERT_NEAR(estimate.wrench_S[2], force.fz, 0.03) << shift_mm << " " << azimuth;
            ASSERT_EQ(estimate.reasons, 0u) << shift_mm << " " << azimuth;
        }
}

TEST(Capacitive, OverlapGoesOnWithoutAnyOneElectrode) {
    const Calibration calibration = overlap_calibration();
    const auto decoupler = make_decoupler(calibration);
    const auto reading = pad_reading(calibration, 1.25, 0.6, -0.4);
    const Pad force = pad_force(1.25, 0.6, -0.4);
    for (std::size_t missing = 0; missing < 5; ++missing) {
        const Estimate estimate = decouple(*decoupler, reading, 1u << missing);
        SCOPED_TRACE(missing);
        EXPECT_NEAR(estimate.wrench_S[0], force.fx, 1e-4);
        EXPECT_NEAR(estimate.wrench_S[1], force.fy, 1e-4);
        EXPECT_NEAR(estimate.wrench_S[2], force.fz, 1e-3);
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_MISSING_CHANNEL});
        EXPECT_GT(estimate.sd[0] + estimate.sd[1] + estimate.sd[2], 0.07 * 1.02);
    }
    EXPECT_EQ(decouple(*decoupler, reading, 0b00111).quality(), TACTILED_BAD);  // two left
    EXPECT_EQ(decouple(*decoupler, reading, 0b10010).quality(), TACTILED_UNCERTAIN);
}

TEST(Capacitive, OverlapFindsAnElectrodeThatIsWrong) {
    const Calibration calibration = overlap_calibration();
    auto reading = pad_reading(calibration, 1.25, 0.6, -0.4);
    EXPECT_LT(decouple(*make_decoupler(calibration), reading).residual, 1);
    reading[2] -= 0.01;  // pF
    const Estimate estimate = decouple(*make_decoupler(calibration), reading);
    EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY});
    EXPECT_GT(estimate.residual, 6);
}

TEST(Capacitive, RatioDoesNotDependOnTheGap) {
    Calibration calibration = overlap_calibration();
    calibration.method = "ratio";
    // sensitivity of C1 to a shift: 2 R sin(40 deg) / A
    const double per_mm =
        2 * 4 * std::sin(40 * kHalfTurn_rad / 180) / sector_area_mm2(4, 2.5, 6, 0, 80 * kHalfTurn_rad / 180, 0, 0);
    for (const char* name : {"shear_stiffness_N_per_m", "noise", "disc_radius_m", "inner_radius_m", "outer_radius_m",
                             "opening_rad", "centre_radius_m", "gap_m"})
        calibration.parameters.erase(name);
    calibration.parameters["shear_scale_N"] = 1.195 / per_mm;
    const auto decoupler = make_decoupler(calibration);
    for (const double u : {0.9, 1.0, 1.3, 1.6}) {
        const Estimate estimate = decouple(*decoupler, pad_reading(calibration, u, 0.2, 0.1));
        const Pad force = pad_force(u, 0.2, 0.1);
        EXPECT_NEAR(estimate.wrench_S[0], force.fx, 0.002 * 0.25) << u;  // N; the third order of the shift
        EXPECT_NEAR(estimate.wrench_S[1], force.fy, 0.002 * 0.25) << u;
        // N: the influence of a shift on the press is not modelled
        EXPECT_NEAR(estimate.wrench_S[2], force.fz, 0.006) << u;
    }
}

TEST(Capacitive, RatioKnowsElectrodesOfUnequalSize) {
    Calibration calibration = capacitive_calibration("ratio");
    calibration.zero = {0.36, 0.35, 0.36, 0.36, 0.5};  // pF, C1 and C2 have different sizes
    calibration.parameters = {{"stray_C1", 0.3}, {"stray_C2", 0.3},          {"stray_C3", 0.3},     {"stray_C4", 0.3},
                              {"stray_Cn", 0.4}, {"normal_stiffness_N", 30}, {"shear_scale_N", 1.5}};
    const auto decoupler = make_decoupler(calibration);
    const double u = 1.25, shift = 0.2;  // in lengths over which an electrode doubles
    const std::vector<double> reading{0.3 + 0.06 * u * (1 + shift), 0.3 + 0.05 * u * (1 - shift), 0.3 + 0.06 * u,
                                      0.3 + 0.06 * u, 0.4 + 0.1 * u};
    const Estimate estimate = decouple(*decoupler, reading);
    EXPECT_NEAR(estimate.wrench_S[0], 1.5 * shift, 1e-14);
    EXPECT_NEAR(estimate.wrench_S[1], 0, 1e-14);
    EXPECT_NEAR(estimate.wrench_S[2], -10 * (u * u - 1 / u), 1e-13);
}

}  // namespace
}  // namespace tactiled
