// Method "map" from sample to sample: a finger that slides, lifts and lands elsewhere.
#include <gtest/gtest.h>

#include <random>

#include "map_contacts.hpp"

namespace tactiled {
namespace {

// A finger that slides, lifts without a sample in between, and lands elsewhere: tracking the last point is not worse.
TEST(TableMap, FollowsAFingerAndItsJumps) {
    const auto warm = make_decoupler(map_calibration()), cold = make_decoupler(map_calibration());
    std::mt19937_64 random(6);
    std::vector<double> warm_points, warm_forces, cold_points;
    for (int landing = 0; landing < 100; ++landing) {
        Contact at = random_contact(random, 0.6e-3), to = random_contact(random, 0.6e-3);
        for (int i = 0; i <= 40; ++i) {
            Contact truth = at;
            truth.x_m += (to.x_m - at.x_m) * i / 40;
            truth.y_m += (to.y_m - at.y_m) * i / 40;
            const auto reading = noisy(strains(truth), Noise::kOfEach, random);
            const Error error = error_of(decouple(*warm, reading), truth);
            warm_points.push_back(error.point_m);
            warm_forces.push_back(error.force);
            (void)cold->decouple({.channel = {}});
            cold_points.push_back(error_of(decouple(*cold, reading), truth).point_m);
        }
    }
    std::printf("a finger that slides and jumps within 0.6 mm, noise 1 %% of each reading:\n");
    Percentiles(warm_points).print("map, following: point", 1e6, "um");
    Percentiles(warm_forces).print("map, following: force vector", 100, "%");
    Percentiles(cold_points).print("map, each sample anew: point", 1e6, "um");
    EXPECT_LT(Percentiles(warm_points).p99, 15e-6);
    EXPECT_LT(Percentiles(warm_forces).p50, 0.02);
    EXPECT_LT(Percentiles(warm_points).p95, 1.5 * Percentiles(cold_points).p95);
}

// The minimum beside the last point can explain the readings of a jump within the gain error, with a pull in place of
// a press.
TEST(TableMap, AJumpIsSearchedAnew) {
    const auto warm = make_decoupler(map_calibration()), cold = make_decoupler(map_calibration());
    std::mt19937_64 random(3);
    int good = 0, pulls = 0, cold_pulls = 0;
    const auto is_pull = [](const Estimate& e) { return e.quality() == TACTILED_GOOD && e.wrench_S[2] > -0.3; };  // N
    for (int jump = 0; jump < 2000; ++jump) {
        const Contact contact = random_contact(random, 0.6e-3, 0.6, 0.35);
        const auto reading = strains(contact);
        for (int i = 0; i < 4; ++i) {
            const Estimate estimate = decouple(*warm, reading);
            good += estimate.quality() == TACTILED_GOOD ? 1 : 0;
            pulls += is_pull(estimate) ? 1 : 0;
            (void)cold->decouple({.channel = {}});
            cold_pulls += is_pull(decouple(*cold, reading)) ? 1 : 0;
        }
    }
    EXPECT_GT(good, 7000);
    // Tracking alone would give 40 samples.
    EXPECT_EQ(pulls, 0);
    EXPECT_EQ(cold_pulls, 0);
    std::printf("  jumps: %d samples, %d read as a pull; %d if searched anew each time\n", 4 * 2000, pulls, cold_pulls);
}

}  // namespace
}  // namespace tactiled
