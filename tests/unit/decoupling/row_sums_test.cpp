// Sums over rows: those of any part of the rows, beside sums of these rows alone.
#include "decoupling/fit/row_sums.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "decoupling/fit/gram.hpp"

namespace tactiled {
namespace {

// 600 rows of two channels with a label of fx and, except in each third row, one of fz.
struct Recording {
    std::vector<LabelledRow> rows;
    Scaled scaled{.u = Eigen::MatrixXd(600, 2), .component = std::vector<Leftover>(2)};
    Rows pointers;

    Recording() {
        std::mt19937_64 random(5);
        std::normal_distribution<double> normal(0, 1);
        std::vector<double> y[2];
        for (Eigen::Index i = 0; i < 600; ++i) {
            LabelledRow row{.line = i + 2, .channel = {normal(random), normal(random)}, .wrench_S = kUnseen};
            row.t_ns = std::uint64_t(i + 1) * 1'000'000;
            scaled.u.row(i) << row.channel[0], row.channel[1];
            for (std::size_t c : {0u, 1u}) {
                if (c == 1 && i % 3 == 0) continue;
                row.wrench_S[2 * c] = row.channel[c] * row.channel[c] + normal(random);
                scaled.component[c].rows.push_back(i);
                y[c].push_back(row.wrench_S[2 * c]);
            }
            rows.push_back(std::move(row));
        }
        for (std::size_t c : {0u, 1u})
            scaled.component[c].y = Eigen::Map<Eigen::VectorXd>(y[c].data(), Eigen::Index(y[c].size()));
        for (const LabelledRow& row : rows) pointers.push_back(&row);
    }
    [[nodiscard]] RowSums sums() const { return {pointers, scaled, quadratic_features}; }
};

void expect_sums_of(const RowSums::Places& places, const Normal& normal, const Recording& made) {
    const Eigen::MatrixXd features = quadratic_features(made.scaled.u(places, Eigen::all));
    const Eigen::MatrixXd y = units_left(made.scaled)(places, Eigen::all);
    const Eigen::MatrixXd gram = features.transpose() * features;
    EXPECT_EQ(normal.rows, double(places.size()));
    EXPECT_LE((gram - normal.gram).triangularView<Eigen::Lower>().toDenseMatrix().cwiseAbs().maxCoeff(),
              1e-9 * gram.maxCoeff());
    EXPECT_LT((features.transpose() * y - normal.feature_y).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(RowSums, AreThoseOfAnyPart) {
    const Recording made;
    const RowSums sums = made.sums();
    for (const Eigen::Index every : {1, 2, 7, 50})
        for (const bool others : {false, true}) {
            RowSums::Places places;
            for (Eigen::Index i = 0; i < 600; ++i)
                if ((i % every == 0) != others) places.push_back(i);
            expect_sums_of(places, sums.of(places), made);
        }
    RowSums::Places begin(400), end(200);  // the last third of the time, and what is before
    std::iota(begin.begin(), begin.end(), 0);
    std::iota(end.begin(), end.end(), 400);
    expect_sums_of(begin, sums.of(begin), made);
    expect_sums_of(end, sums.of(end), made);
    Normal less = sums.of(begin);
    sums.take_out({3, 4, 399}, less);
    begin.erase(begin.begin() + 399);
    begin.erase(begin.begin() + 3, begin.begin() + 5);
    expect_sums_of(begin, less, made);
}

TEST(RowSums, FindRowsByTheirContents) {
    const Recording made;
    const RowSums sums = made.sums();
    Recording again;
    Rows some;
    RowSums::Places expected;
    for (std::size_t i = 5; i < 600; i += 4) {
        some.push_back(&again.rows[i]);
        expected.push_back(Eigen::Index(i));
    }
    ASSERT_TRUE(sums.places_of(some));
    EXPECT_EQ(*sums.places_of(some), expected);
    again.rows[9].wrench_S[0] = kNaN;  // a label that was taken off
    EXPECT_TRUE(sums.places_of(some));
    again.rows[9].wrench_S[0] = 3;  // another label
    EXPECT_FALSE(sums.places_of(some));
    again.rows[9] = made.rows[9];
    again.rows[13].channel[1] += 1e-9;
    EXPECT_FALSE(sums.places_of(some));
}

// ---- Gram matrices and their solutions, beside Eigen's: with AVX2 they have their own code

// Sizes beside and on the borders of tiles of 12 x 4, panels of 256 rows and blocks of 128 columns.
constexpr Eigen::Index kGramRows[] = {1, 255, 256, 700}, kGramColumns[] = {1, 4, 11, 12, 13, 127, 128, 150, 300};

TEST(Gram, IsTheProductOfTheFeatures) {
    for (const Eigen::Index n : kGramRows)
        for (const Eigen::Index m : kGramColumns) {
            const Eigen::MatrixXd features = Eigen::MatrixXd::Random(n, m), before = Eigen::MatrixXd::Random(m, m);
            for (const double sign : {1.0, -1.0}) {
                Eigen::MatrixXd gram = before;
                add_gram(features, sign, gram);
                const Eigen::MatrixXd off = gram - before - sign * features.transpose() * features;
                EXPECT_LT(off.triangularView<Eigen::Lower>().toDenseMatrix().cwiseAbs().maxCoeff(), 1e-12 * double(n + 10))
                    << n << " x " << m;
            }
        }
}

TEST(Gram, SolutionsFulfilTheirEquations) {
    for (const Eigen::Index m : kGramColumns) {
        const Eigen::MatrixXd features = Eigen::MatrixXd::Random(3 * m, m), right = Eigen::MatrixXd::Random(m, 3);
        const Eigen::MatrixXd gram = features.transpose() * features;
        Eigen::MatrixXd lower = gram;
        lower.triangularView<Eigen::StrictlyUpper>().setConstant(kNaN);  // not read
        const Eigen::MatrixXd x = solve_gram(lower, right);
        EXPECT_LT((gram * x - right).cwiseAbs().maxCoeff(), 1e-10) << m;
    }
}

// A product of rank 2: rounding decides whether it has a factor.
TEST(Gram, HasAFiniteSolutionWithoutAFactor) {
    const Eigen::MatrixXd features = Eigen::MatrixXd::Random(2, 200);
    const Eigen::MatrixXd gram = features.transpose() * features;
    EXPECT_TRUE(solve_gram(gram, gram.col(0)).allFinite());
    Eigen::MatrixXd negative = Eigen::MatrixXd::Identity(200, 200);
    negative(150, 150) = -2;
    const Eigen::VectorXd right = Eigen::VectorXd::Ones(200);
    EXPECT_NEAR(solve_gram(negative, right)(150, 0), -0.5, 1e-12);
}

}  // namespace
}  // namespace tactiled
