// Changes of method by method "auto", in simulated time: a machine is a function from time to slowness.
#include "decoupling/method_choice.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <random>
#include <vector>

namespace tactiled {
namespace {

constexpr std::uint64_t kHour = MethodChoice::kHourNs;

// Samples on a machine: each takes `slowness(t_s, method)` times its expected cost; one timed sample each
// `period_ns`.
struct Machine {
    std::vector<double> us;
    double budget_us;
    std::uint64_t period_ns = 8'000'000;  // 1 kHz, one in eight
    MethodChoice choice{us, budget_us};
    std::uint64_t t_ns = 77 * kHour;  // uptime of the machine
    std::uint64_t timed = 0, over = 0;
    std::vector<std::uint64_t> steps_ns{};

    void until(std::uint64_t end_ns, const std::function<double(double, std::size_t)>& slowness) {
        for (; t_ns < end_ns; t_ns += period_ns) {
            const std::size_t before = choice.now();
            const double took_us = us[before] * slowness(double(t_ns) * 1e-9, before);
            over += took_us > budget_us ? 1 : 0;
            ++timed;
            choice.took(std::uint64_t(std::lround(1e3 * took_us)), t_ns);
            if (choice.now() != before) steps_ns.push_back(t_ns);
        }
    }
    void during(double seconds, const std::function<double(double, std::size_t)>& slowness) {
        until(t_ns + std::uint64_t(seconds * 1e9), slowness);
    }
    // Largest number of steps within any hour.
    [[nodiscard]] std::size_t busiest_hour() const {
        std::size_t max = 0, first = 0;
        for (std::size_t i = 0; i < steps_ns.size(); ++i) {
            while (steps_ns[i] - steps_ns[first] > kHour) ++first;
            max = std::max(max, i - first + 1);
        }
        return max;
    }
};

const auto steady = [](double slowness) { return [=](double, std::size_t) { return slowness; }; };

TEST(MethodChoice, BeginsWithTheMostAccurateWithinTheBudgetElseWithTheFastestAndSaysSo) {
    const std::vector<double> us{8, 2, 0.5};
    EXPECT_EQ(MethodChoice(us, 10).now(), 0u);
    EXPECT_EQ(MethodChoice(us, 8).now(), 0u);
    EXPECT_EQ(MethodChoice(us, 3).now(), 1u);
    EXPECT_FALSE(MethodChoice(us, 0.5).is_over_budget());
    EXPECT_EQ(MethodChoice(us, 0.1).now(), 2u);
    EXPECT_TRUE(MethodChoice(us, 0.1).is_over_budget());
}

TEST(MethodChoice, AHogIsOverBudgetForNineTimedSamplesAStepAndNoLonger) {
    Machine machine{.us = {8, 2, 0.5}, .budget_us = 10};
    machine.during(60, steady(1));
    EXPECT_EQ(machine.over, 0u);
    machine.during(60, steady(3));  // 24, 6, 1.5 us
    EXPECT_EQ(machine.choice.now(), 1u);
    EXPECT_EQ(machine.over, MethodChoice::kMaxOver + 1);
    machine.during(60, steady(10));  // 80, 20, 5 us
    EXPECT_EQ(machine.choice.now(), 2u);
    EXPECT_EQ(machine.over, 2 * (MethodChoice::kMaxOver + 1));
    EXPECT_EQ(machine.choice.steps(), 2u);
    EXPECT_FALSE(machine.choice.is_over_budget());
}

TEST(MethodChoice, SaysWhenTheFastestMissesTheBudgetAndWhenItNoLongerDoes) {
    Machine machine{.us = {8, 0.5}, .budget_us = 10};
    machine.during(1, steady(100));
    EXPECT_EQ(machine.choice.now(), 1u);
    EXPECT_TRUE(machine.choice.is_over_budget());
    machine.during(2, steady(1));
    EXPECT_FALSE(machine.choice.is_over_budget());
    EXPECT_EQ(machine.choice.steps(), 1u);
}

// Preemptions: 5 in 64 samples take a millisecond.
TEST(MethodChoice, APreemptionNowAndThenIsNoReason) {
    Machine machine{.us = {8, 2}, .budget_us = 10};
    std::uint64_t n = 0;
    machine.during(3600, [&](double, std::size_t) { return ++n % 13 == 0 ? 125.0 : 1.0; });
    EXPECT_EQ(machine.choice.steps(), 0u);
    EXPECT_EQ(machine.choice.now(), 0u);
}

TEST(MethodChoice, GoesBackUpAfterTenCalmSecondsAndNotSooner) {
    Machine machine{.us = {8, 2}, .budget_us = 10};
    machine.during(5, steady(2));
    ASSERT_EQ(machine.choice.now(), 1u);
    machine.during(9.9, steady(1));
    EXPECT_EQ(machine.choice.now(), 1u);
    machine.during(1, steady(1));
    EXPECT_EQ(machine.choice.now(), 0u);
    EXPECT_EQ(machine.choice.steps(), 2u);
}

TEST(MethodChoice, EachStepUpNeedsACalmOfItsOwn) {
    Machine machine{.us = {8, 2, 0.5}, .budget_us = 10};
    machine.during(5, steady(10));
    ASSERT_EQ(machine.choice.now(), 2u);
    machine.during(15, steady(1));
    EXPECT_EQ(machine.choice.now(), 1u);
    machine.during(10, steady(1));
    EXPECT_EQ(machine.choice.now(), 0u);
}

// The faster one fits, but the known ratio says that the better one would not.
TEST(MethodChoice, StaysDownWhileTheBetterMethodWouldNotFit) {
    Machine machine{.us = {8, 2}, .budget_us = 10};
    machine.during(3600, steady(1.3));  // 10.4 and 2.6 us
    EXPECT_EQ(machine.choice.now(), 1u);
    EXPECT_EQ(machine.choice.steps(), 1u);
}

// The ratio is wrong: the better method never fits, and each attempt must fail.
TEST(MethodChoice, TriesHalfAsOftenEachTimeItFails) {
    Machine machine{.us = {8, 2}, .budget_us = 10};
    machine.during(24 * 3600, [](double, std::size_t method) { return method == 0 ? 2.0 : 0.5; });
    std::vector<double> between_s;
    for (std::size_t i = 3; i < machine.steps_ns.size(); i += 2)
        between_s.push_back(1e-9 * double(machine.steps_ns[i] - machine.steps_ns[i - 2]));
    ASSERT_GT(between_s.size(), 12u);
    for (std::size_t i = 1; i < 8; ++i) EXPECT_NEAR(between_s[i] / between_s[i - 1], 2, 0.15) << i;
    EXPECT_NEAR(between_s.back(), 3600, 10);
    EXPECT_LT(double(machine.over) / double(machine.timed), 1e-4);
    std::printf("a day in which each try fails: %zu steps, %.4f %% of the samples over budget\n", machine.steps_ns.size(),
                100 * double(machine.over) / double(machine.timed));
}

// On and off with each period from seconds to hours: the worst case of a periodic load.
TEST(MethodChoice, NoRhythmOfAHogMakesMoreThan17StepsAnHourAMethod) {
    std::size_t worst = 0;
    for (const double period_s : {0.5, 5.0, 11.0, 21.0, 30.0, 60.0, 300.0, 1200.0, 3700.0, 7300.0}) {
        Machine machine{.us = {8, 2, 0.5}, .budget_us = 10};
        machine.during(8 * 3600,
                       [&](double t_s, std::size_t) { return std::fmod(t_s, period_s) < period_s / 2 ? 1.0 : 30.0; });
        EXPECT_LE(machine.busiest_hour(), 17 * (machine.us.size() - 1)) << period_s;
        worst = std::max(worst, machine.busiest_hour());
    }
    std::printf("worst rhythm: %zu steps within an hour\n", worst);
    EXPECT_GE(worst, 4u);  // there were steps
}

// An adversarial load: it begins as soon as a step up was made.
TEST(MethodChoice, NotEvenALoadThatStrikesAfterEachStepUpDoes) {
    for (const std::size_t methods : {2u, 3u, 5u, 8u}) {
        std::vector<double> us;
        for (std::size_t i = 0; i < methods; ++i) us.push_back(std::pow(0.5, double(i)));
        Machine machine{.us = us, .budget_us = 1.3};
        machine.during(5 * 3600, [&, before = std::size_t(0)](double, std::size_t method) mutable {
            const bool strike = method < before || (method == 0 && machine.choice.steps() == 0);
            if (!strike) before = method;
            return strike ? 1e4 : 1e-3;
        });
        EXPECT_LE(machine.busiest_hour(), 17 * (methods - 1)) << methods;
        EXPECT_GT(machine.steps_ns.size(), 10u);
    }
}

RC_GTEST_PROP(MethodChoice, WhateverTheLoadDoesItNeverOscillatesAndStaysOnItsFront, ()) {
    const auto n = *rc::gen::inRange<std::size_t>(1, MethodChoice::kMax + 1);
    std::mt19937_64 random(*rc::gen::arbitrary<std::uint64_t>());
    std::uniform_real_distribution<double> unit(0, 1);
    std::vector<double> us(n), wrong(n);
    for (std::size_t i = 0; i < n; ++i) us[i] = i == 0 ? 20 * unit(random) + 0.1 : us[i - 1] * (0.1 + 0.7 * unit(random));
    for (double& each : wrong) each = std::pow(10, unit(random) - 0.5);  // the measured cost is not the actual one
    Machine machine{.us = us, .budget_us = us[0] * std::pow(10, 3 * unit(random) - 2)};
    machine.period_ns = std::uint64_t(1e6 * std::pow(10, 2 * unit(random)));
    // Stretches of load, log-uniform from milliseconds to hours, with additional noise and preemptions.
    double slow = 1, preempted = 0, until_s = 0;
    const auto load = [&](double t_s, std::size_t method) {
        if (t_s > until_s) {
            until_s = t_s + 0.01 * std::pow(10, 5.5 * unit(random));
            slow = unit(random) < 0.5 ? 1 : std::pow(10, 2 * unit(random) - 0.5);
            preempted = unit(random) < 0.5 ? 0 : 0.2 * unit(random);
        }
        return wrong[method] * slow * (unit(random) < preempted ? 1000 : 0.9 + 0.2 * unit(random));
    };
    for (int hour = 0; hour < 3; ++hour) {
        // about the same number of samples for any rate
        machine.during(3600.0 * double(machine.period_ns) / 1e8 + 60, load);
        RC_ASSERT(machine.choice.now() < n);
    }
    RC_ASSERT(machine.busiest_hour() <= 17 * (n - 1));
    RC_ASSERT(machine.steps_ns.size() == machine.choice.steps());
}

}  // namespace
}  // namespace tactiled
