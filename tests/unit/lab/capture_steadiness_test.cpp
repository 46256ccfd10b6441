// Noise of a few rows is no motion; a ramp is.
#include "node/lab/capture_steadiness.hpp"

#include <gtest/gtest.h>

#include <random>

namespace tactiled::ctl {
namespace {

// Returns the share of 500 loads of n rows that count as moving. The channel drifts by `ramp` standard deviations of its
// noise in these rows.
double share_that_moves(std::size_t n, double ramp) {
    std::mt19937_64 random(5);
    std::normal_distribution<double> noise(500, 0.2);
    std::size_t moving = 0;
    for (int load = 0; load < 500; ++load) {
        std::vector<CapturedRow> rows(n);
        for (std::size_t i = 0; i < n; ++i) {
            rows[i].t_ns = i * 10'000'000u;
            rows[i].channel = {noise(random) + 0.2 * ramp * double(i) / double(n)};
        }
        moving += steadiness(rows, {"A"}).front().moves;
    }
    return double(moving) / 500;
}

TEST(Steadiness, NoiseOfFewRowsIsNoMotion) {
    for (const std::size_t n : {2u, 3u, 5u, 7u, 10u, 20u, 50u, 500u}) EXPECT_LE(share_that_moves(n, 0), 0.01) << n;
}

TEST(Steadiness, ARampBeyondTheNoiseIsMotion) {
    for (const std::size_t n : {10u, 20u, 50u, 500u}) EXPECT_GE(share_that_moves(n, 20), 0.99) << n;
    EXPECT_GE(share_that_moves(7, 100), 0.99);
}

}  // namespace
}  // namespace tactiled::ctl
