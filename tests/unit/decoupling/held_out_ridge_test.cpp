// The errors of ridges on rows that are left out, beside a direct computation; which ridge is taken.
#include "decoupling/fit/row_sums.hpp"

#include <gtest/gtest.h>

#include <random>

namespace tactiled {
namespace {

constexpr Eigen::Index kChannels = 2;
const std::vector<double> kRidges = {1e-6, 1e-2};

// Sessions of two channels and one component whose residual is curved; the last session goes beyond the others, and each
// has a gain of its own.
struct Recording {
    std::vector<LabelledRow> rows;
    Scaled scaled;
    Rows pointers;

    explicit Recording(std::size_t sessions, std::size_t copies = 1) {
        std::mt19937_64 random(3);
        std::uniform_real_distribution<double> uniform(-1, 1);
        const auto n = Eigen::Index(sessions * 40 * copies);
        scaled.u.resize(n, kChannels);
        scaled.component.resize(1);
        scaled.component[0].y.resize(n);
        Eigen::Index at = 0;
        for (std::size_t s = 0; s < sessions; ++s)
            for (std::size_t i = 0; i < 40; ++i) {
                const double size = s + 1 == sessions ? 2 : 1, u = size * uniform(random), v = size * uniform(random);
                for (std::size_t copy = 0; copy < copies; ++copy, ++at) {
                    scaled.u.row(at) << u + 0.01 * uniform(random), v;
                    scaled.component[0].rows.push_back(at);
                    scaled.component[0].y[at] = (0.3 + 0.05 * double(s)) * u * u - 0.2 * u * v + 0.02 * uniform(random);
                    LabelledRow row{
                        .line = std::int64_t(s * 40 + i + 2), .channel = {u, v}, .wrench_S = kUnseen, .session = s};
                    row.wrench_S[2] = scaled.component[0].y[at];
                    rows.push_back(std::move(row));
                }
            }
        for (const LabelledRow& row : rows) pointers.push_back(&row);
    }
};

// The errors of rows [begin, end) with coefficients of the others, solved with their own QR decomposition.
struct Direct {
    double none = 0;
    std::vector<double> smooth, as_read;
};

Direct direct(const Recording& made, Eigen::Index begin, Eigen::Index end) {
    const Eigen::MatrixXd y = units_left(made.scaled);
    const Eigen::Index n = y.rows(), others = n - (end - begin);
    Eigen::MatrixXd u(others, kChannels), left(others, 1);
    u << made.scaled.u.topRows(begin), made.scaled.u.bottomRows(n - end);
    left << y.topRows(begin), y.bottomRows(n - end);
    const auto line = [](const Eigen::MatrixXd& at) {
        Eigen::MatrixXd features(at.rows(), 1 + kChannels);
        features << Eigen::VectorXd::Ones(at.rows()), at;
        return features;
    };
    const Eigen::MatrixXd matrix = line(u).colPivHouseholderQr().solve(left);
    const Eigen::MatrixXd residual = left - line(u) * matrix, features = quadratic_features(u);
    const Eigen::MatrixXd own = made.scaled.u.middleRows(begin, end - begin);
    const Eigen::RowVectorXd least = u.colwise().minCoeff(), most = u.colwise().maxCoeff();
    Eigen::MatrixXd clamped = own;
    for (Eigen::Index i = 0; i < own.rows(); ++i) clamped.row(i) = own.row(i).cwiseMax(least).cwiseMin(most);
    const Eigen::MatrixXd after_matrix = y.middleRows(begin, end - begin) - line(own) * matrix;
    Direct result{.none = after_matrix.squaredNorm(), .smooth = {}, .as_read = {}};
    for (const double ridge : kRidges) {
        Eigen::MatrixXd stacked(others + features.cols(), features.cols()), right(stacked.rows(), 1);
        stacked << features, std::sqrt(ridge * double(others)) * Eigen::MatrixXd::Identity(features.cols(), features.cols());
        right << residual, Eigen::VectorXd::Zero(features.cols());
        const Eigen::MatrixXd solved = stacked.colPivHouseholderQr().solve(right);
        result.smooth.push_back((after_matrix - quadratic_features(own) * solved).squaredNorm());
        result.as_read.push_back((after_matrix - quadratic_features(clamped) * solved).squaredNorm());
    }
    return result;
}

// Sums over the blocks of one part.
void expect_near(const HeldOutErrors& errors, const Recording& made, std::size_t parts) {
    const Eigen::Index rows = Eigen::Index(made.rows.size()) / Eigen::Index(parts);
    const Eigen::Index blocks = errors.smooth.rows() / Eigen::Index(parts), none = Eigen::Index(kRidges.size());
    for (std::size_t part = 0; part < parts; ++part) {
        const Direct expected = direct(made, Eigen::Index(part) * rows, Eigen::Index(part + 1) * rows);
        const auto sum = [&](const BlockErrors& of, Eigen::Index column) {
            return of.col(column).segment(Eigen::Index(part) * blocks, blocks).sum();
        };
        EXPECT_NEAR(sum(errors.smooth, none), expected.none, 1e-6 * expected.none) << part;
        EXPECT_NEAR(sum(errors.as_read, none), expected.none, 1e-6 * expected.none) << part;
        for (Eigen::Index r = 0; r < none; ++r) {
            EXPECT_NEAR(sum(errors.smooth, r), expected.smooth[std::size_t(r)], 1e-5 * expected.none) << part;
            EXPECT_NEAR(sum(errors.as_read, r), expected.as_read[std::size_t(r)], 1e-5 * expected.none) << part;
        }
    }
}

TEST(HeldOutRidge, EachSessionIsJudgedByTheOthersAlone) {
    const Recording made(4);
    const auto errors = held_out_errors(RowSums(made.pointers, made.scaled, quadratic_features), kRidges);
    ASSERT_EQ(errors.size(), 1u);
    expect_near(errors.front(), made, 4);
    // The last session is beyond the others, so that it differs.
    const Direct last = direct(made, 120, 160);
    EXPECT_GT(std::abs(last.smooth[0] - last.as_read[0]), 0.01 * last.none);
}

TEST(HeldOutRidge, CopiesOfARowAreLeftOutTogether) {
    const Recording made(4, 3);
    expect_near(held_out_errors(RowSums(made.pointers, made.scaled, quadratic_features), kRidges).front(), made, 4);
}

// ---- which ridge is taken
// --------------------------------------------------------------------------------------------------

// 25 blocks: the error of each ridge in each, and 1 without a correction.
BlockErrors blocks(const std::vector<std::function<double(int)>>& of_ridge) {
    BlockErrors errors(25, Eigen::Index(of_ridge.size()) + 1);
    for (int i = 0; i < 25; ++i) {
        for (std::size_t r = 0; r < of_ridge.size(); ++r) errors(i, Eigen::Index(r)) = of_ridge[r](i);
        errors(i, Eigen::Index(of_ridge.size())) = 1;
    }
    return errors;
}
double everywhere_half(int) { return 0.5; }
double a_little(int i) { return 0.95 + 0.01 * (i % 2); }
double once(int i) { return i == 7 ? 0.0001 : 1.0 - 0.1 * (i % 2) + 0.1 * ((i + 1) % 2); }
double worse(int i) { return 1.2 + 0.1 * (i % 2); }

TEST(HeldOutRidge, GainsByFivePercentAndMoreThanChance) {
    EXPECT_TRUE(gains(blocks({everywhere_half}), 0));
    EXPECT_FALSE(gains(blocks({a_little}), 0));  // two squares of 5 % are 9.75 %
    const BlockErrors by_chance = blocks({[](int i) { return i % 6 == 0 && i < 24 ? 0.05 : 1.05; }});
    EXPECT_LT(by_chance.col(0).sum(), 0.9 * 25);
    EXPECT_FALSE(gains(by_chance, 0));
    EXPECT_FALSE(gains(blocks({once}), 0));
    EXPECT_FALSE(gains(blocks({worse}), 0));
}

// The differences of 24 blocks are hidden by one with a hundred times their error.
TEST(HeldOutRidge, GainsByRatiosWhereOneBlockHidesTheRest) {
    BlockErrors errors = blocks({[](int i) { return 0.3 + 0.02 * (i % 3); }});
    errors.row(3) *= 100;
    errors(3, 0) = 60;
    EXPECT_TRUE(gains(errors, 0));
}

TEST(HeldOutRidge, TheBestOneIsSmoothAndNotWorseAsRead) {
    const BlockErrors smooth = blocks({[](int) { return 0.2; }, [](int) { return 0.4; }, everywhere_half});
    // The first one is worse than none as it is read outside the domain of the others.
    const BlockErrors as_read = blocks({worse, [](int) { return 0.8; }, [](int) { return 0.7; }});
    EXPECT_EQ(best_ridge({.as_read = as_read, .smooth = smooth}), 1u);
    EXPECT_EQ(best_ridge({.as_read = as_read, .smooth = blocks({worse, worse, worse})}), 2u);  // the least as read
    EXPECT_EQ(best_ridge({.as_read = blocks({worse, worse, worse}), .smooth = smooth}), 3u);
    EXPECT_EQ(best_ridge({.as_read = blocks({a_little, a_little, worse}), .smooth = blocks({a_little, once, worse})}), 3u);
}

}  // namespace
}  // namespace tactiled
