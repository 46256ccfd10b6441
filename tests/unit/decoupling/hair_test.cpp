#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "decoupling/fit/hair_fit.hpp"
#include "hair_session.hpp"

namespace tactiled {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

Calibration paper(const std::string& method) {
    if (method != "physics") return paper_hair(method);
    Calibration calibration = hair_calibration(method);
    calibration.parameters = hair_parameters("PDMS");
    calibration.parameters["correction_normal"] = kHairNormal / normal_sensitivity_per_Pa({});
    calibration.parameters["correction_shear"] = kHairShear / shear_sensitivity_per_Pa({});
    calibration.tables["noise"] = {{kHairNoise, kHairNoise, kHairNoise, kHairNoise}};
    return calibration;
}

class HairBy : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Methods, HairBy, testing::ValuesIn(kHairMethods), [](const auto& method) { return method.param; });

TEST_P(HairBy, ReadsEveryDirection) {
    const auto decoupler = make_decoupler(paper(GetParam()));
    for (int degree = 0; degree < 360; ++degree)
        for (const double sigma : {0.0, 693.0, 1925.0}) {
            const double alpha = degree * std::numbers::pi / 180;
            const Stress stress{sigma, 1733 * std::cos(alpha), 1733 * std::sin(alpha)};
            const Estimate estimate = decouple(*decoupler, HairSensor::ideal().reading(stress));
            expect_force(estimate, stress, 1e-9);
            EXPECT_EQ(estimate.quality(), TACTILED_GOOD);
            EXPECT_LT(estimate.residual, 1e-6);
            EXPECT_TRUE(std::isnan(estimate.wrench_S[3]));
        }
}

// Shear at 0 degrees lowers H1 and raises H3; a press raises all: fz < 0.
TEST_P(HairBy, HasTheSignsOfTheText) {
    const auto decoupler = make_decoupler(paper(GetParam()));
    const Estimate estimate = decouple(*decoupler, {-7.91e-4, 0, 7.91e-4, 0});
    EXPECT_NEAR(estimate.wrench_S[0], 1000 * kCap_m2, 1e-9);
    EXPECT_NEAR(decouple(*decoupler, {0, -7.91e-4, 0, 7.91e-4}).wrench_S[1], 1000 * kCap_m2, 1e-9);
    EXPECT_NEAR(decouple(*decoupler, {3.74e-4, 3.74e-4, 3.74e-4, 3.74e-4}).wrench_S[2], -1000 * kCap_m2, 1e-9);
    EXPECT_FALSE(std::signbit(decouple(*decoupler, {0, 0, 0, 0}).wrench_S[2]));
}

// Hard case H01, through the model.
TEST_P(HairBy, SeesHalfAPascalOfShearUnderTwoKilopascal) {
    const auto decoupler = make_decoupler(paper(GetParam()));
    expect_force(decouple(*decoupler, HairSensor::ideal().reading({2000, 0.5, 0})), {2000, 0.5, 0}, 1e-8);
}

TEST_P(HairBy, SurvivesEachDeadHairWithALargerStandardDeviation) {
    const auto decoupler = make_decoupler(paper(GetParam()));
    const Stress stress{1200, 700, -900};
    for (std::size_t dead = 0; dead < 4; ++dead)
        for (const bool at_rail : {false, true}) {
            auto reading = HairSensor::ideal().reading(stress);
            reading[dead] = at_rail ? 0.01 : kNaN;
            const Estimate estimate = decouple(*decoupler, reading, 0, at_rail ? 1u << dead : 0);
            SCOPED_TRACE(dead);
            expect_force(estimate, stress, 1e-9);
            EXPECT_EQ(estimate.quality(), TACTILED_UNCERTAIN);
            EXPECT_EQ(estimate.reasons, std::uint32_t{at_rail ? TACTILED_SATURATED : TACTILED_MISSING_CHANNEL});
            EXPECT_TRUE(std::isnan(estimate.residual));
            // Normal stress from a pair instead of two; the shear of the whole pair is unchanged; that of the single
            // hair is b tau = -+(r - a sigma): noise of 1 + 1/2 instead of 1/2.
            EXPECT_NEAR(estimate.sd[2], 1e-4 * std::numbers::sqrt2, 1e-9);
            EXPECT_NEAR(estimate.sd[dead % 2 == 0 ? 1 : 0], 1e-4, 1e-9);
            EXPECT_NEAR(estimate.sd[dead % 2 == 0 ? 0 : 1], 1e-4 * std::sqrt(3), 1e-9);
        }
}

TEST_P(HairBy, TwoDeadHairsAreBad) {
    const auto decoupler = make_decoupler(paper(GetParam()));
    const auto reading = HairSensor::ideal().reading({1200, 700, -900});
    for (const std::uint32_t dead : {0b0011u, 0b0101u, 0b1010u, 0b1100u, 0b1111u}) {
        const Estimate estimate = decouple(*decoupler, reading, dead);
        EXPECT_EQ(estimate.quality(), TACTILED_BAD);
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_MISSING_CHANNEL});
        EXPECT_TRUE(std::isnan(estimate.wrench_S[2]));
    }
}

// Two sums of pairs must agree. A hair that is stuck at 0 is not found by its number, but the sample reports a
// disagreement.
TEST_P(HairBy, SaysDisagreementWhereAHairIsStuck) {
    const auto decoupler = make_decoupler(paper(GetParam()));
    auto reading = HairSensor::ideal().reading({1200, 700, -900});
    reading[2] = 0;
    const Estimate estimate = decouple(*decoupler, reading);
    EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_DISAGREEMENT | TACTILED_UNKNOWN_UNCERTAINTY});
    EXPECT_TRUE(std::isnan(estimate.sd[0]));
}

TEST_P(HairBy, NoiseAloneIsNoDisagreement) {
    const auto decoupler = make_decoupler(paper(GetParam()));
    std::mt19937_64 random(7);
    std::normal_distribution<double> noise(0, kHairNoise);
    double squares = 0;
    for (int i = 0; i < 100000; ++i) {
        const Estimate estimate = decouple(*decoupler, {noise(random), noise(random), noise(random), noise(random)});
        ASSERT_EQ(estimate.quality(), TACTILED_GOOD);
        squares += estimate.residual * estimate.residual;
    }
    EXPECT_NEAR(std::sqrt(squares / 100000), 1.0, 0.01);  // the residual is in standard deviations
}

TEST_P(HairBy, IsFiniteOrBadForEveryPatternOfBrokenNumbers) {
    for (const bool leaks : {false, true}) {
        Calibration calibration = paper(GetParam());
        if (leaks && GetParam() == "matrix") calibration.tables["leak"].assign(4, std::vector<double>(16, 1e-5));
        if (leaks && GetParam() == "sum_diff") calibration.tables["intercept"].assign(4, std::vector<double>(7, 1e-5));
        const auto decoupler = make_decoupler(calibration);
        const std::array<double, 8> kinds{0.01, kNaN, kInf, -kInf, 1e308, -1e308, 1e200, 5e-324};
        std::mt19937 random(20260301);
        for (int i = 0; i < 20000; ++i) {
            std::vector<double> reading(4);
            for (auto& r : reading) r = kinds[random() % kinds.size()];
            const Estimate estimate =
                decouple(*decoupler, reading, std::uint32_t(random() & random()), std::uint32_t(random() & random()));
            for (std::size_t c = 0; c < 3; ++c)
                ASSERT_EQ(std::isfinite(estimate.wrench_S[c]), estimate.quality() != TACTILED_BAD);
            if (estimate.quality() != TACTILED_GOOD) { ASSERT_NE(estimate.reasons, 0u); }
        }
        expect_force(decouple(*decoupler, {0, 0, 0, 0}), {0, 0, 0}, leaks ? 1 : 1e-9);  // no state remains
    }
}

TEST_P(HairBy, TheOrderOfTheChannelsIsFree) {
    const auto session = hair_session(HairSensor::asymmetric(3, 1), 200, 4);
    auto turned = session;
    for (auto& row : turned) row.channel = {row.channel[2], row.channel[0], row.channel[3], row.channel[1]};
    const auto one = make_decoupler(fitted_hair(GetParam(), rows_of(session)));
    const auto other =
        make_decoupler(fitted_hair(GetParam(), rows_of(turned), hair_calibration(GetParam(), {"H3", "H1", "H4", "H2"})));
    for (std::size_t i = 0; i < 20; ++i)
        for (std::size_t c = 0; c < 3; ++c)
            EXPECT_NEAR(decouple(*one, session[i].channel).wrench_S[c], decouple(*other, turned[i].channel).wrench_S[c],
                        1e-12);
}

// The result of the fit passes through a calibration file to the last bit.
TEST_P(HairBy, ReadsItsCalibrationFile) {
    const auto session = hair_session(HairSensor::asymmetric(8, 1), 300, 16);
    Calibration calibration = fitted_hair(GetParam(), rows_of(session));
    calibration.contact_model = "uniform";
    calibration.serial = "S1";
    calibration.date = "2026-03-01";
    calibration.channel_unit = "dR/R0";
    Problems problems;
    const Calibration read = parse_calibration(calibration_text(calibration), "hair.toml", problems);
    problems.throw_if_any();
    const auto one = make_decoupler(calibration), other = make_decoupler(read);
    for (std::size_t i = 0; i < 20; ++i)
        for (std::size_t c = 0; c < 3; ++c)
            EXPECT_EQ(decouple(*one, session[i].channel).wrench_S[c], decouple(*other, session[i].channel).wrench_S[c]);
}

// H1 and H3 alone: one axis of shear, as Cao et al. measured.
TEST_P(HairBy, OnePairSeesItsAxis) {
    for (const bool x : {true, false}) {
        const std::vector<std::string> channels =
            x ? std::vector<std::string>{"H3", "H1"} : std::vector<std::string>{"H2", "H4"};
        auto rows = hair_session(HairSensor::ideal(), 300, 5, 1e-9);
        for (auto& row : rows) {
            const auto r = HairSensor::ideal().reading(
                {-row.wrench_S[2] / kCap_m2, x ? row.wrench_S[0] / kCap_m2 : 0, x ? 0 : row.wrench_S[1] / kCap_m2});
            row.channel = x ? std::vector<double>{r[2], r[0]} : std::vector<double>{r[1], r[3]};
            row.wrench_S[x ? 1 : 0] = kNaN;
        }
        const auto decoupler =
            make_decoupler(fitted_hair(GetParam(), rows_of(rows), hair_calibration(GetParam(), channels)));
        const double b = kHairShear * 500, a = kHairNormal * 1500;
        const Estimate estimate =
            decouple(*decoupler, x ? std::vector<double>{a + b, a - b} : std::vector<double>{a - b, a + b});
        EXPECT_NEAR(estimate.wrench_S[x ? 0 : 1], 500 * kCap_m2, 0.1 * kCap_m2);
        EXPECT_NEAR(estimate.wrench_S[2], -1500 * kCap_m2, 0.1 * kCap_m2);
        EXPECT_TRUE(std::isnan(estimate.wrench_S[x ? 1 : 0]));
        EXPECT_EQ(decouple(*decoupler, {a + b, a - b}, 1).quality(), TACTILED_BAD);  // one hair, two unknowns
    }
}

// Four hairs, but only fx and fz are calibrated: the other pair serves SUM, and all of it may be dead.
TEST(Hair, TwoComponentsFromFourHairs) {
    for (const char* method : {"sum_diff", "matrix"}) {
        Calibration c = paper_hair(method);
        c.components = {"fx", "fz"};
        c.sd = {1e-4, 1e-4};
        const auto decoupler = make_decoupler(c);
        const auto reading = HairSensor::ideal().reading({1200, 700, 0});
        for (const std::uint32_t dead : {0b0000u, 0b0010u, 0b1000u, 0b1010u}) {
            const Estimate estimate = decouple(*decoupler, reading, dead);
            EXPECT_NEAR(estimate.wrench_S[0], 700 * kCap_m2, 1e-14);
            EXPECT_NEAR(estimate.wrench_S[2], -1200 * kCap_m2, 1e-14);
            EXPECT_TRUE(std::isnan(estimate.wrench_S[1]));
        }
        EXPECT_NEAR(decouple(*decoupler, reading, 0b1010u).sd[2], 1e-4 * std::numbers::sqrt2, 1e-9);
    }
}

TEST(Hair, RefusesCalibrationsThatItCannotUse) {
    const auto says = [](const Calibration& calibration, const char* what) {
        const std::string said = refusal(calibration);
        EXPECT_NE(said.find(what), std::string::npos) << said;
    };
    Calibration c = paper("matrix");
    c.channels[3] = "H5";
    says(c, "\"H5\"");
    c.channels[3] = "H1";
    says(c, "\"H1\" twice");
    c = paper("matrix");
    c.components[0] = "mx";
    says(c, "component \"mx\"");
    c = paper("sum_diff");
    c.parameters["diff_x_per_pa"] = 1;
    says(c, "did you mean diff_x_per_Pa?");
    c = paper("sum_diff");
    c.parameters.erase("diff_y_per_Pa");
    says(c, "diff_y_per_Pa (DIFF of the pair at 1 Pa of shear, r4 - r2) is missing");
    c = paper("matrix");
    c.parameters.erase("area_m2");
    says(c, "parameter area_m2 is missing: of the cap; 2.827e-5 of one of 6 mm diameter");
    c = paper("matrix");
    c.tables["leek"] = {{1}};
    says(c, "table leek is unknown; did you mean leak?");
    c = paper("matrix");
    c.tables["gains"].pop_back();
    says(c, "table gains has 3 rows of 3; needed are 4 of 3");
    c = paper("matrix");
    c.tables["leak"].assign(4, std::vector<double>(16, 1e-3));
    says(c, "leak terms are too large");
    c = paper("matrix");
    for (auto& row : c.tables["gains"]) row[1] = 0;
    says(c, "do not determine the stresses");
    c = paper("sum_diff");
    c.tables["gains"][2][0] = -kHairNormal;
    says(c, "SUM has no meaning");
    c = paper("matrix");
    c.tables["noise"][0][1] = 0;
    says(c, "table noise");
    c = paper("physics");
    c.parameters["thickness_m"] = 0;
    says(c, "parameter thickness_m = 0 is not above 0: of the hair");
    c = paper_hair("sum_diff", {"H1", "H2", "H3"});
    says(c, "H2 H4 for fy");
}

}  // namespace
}  // namespace tactiled
