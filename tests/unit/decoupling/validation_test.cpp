// Held-out errors of dead-weight calibrations, and the standard deviation that follows from held-out errors.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <vector>

#include "decoupling/fit/error_shape.hpp"
#include "decoupling/fit/groups.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/solve/load_scale.hpp"
#include "made_by_hand.hpp"
#include "recordings.hpp"

namespace tactiled {
namespace {

TEST(Validation, OfDeadWeightsOneAxisAfterTheOtherLeavesSingleLoadsOut) {
    double within = 0, n = 0;
    for (unsigned seed = 1; seed <= 10; ++seed) {
        const FitReport report = fit(six_axes(seed, 2e-3), by("matrix"));
        // 54 loads and, at the start, one without load; the third level is held for two rows.
        EXPECT_EQ(report.calibration.validation, "leave one load out (49 loads)");
        ASSERT_EQ(report.calibration.sd.size(), 6u);
        EXPECT_LT(percent_of_full_scale(report), 0.6);
        const auto decoupler = make_decoupler(report.calibration);
        for (const auto& row : six_axes(seed, 2e-3).rows) {
            const Estimate estimate = decouple(*decoupler, row.channel);
            EXPECT_EQ(estimate.quality(), TACTILED_GOOD);
        }
        for (const auto& [row, estimated] : report.held_out)
            for (std::size_t c = 0; c < 6; ++c, ++n)
                within += std::abs(estimated[c] - row->wrench_S[c]) <= stated_sd(report.calibration, c, estimated) ? 1 : 0;
    }
    EXPECT_GT(within / n, 0.6);
    EXPECT_LT(within / n, 0.8);
}

// A rest after each of twenty loads: without a rest the zero would be that of loads.
TEST(Validation, LeavesNotAllRestsOutTogether) {
    Labelled labelled{.name = "rests.csv", .channels = {"A"}, .sessions = {}, .rows = {}};
    for (int i = 0; i < 400; ++i) {
        const double fz = i / 10 % 2 == 0 ? 0 : -1.0 - i / 20;
        labelled.rows.push_back(
            {.line = i + 2, .channel = {fz}, .wrench_S = {kNaN, kNaN, fz, kNaN, kNaN, kNaN}, .session = 0, .t_ns = 0});
    }
    Rows rows;
    for (const LabelledRow& row : labelled.rows) rows.push_back(&row);
    const Groups groups = ways_to_hold_out(labelled, rows, false).front();
    ASSERT_EQ(groups.validation, "leave poses out (40 poses in 10 groups)");
    for (std::size_t group = 0; group < groups.names.size(); ++group) {
        int rests = 0;
        for (std::size_t i = 0; i < rows.size(); ++i) rests += groups.fits(i, group) && rows[i]->wrench_S[2] == 0 ? 1 : 0;
        EXPECT_EQ(rests, 180) << groups.names[group];
    }
}

// One session of 20 min that repeats ten poses, and the same time again, while the zeros walk. The poses of a group occur
// all the time, so that leaving poses out claims a third of the error.
TEST(Validation, OfASensorThatDriftsClaimsTheTimeAfterIt) {
    double claimed = 0, later = 0;
    for (unsigned seed = 1; seed <= 20; ++seed) {
        std::mt19937_64 random(seed);
        std::normal_distribution<double> normal(0, 1);
        Labelled fitted;
        fitted.name = "walk.csv";
        fitted.channels = {"A", "B"};
        Labelled after = fitted;
        double zero = 0;
        for (int i = 0; i < 2400; ++i) {
            const double fz = -double(i / 10 % 10);
            zero += 0.01 * normal(random);
            (i < 1200 ? fitted : after)
                .rows.push_back({.line = i + 2,
                                 .channel = {fz + zero + 0.01 * normal(random), 0.1 * fz + 0.01 * normal(random)},
                                 .wrench_S = {kNaN, kNaN, fz, kNaN, kNaN, kNaN},
                                 .session = 0,
                                 .t_ns = std::uint64_t(i + 1) * 1'000'000'000});
        }
        const FitReport report = fit(fitted, by("matrix"));
        Rows rows;
        for (const LabelledRow& row : after.rows) rows.push_back(&row);
        claimed += std::pow(report.components[0].held_out_rms, 2);
        later += std::pow(rms_error(report.calibration, rows)[2], 2);
        EXPECT_TRUE(has_way(report, "leave poses out")) << seed;
    }
    EXPECT_NEAR(std::sqrt(claimed / later), 1, 0.4);
}

// Three components whose errors are largest in different ways to hold rows out: fx in those of poses, whose gains scatter
// and which the last third of the time does not load; fz in the last third, because it drifts.
TEST(Validation, EachComponentClaimsItsOwnLargestError) {
    std::mt19937_64 random(4);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Labelled labelled;
    labelled.name = "two.csv";
    labelled.channels = {"A", "B"};
    double fx = 0, fz = 0, gain = 1;
    for (int i = 0; i < 3000; ++i) {
        if (i % 10 == 0)
            fx = i < 2000 ? 5 * uniform(random) : 0, fz = -5 * std::abs(uniform(random)), gain = 1 + 0.1 * normal(random);
        labelled.rows.push_back({.line = i + 2,
                                 .channel = {gain * fx + 0.01 * normal(random), fz + 1e-3 * i + 0.01 * normal(random)},
                                 .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN},
                                 .session = 0,
                                 .t_ns = std::uint64_t(i + 1) * 1'000'000'000});
    }
    const FitReport report = fit(labelled, by("matrix"));
    EXPECT_EQ(report.calibration.validation, "leave the last third of the time out");
    EXPECT_GT(report.components[0].held_out_rms, 0.15) << "10 % of 2.9 N, at two thirds of the rows";
    EXPECT_GT(stated_sd(report.calibration, 0, {4, kNaN, -2, kNaN, kNaN, kNaN}), 0.2);
}

// A way that leaves no label of a component out says nothing on it, and hides no other way.
TEST(Validation, AWayWithoutALabelOfEachComponentIsNotPossible) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Labelled labelled;
    labelled.name = "half.csv";
    labelled.channels = {"A", "B"};
    for (int i = 0; i < 900; ++i) {
        const double fx = uniform(random), fz = uniform(random);
        labelled.rows.push_back({.line = i + 2,
                                 .channel = {fx + 0.01 * uniform(random), fz + 0.01 * uniform(random)},
                                 .wrench_S = {i < 500 ? fx : kNaN, kNaN, fz, kNaN, kNaN, kNaN},
                                 .session = 0,
                                 .t_ns = 0});
    }
    const FitReport report = fit(labelled, by("matrix"));
    ASSERT_EQ(report.ways.back().how, "leave the last third of the rows out");
    EXPECT_EQ(report.ways.back().refused, "no row that is left out has a label of fx");
    EXPECT_EQ(report.calibration.sd.size(), 2u);
}

// The error of a held-out row is e / (1 - h) with its leverage h.
TEST(Validation, OfSingleLoadsIsThatByLeverage) {
    Labelled labelled = six_axes(3, 2e-3);
    for (std::size_t i = 0; i < labelled.rows.size(); ++i)  // no two rows are alike
        for (std::size_t k = 0; k < 6; ++k) {
            labelled.rows[i].wrench_S[k] *= 1 + 0.02 * double(i % 7);
            labelled.rows[i].channel[k] *= 1 + 0.02 * double(i % 7);
        }
    labelled.rows.erase(labelled.rows.begin(), labelled.rows.begin() + 4);
    const FitReport report = fit(labelled, by("matrix"));
    ASSERT_EQ(report.held_out.size(), labelled.rows.size());
    ASSERT_TRUE(report.suspects.empty());
    const auto n = Eigen::Index(labelled.rows.size());
    Eigen::MatrixXd x(n, 7);
    Eigen::VectorXd y(n);
    for (Eigen::Index i = 0; i < n; ++i) {
        x(i, 0) = 1;
        for (Eigen::Index k = 0; k < 6; ++k) x(i, k + 1) = labelled.rows[std::size_t(i)].channel[std::size_t(k)];
        y[i] = labelled.rows[std::size_t(i)].wrench_S[0];
    }
    const Eigen::MatrixXd hat = x * (x.transpose() * x).inverse() * x.transpose();
    const Eigen::VectorXd error = hat * y - y;
    for (const auto& [row, estimated] : report.held_out) {
        const Eigen::Index i = row->line - labelled.rows.front().line;
        EXPECT_NEAR(estimated[0] - row->wrench_S[0], error[i] / (1 - hat(i, i)), 1e-6);
    }
}

Validation errors_of(const std::vector<double>& errors, std::vector<LabelledRow>& rows, std::size_t sessions) {
    Validation validation;
    rows.clear();
    for (std::size_t i = 0; i < errors.size(); ++i)
        rows.push_back(
            {.line = std::int64_t(i), .channel = {0}, .wrench_S = {kNaN, kNaN, i % 2 == 0 ? -5.0 : -6.0, kNaN, kNaN, kNaN}});
    for (std::size_t i = 0; i < errors.size(); ++i) {
        validation.all.push_back(&rows[i]);
        validation.rows.push_back({&rows[i], {kNaN, kNaN, rows[i].wrench_S[2] + errors[i], kNaN, kNaN, kNaN}});
        validation.group.push_back(i * sessions / errors.size());
    }
    validation.by_sessions = sessions > 1;
    return validation;
}

double sd_found(const Validation& validation, double at) {
    Calibration calibration;
    calibration.channels = {"A"};
    calibration.components = {"fz"};
    calibration.full_scale = {10};
    set_uncertainty(validation, calibration, false);
    return std::hypot(calibration.sd.at(0), calibration.sd_slope.at(0) * at);
}

TEST(Uncertainty, IsTheRootMeanSquareOfTheWorstSessionAndOfFewRows) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::vector<LabelledRow> rows;
    std::vector<double> errors(4000);
    for (double& error : errors) error = normal(random);
    EXPECT_NEAR(sd_found(errors_of(errors, rows, 1), 5), 1, 0.06);
    for (std::size_t i = 0; i < errors.size(); i += 49) errors[i] = 7;  // 2 %, under both loads
    EXPECT_NEAR(sd_found(errors_of(errors, rows, 1), 5), std::sqrt(0.98 + 0.02 * 49), 0.06);
    for (double& error : errors) error = normal(random);
    for (std::size_t i = 3000; i < 4000; ++i) errors[i] += 2;  // one session in four
    const double of_sessions = sd_found(errors_of(errors, rows, 4), 5);
    EXPECT_GT(of_sessions, std::sqrt(5.0) * 0.95);
    errors.resize(12);
    for (double& error : errors) error = 1;
    // Student: 12 loads, 2 coefficients. The loads are 5 and 6 N.
    const double of_5 = sd_found(errors_of(errors, rows, 1), 5), of_6 = sd_found(errors_of(errors, rows, 1), 6);
    EXPECT_NEAR(std::hypot(of_5, of_6) / std::sqrt(2), 1 + 0.5 / 10 + 0.25 / 100, 1e-3);
    errors.resize(7);
    EXPECT_THROW((void)sd_found(errors_of(errors, rows, 1), 5), std::out_of_range);
}

// The error of a shear grows with the press: one sd for all loads would be too wide at rest and too narrow under load.
TEST(Uncertainty, OfAComponentDependsOnTheLoadOfTheOthers) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Calibration calibration;
    calibration.channels = {"A", "B"};
    calibration.components = {"fx", "fz"};
    calibration.full_scale = {2, 10};
    std::vector<LabelledRow> rows;
    rows.reserve(4000);
    Validation validation;
    for (int i = 0; i < 4000; ++i) {
        const double fx = 2 * uniform(random), fz = -10 * std::abs(uniform(random));
        rows.push_back(
            {.line = i, .channel = {fx, fz}, .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN}, .session = 0, .t_ns = 0});
        Wrench estimated = rows.back().wrench_S;
        estimated[0] += std::hypot(0.04, 0.02 * fz) * normal(random);
        estimated[2] += 0.05 * normal(random);
        validation.all.push_back(&rows.back());
        validation.rows.push_back({&rows.back(), estimated});
        validation.group.push_back(0);
    }
    set_uncertainty(validation, calibration, false);
    EXPECT_NEAR(stated_sd(calibration, 0, {0, kNaN, 0, kNaN, kNaN, kNaN}), 0.04, 0.02);
    EXPECT_NEAR(stated_sd(calibration, 0, {0, kNaN, -10, kNaN, kNaN, kNaN}), 0.2, 0.03);
    EXPECT_NEAR(stated_sd(calibration, 1, {0, kNaN, -10, kNaN, kNaN, kNaN}), 0.05, 0.01);
}

// A straight line through curved loads that is off by 1 N at rest: a tare makes it right there, and wrong elsewhere.
TEST(Uncertainty, HoldsAfterATareToo) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 0.2);
    std::vector<LabelledRow> rows;
    std::vector<double> errors(2000);
    for (double& error : errors) error = normal(random);
    Validation validation = errors_of(errors, rows, 1);
    EXPECT_NEAR(sd_found(validation, 5), 0.2, 0.02);
    validation.at_rest[0] = {kNaN, kNaN, 1, kNaN, kNaN, kNaN};
    EXPECT_NEAR(sd_found(validation, 5), 1.1, 0.1);  // 68 % of |0.2 z - 1| are below 1.09
}

TEST(Uncertainty, TheErrorAtRestIsThatOfThreeRowsOrMoreOfASession) {
    Calibration calibration = table_calibration(all_gauges());
    calibration.full_scale = {1, 1, 1};
    std::vector<LabelledRow> rows;
    for (std::size_t i = 0; i < 8; ++i)
        rows.push_back({.line = std::int64_t(i),
                        .channel = std::vector<double>(8, 1e-4),
                        .wrench_S = {0, 0, i < 2 ? -0.9 : 0, kNaN, kNaN, kNaN},
                        .session = i < 6 ? 0u : 1u});
    const double reading = make_decoupler(calibration)->decouple({.channel = rows[0].channel}).wrench_S[2];
    ASSERT_NE(reading, 0);
    Rows all;
    for (const LabelledRow& row : rows) all.push_back(&row);
    const auto at_rest = errors_at_rest(calibration, all);
    ASSERT_EQ(at_rest.size(), 1u);  // session 1 has two
    EXPECT_DOUBLE_EQ(at_rest.at(0)[2], reading);
}

// Rows with fx and fz, and the error of their fx.
struct TwoAxes {
    TwoAxes() {
        rows.reserve(kRows);  // validation has their addresses
        calibration.channels = {"A", "B"};
        calibration.components = {"fx", "fz"};
        calibration.full_scale = {2, 10};
    }
    void add(double fx, double fz, double error_N) {
        rows.push_back({.line = int(rows.size()),
                        .channel = {fx, fz},
                        .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN},
                        .session = 0,
                        .t_ns = 0});
        Wrench estimated = rows.back().wrench_S;
        estimated[0] += error_N;
        validation.all.push_back(&rows.back());
        validation.rows.push_back({&rows.back(), estimated});
        validation.group.push_back(0);
    }

    static constexpr int kRows = 4000;
    Calibration calibration;
    std::vector<LabelledRow> rows;
    Validation validation;
};

// One row in 125 bears a light load and is far off: too few to count among all rows, but no more than 0.5 % of all are
// beyond five standard deviations.
TEST(Uncertainty, HoldsForLightLoadsAlone) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(0, 1);
    TwoAxes recording;
    for (int i = 0; i < TwoAxes::kRows; ++i) {
        const bool is_off = i % 125 == 0;
        const double fx = 4 * uniform(random) - 2, fz = is_off ? -0.1 : -10 * uniform(random);
        recording.add(fx, fz, is_off ? 0.3 : 0.02 * fz * normal(random));
    }
    set_uncertainty(recording.validation, recording.calibration, false);
    int beyond = 0;
    for (const LabelledRow& row : recording.rows)
        if (row.line % 125 == 0) beyond += 0.3 > 5 * stated_sd(recording.calibration, 0, row.wrench_S);
    EXPECT_LE(beyond, 0.005 * TwoAxes::kRows);
}

// A method that doubts a reading states no standard deviation for it, and its error there is not part of the others'.
TEST(Uncertainty, ReadingsForWhichNoneIsStatedDoNotCount) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::vector<LabelledRow> rows;
    std::vector<double> errors(2000);
    for (std::size_t i = 0; i < errors.size(); ++i) errors[i] = i % 5 == 0 ? 20 : normal(random);
    Validation validation = errors_of(errors, rows, 1);
    EXPECT_GT(sd_found(validation, 5), 3);
    for (std::size_t i = 0; i < errors.size(); ++i) validation.has_sd.push_back(i % 5 != 0);
    EXPECT_NEAR(sd_found(validation, 5), 1, 0.06);
}

// Nineteen of twenty rows are at rest, where the error is small.
TEST(Uncertainty, HoldsUnderLoadThoughMostRowsAreAtRest) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::vector<LabelledRow> rows;
    std::vector<double> errors(4000);
    for (std::size_t i = 0; i < errors.size(); ++i) errors[i] = (i % 20 == 0 ? 0.1 : 0.001) * normal(random);
    Validation validation = errors_of(errors, rows, 1);
    for (std::size_t i = 0; i < errors.size(); ++i) {
        if (i % 20 != 0) rows[i].wrench_S[2] = 0;
        validation.rows[i].estimated_S[2] = rows[i].wrench_S[2] + errors[i];
    }
    EXPECT_NEAR(sd_found(validation, 5), 0.1, 0.015);
}

// The error grows with the component, but is not 0 where the component is: there the others load the sensor.
TEST(Uncertainty, HoldsWhereOnlyTheOthersLoad) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(0.5, 2);
    TwoAxes recording;
    for (int i = 0; i < TwoAxes::kRows; ++i) {
        const bool rests = i % 10 < 7, only_press = !rests && i % 40 == 7;
        const double fx = rests || only_press ? 0 : uniform(random), fz = only_press ? -0.5 : rests ? 0 : -10;
        recording.add(fx, fz, (rests ? 0.0005 : only_press ? 0.05 : 0.1 * fx) * normal(random));
    }
    set_uncertainty(recording.validation, recording.calibration, false);
    // The tails of the quarter of the loaded rows with the smallest sd, a third of which are these.
    EXPECT_GT(stated_sd(recording.calibration, 0, {0, kNaN, -0.5, kNaN, kNaN, kNaN}), 0.022);
}

// At rest the error is a fiftieth of that under full load, as after a rest of a sensor with a gain error.
TEST(Uncertainty, FallsAsFarAsTheErrorsDo) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(0, 1);
    TwoAxes recording;
    for (int i = 0; i < TwoAxes::kRows; ++i) {
        const double fx = 4 * uniform(random) - 2, fz = i % 4 == 0 ? 0 : -10 * uniform(random);
        recording.add(fz == 0 ? 0 : fx, fz, std::hypot(0.004, 0.02 * fz) * normal(random));
    }
    set_uncertainty(recording.validation, recording.calibration, false);
    EXPECT_NEAR(stated_sd(recording.calibration, 0, {0, kNaN, 0, kNaN, kNaN, kNaN}), 0.005, 0.0015);
    EXPECT_NEAR(stated_sd(recording.calibration, 0, {0, kNaN, -10, kNaN, kNaN, kNaN}), 0.2, 0.03);
}

// Errors that grow with the load, of twenty loads: one sd for all of them would be too small at full load.
TEST(Uncertainty, GrowsWithTheLoadOfAFewLoads) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::vector<double> stated;
    for (int calibration = 0; calibration < 51; ++calibration) {
        TwoAxes recording;
        for (int i = 0; i < 20; ++i) {
            const double fz = -10 * uniform(random);
            recording.add(2 * uniform(random), fz, std::hypot(0.01, 0.02 * fz) * normal(random));
        }
        set_uncertainty(recording.validation, recording.calibration, false);
        stated.push_back(stated_sd(recording.calibration, 0, {0, kNaN, -10, kNaN, kNaN, kNaN}));
    }
    std::nth_element(stated.begin(), stated.begin() + 25, stated.end());
    EXPECT_NEAR(stated[25], 0.2, 0.04);
}

// One load of thirty is off by twenty times the others' standard deviation.
TEST(Uncertainty, ContainsASingleLoadThatIsFarOff) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::vector<LabelledRow> rows;
    std::vector<double> errors(30);
    for (double& error : errors) error = normal(random);
    errors[7] = 20;
    double squares = 0;
    for (const double error : errors) squares += error * error / 30;
    const auto validation = errors_of(errors, rows, 1);
    EXPECT_GT(std::hypot(sd_found(validation, 5), sd_found(validation, 6)) / std::sqrt(2), 0.95 * std::sqrt(squares));
}

// A single load at rest, without an error, says little about the errors of small loads.
TEST(Uncertainty, DoesNotFallWithoutRests) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(0.5, 1);
    TwoAxes recording;
    recording.add(0, 0, 0);
    for (int i = 1; i < 200; ++i) {
        const double fz = -10 * uniform(random);
        recording.add(uniform(random), fz, 0.02 * fz * normal(random));
    }
    set_uncertainty(recording.validation, recording.calibration, false);
    EXPECT_GT(stated_sd(recording.calibration, 0, {0, kNaN, 0, kNaN, kNaN, kNaN}), 0.05);
}

// Errors with all parts of the variance, of which the fit must find each.
TEST(Uncertainty, HasEachPartOfTheErrors) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(0, 1);
    const Parts made{1, 400, 100, 900};
    Errors errors;
    for (int i = 0; i < 20'000; ++i) {
        Error error{.square = {1}, .size = 0, .weight = 1, .group = 0};
        double variance = made[kConstant];
        for (const Part part : {kSlope, kLoad, kUnloading}) {
            error.square[part] = i % 3 == 0 ? 0 : std::pow(uniform(random), 2);
            variance += made[part] * error.square[part];
        }
        error.size = std::abs(std::sqrt(variance) * normal(random));
        errors.plain.push_back(error);
    }
    errors.tared = errors.plain;
    const Parts found = variance_of(errors, false, {.load = true, .unloading = true});
    for (std::size_t part = 0; part < kParts; ++part)
        EXPECT_NEAR(std::sqrt(found[part]), std::sqrt(made[part]), 0.15 * std::sqrt(made[part])) << part;
    EXPECT_EQ(variance_of(errors, false, {.load = false, .unloading = false})[kLoad], 0);
}

}  // namespace
}  // namespace tactiled
