#include "decoupling/fit/taxel_gains.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

namespace tactiled {
namespace {

// Presses of a round body on a square array whose gains are 1 + error, with the places of all.
class TaxelGainsTest : public testing::Test {
protected:
    static constexpr int kSide = 10, kTaxels = kSide * kSide;
    static constexpr double kPitch_m = 2e-3, kForceError = 0.003, kPlaceError_m = 0.1e-3, kNoise_N = 2e-3, kSpread = 0.2;

    TaxelGainsTest() { begin(5); }
    // Another array.
    void begin(std::uint64_t seed) {
        random_.seed(seed);
        normal_.reset();
        error_.clear();
        for (int i = 0; i < kTaxels; ++i) error_.push_back(std::max(-0.6, kSpread * normal_(random_)));
        equations_ = EquationMaker(kTaxels);
        taken_ = {};
        n_presses_ = 0;
    }
    static double x(int i) { return (i % kSide) * kPitch_m; }
    static double y(int i) { return (i / kSide) * kPitch_m; }
    // Presses at places from `least` to `most` taxels along x.
    void press(int presses, double least = 0, double most = kSide - 1) {
        std::uniform_real_distribution<double> along_x(least, most), along_y(0, kSide - 1), load(2, 8);
        for (int k = 0; k < presses; ++k) {
            const double at_x = along_x(random_) * kPitch_m, at_y = along_y(random_) * kPitch_m, whole_N = load(random_);
            std::vector<double> force(kTaxels);
            double sum = 0;
            for (int i = 0; i < kTaxels; ++i)
                sum += force[std::size_t(i)] =
                    std::max(0., 1 - (std::pow(x(i) - at_x, 2) + std::pow(y(i) - at_y, 2)) / std::pow(1.5 * kPitch_m, 2));
            double moment_x = 0, moment_y = 0;
            for (int i = 0; i < kTaxels; ++i) {
                double& f = force[std::size_t(i)];
                f *= whole_N / sum;
                moment_x += f * x(i) / whole_N, moment_y += f * y(i) / whole_N;
                f = f / (1 + error_[std::size_t(i)]) + (f > 0 ? kNoise_N * normal_(random_) : 0);
            }
            const double place_x = moment_x + kPlaceError_m * normal_(random_),
                         place_y = moment_y + kPlaceError_m * normal_(random_);
            add(GainEquations::kForce, force, whole_N * (1 + kForceError * normal_(random_)), whole_N,
                [](int) { return 1.; });
            add(GainEquations::kPlace, force, 0, whole_N, [&](int i) { return x(i) - place_x; });
            add(GainEquations::kPlace, force, 0, whole_N, [&](int i) { return y(i) - place_y; });
            ++n_presses_;
        }
    }
    void add(std::size_t kind, const std::vector<double>& force, double right, double scale,
             const std::function<double(int)>& arm) {
        equations_.begin(kind, n_presses_);
        equations_.add_right(right, scale);
        for (int i = 0; i < kTaxels; ++i)
            if (const double f = force[std::size_t(i)]; f != 0)
                equations_.add_taxel(std::size_t(i), f * arm(i), std::pow(kNoise_N * arm(i), 2));
    }
    TaxelGains fit() {
        if (taken_.y.size() == 0) taken_ = equations_.take();
        TaxelGains gains(kTaxels);
        gains.fit(taken_);
        return gains;
    }
    // Error of the gain of taxel i over its sd.
    double of_sd(const TaxelGains& gains, int i) const { return (gains.gain[i] - 1 - error_[std::size_t(i)]) / gains.sd[i]; }
    double largest_of_sd(const TaxelGains& gains) const {
        double largest = 0;
        for (int i = 0; i < kTaxels; ++i) largest = std::max(largest, std::abs(of_sd(gains, i)));
        return largest;
    }
    static std::vector<int> far(const TaxelGains& gains) {
        std::vector<int> list;
        for (int i = 0; i < kTaxels; ++i)
            if (gains.is_far[std::size_t(i)] != 0) list.push_back(i);
        return list;
    }

    std::mt19937_64 random_{5};
    std::normal_distribution<double> normal_{0, 1};
    std::vector<double> error_;
    EquationMaker equations_{kTaxels};
    GainEquations taken_;
    std::size_t n_presses_ = 0;
};

// Eight arrays: the errors in one of them have a part in common.
TEST_F(TaxelGainsTest, FindsGainsWithinTheirSd) {
    constexpr int kArrays = 8;
    int within = 0;
    for (int array = 1; array <= kArrays; ++array) {
        begin(std::uint64_t(array));
        press(300);
        const TaxelGains gains = fit();
        for (int i = 0; i < kTaxels; ++i) within += std::abs(of_sd(gains, i)) <= 1 ? 1 : 0;
        EXPECT_LT(largest_of_sd(gains), 5);
    }
    EXPECT_GT(within, 60 * kArrays);
    EXPECT_LT(within, 76 * kArrays);
}

TEST_F(TaxelGainsTest, FindsSpreadsAndGains) {
    press(300);
    const TaxelGains gains = fit();
    double squares = 0;
    for (int i = 0; i < kTaxels; ++i) squares += std::pow(gains.gain[i] - 1 - error_[std::size_t(i)], 2) / kTaxels;
    EXPECT_LT(std::sqrt(squares), kSpread / 2);
    EXPECT_NEAR(gains.bulk_sd(), kSpread, 3 * kSpread / std::sqrt(2. * kTaxels) + 0.02);
    EXPECT_NEAR(gains.spread[GainEquations::kForce], kForceError, kForceError / 3);
    EXPECT_NEAR(gains.spread[GainEquations::kPlace], kPlaceError_m, kPlaceError_m / 3);
    EXPECT_EQ(far(gains), std::vector<int>{});
}

TEST_F(TaxelGainsTest, AFarGainIsNamedAndLeavesItsNeighboursAlone) {
    error_[44] = 2.3;
    press(300);
    const TaxelGains gains = fit();
    EXPECT_EQ(far(gains), std::vector<int>{44});
    EXPECT_LT(largest_of_sd(gains), 5);
}

// Column 9 is only beside the contacts, and one of its taxels is weak: with the variance that all taxels have in common, its
// error spreads over its neighbours.
TEST_F(TaxelGainsTest, AFarGainWithLittleLoadIsWithinItsSdAsAreItsNeighbours) {
    error_[59] = 2.3;
    press(200, 0, 8);
    const TaxelGains gains = fit();
    EXPECT_LT(largest_of_sd(gains), 5);
    EXPECT_GT(gains.sd[59], kSpread);
}

TEST_F(TaxelGainsTest, ATaxelWithoutALoadKeepsThePrior) {
    press(200, 0, 6);  // columns 8 and 9 are not touched
    const TaxelGains gains = fit();
    for (int row = 0; row < kSide; ++row) {
        const int i = row * kSide + 9;
        EXPECT_NEAR(gains.gain[i], 1, 0.3 * gains.bulk_sd());
        EXPECT_GT(gains.sd[i], gains.bulk_sd());
        EXPECT_LT(gains.sd[i], 4 * gains.bulk_sd());
        EXPECT_EQ(gains.is_far[std::size_t(i)], 0);
    }
}

TEST_F(TaxelGainsTest, IsTheSameEachTime) {
    press(100);
    EXPECT_TRUE(fit().gain == fit().gain);
}

TEST_F(TaxelGainsTest, PressesThatWereLeftOutAreWithinTheSd) {
    press(300);
    const TaxelGains gains = fit();
    EXPECT_NEAR(gains.hold_out(taken_).ratio2, 1, 0.3);
}

}  // namespace
}  // namespace tactiled
