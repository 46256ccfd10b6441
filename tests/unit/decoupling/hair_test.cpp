#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <random>
#include <sstream>

#include "decoupling/fit/hair_fit.hpp"
#include "hair_session.hpp"

namespace tactiled {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kFullScale_N = kHairRange_Pa * kCap_m2;
const std::vector<std::string> kMethods{"sum_diff", "matrix", "physics"};

Calibration paper(const std::string& method) {
    if (method != "physics") return paper_hair(method);
    Calibration calibration = hair_calibration(method);
    calibration.parameters = hair_parameters("PDMS");
    calibration.parameters["correction_normal"] = kHairNormal / normal_sensitivity_per_Pa({});
    calibration.parameters["correction_shear"] = kHairShear / shear_sensitivity_per_Pa({});
    calibration.tables["noise"] = {{kHairNoise, kHairNoise, kHairNoise, kHairNoise}};
    return calibration;
}

Calibration fitted(const std::string& method, const Rows& rows, Calibration calibration = {},
                   std::vector<std::string>* said = nullptr) {
    if (calibration.channels.empty()) calibration = hair_calibration(method);
    calibration.method = method;
    std::vector<std::string> warnings;
    (method == "sum_diff" ? fit_hair_sum_diff
     : method == "matrix" ? fit_hair_matrix
                          : fit_hair_physics)(rows, calibration, warnings);
    if (said != nullptr) *said = warnings;
    return calibration;
}

void expect_force(const Estimate& estimate, Stress s, double tolerance_Pa) {
    const Wrench force = force_of(s);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(estimate.wrench_S[c], force[c], tolerance_Pa * kCap_m2) << c;
}

std::string refusal(const Calibration& calibration) {
    Problems problems;
    EXPECT_EQ(make_decoupler(calibration, problems), nullptr);
    return problems.empty() ? "" : problems.lines().front();
}

class HairBy : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Methods, HairBy, testing::ValuesIn(kMethods), [](const auto& method) { return method.param; });

TEST_P(HairBy, ReadsEveryDirection) {
    const auto decoupler = make_decoupler(paper(GetParam()));
    for (int degree = 0; degree < 360; ++degree)
        for (const double sigma : {0.0, 693.0, 1925.0}) {
            const double alpha = degree * std::numbers::pi / 180;
            const Stress stress{sigma, 1733 * std::cos(alpha), 1733 * std::sin(alpha)};
            const Estimate estimate = decouple(*decoupler, HairSensor::ideal().reading(stress));
            expect_force(estimate, stress, 1e-9);
            EXPECT_EQ(estimate.quality, TACTILED_GOOD);
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

TEST_P(HairBy, SurvivesEachDeadHairWithALargerDeviation) {
    const auto decoupler = make_decoupler(paper(GetParam()));
    const Stress stress{1200, 700, -900};
    for (std::size_t dead = 0; dead < 4; ++dead)
        for (const bool at_rail : {false, true}) {
            auto reading = HairSensor::ideal().reading(stress);
            reading[dead] = at_rail ? 0.01 : kNaN;
            const Estimate estimate = decouple(*decoupler, reading, 0, at_rail ? 1u << dead : 0);
            SCOPED_TRACE(dead);
            expect_force(estimate, stress, 1e-9);
            EXPECT_EQ(estimate.quality, TACTILED_UNCERTAIN);
            EXPECT_EQ(estimate.reasons, std::uint32_t{at_rail ? TACTILED_SATURATED : TACTILED_MISSING_CHANNEL});
            EXPECT_TRUE(std::isnan(estimate.residual));
            // Normal from a pair instead of two; the shear of the whole pair as before; that of the lone hair,
            // b tau = -+(r - a sigma): noise of 1 + 1/2 instead of 1/2.
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
        EXPECT_EQ(estimate.quality, TACTILED_BAD);
        EXPECT_EQ(estimate.reasons, std::uint32_t{TACTILED_MISSING_CHANNEL});
        EXPECT_TRUE(std::isnan(estimate.wrench_S[2]));
    }
}

// Two sums of pairs must agree. A hair that is stuck at 0 is not found by its number, but the sample says so.
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
        ASSERT_EQ(estimate.quality, TACTILED_GOOD);
        squares += estimate.residual * estimate.residual;
    }
    EXPECT_NEAR(std::sqrt(squares / 100000), 1.0, 0.01);  // it is in standard deviations
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
                ASSERT_EQ(std::isfinite(estimate.wrench_S[c]), estimate.quality != TACTILED_BAD);
            if (estimate.quality != TACTILED_GOOD) { ASSERT_NE(estimate.reasons, 0u); }
        }
        expect_force(decouple(*decoupler, {0, 0, 0, 0}), {0, 0, 0}, leaks ? 1 : 1e-9);  // nothing is remembered
    }
}

TEST_P(HairBy, TheOrderOfTheChannelsIsFree) {
    const auto session = hair_session(HairSensor::asymmetric(3, 1), 200, 4);
    auto turned = session;
    for (auto& row : turned) row.channel = {row.channel[2], row.channel[0], row.channel[3], row.channel[1]};
    const auto one = make_decoupler(fitted(GetParam(), rows_of(session)));
    const auto other =
        make_decoupler(fitted(GetParam(), rows_of(turned), hair_calibration(GetParam(), {"H3", "H1", "H4", "H2"})));
    for (std::size_t i = 0; i < 20; ++i)
        for (std::size_t c = 0; c < 3; ++c)
            EXPECT_NEAR(decouple(*one, session[i].channel).wrench_S[c], decouple(*other, turned[i].channel).wrench_S[c],
                        1e-12);
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
        const auto decoupler = make_decoupler(fitted(GetParam(), rows_of(rows), hair_calibration(GetParam(), channels)));
        const double b = kHairShear * 500, a = kHairNormal * 1500;
        const Estimate estimate =
            decouple(*decoupler, x ? std::vector<double>{a + b, a - b} : std::vector<double>{a - b, a + b});
        EXPECT_NEAR(estimate.wrench_S[x ? 0 : 1], 500 * kCap_m2, 0.1 * kCap_m2);
        EXPECT_NEAR(estimate.wrench_S[2], -1500 * kCap_m2, 0.1 * kCap_m2);
        EXPECT_TRUE(std::isnan(estimate.wrench_S[x ? 1 : 0]));
        EXPECT_EQ(decouple(*decoupler, {a + b, a - b}, 1).quality, TACTILED_BAD);  // one hair, two unknowns
    }
}

struct Errors {
    std::array<double, 3> rms{}, worst{};  // fx fy fz, % of 2 kPa
    int good = 0, rows = 0;
};

Errors errors_on(Decoupler& decoupler, const std::vector<LabelledRow>& session, std::uint32_t missing = 0) {
    Errors errors;
    for (const auto& row : session) {
        const Estimate estimate = decouple(decoupler, row.channel, missing);
        errors.good += estimate.quality == TACTILED_GOOD ? 1 : 0;
        ++errors.rows;
        for (std::size_t c = 0; c < 3; ++c) {
            const double error = 100 * (estimate.wrench_S[c] - row.wrench_S[c]) / kFullScale_N;
            errors.rms[c] += error * error;
            errors.worst[c] = std::max(errors.worst[c], std::abs(error));
        }
    }
    for (double& rms : errors.rms) rms = std::sqrt(rms / errors.rows);
    return errors;
}

// Cao et al. print 3.0 % (shear) and 2.9 % (normal). Ten sensors, each calibrated on one session of 600 combined loads in
// any direction and measured on another of 4000; both with their noise.
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
    for (const auto& method : kMethods) {
        std::array<double, 3> mean{}, highest{}, worst{};
        int good = 0, rows = 0, within = 0;
        for (unsigned seed = 1; seed <= 10; ++seed) {
            HairSensor sensor = HairSensor::asymmetric(seed, GetParam().azimuth_deg);
            sensor.bend = GetParam().bend;
            const auto decoupler = make_decoupler(fitted(method, rows_of(hair_session(sensor, 600, 100 + seed))));
            const Errors errors = errors_on(*decoupler, hair_session(sensor, 4000, 200 + seed));
            good += errors.good;
            rows += errors.rows;
            for (std::size_t c = 0; c < 3; ++c) {
                mean[c] += errors.rms[c] / 10;
                highest[c] = std::max(highest[c], errors.rms[c]);
                worst[c] = std::max(worst[c], errors.worst[c]);
                // The matrix is within 1 % in every case, at little more than noise (0.23 % and 0.34 %). In DIFF a press
                // shows where the hairs of a pair answer it differently, and the other shear where they are turned: the two
                // steps are within 1 % where the pair is alike to 5 % and straight.
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
            EXPECT_EQ(good, rows);  // what is modelled is no disagreement
        }
    }
}

// Without g(tau) the two steps are not enough: the intercept is what the second step is for.
TEST(Hair, TheInterceptIsNeeded) {
    const HairSensor sensor = HairSensor::asymmetric(1, 0);
    Calibration calibration = fitted("sum_diff", rows_of(hair_session(sensor, 600, 101)));
    const auto test = hair_session(sensor, 4000, 201);
    const double with = errors_on(*make_decoupler(calibration), test).rms[2];
    calibration.tables.erase("intercept");
    const double without = errors_on(*make_decoupler(calibration), test).rms[2];
    std::printf("normal error with g(tau) %.2f %%, without its bend %.2f %%\n", with, without);
    EXPECT_GT(without, 2 * with);
}

// One hair dead: what is left of the accuracy, on the asymmetric sensors.
TEST(Hair, ADeadHairCostsLittleAccuracy) {
    for (const char* method : {"sum_diff", "matrix"})
        for (std::uint32_t dead = 0; dead < 4; ++dead) {
            const HairSensor sensor = HairSensor::asymmetric(2, 1);
            const auto decoupler = make_decoupler(fitted(method, rows_of(hair_session(sensor, 600, 102))));
            const Errors errors = errors_on(*decoupler, hair_session(sensor, 4000, 202), 1u << dead);
            std::printf("%s without H%u: rms of fx fy fz %.2f %.2f %.2f %%\n", method, dead + 1, errors.rms[0],
                        errors.rms[1], errors.rms[2]);
            for (std::size_t c = 0; c < 3; ++c) EXPECT_LE(errors.rms[c], 1.5) << method << dead << c;
        }
}

TEST(Hair, WithoutNoiseOnlyTheMatrixIsExact) {
    const HairSensor sensor = HairSensor::asymmetric(4, 1);
    const auto decoupler = make_decoupler(fitted("matrix", rows_of(hair_session(sensor, 600, 8, 0))));
    const Errors errors = errors_on(*decoupler, hair_session(sensor, 1000, 9, 0));
    for (std::size_t c = 0; c < 3; ++c) EXPECT_LT(errors.worst[c], 1e-6);  // its terms hold this leak whole
}

TEST(HairFit, RecoversTheSensor) {
    const HairSensor sensor = HairSensor::asymmetric(5, 0);
    for (const auto& method : kMethods) {
        const Calibration c = fitted(method, rows_of(hair_session(sensor, 2000, 10)));
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

// As in real sets: labels of two rows are swapped.
TEST(HairFit, RowsWithWrongLabelsHaveNoWeight) {
    const HairSensor sensor = HairSensor::asymmetric(6, 1);
    for (const char* method : {"sum_diff", "matrix"}) {
        auto session = hair_session(sensor, 400, 11);
        for (std::size_t i = 10; i < 20; ++i) std::swap(session[i].wrench_S, session[i + 200].wrench_S);
        const auto clean = make_decoupler(fitted(method, rows_of(hair_session(sensor, 400, 11))));
        const auto swapped = make_decoupler(fitted(method, rows_of(session)));
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
    const Calibration c = fitted("matrix", rows_of(session), {}, &said);
    ASSERT_EQ(said.size(), 1u);
    EXPECT_NE(said[0].find("do not determine all terms"), std::string::npos);
    for (const auto& row : c.tables.at("leak")) {
        EXPECT_EQ(row[3], 0);   // sigma^3 from three levels
        EXPECT_EQ(row[10], 0);  // tau_x tau_y, never together
    }
    const Errors errors = errors_on(*make_decoupler(c), session);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(errors.worst[i], 1e-6);
}

TEST(HairFit, RefusesWhatTheRowsDoNotDetermine) {
    const auto refused = [](std::vector<LabelledRow> session, Calibration calibration) {
        try {
            (void)fitted(calibration.method, rows_of(session), calibration);
        } catch (const Undetermined& error) { return std::string(error.what()); }
        return std::string();
    };
    const auto session = hair_session(HairSensor::ideal(), 100, 13);
    auto few = session;
    few.resize(11);
    auto together = session, no_press = session;
    for (auto& row : together) row.wrench_S[0] = row.wrench_S[2];
    for (auto& row : no_press) row.wrench_S[2] = std::abs(row.wrench_S[2]);
    for (const auto& method : kMethods) {
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
    const Calibration c = fitted("sum_diff", rows_of(session), {}, &said);
    EXPECT_LT(c.parameters.at("diff_x_per_Pa"), 0);
    ASSERT_EQ(said.size(), 2u);
    EXPECT_NE(said[0].find("H1 and H3 are swapped"), std::string::npos);
    const Errors errors = errors_on(*make_decoupler(c), session);
    EXPECT_LT(errors.rms[0], 0.5);  // and reads right all the same
}

TEST(HairFit, PhysicsCorrectsTheGeometryItWasGiven) {
    const auto session = hair_session(HairSensor::ideal(), 500, 15);
    Calibration start = hair_calibration("physics");
    start.parameters = hair_parameters("Ecoflex");
    const Calibration c = fitted("physics", rows_of(session), start);
    EXPECT_EQ(c.parameters.at("elastomer_kPa"), 250);
    EXPECT_NEAR(c.parameters.at("correction_shear"), 250.0 / 750, 0.005);  // the model says three times what PDMS reads
    EXPECT_NEAR(c.parameters.at("correction_normal"), 250.0 / 750, 0.005);
    const Errors errors = errors_on(*make_decoupler(c), session);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(errors.rms[i], 0.5);
    EXPECT_THROW((void)hair_parameters("PDSM"), SetupError);
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
    says(c, "area_m2 (of the cap; 2.827e-5 of one of 6 mm diameter) is missing");
    c = paper("matrix");
    c.tables["leek"] = {{1}};
    says(c, "table leek is unknown; method matrix has gains leak noise");
    c = paper("matrix");
    c.tables["gains"].pop_back();
    says(c, "table gains has 3 rows of 3; needed are 4 of 3");
    c = paper("matrix");
    c.tables["leak"].assign(4, std::vector<double>(16, 1e-3));
    says(c, "leak terms are too large");
    c = paper("matrix");
    for (auto& row : c.tables["gains"]) row[1] = 0;
    says(c, "cannot tell the stresses apart");
    c = paper("sum_diff");
    c.tables["gains"][2][0] = -kHairNormal;
    says(c, "SUM says nothing");
    c = paper("matrix");
    c.tables["noise"][0][1] = 0;
    says(c, "table noise");
    c = paper("physics");
    c.parameters["thickness_m"] = 0;
    says(c, "parameter thickness_m (of the hair) = 0 is not above 0");
    c = paper_hair("sum_diff", {"H1", "H2", "H3"});
    says(c, "H2 H4 for fy");
}

// ---- finite elements, one-way (assumption 1 of Cao et al.): strain stands for dR/R0

struct FemRow {
    double young_kPa;
    std::string what;
    Stress stress;
    std::vector<double> strain;  // H1 .. H4
};

// In the finite elements the hairs are curled the other way: a shear towards H1 stretches H1. `turned` = the paper's sign.
std::vector<FemRow> fem_rows(bool turned) {
    std::ifstream file(TACTILED_SOURCE_DIR "/tests/data/fem/hair_strains.csv");
    std::vector<FemRow> rows;
    std::string line;
    std::getline(file, line);
    while (std::getline(file, line)) {
        std::vector<std::string> cell;
        std::istringstream cells(line);
        for (std::string one; std::getline(cells, one, ',');) cell.push_back(one);
        const auto number = [&](std::size_t i) { return std::stod(cell.at(i)); };
        const double alpha = number(5) * std::numbers::pi / 180 + (turned ? std::numbers::pi : 0), tau = 1e3 * number(4);
        rows.push_back({number(1), cell[2], {1e3 * number(3), tau * std::cos(alpha), tau * std::sin(alpha)}, {}});
        for (std::size_t i = 14; i < 18; ++i) rows.back().strain.push_back(1e-6 * number(i));
    }
    return rows;
}

TEST(HairFem, SumAndDiffSeparate) {
    double shear_in_sum = 0, press_in_diff = 0;
    for (const FemRow& row : fem_rows(false)) {
        const auto& r = row.strain;
        if (row.what == "shear")  // of what the same stress as a press makes
            shear_in_sum =
                std::max(shear_in_sum, std::abs(r[0] + r[2]) / (201.1e-6 * 750 / row.young_kPa * row.stress.tau_x / 1e3));
        if (row.what == "normal" && row.stress.sigma > 0)
            press_in_diff =
                std::max(press_in_diff, std::abs(r[2] - r[0]) / (3143e-6 * 750 / row.young_kPa * row.stress.sigma / 1e3));
    }
    std::printf("finite elements: shear in SUM %.2g, press in DIFF %.2g of the other's reading\n", shear_in_sum,
                press_in_diff);
    EXPECT_GT(shear_in_sum, 0);
    EXPECT_LT(shear_in_sum, 2e-4);
    EXPECT_LT(press_in_diff, 1e-5);
}

// Calibrated on single loads and angles, measured on combined ones.
TEST(HairFem, EachMethodReadsCombinedLoads) {
    for (const double young_kPa : {750.0, 250.0, 150.0})
        for (const auto& method : kMethods) {
            std::vector<LabelledRow> single, combined;
            for (const FemRow& row : fem_rows(method == "physics"))
                if (row.young_kPa == young_kPa)
                    (row.what.find("combined") == row.what.npos ? single : combined)
                        .push_back({.line = 1, .channel = row.strain, .wrench_S = force_of(row.stress)});
            ASSERT_EQ(single.size(), 22u);
            ASSERT_EQ(combined.size(), 17u);
            const Errors errors = errors_on(*make_decoupler(fitted(method, rows_of(single))), combined);
            std::printf("finite elements, %g kPa, %s: largest error of fx fy fz %.2g %.2g %.2g %% of 2 kPa\n", young_kPa,
                        method.c_str(), errors.worst[0], errors.worst[1], errors.worst[2]);
            for (std::size_t c = 0; c < 3; ++c) EXPECT_LT(errors.worst[c], 0.1) << method << c;
        }
}

// One-way, 1/E holds: calibrated on PDMS, the modulus alone makes it read the other two. With the hair's own stiffness
// it does not (hair.md).
TEST(HairFem, PhysicsFollowsTheModulus) {
    std::vector<LabelledRow> pdms;
    const auto rows = fem_rows(true);
    for (const FemRow& row : rows)
        if (row.young_kPa == 750) pdms.push_back({.line = 1, .channel = row.strain, .wrench_S = force_of(row.stress)});
    Calibration c = fitted("physics", rows_of(pdms));
    for (const double young_kPa : {250.0, 150.0}) {
        c.parameters["elastomer_kPa"] = young_kPa;
        const auto decoupler = make_decoupler(c);
        for (const FemRow& row : rows)
            if (row.young_kPa == young_kPa) expect_force(decouple(*decoupler, row.strain), row.stress, 2);  // Pa, of 2000
    }
}

TEST(HairFem, PhysicsRefusesHairsThatAreCurledTheOtherWay) {
    std::vector<LabelledRow> rows;
    for (const FemRow& row : fem_rows(false))
        rows.push_back({.line = 1, .channel = row.strain, .wrench_S = force_of(row.stress)});
    EXPECT_THROW((void)fitted("physics", rows_of(rows)), Undetermined);
}

}  // namespace
}  // namespace tactiled
