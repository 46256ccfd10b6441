#include "decoupling/auto_method.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "decoupling/solve/play_hysteresis.hpp"
#include "made_by_hand.hpp"

namespace tactiled {
namespace {

// Methods "linear" and "nonlinear" of a table sensor; the latter is more accurate and has a memory.
Calibration with_hysteresis() {
    Calibration calibration = table_calibration(inner_gauges());
    calibration.full_scale = {1, 1, 2};
    Fit nonlinear = calibration;
    nonlinear.method = "nonlinear";
    nonlinear.sd = {0.002, 0.002, 0.004};
    nonlinear.tables["hysteresis"] = {{0, 1, 1, 1}, {0.1, 0.05, 0.05, 0.05}, {0.3, 0.1, 0.1, 0.1}};
    calibration.others = {nonlinear};
    return calibration;
}

std::vector<double> press(double N) { return {kNormal_per_N * N, kNormal_per_N * N, kNormal_per_N * N, kNormal_per_N * N}; }

std::unique_ptr<AutoMethod> automatic(const Calibration& calibration, double budget_us, std::vector<MethodCost> costs) {
    DecouplerFault fault;
    auto made = make_auto_method(calibration, budget_us, costs, fault);
    EXPECT_EQ(fault.text, "");
    return made;
}

std::vector<std::string> names(const AutoMethod& made) {
    std::vector<std::string> all;
    for (const auto& each : made.front()) all.push_back(each.cost.method);
    return all;
}

using Names = std::vector<std::string>;

TEST(AutoMethod, TakesTheFrontOfAccuracyAgainstTheCostsThatWereKept) {
    const Calibration calibration = with_hysteresis();
    const auto two = automatic(calibration, 10, {{"linear", 1}, {"nonlinear", 5}});
    EXPECT_EQ(names(*two), (Names{"nonlinear", "linear"}));
    EXPECT_EQ(two->method(), "nonlinear");
    EXPECT_EQ(automatic(calibration, 4, {{"linear", 1}, {"nonlinear", 5}})->method(), "linear");
    // Less accurate, and saves next to nothing.
    EXPECT_EQ(names(*automatic(calibration, 10, {{"linear", 4.5}, {"nonlinear", 5}})), Names{"nonlinear"});
}

TEST(AutoMethod, MeasuresWhatWasNotKeptOrIsNoTime) {
    const Calibration calibration = with_hysteresis();
    DecouplerFault fault;
    for (const std::vector<MethodCost>& kept : {std::vector<MethodCost>{}, std::vector<MethodCost>{{"linear", 1}},
                                                std::vector<MethodCost>{{"linear", 1}, {"nonlinear", kNaN}}}) {
        std::vector<MethodCost> costs = kept;
        ASSERT_NE(make_auto_method(calibration, 10, costs, fault), nullptr);
        ASSERT_EQ(costs.size(), 2u);
        for (const auto& each : costs) EXPECT_GT(each.us, 0) << each.method;
    }
}

TEST(AutoMethod, AMethodWithoutAStandardDeviationIsNotTakenWhereAnotherHasOne) {
    Calibration calibration = with_hysteresis();
    calibration.others[0].sd.clear();
    EXPECT_EQ(names(*automatic(calibration, 10, {{"linear", 5}, {"nonlinear", 1}})), Names{"linear"});
}

void step_down(AutoMethod& made) {
    for (unsigned i = 0; i <= MethodChoice::kMaxOver; ++i) made.took(1'000'000, 1000 + i);
}

void step_up(AutoMethod& made) {
    for (unsigned i = 0; i <= MethodChoice::kWindow * 2; ++i) made.took(1, 2000 + i * MethodChoice::kCalmNs / 64);
}

// The method has missed the load meanwhile: its values may be wrong by the width of the loop.
TEST(AutoMethod, AMethodThatRemembersSaysAtItsReturnThatItDoesNotKnowThePast) {
    const auto made = automatic(with_hysteresis(), 10, {{"linear", 1}, {"nonlinear", 5}});
    EXPECT_EQ(decouple(*made, press(0.5)).quality(), TACTILED_GOOD);
    step_down(*made);
    ASSERT_EQ(made->method(), "linear");
    EXPECT_EQ(decouple(*made, press(2)).quality(), TACTILED_GOOD);
    step_up(*made);
    ASSERT_EQ(made->method(), "nonlinear");
    const Estimate back = decouple(*made, press(0.5));
    EXPECT_EQ(back.quality(), TACTILED_UNCERTAIN);
    EXPECT_EQ(back.reasons, std::uint32_t{TACTILED_UNKNOWN_UNCERTAINTY});
    EXPECT_TRUE(std::isnan(back.sd[2]));
    // It is settled when every component has swung by twice the widest play operator.
    const double t = 2 * kTangential_per_N;
    (void)decouple(*made, {t, t, -t, -t});
    (void)decouple(*made, press(2));
    EXPECT_EQ(decouple(*made, press(0.5)).quality(), TACTILED_GOOD);
}

TEST(PlayHysteresis, IsSettledFromWhereAnyPastWouldGiveTheSame) {
    PlayOperators plays;
    plays.n = 3;
    plays.threshold = {0, 0.1, 0.4};
    plays.weight = {1, 0.2, 0.3};
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> unit(-1, 1);
    for (int trial = 0; trial < 300; ++trial) {
        PlayState knows, forgot;
        for (int i = 0; i < 20; ++i) (void)knows.next(plays, unit(random));
        (void)forgot.next(plays, unit(random));
        forgot.forget();
        double x = unit(random);
        int settled = 0;
        for (int i = 0; i < 200; ++i) {
            x = std::clamp(x + 0.1 * unit(random), -1.0, 1.0);
            const double truly = knows.next(plays, x), found = forgot.next(plays, x);
            if (!forgot.is_settled()) continue;
            ++settled;
            ASSERT_EQ(found, truly);
        }
        EXPECT_TRUE(knows.is_settled());
    }
}

}  // namespace
}  // namespace tactiled
