// load_node() sets up sensors as their configuration says.
#include "node/setup.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

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

// c1 follows temperature by 1 N/K, the dummy by 0.5 /K from 1.
constexpr char kDummy[] =
    "temperature.reference_C = 23.0\ntemperature.range_C = [10.0, 40.0]\ntemperature.zero = [0.0, 0.0, 0.0]\n"
    "temperature.zero_per_K = [1.0, 0.0, 0.0]\ntemperature.gain_per_K = [0.0, 0.0, 0.0]\ntemperature.dummy = \"D\"\n"
    "temperature.dummy_zero = 1.0\ntemperature.dummy_per_K = 0.5\ntemperature.dummy_difference_K = 0.01\n";

// Returns the last of some samples with c1 = 3, and D = 2 or without a value.
tactiled_sample with_dummy(const std::string& key, double dummy, std::vector<std::string>* refused = nullptr) {
    const test::Folder folder;
    (void)folder.write("unit.toml", test::unit_calibration() + kDummy);
    Problems problems;
    Node node = load_node(folder.write("tactiled.toml", kConfig + key), problems);
    if (refused != nullptr) *refused = problems.lines();
    if (!problems.empty()) return {};
    Sensor& sensor = node.sensors.front();
    sensor.start(7, 0);
    tactiled_sample last{};
    for (std::uint64_t t_ns = kMs; t_ns <= 20 * kMs; t_ns += kMs) {
        Frame frame;
        frame.t_ns = t_ns;
        frame.n_channels = 4;
        frame.channel = {3, 0, 0, dummy};
        if (std::isnan(dummy)) frame.missing = 8;
        last = sensor.sample(frame, t_ns);
    }
    return last;
}

TEST(Setup, ADummyIsTheThermometerInTheScaleOfItsCalibration) {
    for (const char* key : {"", "channels = [\"c1\", \"c2\", \"c3\", \"D\"]\n"}) {
        const tactiled_sample good = with_dummy(key, 2), none = with_dummy(key, std::nan(""));
        EXPECT_EQ(good.temperature_C, 25) << key;
        EXPECT_DOUBLE_EQ(good.force_S_N[0], 1) << key;
        EXPECT_EQ(good.quality, std::uint32_t(TACTILED_GOOD)) << key << good.reasons;
        EXPECT_NE(none.reasons & TACTILED_TEMPERATURE, 0u) << key;
    }
}

TEST(Setup, ADummyThatIsNotInTheFrameOrHasAThermometerBesideItIsRefused) {
    std::vector<std::string> refused;
    (void)with_dummy("channels = [\"c1\", \"c2\", \"c3\", \"-\"]\n", 2, &refused);
    ASSERT_EQ(refused.size(), 1u);
    EXPECT_NE(refused[0].find("needs its dummy \"D\"; channels = [c1, c2, c3, -] lacks it"), refused[0].npos) << refused[0];
    (void)with_dummy("channels = [\"c1\", \"c2\", \"c3\", \"D\"]\ntemperature = \"D\"\n", 2, &refused);
    ASSERT_EQ(refused.size(), 1u);
    EXPECT_NE(refused[0].find("temperature = \"D\": the temperature is that of the dummy"), refused[0].npos) << refused[0];
}

TEST(Setup, KnowledgeOfATemperatureWithoutCoefficientsIsRefused) {
    const test::Folder folder;
    (void)folder.write("unit.toml", test::unit_calibration());
    Problems problems;
    (void)load_node(folder.write("tactiled.toml", std::string(kConfig) + "temperature_sd_K = 0.1\n"), problems);
    ASSERT_EQ(problems.lines().size(), 1u);
    EXPECT_NE(problems.lines()[0].find("temperature_sd_K = 0.1: neither"), std::string::npos) << problems.lines()[0];
}

}  // namespace
}  // namespace tactiled
