// Links and sensors: their number, names, channels, and pairs that are compared.
#include <gtest/gtest.h>

#include <filesystem>

#include "config/config.hpp"
#include "loaded.hpp"

namespace tactiled {
namespace {

using test::errors, test::kLink, test::kSensor, test::Lines, test::Loaded, test::sensor;

std::string link(const std::string& keys) { return "[[link]]\n" + keys; }

TEST(Config, HoldsSixteenSensorsAndLinks) {
    std::string links, sensors;
    for (int i = 0; i < 17; ++i) {
        const std::string n = std::to_string(i);
        links += link("name = 'l" + n + "'\ndriver = 'd'\n");
        sensors += sensor("s" + n, "link = 'l" + std::to_string(i % 16) + "'\ndevice = " + n + "\n");
        if (i == 15) { EXPECT_EQ(errors(links + sensors), Lines{}); }
    }
    EXPECT_EQ(errors(links + sensors), (Lines{"t.toml:49: this is [[link]] number 17; at most 16 are possible",
                                              "t.toml:148: this is [[sensor]] number 17; at most 16 are possible"}));
}

TEST(Config, RefusesTheSameNameTwice) {
    EXPECT_EQ(errors(std::string(kLink) + kLink + kSensor + sensor("left", "link = 'usb0'\ndevice = 1\n")),
              (Lines{"t.toml:5: link \"usb0\": name = \"usb0\" is the name of the [[link]] at t.toml:2 already",
                     "t.toml:13: sensor \"left\": name = \"left\" is the name of the [[sensor]] at t.toml:8 already"}));
}

TEST(Config, NamesTheNearestLink) {
    EXPECT_EQ(errors(std::string(kLink) + sensor("s", "link = 'usb1'\n")),
              Lines{"t.toml:8: sensor \"s\": link = \"usb1\" is no [[link]]; did you mean \"usb0\"?"});
    EXPECT_EQ(errors(std::string(kLink) + sensor("s", "link = 'can'\n")),
              Lines{"t.toml:8: sensor \"s\": link = \"can\" is no [[link]]; known: usb0"});
}

TEST(Config, PairsTwoSensorsOfWhichOneNamesTheOther) {
    const auto three = [](const std::string& of_a, const std::string& of_b, const std::string& of_c = "") {
        return std::string(kLink) + sensor("a", "link = 'usb0'\n" + of_a) +
               sensor("b", "link = 'usb0'\ndevice = 1\n" + of_b) + sensor("c", "link = 'usb0'\ndevice = 2\n" + of_c);
    };
    const std::string names_a = "agrees_with = 'a'\nagree_N = 2\nagree_ms = 30\n";
    const Loaded loaded(three("", "", names_a));
    EXPECT_EQ(loaded.lines(), Lines{});
    EXPECT_EQ(loaded.config.sensors[0].pair, (PairSettings{2, 2, 30}));
    EXPECT_EQ(loaded.config.sensors[1].pair.other, -1);
    EXPECT_EQ(loaded.config.sensors[2].pair, (PairSettings{0, 2, 30}));

    const std::string at_b = "t.toml:15: sensor \"b\": agrees_with ";
    EXPECT_EQ(errors(three("", "agrees_with = 'a'\n")),
              Lines{at_b + "needs agree_N: by how many newtons the two may differ"});
    EXPECT_EQ(errors(three("", "agrees_with = 'b'\nagree_N = 1\n")), Lines{at_b + "= \"b\" is this sensor itself"});
    EXPECT_EQ(errors(three("", "agrees_with = 'cc'\nagree_N = 1\n")),
              Lines{at_b + "= \"cc\" is no [[sensor]]; did you mean \"c\"?"});
    EXPECT_EQ(errors(three("agree_N = 1\n", "", names_a)),
              Lines{"t.toml:9: sensor \"a\": agree_N stands beside agrees_with, on one of the two sensors"});
    EXPECT_EQ(errors(three("register_N = 0.002\n", "", "")),
              Lines{"t.toml:9: sensor \"a\": register_N = 0.002 is no power of ten, such as 0.001"});
    const Lines twice = errors(three("", names_a, names_a));
    ASSERT_EQ(twice.size(), 1u);
    EXPECT_NE(twice[0].find("sensor \"c\": agrees_with = \"a\" "), std::string::npos) << twice[0];
}

TEST(Config, ChecksChannelsOfASensor) {
    const auto channels = [](const std::string& text) {
        return errors(std::string(kLink) + kSensor + "channels = " + text + "\n");
    };
    const std::string at = "t.toml:9: sensor \"left\": channels ";
    EXPECT_EQ(channels("['a', '-', 'b', '-']"), Lines{});
    EXPECT_EQ(channels("['a', 'b', 'a']"), Lines{at + "has \"a\" twice; write \"-\" for a channel that is not used"});
    EXPECT_EQ(channels("['-', '-']"), Lines{at + "uses none of the frame's channels; \"-\" stands for one not used"});
    EXPECT_EQ(channels("[]"), Lines{at + "has 0 entries, should have 1 .. 32"});
    for (const char* bad : {"''", "'a,b'", "'a b'", "'\"'", "\"\\n\"", "'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx'"})
        EXPECT_EQ(channels(std::string("[") + bad + "]").size(), 1u) << bad;
    std::string many = "[";
    for (int i = 0; i < 32; ++i) many += "'c" + std::to_string(i) + "', ";
    EXPECT_EQ(channels(many + "]"), Lines{});
    EXPECT_EQ(channels(many + "'-']"), Lines{at + "has 33 entries, should have 1 .. 32"});
}

TEST(Config, ChecksTheSaturationLimits) {
    const auto limits = [](const std::string& text) {
        return errors(std::string(kLink) + kSensor + "saturates_at = " + text + "\n");
    };
    const std::string at = "t.toml:9: sensor \"left\": saturates_at";
    EXPECT_EQ(limits("[-5, 5]"), Lines{});
    EXPECT_EQ(limits("[5, -5]"), Lines{at + " = [5, -5] should be [lowest, highest]"});
    EXPECT_EQ(limits("[5, 5]"), Lines{at + " = [5, 5] should be [lowest, highest]"});
    EXPECT_EQ(limits("[5]"), Lines{at + " has 1 entries, should have 2"});
    EXPECT_EQ(limits("[]"), Lines{at + " has 0 entries, should have 2"});
    EXPECT_EQ(limits("[nan, 5]"), Lines{at + "[0] = nan is not a finite number"});
}

TEST(Config, LetsSensorsShareALinkButNoChannel) {
    const auto two = [](const std::string& a, const std::string& b) {
        return errors(kLink + sensor("a", "link = 'usb0'\n" + a) + sensor("b", "link = 'usb0'\n" + b));
    };
    EXPECT_EQ(two("device = 1\n", "device = 2\n"), Lines{});
    EXPECT_EQ(two("channels = ['R1', '-']\n", "channels = ['-', 'R1']\n"), Lines{});  // two alike in one frame
    EXPECT_EQ(two("channels = ['R1']\n", "channels = ['-', 'R1']\n"), Lines{});
    EXPECT_EQ(two("", ""),
              Lines{"t.toml:13: sensor \"b\": link \"usb0\", device 0 is read by sensor \"a\", too: give each its own "
                    "`device`, or its own `channels` with \"-\" for the other's"});
    EXPECT_EQ(two("channels = ['R1']\n", "").size(), 1u);
    EXPECT_EQ(two("channels = ['R1', 'R2']\n", "channels = ['-', 'x']\n"),
              Lines{"t.toml:15: sensor \"b\": channels[1] = \"x\" is used by sensor \"a\", too (as \"R2\"): write \"-\" in "
                    "one of them"});
    const Loaded loaded(std::string(kLink) + sensor("a", "link = 'usb0'\n") + sensor("b", "link = 'usb0'\ndevice = 1\n"));
    EXPECT_EQ(loaded.config.links.at(0).sensors, 2);
}

TEST(Config, LooksForCalibrationsBesideItself) {
    const Loaded loaded(std::string(kLink) + kSensor + sensor("b", "link = 'usb0'\ndevice = 1\n"));
    EXPECT_EQ(loaded.config.sensors.at(0).calibration, loaded.folder / "left.toml");
    Problems problems;
    std::filesystem::current_path(loaded.folder.path());
    EXPECT_EQ(load_config("t.toml", problems).sensors.at(0).calibration, "left.toml");
    std::filesystem::current_path("/");
}

}  // namespace
}  // namespace tactiled
