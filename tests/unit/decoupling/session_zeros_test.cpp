// Sessions with their own zeros, and zeros that drift in use.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "decoupling/decoupler.hpp"
#include "decoupling/fit/fit.hpp"
#include "made_by_hand.hpp"
#include "recordings.hpp"

namespace tactiled {
namespace {

TEST(SessionZeros, AreFoundWhereEachPlacementHasItsOwn) {
    for (unsigned seed = 1; seed <= 10; ++seed) {
        const Labelled labelled = Cell(seed).recording(3, 2, 0.03, 3e-4);
        const FitReport report = fit(labelled, by("matrix"));
        EXPECT_TRUE(report.zeros.own) << seed;
        EXPECT_LT(percent_of_full_scale(report), 0.15) << seed;
        EXPECT_TRUE(warns(report, "each session has its own zero"));
        EXPECT_TRUE(has_way(report, "leave one session out (3 sessions)"));
        EXPECT_TRUE(report.calibration.validation.ends_with(Calibration::kOwnZeros));
        EXPECT_TRUE(report.suspects.empty());
        FitRequest one = by("matrix");
        one.zeros = FitRequest::Zeros::common;
        EXPECT_GT(percent_of_full_scale(fit(labelled, one)), 1) << seed;
        EXPECT_FALSE(fit(Cell(seed).recording(3, 2, 0, 3e-4), by("matrix")).zeros.own) << seed;
    }
}

// A tare takes the zero off the force: where a bent sensor is read from another zero, the load is another one then, and
// the standard deviation contains that.
TEST(SessionZeros, AreInTheStandardDeviationOfAMethodThatIsNotStraight) {
    std::mt19937_64 random(3);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Labelled labelled;
    labelled.name = "bent.csv";
    labelled.channels = {"A", "B"};
    labelled.sessions = {"a", "b", "c"};
    const double zero[3][2] = {{0, 0}, {0.4, -0.3}, {-0.4, 0.3}};
    for (int i = 0; i < 900; ++i) {
        const std::size_t session = std::size_t(i) / 300;
        const double fx = i % 20 == 0 ? 0 : uniform(random), fz = i % 20 == 0 ? 0 : uniform(random);
        const auto bent = [](double x) { return x + 0.1 * x * x; };
        labelled.rows.push_back({.line = i + 2,
                                 .channel = {zero[session][0] + bent(fx) + 1e-3 * normal(random),
                                             zero[session][1] + bent(fz) + 1e-3 * normal(random)},
                                 .wrench_S = {fx, kNaN, fz, kNaN, kNaN, kNaN},
                                 .session = session});
    }
    FitRequest request = by("quadratic");
    request.zeros = FitRequest::Zeros::per_session;
    const Calibration calibration = fit(labelled, request).calibration;
    EXPECT_TRUE(warns(fit(labelled, request), "a tare does not take the zeros of the sessions off entirely"));
    request.method = "matrix";
    EXPECT_FALSE(warns(fit(labelled, request), "a tare does not take"));
    const auto decoupler = make_decoupler(calibration);
    for (std::size_t session = 0; session < 3; ++session) {
        const Wrench rest = decoupler->decouple({.channel = zero[session]}).wrench_S;
        std::size_t beyond = 0;
        for (std::size_t i = 300 * session; i < 300 * (session + 1); ++i) {
            const LabelledRow& row = labelled.rows[i];
            const Estimate estimate = decoupler->decouple({.channel = row.channel});
            beyond += std::abs(estimate.wrench_S[0] - rest[0] - row.wrench_S[0]) > 5 * estimate.sd[0] ? 1 : 0;
        }
        EXPECT_LE(beyond, 1u) << session;
    }
}

// A session without one of the labels has no zero of its own; the others keep theirs.
TEST(SessionZeros, StandASessionWithoutALabel) {
    Labelled labelled = Cell(5).recording(4, 2, 0.03, 3e-4);
    for (LabelledRow& row : labelled.rows)
        if (row.session == 2) row.wrench_S[1] = kNaN;
    const FitReport report = fit(labelled, by("matrix"));
    EXPECT_TRUE(report.zeros.own);
    EXPECT_TRUE(report.zeros.offset[2].empty());
    EXPECT_FALSE(report.zeros.offset[3].empty());
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
    constexpr int kTrials = 400;  // 0.68 +- 0.023 of them are within one standard deviation
    const auto error_with_zeros = [&](const Calibration& calibration, double& beyond, double& within) {
        const auto decoupler = make_decoupler(calibration);
        double squares = 0;
        beyond = within = 0;
        for (int trial = 0; trial < kTrials; ++trial) {
            std::vector<double> zero(6);
            for (double& z : zero) z = 0.1 * normal(random);  // 1 % of a channel's width
            for (const auto& row : labelled.rows) {
                std::vector<double> channel = row.channel;
                for (std::size_t k = 0; k < 6; ++k) channel[k] += zero[k];
                const Estimate estimate = decouple(*decoupler, channel);
                const double error = estimate.wrench_S[2] - row.wrench_S[2];
                squares += error * error / (1000 * kTrials);
                beyond += std::abs(error) > 5 * estimate.sd[2] ? 1.0 / (1000 * kTrials) : 0;
                within += std::abs(error) <= estimate.sd[2] ? 1.0 / (1000 * kTrials) : 0;
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
    EXPECT_GT(within, 0.6);                                                             // share for the sets of zeros
    EXPECT_LT(calibration.sd[0], 1.5 * error_with_zeros(calibration, beyond, within));  // and no wider than that
    ASSERT_EQ(calibration.zero_drift.size(), 6u);
    EXPECT_NEAR(calibration.zero_drift[1], 0.1, 0.003);
}

}  // namespace
}  // namespace tactiled
