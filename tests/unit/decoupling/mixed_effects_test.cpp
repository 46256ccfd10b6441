// The regression with mixed effects: against least squares by hand, from far starts, and with zeros that are known.
#include "decoupling/fit/mixed_effects.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "recordings.hpp"

namespace tactiled {
namespace {

struct Made {
    OneChannel channel;
    std::vector<double> zero;
};

// Two loads; every fiftieth reading is far off.
Made made(unsigned seed, std::size_t sessions, double noise, double bend) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Made made{.channel = {.reading = {}, .load = {}, .session = {}, .sessions = sessions}, .zero = {}};
    for (std::size_t s = 0; s < sessions; ++s) {
        made.zero.push_back(0.03 * normal(random));
        for (int i = 0; i < 150; ++i) {
            const double x = i % 5 == 0 ? 0 : uniform(random), y = i % 5 == 0 ? 0 : uniform(random);
            made.channel.reading.push_back(0.1 + made.zero[s] + 0.3 * x - 0.2 * y + bend * x * x + noise * normal(random) +
                                           (i % 50 == 7 ? 0.5 : 0));
            made.channel.load.push_back({x, 0, y, 0, 0, 0});
            made.channel.session.push_back(s);
        }
    }
    return made;
}

// Weighted least squares in the same variances, until the weights of Cauchy's loss no longer change. Returns zero, gains of
// the two loads, and the zeros of the sessions.
Eigen::VectorXd by_hand(const OneChannel& channel, const OneFit& fit) {
    const auto n = Eigen::Index(channel.reading.size()), m = Eigen::Index(3 + channel.sessions);
    Eigen::MatrixXd x = Eigen::MatrixXd::Zero(n, m);
    Eigen::VectorXd y(n), sd(n), solution = Eigen::VectorXd::Zero(m);
    for (Eigen::Index i = 0; i < n; ++i) {
        const auto& load = channel.load[std::size_t(i)];
        x.row(i).head(3) << 1, load[0], load[2];
        x(i, Eigen::Index(3 + channel.session[std::size_t(i)])) = 1;
        y[i] = channel.reading[std::size_t(i)];
        sd[i] = std::hypot(fit.noise, fit.bend * std::max(std::abs(load[0]), std::abs(load[2])));
    }
    for (int round = 0; round < 500; ++round) {
        const Eigen::ArrayXd z = (y - x * solution).array() / sd.array();
        const Eigen::ArrayXd weight = 1 / (1 + z.square() / (kCauchyEfficient * kCauchyEfficient)) / sd.array().square();
        Eigen::MatrixXd normal = x.transpose() * (x.array().colwise() * weight).matrix();
        normal.diagonal().tail(m - 3).array() += 1 / (fit.between * fit.between);
        normal.diagonal().head(3).array() += 1e-6;
        solution = dense::solve_by_ldlt(normal, x.transpose() * (weight * y.array()).matrix());
    }
    return solution;
}

TEST(MixedEffects, AgreeWithIterativeLeastSquares) {
    for (unsigned seed = 1; seed <= 5; ++seed) {
        const Made made_here = made(seed, 4, 0.005, 0.05);
        const OneFit fit = fit_one_channel(made_here.channel);
        const Eigen::VectorXd expected = by_hand(made_here.channel, fit);
        EXPECT_NEAR(fit.common[0], expected[0], 1e-5);
        EXPECT_NEAR(fit.common[1], expected[1], 1e-5);
        EXPECT_NEAR(fit.common[3], expected[2], 1e-5);
        for (std::size_t s = 0; s < 4; ++s) EXPECT_NEAR(fit.session_zero[s], expected[Eigen::Index(3 + s)], 1e-5) << s;
    }
}

TEST(MixedEffects, AreFoundFromFarStarts) {
    const Made made_here = made(7, 6, 0.005, 0.05);
    const OneFit convex = fit_one_channel(made_here.channel);
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal(0, 100);  // widths of the channel
    for (int trial = 0; trial < 100; ++trial) {
        std::vector<double> start(7 + 6);
        for (double& each : start) each = normal(random);
        const OneFit fit = fit_one_channel(made_here.channel, start);
        for (std::size_t i = 0; i < 7; ++i) EXPECT_NEAR(fit.common[i], convex.common[i], 1e-4) << trial << ' ' << i;
        for (std::size_t s = 0; s < 6; ++s) EXPECT_NEAR(fit.session_zero[s], convex.session_zero[s], 1e-4) << trial;
    }
}

// Rows at rest determine the zeros where the sensor bends, and readings that are far off do not move them.
TEST(MixedEffects, ZerosOfSessionsAreThoseThatWereMade) {
    for (const double bend : {0.0, 0.2}) {
        const Made made_here = made(3, 8, 0.003, bend);
        const OneFit fit = fit_one_channel(made_here.channel);
        double mean = 0, squares = 0;
        for (std::size_t s = 0; s < 8; ++s) mean += (fit.session_zero[s] - made_here.zero[s]) / 8;
        for (std::size_t s = 0; s < 8; ++s) squares += std::pow(fit.session_zero[s] - made_here.zero[s] - mean, 2) / 8;
        EXPECT_LT(std::sqrt(squares), 0.003) << bend;
        EXPECT_NEAR(fit.noise, 0.003, 0.002) << bend;
        EXPECT_GT(fit.between, 0.01);
        EXPECT_LT(fit.between, 0.06);
    }
}

}  // namespace
}  // namespace tactiled
