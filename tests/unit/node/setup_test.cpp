// load_node() sets up sensors as their configuration says.
#include "node/setup.hpp"

#include <gtest/gtest.h>

#include <string>

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

}  // namespace
}  // namespace tactiled
