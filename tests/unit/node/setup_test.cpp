// load_node() sets up sensors as their configuration says.
#include "node/setup.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tactiled/reader.h"
#include "tests/unit/config/folder.hpp"
#include "tests/unit/milliseconds.hpp"
#include "tests/unit/node/unit_calibration.hpp"

namespace tactiled {
namespace {

constexpr char kConfig[] = R"(
[[link]]
name = "line"
driver = "uart"
device = "/dev/null"
format = "lines"
channels = 3

[[sensor]]
name = "s"
link = "line"
model = "generic"
calibration = "unit.toml"
)";

// Returns the result of a tare under a constant force.
Sensor::Tare tare(const std::string& key, double fx_N, double fy_N, double fz_N) {
    const test::Folder folder;
    (void)folder.write("unit.toml", test::unit_calibration("10.0, 20.0, 50.0"));
    Problems problems;
    Node node = load_node(folder.write("tactiled.toml", kConfig + key), problems);
    EXPECT_TRUE(problems.empty()) << problems.lines().front();
    Sensor& sensor = node.sensors.front();
    sensor.start(7, 0);
    for (std::uint64_t t_ns = kMs; t_ns <= 120 * kMs; t_ns += kMs) {
        Frame frame;
        frame.t_ns = t_ns;
        frame.n_channels = 3;
        frame.channel = {fx_N, fy_N, fz_N};
        (void)sensor.sample(frame, t_ns);
        if (t_ns == 10 * kMs) sensor.begin_tare(t_ns);
    }
    return sensor.poll_tare(121 * kMs);
}

TEST(Setup, ATareIsLimitedTo20PercentOfTheFullScaleOfEachComponentUnlessALimitIsGiven) {
    EXPECT_EQ(tare("", 1.9, -3.9, 9.9), Sensor::Tare::done);
    EXPECT_EQ(tare("", -2.1, 0, 0), Sensor::Tare::loaded);
    EXPECT_EQ(tare("", 0, 4.1, 0), Sensor::Tare::loaded);
    EXPECT_EQ(tare("", 0, 0, -10.1), Sensor::Tare::loaded);
    EXPECT_EQ(tare("tare_limit_N = 0\n", 8, 8, 8), Sensor::Tare::done);
    EXPECT_EQ(tare("tare_limit_N = 3\n", 2.1, 2, 0), Sensor::Tare::done) << "a magnitude";
    EXPECT_EQ(tare("tare_limit_N = 3\n", 2.2, 2.2, 0), Sensor::Tare::loaded);
}

// Returns the reasons of a sample and the damage in the directory. `calibration`: lines of the file.
std::uint32_t reasons(const std::string& key, const std::string& calibration, tactiled_undetected* directory = nullptr) {
    const test::Folder folder;
    (void)folder.write("unit.toml", test::unit_calibration() + calibration);
    Problems problems;
    Node node = load_node(folder.write("tactiled.toml", kConfig + key), problems);
    EXPECT_TRUE(problems.empty()) << problems.lines().front();
    if (directory != nullptr) *directory = tactiled_undetected_in(&node.plan.sensors.front());
    Sensor& sensor = node.sensors.front();
    sensor.start(7, 0);
    std::uint32_t reasons = 0;
    for (std::uint64_t t_ns = kMs; t_ns <= 20 * kMs; t_ns += kMs) {
        Frame frame;
        frame.t_ns = t_ns;
        frame.n_channels = 3;
        frame.channel = {1, 1, 1};
        reasons = sensor.sample(frame, t_ns).reasons;
    }
    return reasons;
}

// The mean over the channels of its worst kind, "exchanged", is 0.3.
constexpr char kDamage[] =
    "undetected_damage.stuck = [0.1, 0.2, 0.3]\nundetected_damage.half_gain = [0.0, 0.0, 0.0]\n"
    "undetected_damage.drifting = [0.0, 0.0, 0.8]\nundetected_damage.exchanged = [0.25, 0.35, 0.3]\n"
    "undetected_damage.zero = [0.0, 0.0, 0.0]\n";

TEST(Setup, ACalibrationThatLeavesMoreDamageUndetectedThanTheLimitIsUncertain) {
    const auto not_redundant = [](const std::string& key, const std::string& calibration) {
        return (reasons(key, calibration) & TACTILED_NOT_REDUNDANT) != 0;
    };
    EXPECT_FALSE(not_redundant("", "")) << "no limit";
    EXPECT_FALSE(not_redundant("", kDamage));
    EXPECT_TRUE(not_redundant("undetected_damage_limit = 1\n", "")) << "it states nothing";
    EXPECT_FALSE(not_redundant("undetected_damage_limit = 0.31\n", kDamage));
    EXPECT_TRUE(not_redundant("undetected_damage_limit = 0.29\n", kDamage));
    EXPECT_TRUE(not_redundant("undetected_damage_limit = 0\n", kDamage));
}

TEST(Setup, TheDirectoryHasTheWorstKindOfDamageAndItsWorstChannel) {
    tactiled_undetected undetected{};
    (void)reasons("", kDamage, &undetected);
    EXPECT_FLOAT_EQ(undetected.mean, 0.3F);
    EXPECT_FLOAT_EQ(undetected.worst, 0.35F);
    EXPECT_EQ(undetected.channel, 1u);
    EXPECT_EQ(undetected.kind, std::uint32_t(TACTILED_DAMAGE_EXCHANGED));
    EXPECT_STREQ(kDamageKinds[TACTILED_DAMAGE_STUCK].key, "stuck");
    EXPECT_STREQ(kDamageKinds[TACTILED_DAMAGE_HALF_GAIN].key, "half_gain");
    EXPECT_STREQ(kDamageKinds[TACTILED_DAMAGE_DRIFTING].key, "drifting");
    EXPECT_STREQ(kDamageKinds[TACTILED_DAMAGE_ZERO].key, "zero");
    (void)reasons("", "", &undetected);
    EXPECT_TRUE(std::isnan(undetected.mean));
}

}  // namespace
}  // namespace tactiled
