// Calibrations of model "hair", and their errors on held-out loads.
#include <gtest/gtest.h>

#include "hair_session.hpp"

namespace tactiled {
namespace {

// Cao et al. print 3.0 % (shear) and 2.9 % (normal). Ten sensors, each calibrated on one session of 600 combined
// loads in any direction and measured on another of 4000; both with their noise.
struct Case {
    const char* name;
    double azimuth_deg, bend;  // HairSensor
};
class HairAccuracy : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Sensors, HairAccuracy,
                         testing::Values(Case{"straight", 0, 0}, Case{"turned_by_one_degree", 1, 0},
                                         Case{"bent_beyond_the_terms", 1, 0.02}),
                         [](const auto& sensor) { return std::string(sensor.param.name); });

TEST_P(HairAccuracy, BeatsThePublishedErrorsUnderCombinedLoad) {
    for (const auto& method : kHairMethods) {
        std::array<double, 3> mean{}, highest{}, worst{};
        int good = 0, rows = 0, within = 0;
        for (unsigned seed = 1; seed <= 10; ++seed) {
            HairSensor sensor = HairSensor::asymmetric(seed, GetParam().azimuth_deg);
            sensor.bend = GetParam().bend;
            const auto decoupler = make_decoupler(fitted_hair(method, rows_of(hair_session(sensor, 600, 100 + seed))));
            const HairErrors errors = errors_on(*decoupler, hair_session(sensor, 4000, 200 + seed));
            good += errors.good;
            rows += errors.rows;
            for (std::size_t c = 0; c < 3; ++c) {
                mean[c] += errors.rms[c] / 10;
                highest[c] = std::max(highest[c], errors.rms[c]);
                worst[c] = std::max(worst[c], errors.worst[c]);
                // The matrix is within 1 % in every case, with little more than noise (0.23 % and 0.34 %). A press
                // appears in DIFF if the hairs of a pair respond to it differently, and the other shear if they are
                // rotated: the two steps are within 1 % if the pair is equal to 5 % and linear.
                const bool alike = std::abs(sensor.normal[c] / sensor.normal[(c + 2) % 4] - 1) < 0.05;
                const double limit = method == "matrix"                                 ? 0.45
                                     : method == "physics"                              ? 2.5
                                     : c == 2 || (alike && GetParam().azimuth_deg == 0) ? 1.0
                                                                                        : 2.0;
                EXPECT_LE(errors.rms[c], limit) << method << " sensor " << seed << " component " << c;
                within += method == "sum_diff" && errors.rms[c] <= 1.0 ? 1 : 0;
            }
        }
        std::printf(
            "%s, %s: rms of fx fy fz, %% of 2 kPa: mean of ten sensors %.2f %.2f %.2f, worst sensor %.2f %.2f %.2f, "
            "largest error %.2f %.2f %.2f, GOOD %.2f %%\n",
            GetParam().name, method.c_str(), mean[0], mean[1], mean[2], highest[0], highest[1], highest[2], worst[0],
            worst[1], worst[2], 100.0 * good / rows);
        if (method == "sum_diff") {
            std::printf("  %d of 30 components within 1 %%\n", within);
            EXPECT_GE(within, 20);
        }
        if (method == "matrix") {
            EXPECT_EQ(good, rows);  // modelled effects are not disagreement
        }
    }
}

// Without g(tau) the two steps are not sufficient: the second step determines the intercept.
TEST(Hair, TheInterceptIsNeeded) {
    const HairSensor sensor = HairSensor::asymmetric(1, 0);
    Calibration calibration = fitted_hair("sum_diff", rows_of(hair_session(sensor, 600, 101)));
    const auto test = hair_session(sensor, 4000, 201);
    const double with = errors_on(*make_decoupler(calibration), test).rms[2];
    calibration.tables.erase("intercept");
    const double without = errors_on(*make_decoupler(calibration), test).rms[2];
    std::printf("normal error with g(tau) %.2f %%, without its bend %.2f %%\n", with, without);
    EXPECT_GT(without, 2 * with);
}

// One hair dead: the remaining accuracy, on the asymmetric sensors.
TEST(Hair, ADeadHairCostsLittleAccuracy) {
    for (const char* method : {"sum_diff", "matrix"})
        for (std::uint32_t dead = 0; dead < 4; ++dead) {
            const HairSensor sensor = HairSensor::asymmetric(2, 1);
            const auto decoupler = make_decoupler(fitted_hair(method, rows_of(hair_session(sensor, 600, 102))));
            const HairErrors errors = errors_on(*decoupler, hair_session(sensor, 4000, 202), 1u << dead);
            std::printf("%s without H%u: rms of fx fy fz %.2f %.2f %.2f %%\n", method, dead + 1, errors.rms[0],
                        errors.rms[1], errors.rms[2]);
            for (std::size_t c = 0; c < 3; ++c) EXPECT_LE(errors.rms[c], 1.5) << method << dead << c;
        }
}

TEST(Hair, WithoutNoiseOnlyTheMatrixIsExact) {
    const HairSensor sensor = HairSensor::asymmetric(4, 1);
    const auto decoupler = make_decoupler(fitted_hair("matrix", rows_of(hair_session(sensor, 600, 8, 0))));
    const HairErrors errors = errors_on(*decoupler, hair_session(sensor, 1000, 9, 0));
    for (std::size_t c = 0; c < 3; ++c) EXPECT_LT(errors.worst[c], 1e-6);  // its terms contain this leak completely
}

TEST(HairFit, RecoversTheSensor) {
    const HairSensor sensor = HairSensor::asymmetric(5, 0);
    for (const auto& method : kHairMethods) {
        const Calibration c = fitted_hair(method, rows_of(hair_session(sensor, 2000, 10)));
        for (std::size_t i = 0; i < 4; ++i) {
            EXPECT_NEAR(c.zero[i], sensor.zero[i], method == "physics" ? 1e-4 : 3e-6) << method;
            if (method == "physics") continue;
            EXPECT_NEAR(c.tables.at("gains")[i][0], sensor.normal[i], 0.01 * kHairNormal);
            EXPECT_NEAR(c.tables.at("gains")[i][1 + i % 2], (i < 2 ? -1 : 1) * sensor.shear[i], 0.01 * kHairShear);
            EXPECT_NEAR(c.tables.at("noise")[0][i], kHairNoise, 0.1 * kHairNoise);
        }
        EXPECT_GT(c.condition, 1);
        EXPECT_LT(c.condition, 150);
    }
}

// Errors of real recordings: labels of two rows are swapped.
TEST(HairFit, RowsWithWrongLabelsHaveNoWeight) {
    const HairSensor sensor = HairSensor::asymmetric(6, 1);
    for (const char* method : {"sum_diff", "matrix"}) {
        auto session = hair_session(sensor, 400, 11);
        for (std::size_t i = 10; i < 20; ++i) std::swap(session[i].wrench_S, session[i + 200].wrench_S);
        const auto clean = make_decoupler(fitted_hair(method, rows_of(hair_session(sensor, 400, 11))));
        const auto swapped = make_decoupler(fitted_hair(method, rows_of(session)));
        const auto test = hair_session(sensor, 2000, 12);
        for (std::size_t c = 0; c < 3; ++c)
            EXPECT_LT(errors_on(*swapped, test).rms[c], errors_on(*clean, test).rms[c] + 0.05) << method;
    }
}

TEST(HairFit, FewLevelsDropTheTermsThatTheyDoNotDetermine) {
    // Cao et al.: three levels of press, five of shear, along x, then along y.
    std::vector<LabelledRow> session;
    const HairSensor sensor = HairSensor::asymmetric(7, 0);
    for (const double sigma : {0.0, 693.0, 1925.0})
        for (const double tau : {-1300.0, 0.0, 693.0, 1039.0, 1733.0})
            for (const bool x : {true, false})
                for (int repeat = 0; repeat < 3; ++repeat) {
                    const Stress stress{sigma, x ? tau : 0, x ? 0 : tau};
                    session.push_back({.line = 1, .channel = sensor.reading(stress), .wrench_S = force_of(stress)});
                }
    std::vector<std::string> said;
    const Calibration c = fitted_hair("matrix", rows_of(session), {}, &said);
    ASSERT_EQ(said.size(), 1u);
    EXPECT_NE(said[0].find("do not determine all terms"), std::string::npos);
    for (const auto& row : c.tables.at("leak")) {
        EXPECT_EQ(row[3], 0);   // sigma^3 from three levels
        EXPECT_EQ(row[10], 0);  // tau_x tau_y, never together
    }
    const HairErrors errors = errors_on(*make_decoupler(c), session);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(errors.worst[i], 1e-6);
}

TEST(HairFit, RefusesWhatTheRowsDoNotDetermine) {
    const auto refused = [](std::vector<LabelledRow> session, Calibration calibration) {
        try {
            (void)fitted_hair(calibration.method, rows_of(session), calibration);
        } catch (const Undetermined& error) { return std::string(error.what()); }
        return std::string();
    };
    const auto session = hair_session(HairSensor::ideal(), 100, 13);
    auto few = session;
    few.resize(11);
    auto together = session, no_press = session;
    for (auto& row : together) row.wrench_S[0] = row.wrench_S[2];
    for (auto& row : no_press) row.wrench_S[2] = std::abs(row.wrench_S[2]);
    for (const auto& method : kHairMethods) {
        EXPECT_NE(refused(few, hair_calibration(method)).find("at least 12"), std::string::npos) << method;
        EXPECT_NE(refused(together, hair_calibration(method)).find("independently"), std::string::npos) << method;
        EXPECT_NE(refused(no_press, hair_calibration(method)).find("fz < 0"), std::string::npos) << method;
        EXPECT_NE(refused(session, hair_calibration(method, {"H1", "H2", "H3", "R4"})).find("R4"), std::string::npos);
        Calibration c = hair_calibration(method);
        c.components = {"fx", "fy", "fz", "mz"};
        EXPECT_NE(refused(session, c).find("mz"), std::string::npos);
        c.components = {"fz"};
        EXPECT_NE(refused(session, c).find("fx_N"), std::string::npos);
    }
    EXPECT_NE(refused(session, hair_calibration("sum_diff", {"H1", "H2", "H3"})).find("H2 and H4"), std::string::npos);
}

TEST(HairFit, SaysThatThePairIsSwapped) {
    auto session = hair_session(HairSensor::ideal(), 200, 14);
    for (auto& row : session) std::swap(row.channel[0], row.channel[2]);
    std::vector<std::string> said;
    const Calibration c = fitted_hair("sum_diff", rows_of(session), {}, &said);
    EXPECT_LT(c.parameters.at("diff_x_per_Pa"), 0);
    ASSERT_EQ(said.size(), 2u);
    EXPECT_NE(said[0].find("H1 and H3 are swapped"), std::string::npos);
    const HairErrors errors = errors_on(*make_decoupler(c), session);
    EXPECT_LT(errors.rms[0], 0.5);  // and reads right all the same
}

TEST(HairFit, PhysicsCorrectsTheGeometryItWasGiven) {
    const auto session = hair_session(HairSensor::ideal(), 500, 15);
    Calibration start = hair_calibration("physics");
    start.parameters = hair_parameters("Ecoflex");
    const Calibration c = fitted_hair("physics", rows_of(session), start);
    EXPECT_EQ(c.parameters.at("elastomer_kPa"), 250);
    // the model predicts three times the reading of PDMS
    EXPECT_NEAR(c.parameters.at("correction_shear"), 250.0 / 750, 0.005);
    EXPECT_NEAR(c.parameters.at("correction_normal"), 250.0 / 750, 0.005);
    const HairErrors errors = errors_on(*make_decoupler(c), session);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(errors.rms[i], 0.5);
    EXPECT_THROW((void)hair_parameters("PDSM"), SetupError);
}

}  // namespace
}  // namespace tactiled
