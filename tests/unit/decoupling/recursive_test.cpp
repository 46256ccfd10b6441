// Calibrations with forgetting.
#include "decoupling/fit/recursive.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "decoupling/fit/fit.hpp"
#include "decoupling/fit/least_squares.hpp"

namespace tactiled {
namespace {

// 4000 rows of three channels with a large value at rest; from the middle on the first gain is 2 instead of 1.
Labelled drifting() {
    Labelled labelled;
    labelled.name = "drifting.csv";
    labelled.channels = {"A", "B", "C"};
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> noise(0, 0.01);
    for (int i = 0; i < 4000; ++i) {
        const double a = uniform(random), b = uniform(random), c = uniform(random);
        LabelledRow row{.line = i + 2, .channel = {1e4 + a, b, 30 * c}, .wrench_S = kUnseen, .session = 0};
        row.wrench_S[2] = (i < 2000 ? 1 : 2) * a - 0.5 * b + c + noise(random);
        labelled.rows.push_back(row);
    }
    return labelled;
}

std::vector<double> gains(std::map<std::string, double> parameters, double* forget = nullptr) {
    FitRequest request;
    request.model = "generic";
    request.method = "matrix";
    request.parameters = std::move(parameters);
    const Calibration calibration = fit(drifting(), request).calibration;
    if (forget != nullptr) *forget = calibration.parameters.count("forget") != 0 ? calibration.parameters.at("forget") : 0;
    return calibration.matrix[0];
}

TEST(Forget, TheNewestRowsDecide) {
    double forget = 0;
    const auto newest = gains({{"forget", 0.99}}, &forget), all = gains({});
    EXPECT_NEAR(all[0], 1.5, 0.05);
    EXPECT_NEAR(newest[0], 2, 0.01);  // noise 0.01 over a hundred rows, spread 0.58
    EXPECT_NEAR(newest[1], -0.5, 0.01);
    EXPECT_NEAR(newest[2], 1.0 / 30, 0.01 / 30);
    EXPECT_EQ(forget, 0.99);  // recorded in the file
}

TEST(Forget, NothingIsTheFitOfAllRows) {
    const auto one = gains({{"forget", 1}}), all = gains({});
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(one[k], all[k], 1e-9);
}

TEST(Forget, OutsideOfItsRangeIsRefused) {
    EXPECT_THROW((void)gains({{"forget", 1.01}}), Undetermined);
    EXPECT_THROW((void)gains({{"forget", 0.1}}), Undetermined);
}

// Two directions, one of them excited: the other keeps its start value as long as the rows have no information on it.
TEST(Forget, WhatNothingExcitesKeepsItsStart) {
    RecursiveLeastSquares recursive(Eigen::Vector2d(3, 7), 0.9);
    for (int i = 0; i < 100'000; ++i) recursive.update(Eigen::Vector2d(std::sin(i), 0), 5 * std::sin(i));
    EXPECT_NEAR(recursive.coefficient()[0], 5, 1e-5);
    EXPECT_NEAR(recursive.coefficient()[1], 7, 1e-12);
}

}  // namespace
}  // namespace tactiled
