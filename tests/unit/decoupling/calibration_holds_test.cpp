// Realistic recordings: mistyped labels, sessions with their own zeros, dead weights on one axis after the other.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <set>

#include "decoupling/accuracy.hpp"
#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/validate.hpp"
#include "decoupling/solve/domain.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

FitRequest by(const std::string& method) {
    return {.model = "generic", .method = method, .serial = "", .channel_unit = "V", .date = "2026-03-01"};
}

bool warns(const FitReport& report, const std::string& what) {
    return std::any_of(report.warnings.begin(), report.warnings.end(),
                       [&](const std::string& warning) { return warning.find(what) != warning.npos; });
}

std::string refusal(const Labelled& labelled, const FitRequest& request) {
    try {
        (void)fit(labelled, request);
    } catch (const Undetermined& error) { return error.what(); }
    return "";
}

std::set<std::int64_t> lines_of(const FitReport& report, bool left_out_only = false) {
    std::set<std::int64_t> lines;
    for (const Suspect& suspect : report.suspects)
        if (suspect.left_out || !left_out_only) lines.insert(suspect.row->line);
    return lines;
}

// A load cell with 2 % of crosstalk, loaded with weights up and down, one axis after the other; noise relative to
// full scale.
struct Cell {
    static constexpr double kScale_N[3] = {50, 50, 100};
    std::mt19937_64 random;
    std::normal_distribution<double> normal{0, 1};
    double mix[3][3];
    explicit Cell(unsigned seed) : random(seed) {
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) mix[i][j] = i == j ? 1 : 0.02 * normal(random);
    }
    Labelled recording(int sessions, int turns, double zero_sd, double noise) {
        Labelled labelled;
        labelled.name = "cell.csv";
        labelled.channels = {"A", "B", "C"};
        for (int session = 0; session < sessions; ++session) {
            if (sessions > 1) labelled.sessions.push_back("day " + std::to_string(session));
            double zero[3];
            for (double& z : zero) z = zero_sd * normal(random);
            for (int turn = 0; turn < turns; ++turn)
                for (int axis = 0; axis < 3; ++axis)
                    for (const int level : {0, 1, 2, 3, 4, 5, 4, 3, 2, 1}) {
                        double load[3];
                        for (double& part : load) part = 0.002 * normal(random) * level / 5;
                        load[axis] = (axis == 2 || turn % 2 == 0 ? -1 : 1) * level / 5.0;
                        LabelledRow row{.line = std::int64_t(labelled.rows.size()) + 2,
                                        .channel = {},
                                        .wrench_S = kUnseen,
                                        .session = std::size_t(session)};
                        for (int i = 0; i < 3; ++i) {
                            row.channel.push_back(zero[i] + noise * normal(random) + mix[i][0] * load[0] +
                                                  mix[i][1] * load[1] + mix[i][2] * load[2]);
                            row.wrench_S[std::size_t(i)] = kScale_N[i] * load[i];
                        }
                        labelled.rows.push_back(row);
                    }
        }
        return labelled;
    }
};

double percent_of_full_scale(const FitReport& report) {
    double worst = 0;
    for (const auto& c : report.components) worst = std::max(worst, 100 * c.held_out_rms / c.full_scale);
    return worst;
}

// ---- labels that look wrong ----

TEST(Outliers, FourMistypedLoadsAmong120AreNamedAndLeftOut) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        Labelled labelled = Cell(seed).recording(1, 4, 0, 1e-4);
        ASSERT_EQ(labelled.rows.size(), 120u);
        // Errors: a sign, a decimal point, two swapped digits, the previous load; of loads in the middle of the
        // range.
        std::set<std::int64_t> wrong;
        const auto mistype = [&](std::size_t row, std::size_t axis, double label) {
            labelled.rows[row].wrench_S[axis] = label;
            wrong.insert(labelled.rows[row].line);
        };
        mistype(3, 0, 30);     // N, is -30
        mistype(44, 1, 4);     // is 40
        mistype(82, 2, -402);  // is -40
        mistype(97, 0, 10);    // is 30
        const FitReport report = fit(labelled, by("matrix"));
        EXPECT_EQ(lines_of(report, true), wrong) << seed;
        EXPECT_EQ(report.calibration.rows, 120 - int(wrong.size()));
        EXPECT_LT(percent_of_full_scale(report), 0.1) << seed;
        for (const std::int64_t line : wrong) EXPECT_TRUE(warns(report, "left out: cell.csv:" + std::to_string(line) + ":"));
        FitRequest keep = by("matrix");
        keep.keep_outliers = true;
        const FitReport kept = fit(labelled, keep);
        EXPECT_EQ(kept.calibration.rows, 120);
        EXPECT_TRUE(lines_of(kept, true).empty());
        EXPECT_FALSE(lines_of(kept).empty());
    }
}

TEST(Outliers, GoodRecordingsLoseNothing) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        const FitReport report = fit(Cell(seed).recording(1, 4, 0, 1e-3), by("matrix"));
        EXPECT_TRUE(report.suspects.empty()) << seed;
    }
}

// A load beyond all others, or at their end, may be one that the sensor reads too low: it is kept, and the user is
// asked to record it again.
TEST(Outliers, TheMostLoadedRowIsNeverLeftOut) {
    for (const double reads : {1.0, 1.2, 1.5}) {
        Labelled labelled = Cell(3).recording(1, 4, 0, 1e-4);
        LabelledRow row = labelled.rows[25];  // the greatest press, 100 N
        for (std::size_t i = 0; i < 3; ++i) row.channel[i] *= reads, row.wrench_S[i] *= 1.8;
        row.line = 122;
        labelled.rows.push_back(row);
        const FitReport report = fit(labelled, by("matrix"));
        EXPECT_EQ(report.calibration.rows, 121) << reads;
        EXPECT_EQ(lines_of(report), (std::set<std::int64_t>{122})) << reads;
        EXPECT_TRUE(warns(report, "kept: cell.csv:122: fz_N is -180")) << reads;
        EXPECT_TRUE(warns(report, "apply this load again")) << reads;
    }
}

// Weights of which the largest occurs once: a label in the range of the others cannot be explained by a nonlinearity.
TEST(Outliers, AMistypedGreatestLoadIsLeftOut) {
    Labelled labelled = Cell(4).recording(1, 4, 0, 1e-4);
    LabelledRow row = labelled.rows[25];
    for (double& reading : row.channel) reading *= 1.1;
    row.wrench_S[2] = 11;  // N, is -110
    row.line = 122;
    labelled.rows.push_back(row);
    EXPECT_EQ(lines_of(fit(labelled, by("matrix")), true), (std::set<std::int64_t>{122}));
}

// Random loads on a sensor that saturates softly. The largest loads disagree with a straight line, all of them alike.
TEST(Outliers, ABendOfTheSensorIsNoFaultOfItsLabels) {
    std::mt19937_64 random(4);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::normal_distribution<double> noise(0, 1e-3);
    Labelled labelled;
    labelled.name = "soft.csv";
    labelled.channels = {"A", "B"};
    for (int i = 0; i < 2000; ++i) {
        const double press = 10 * std::pow(uniform(random), 3);  // N: few great ones
        labelled.rows.push_back({.line = i + 2,
                                 .channel = {std::tanh(press / 6) + noise(random), std::tanh(press / 9) + noise(random)},
                                 .wrench_S = {kNaN, kNaN, -press, kNaN, kNaN, kNaN}});
    }
    for (const char* method : {"matrix", "quadratic", "rbf"}) {
        const FitReport report = fit(labelled, by(method));
        EXPECT_EQ(report.calibration.full_scale[0], fit(labelled, by("rbf")).calibration.full_scale[0]) << method;
        EXPECT_GE(report.calibration.rows, 1995) << method;
    }
}

// Labels swapped on a curve that only the right method models.
TEST(Outliers, AreJudgedByTheMethodThatIsChosen) {
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> noise(0, 2e-3);
    Labelled labelled;
    labelled.name = "bowl.csv";
    labelled.channels = {"A", "B"};
    for (int i = 0; i < 600; ++i) {
        const double fx = uniform(random), fz = uniform(random);
        labelled.rows.push_back({.line = i + 2,
                                 .channel = {fx + 0.3 * fz * fz + noise(random), fz + 0.3 * fx * fx + noise(random)},
                                 .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN}});
    }
    for (const std::size_t at : {40u, 250u, 470u}) std::swap(labelled.rows[at].wrench_S, labelled.rows[at + 77].wrench_S);
    const FitReport report = fit(labelled, by("rbf"));
    std::size_t named = 0;
    for (const std::int64_t line : {42, 119, 252, 329, 472, 549}) named += lines_of(report, true).count(line);
    EXPECT_EQ(named, 6u);
    EXPECT_LE(report.suspects.size(), 6u + 3u);  // 0.5 % of the others
}

TEST(Outliers, WhereManyDisagreeAllStay) {
    Labelled labelled = Cell(6).recording(1, 4, 0, 1e-4);
    for (std::size_t i = 3; i < 120; i += 10) labelled.rows[i].wrench_S[0] += 20;  // N; 12 of 120
    const FitReport report = fit(labelled, by("matrix"));
    EXPECT_EQ(report.calibration.rows, 120);
    EXPECT_TRUE(lines_of(report, true).empty());
}

// ---- zeros of the sessions ----

TEST(SessionZeros, AreFoundWhereEachPlacementHasItsOwn) {
    for (unsigned seed = 1; seed <= 10; ++seed) {
        const Labelled labelled = Cell(seed).recording(3, 2, 0.03, 3e-4);
        const FitReport report = fit(labelled, by("matrix"));
        EXPECT_TRUE(report.zeros.own) << seed;
        EXPECT_LT(percent_of_full_scale(report), 0.15) << seed;
        EXPECT_TRUE(warns(report, "each session has its own zero"));
        EXPECT_EQ(report.calibration.validation, "leave one session out (3 sessions), each with its own zero");
        EXPECT_TRUE(report.suspects.empty());
        FitRequest one = by("matrix");
        one.zeros = FitRequest::Zeros::common;
        EXPECT_GT(percent_of_full_scale(fit(labelled, one)), 1) << seed;
        EXPECT_FALSE(fit(Cell(seed).recording(3, 2, 0, 3e-4), by("matrix")).zeros.own) << seed;
    }
}

// A mistyped load must not move the zero of its session, and the zero must not hide it.
TEST(SessionZeros, StandMistypedLoads) {
    Labelled labelled = Cell(11).recording(3, 2, 0.03, 3e-4);
    labelled.rows[13].wrench_S[0] = 35;  // N
    labelled.rows[113].wrench_S[2] *= 0.1;
    const FitReport report = fit(labelled, by("matrix"));
    EXPECT_TRUE(report.zeros.own);
    EXPECT_EQ(lines_of(report, true), (std::set<std::int64_t>{15, 115}));
    EXPECT_LT(percent_of_full_scale(report), 0.15);
}

TEST(ZeroDrift, IsInTheFitAndInTheStandardDeviation) {
    // One force, six channels that respond alike: independent changes of their zeros hardly change their sum, but
    // change a single channel.
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> uniform(0, 10);
    std::normal_distribution<double> normal(0, 1);
    Labelled labelled;
    labelled.name = "six.csv";
    labelled.channels = {"A", "B", "C", "D", "E", "F"};
    for (int i = 0; i < 1000; ++i) {
        const double press = uniform(random);
        LabelledRow row{.line = i + 2, .channel = {}, .wrench_S = {kNaN, kNaN, -press, kNaN, kNaN, kNaN}};
        for (int k = 0; k < 6; ++k) row.channel.push_back(press + (k == 0 ? 1e-4 : 1e-2) * normal(random));
        labelled.rows.push_back(row);
    }
    const auto error_with_zeros = [&](const Calibration& calibration, double& beyond, double& within) {
        const auto decoupler = make_decoupler(calibration);
        double squares = 0;
        beyond = within = 0;
        for (int trial = 0; trial < 50; ++trial) {
            std::vector<double> zero(6);
            for (double& z : zero) z = 0.1 * normal(random);  // 1 % of a channel's width
            for (const auto& row : labelled.rows) {
                std::vector<double> channel = row.channel;
                for (std::size_t k = 0; k < 6; ++k) channel[k] += zero[k];
                const Estimate estimate = decouple(*decoupler, channel);
                const double error = estimate.wrench_S[2] - row.wrench_S[2];
                squares += error * error / 50000;
                beyond += std::abs(error) > 5 * estimate.sd[2] ? 1.0 / 50000 : 0;
                within += std::abs(error) <= estimate.sd[2] ? 1.0 / 50000 : 0;
            }
        }
        return std::sqrt(squares);
    };
    double beyond = 0, within = 0;
    const double plain = error_with_zeros(fit(labelled, by("matrix")).calibration, beyond, within);
    EXPECT_GT(plain, 0.08);  // N
    EXPECT_GT(beyond, 0.5);
    FitRequest stated = by("matrix");
    stated.zero_drift = 0.01;
    const Calibration calibration = fit(labelled, stated).calibration;
    EXPECT_LT(error_with_zeros(calibration, beyond, within), 0.05);  // 0.1 / sqrt(6) = 0.041
    EXPECT_EQ(beyond, 0);
    EXPECT_GT(within, 0.6);                                                             // share for 50 sets of zeros
    EXPECT_LT(calibration.sd[0], 1.5 * error_with_zeros(calibration, beyond, within));  // and no wider than that
    ASSERT_EQ(calibration.zero_drift.size(), 6u);
    EXPECT_NEAR(calibration.zero_drift[1], 0.1, 0.003);
}

// ---- validation and uncertainty ----

// Six axes, one after the other: no stretch of time and no group of poses can be left out.
Labelled six_axes(unsigned seed, double noise) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, 1);
    double mix[6][6];
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) mix[i][j] = (i == j ? 1 : 0) + 0.1 * normal(random);
    const double scale[6] = {100, 100, 200, 5, 5, 5};
    Labelled labelled;
    labelled.name = "six.csv";
    labelled.channels = {"A", "B", "C", "D", "E", "F"};
    for (int n = 0; n < 59; ++n) {
        double load[6]{};
        if (n >= 5) {
            const int step[9] = {1, 2, 3, 3, 2, 1, -1, -2, -3};
            load[(n - 5) / 9] = step[(n - 5) % 9] / 3.0;
        }
        LabelledRow row{.line = n + 2, .channel = {}, .wrench_S = kUnseen};
        for (int i = 0; i < 6; ++i) {
            double reading = noise * normal(random);
            for (int j = 0; j < 6; ++j) reading += mix[i][j] * load[j];
            row.channel.push_back(reading);
            row.wrench_S[std::size_t(i)] = scale[i] * load[i];
        }
        labelled.rows.push_back(row);
    }
    return labelled;
}

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
            EXPECT_EQ(estimate.quality, TACTILED_GOOD);
        }
        for (const auto& [row, estimated] : report.held_out)
            for (std::size_t c = 0; c < 6; ++c, ++n)
                within += std::abs(estimated[c] - row->wrench_S[c]) <=
                                  std::hypot(report.calibration.sd[c], report.calibration.sd_slope[c] * estimated[c])
                              ? 1
                              : 0;
    }
    EXPECT_GT(within / n, 0.6);
    EXPECT_LT(within / n, 0.8);
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
        validation.rows.push_back({&rows[i], {kNaN, kNaN, rows[i].wrench_S[2] + errors[i], kNaN, kNaN, kNaN}});
        validation.group.push_back(i * sessions / errors.size());
    }
    validation.by_sessions = sessions > 1;
    return validation;
}

double stated_sd(const Validation& validation, double at) {
    Calibration calibration;
    calibration.channels = {"A"};
    calibration.components = {"fz"};
    calibration.full_scale = {10};
    set_uncertainty(validation, calibration);
    return std::hypot(calibration.sd.at(0), calibration.sd_slope.at(0) * at);
}

TEST(Uncertainty, SeesTailsWorstSessionsAndFewRows) {
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal(0, 1);
    std::vector<LabelledRow> rows;
    std::vector<double> errors(4000);
    for (double& error : errors) error = normal(random);
    EXPECT_NEAR(stated_sd(errors_of(errors, rows, 1), 5), 1, 0.06);
    for (std::size_t i = 0; i < errors.size(); i += 50) errors[i] = 7;      // 2 %
    EXPECT_NEAR(stated_sd(errors_of(errors, rows, 1), 5), 7 / 2.576, 0.3);  // their 99 % quantile
    for (double& error : errors) error = normal(random);
    for (std::size_t i = 3000; i < 4000; ++i) errors[i] += 2;  // one session in four
    const double of_sessions = stated_sd(errors_of(errors, rows, 4), 5);
    EXPECT_GT(of_sessions, std::sqrt(5.0) * 0.95);
    errors.resize(12);
    for (double& error : errors) error = 1;
    EXPECT_NEAR(stated_sd(errors_of(errors, rows, 1), 5), 1 + 0.5 / 10 + 0.25 / 100,
                1e-3);  // Student: 12 loads, 2 coefficients
    errors.resize(7);
    EXPECT_THROW((void)stated_sd(errors_of(errors, rows, 1), 5), std::out_of_range);
}

// ---- networks ----

Labelled waves(int rows, double noise_sd, unsigned seed, bool bent) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> noise(0, noise_sd);
    Labelled labelled;
    labelled.name = "waves.csv";
    labelled.channels = {"A", "B", "C"};
    for (int i = 0; i < rows; ++i) {
        const double fx = uniform(random), fz = uniform(random), b = bent ? 0.3 : 0;
        labelled.rows.push_back({.line = i + 2,
                                 .channel = {fx + b * fz * fz + noise(random), fz + b * fx * fz + noise(random),
                                             0.5 * fx - fz + b * std::sin(3 * fx) + noise(random)},
                                 .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN}});
    }
    return labelled;
}

TEST(Mlp, NoRandomStartEndsAtZeroOrAboveItsAffinePart) {
    const Labelled seen = waves(900, 3e-3, 1, true), unseen = waves(500, 3e-3, 2, true);
    Rows rows, others;
    for (const auto& row : seen.rows) rows.push_back(&row);
    for (const auto& row : unseen.rows) others.push_back(&row);
    for (int seed = 1; seed <= 25; ++seed) {
        Calibration calibration;
        calibration.model = "generic";
        calibration.method = "mlp";
        calibration.path = "mlp.toml";
        calibration.channels = seen.channels;
        calibration.components = {"fx", "fz"};
        calibration.parameters = {{"seed", double(seed)}};
        set_domain(rows, calibration);
        std::vector<std::string> warnings;
        find_fit("generic", "mlp")->fit(rows, calibration, warnings);
        for (const auto& output : calibration.tables.at("layer2"))
            EXPECT_TRUE(std::any_of(output.begin() + 1, output.end(), [](double w) { return w != 0; })) << seed;
        Calibration part = calibration;
        part.method = "matrix";
        const Wrench error = rms_error(calibration, others), before = rms_error(part, others);
        for (const std::size_t c : {0u, 2u}) EXPECT_LT(error[c], 0.3 * before[c]) << seed;
    }
}

TEST(Mlp, IsRefusedWhereItGainsNothingOrHasMoreWeightsThanRows) {
    EXPECT_NE(refusal(waves(900, 3e-3, 1, false), by("mlp")).find("method mlp gains nothing"), std::string::npos);
    Labelled poses = waves(47 * 20, 1e-3, 1, true);
    for (std::size_t i = 0; i < poses.rows.size(); ++i)
        poses.rows[i] = poses.rows[i / 20 * 20], poses.rows[i].line = std::int64_t(i) + 2;
    EXPECT_NE(refusal(poses, by("mlp")).find("47 independent rows for the 20 weights"), std::string::npos)
        << refusal(poses, by("mlp"));
}

TEST(Auto, PutsTheLeastHeldOutErrorFirst) {
    const FitReport report = fit(waves(900, 3e-3, 1, true), by("auto"));
    double before = inaccuracy(report.calibration);
    EXPECT_EQ(report.calibration.held_out_rms.size(), 2u);
    for (const Fit& other : report.calibration.others) {
        const double next = inaccuracy(report.calibration.with_method(other.method));
        EXPECT_LE(before, next);
        before = next;
    }
    const auto rms = [&](const Fit& fit) {
        return fit.held_out_rms[0] / report.calibration.full_scale[0] +
               fit.held_out_rms[1] / report.calibration.full_scale[1];
    };
    EXPECT_NEAR(inaccuracy(report.calibration), rms(report.calibration) / 2, 1e-12);
}

// ---- input ----

TEST(Input, RowsAtSaturationLimitsStayOut) {
    Labelled labelled = waves(300, 3e-3, 1, false);
    for (std::size_t i = 0; i < 12; ++i) labelled.rows[20 * i].channel[1] = i % 2 == 0 ? 3.3 : -3.3;
    FitRequest request = by("matrix");
    request.saturates_above = 3.3;
    request.saturates_below = -3.3;
    const FitReport report = fit(labelled, request);
    EXPECT_EQ(report.rows_saturated, 12);
    EXPECT_EQ(report.calibration.rows, 288);
    EXPECT_LT(report.calibration.channel_most[1], 1.1);
    request.saturates_above = -3.3;
    EXPECT_NE(refusal(labelled, request).find("at a saturation limit"), std::string::npos);
}

TEST(Input, OddLabelsAndReadingsAreNamed) {
    Labelled labelled = waves(300, 3e-3, 1, false);
    EXPECT_FALSE(warns(fit(labelled, by("matrix")), "fz_N is never negative"));
    Labelled positive = labelled;
    for (auto& row : positive.rows) row.wrench_S[2] += 1.001;
    EXPECT_TRUE(warns(fit(positive, by("matrix")), "fz_N is never negative"));
    Labelled tiny = labelled, huge = labelled, far = labelled;
    for (auto& row : tiny.rows) row.wrench_S[0] *= 1e-300;
    EXPECT_NE(refusal(tiny, by("matrix")).find("e-301 at most, which no reference measures"), std::string::npos)
        << refusal(tiny, by("matrix"));
    huge.rows[7].channel[1] = 1e170;
    EXPECT_NE(refusal(huge, by("matrix")).find("waves.csv:9: channel B is 1e+170"), std::string::npos)
        << refusal(huge, by("matrix"));
    far.rows[7].wrench_S[2] = 1e200;
    EXPECT_NE(refusal(far, by("matrix")).find("waves.csv:9: fz_N is 1e+200"), std::string::npos);
}

TEST(Input, TimesBeforeZeroKeepTheirDistances) {
    const ScratchFile file("t_s,A,fz_N\n-2.5,1,-1\n-1.25,2,-2\n0,3,-3\n1,4,-4\n");
    const Labelled labelled = read_labelled(file.path(), {});
    EXPECT_EQ(labelled.rows[1].t_ns - labelled.rows[0].t_ns, 1250000000u);
    EXPECT_EQ(labelled.rows[3].t_ns - labelled.rows[0].t_ns, 3500000000u);
    EXPECT_GT(labelled.rows[0].t_ns, 0u);
}

}  // namespace
}  // namespace tactiled
