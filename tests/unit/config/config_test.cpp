#include "config/config.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <sstream>

#include "config/names.hpp"
#include "drivers/frame.hpp"
#include "folder.hpp"
#include "tactiled/layout.h"

namespace tactiled {
namespace {

using Lines = std::vector<std::string>;
using test::Folder;

constexpr const char* kLink = "[[link]]\nname = 'usb0'\ndriver = 'uart'\n";
constexpr const char* kSensor = "[[sensor]]\nname = 'left'\nlink = 'usb0'\nmodel = 'generic'\ncalibration = 'left.toml'\n";

struct Loaded {
    Folder folder;
    Problems problems;
    Config config;
    explicit Loaded(const std::string& text) : config(load_config(folder.write("t.toml", text), problems)) {}

    // Errors without the folder.
    [[nodiscard]] Lines lines() const {
        Lines lines;
        for (auto line : problems.lines()) {
            for (auto at = line.find(folder.path() + "/"); at != line.npos; at = line.find(folder.path() + "/"))
                line.erase(at, folder.path().size() + 1);
            lines.push_back(line);
        }
        return lines;
    }
};

Lines errors(const std::string& text) { return Loaded(text).lines(); }

// Errors of a table's lines beside a good link and a good sensor; the text's first line is line 1.
Lines errors_of(const std::string& table) { return errors(table + "\n" + kLink + kSensor); }

std::string link(const std::string& keys) { return "[[link]]\n" + keys; }
std::string sensor(const std::string& name, const std::string& keys) {
    return "[[sensor]]\nname = '" + name + "'\nmodel = 'generic'\ncalibration = 'c.toml'\n" + keys;
}

TEST(Config, HasDefaults) {
    const Loaded loaded(std::string(kLink) + kSensor);
    EXPECT_EQ(loaded.lines(), Lines{});
    const Config& c = loaded.config;
    EXPECT_EQ(c.path, loaded.folder / "t.toml");
    EXPECT_EQ(c.node.name, "gripper");
    EXPECT_EQ(c.node.watchdog_ms, 250);
    EXPECT_EQ(c.node.control, "/run/tactiled/gripper.sock");
    EXPECT_EQ(c.realtime.priority, 80);
    EXPECT_EQ(c.realtime.cpu, -1);
    EXPECT_TRUE(c.realtime.lock_memory);
    EXPECT_FALSE(c.realtime.required);
    EXPECT_EQ(c.realtime.period_us, 250);
    EXPECT_TRUE(c.modbus.enabled());
    EXPECT_EQ(c.modbus.listen, "127.0.0.1:1502");
    EXPECT_TRUE(c.modbus.allow.empty());
    EXPECT_EQ(c.modbus.max_clients, 8);
    EXPECT_EQ(c.shm.group, "");
    EXPECT_EQ(c.shm.history, 0);  // as many as keep the segment within 1 MB
    ASSERT_EQ(c.links.size(), 1u);
    EXPECT_FALSE(c.links[0].simulated);
    EXPECT_EQ(c.links[0].sensors, 1);
    ASSERT_EQ(c.sensors.size(), 1u);
    const SensorSettings& s = c.sensors[0];
    EXPECT_EQ(s.device, 0);
    EXPECT_TRUE(s.channels.empty());
    EXPECT_EQ(s.counts_per_unit, 1.0);
    EXPECT_EQ(s.saturates_below, -std::numeric_limits<double>::infinity());
    EXPECT_EQ(s.saturates_above, std::numeric_limits<double>::infinity());
    EXPECT_EQ(s.method, "");
    EXPECT_EQ(s.stale_ms, 100);
    EXPECT_EQ(s.frozen_after, -1);  // as the driver knows
    EXPECT_EQ(s.slew_limit_per_s, std::numeric_limits<double>::infinity());
    EXPECT_EQ(s.rate_Hz, 0.0);
    EXPECT_EQ(s.rate_tolerance, 0.2);
    EXPECT_EQ(s.drift_limit_N, 0.0);
    EXPECT_EQ(s.tare_ms, 100);
    EXPECT_EQ(s.tare_limit_N, 0.0);
    EXPECT_EQ(s.pair, PairSettings{.agree_ms = 100});
}

TEST(Config, ReadsEveryKey) {
    const Loaded loaded(
        "[node]\nname = 'a.b_c-1'\nwatchdog_ms = 10\ncontrol = '/tmp/x'\n[realtime]\npriority = 1\ncpu = 1023\nlock_memory "
        "= false\n"
        "required = true\nperiod_us = 50\n[modbus]\nlisten = '0.0.0.0:502'\nallow = ['10.0.0.0/8', "
        "'fd00::/16']\nmax_clients = 64\n"
        "[shm]\ngroup = 'robots'\nhistory = 64\n[[link]]\nname = 'l'\ndriver = 'd'\nsimulated = true\n[[sensor]]\nname = "
        "'s'\nlink = 'l'\n"
        "device = 65535\nchannels = ['a', '-', '-']\ncounts_per_unit = 0.5\nsaturates_at = [-2, 3]\nmodel = "
        "'m'\ncalibration = '/c'\n"
        "method = 'x'\nstale_ms = 1\ntare_ms = 10000\nfrozen_after = 2\nslew_limit_per_s = 3.5\nrate_Hz = 4\nrate_tolerance "
        "= 0.5\n"
        "drift_limit_N = 0.25\ntare_limit_N = 1.5\n");
    EXPECT_EQ(loaded.lines(), Lines{});
    const Config& c = loaded.config;
    EXPECT_EQ(c.node.name, "a.b_c-1");
    EXPECT_EQ(c.node.watchdog_ms, 10);
    EXPECT_EQ(c.node.control, "/tmp/x");
    EXPECT_EQ(c.realtime.priority, 1);
    EXPECT_EQ(c.realtime.cpu, 1023);
    EXPECT_FALSE(c.realtime.lock_memory);
    EXPECT_TRUE(c.realtime.required);
    EXPECT_EQ(c.realtime.period_us, 50);
    EXPECT_EQ(c.modbus.listen, "0.0.0.0:502");
    EXPECT_EQ(c.modbus.allow, (Lines{"10.0.0.0/8", "fd00::/16"}));
    EXPECT_EQ(c.modbus.max_clients, 64);
    EXPECT_EQ(c.shm.group, "robots");
    EXPECT_EQ(c.shm.history, 64);
    ASSERT_EQ(c.links.size(), 1u);
    EXPECT_EQ(c.links[0].name, "l");
    EXPECT_EQ(c.links[0].driver, "d");
    EXPECT_TRUE(c.links[0].simulated);
    ASSERT_EQ(c.sensors.size(), 1u);
    const SensorSettings& s = c.sensors[0];
    EXPECT_EQ(s.name, "s");
    EXPECT_EQ(s.link, "l");
    EXPECT_EQ(s.device, 65535);
    EXPECT_EQ(s.channels, (Lines{"a", "-", "-"}));
    EXPECT_EQ(s.counts_per_unit, 0.5);
    EXPECT_EQ(s.saturates_below, -2.0);
    EXPECT_EQ(s.saturates_above, 3.0);
    EXPECT_EQ(s.model, "m");
    EXPECT_EQ(s.calibration, "/c");
    EXPECT_EQ(s.method, "x");
    EXPECT_EQ(s.stale_ms, 1);
    EXPECT_EQ(s.frozen_after, 2);
    EXPECT_EQ(s.slew_limit_per_s, 3.5);
    EXPECT_EQ(s.rate_Hz, 4.0);
    EXPECT_EQ(s.rate_tolerance, 0.5);
    EXPECT_EQ(s.drift_limit_N, 0.25);
    EXPECT_EQ(s.tare_ms, 10000);
    EXPECT_EQ(s.tare_limit_N, 1.5);
}

TEST(Config, LeavesTheDriversKeysToTheDriver) {
    Loaded loaded("[[link]]\nname = 'usb0'\ndriver = 'uart'\nbaud = 9600\ndevcie = '/dev/x'\n" + std::string(kSensor) +
                  "filter_Hz = 5\n");
    EXPECT_EQ(loaded.lines(), Lines{});
    EXPECT_EQ(loaded.config.links[0].options.integer("baud", {300, 1e6}), 9600);
    EXPECT_EQ(loaded.config.links[0].options.text("device", ""), "");
    Config copy = loaded.config;
    EXPECT_EQ(copy.sensors[0].options.number("filter_Hz", {0, 10}), 5);
    copy.root.finish();
    EXPECT_EQ(loaded.lines(), Lines{"t.toml:5: link \"usb0\": unknown key \"devcie\"; did you mean \"device\"?"});
}

TEST(Config, RefusesWhatIsOutOfRange) {
    struct Case {
        const char *table, *low, *high, *error;
    };
    const Case cases[] = {
        {"[node]", "watchdog_ms = 9", "watchdog_ms = 10001", "is outside 10 .. 10000"},
        {"[realtime]", "priority = 0", "priority = 99", "is outside 1 .. 98"},
        {"[realtime]", "cpu = -2", "cpu = 1024", "is outside -1 .. 1023"},
        {"[realtime]", "period_us = 49", "period_us = 100001", "is outside 50 .. 100000"},
        {"[modbus]", "max_clients = 0", "max_clients = 65", "is outside 1 .. 64"},
        {"[shm]", "history = 32", "history = 131072", "is outside 64 .. 65536"},
    };
    for (const auto& [table, low, high, error] : cases)
        for (const char* key : {low, high})
            EXPECT_EQ(errors_of(std::string(table) + "\n" + key),
                      Lines{"t.toml:2: " + std::string(table) + ": " + key + " " + error});
    const std::pair<std::string, const char*> of_sensor[] = {
        {"device = -1", "is outside 0 .. 65535"},
        {"device = 65536", "is outside 0 .. 65535"},
        {"stale_ms = 0", "is outside 1 .. 10000"},
        {"frozen_after = 1", "is no number of equal readings; 0 = off, else 2 or more"},
        {"slew_limit_per_s = 0", "is outside 1e-300 .. 1e+300"},
        {"stale_ms = 10001", "is outside 1 .. 10000"},
        {"tare_ms = 0", "is outside 1 .. 10000"},
        {"tare_ms = 10001", "is outside 1 .. 10000"},
        {"counts_per_unit = 0", "is outside 1e-18 .. 1e+18"},
        {"counts_per_unit = -1", "is outside 1e-18 .. 1e+18"},
    };
    for (const auto& [key, error] : of_sensor)
        EXPECT_EQ(errors(std::string(kLink) + kSensor + key + "\n"),
                  Lines{"t.toml:9: sensor \"left\": " + key + " " + error});
    EXPECT_EQ(errors_of("[shm]\nhistory = 1000"),
              Lines{"t.toml:2: [shm]: history = 1000 is no power of two; the next one is 1024"});
}

TEST(Config, RefusesNamesThatFitNowhere) {
    const std::string rule = "; a name has 1 .. 31 of A-Z a-z 0-9 _ . -";
    EXPECT_EQ(errors_of("[node]\nname = 'a/b'\n").at(0), "t.toml:2: [node]: name = \"a/b\"" + rule);
    const std::string long_name(32, 'n');
    EXPECT_EQ(errors_of("[node]\nname = '" + long_name + "'\n"),
              Lines{"t.toml:2: [node]: name = \"" + long_name + "\"" + rule});
    EXPECT_EQ(errors_of("[node]\nname = '" + std::string(31, 'n') + "'\n"), Lines{});
    EXPECT_EQ(errors_of("[node]\nname = ''\n").at(0), "t.toml:2: [node]: name = \"\"" + rule);
    EXPECT_EQ(errors_of("[shm]\ngroup = 'a b'\n"), Lines{"t.toml:2: [shm]: group = \"a b\"" + rule});
    EXPECT_EQ(errors(std::string(kLink) + sensor("all", "link = 'usb0'\n")),
              Lines{"t.toml:5: sensor \"all\": name = \"all\" means every sensor in commands; choose another"});
    EXPECT_EQ(errors(std::string(kLink) + sensor("a b", "link = 'usb0'\n")),
              Lines{"t.toml:5: sensor \"a b\": name = \"a b\"" + rule});
}

TEST(Config, NamesTheControlSocketAfterTheNode) {
    EXPECT_EQ(Loaded(std::string("[node]\nname = 'arm'\n") + kLink + kSensor).config.node.control, "/run/tactiled/arm.sock");
    EXPECT_EQ(errors_of("[node]\ncontrol = '/" + std::string(106, 'x') + "'\n"), Lines{});
    EXPECT_EQ(errors_of("[node]\ncontrol = '/" + std::string(107, 'x') + "'\n"),
              Lines{"t.toml:2: [node]: control has 108 bytes; the path of a socket has at most 107"});
    EXPECT_EQ(errors_of("[node]\ncontrol = 'x.sock'\n"),
              Lines{"t.toml:2: [node]: control = \"x.sock\" should be a full path, starting with /"});
}

TEST(Config, NeedsALinkAndASensor) {
    EXPECT_EQ(errors(""), (Lines{"t.toml:1: there is no [[link]]; one at least says where data come from",
                                 "t.toml:1: there is no [[sensor]]; one at least says what the data mean"}));
    EXPECT_EQ(errors("link = []\nsensor = []\n"), (Lines{"t.toml:1: link is an array, should be tables [[link]]",
                                                         "t.toml:2: sensor is an array, should be tables [[sensor]]"}));
    EXPECT_EQ(
        errors(std::string(kLink) + "[[sensor]]\n"),
        (Lines{"t.toml:4: [[sensor]]: key \"name\" is missing", "t.toml:4: [[sensor]]: key \"link\" is missing",
               "t.toml:4: [[sensor]]: key \"model\" is missing", "t.toml:4: [[sensor]]: key \"calibration\" is missing"}));
    EXPECT_EQ(errors("[[link]]\n" + std::string(kSensor)),
              (Lines{"t.toml:1: [[link]]: key \"name\" is missing", "t.toml:1: [[link]]: key \"driver\" is missing",
                     "t.toml:4: sensor \"left\": link = \"usb0\" is no [[link]]; known: "}));
}

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

TEST(Config, ChecksTheRails) {
    const auto rails = [](const std::string& text) {
        return errors(std::string(kLink) + kSensor + "saturates_at = " + text + "\n");
    };
    const std::string at = "t.toml:9: sensor \"left\": saturates_at";
    EXPECT_EQ(rails("[-5, 5]"), Lines{});
    EXPECT_EQ(rails("[5, -5]"), Lines{at + " = [5, -5] should be [lowest, highest]"});
    EXPECT_EQ(rails("[5, 5]"), Lines{at + " = [5, 5] should be [lowest, highest]"});
    EXPECT_EQ(rails("[5]"), Lines{at + " has 1 entries, should have 2"});
    EXPECT_EQ(rails("[]"), Lines{at + " has 0 entries, should have 2"});
    EXPECT_EQ(rails("[nan, 5]"), Lines{at + "[0] = nan is not a finite number"});
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

TEST(Config, LetsOthersReachModbusOnlyWhereTheyAreNamed) {
    const auto modbus = [](const std::string& keys) { return errors_of("[modbus]\n" + keys); };
    EXPECT_EQ(modbus("listen = '0.0.0.0:502'"), Lines{"t.toml:2: [modbus]: listen = \"0.0.0.0:502\" lets other machines in, "
                                                      "and Modbus knows no passwords: name those that may "
                                                      "connect, for example allow = [\"192.168.0.10/32\"]"});
    for (const char* open :
         {"192.168.0.5:502", "[::]:502", "[fd00::1]:502", "[::ffff:127.0.0.1]:502", "126.255.255.255:1", "128.0.0.1:1"}) {
        EXPECT_EQ(modbus("listen = '" + std::string(open) + "'").size(), 1u) << open;
        EXPECT_EQ(modbus("listen = '" + std::string(open) + "'\nallow = []").size(), 1u) << open;
        EXPECT_EQ(modbus("listen = '" + std::string(open) + "'\nallow = ['192.168.0.0/24']"), Lines{}) << open;
    }
    for (const char* closed : {"127.0.0.1:1", "127.255.0.9:65535", "[::1]:502"})
        EXPECT_EQ(modbus("listen = '" + std::string(closed) + "'"), Lines{}) << closed;
}

TEST(Config, SwitchesModbusOff) {
    const Loaded loaded(std::string("[modbus]\nlisten = ''\n") + kLink + kSensor);
    EXPECT_EQ(loaded.lines(), Lines{});
    EXPECT_FALSE(loaded.config.modbus.enabled());
}

TEST(Config, RefusesAddressesThatAreNone) {
    for (const char* bad : {"localhost:502",
                            "127.0.0.1",
                            "127.0.0.1:",
                            "127.0.0.1:0",
                            "127.0.0.1:65536",
                            "127.0.0.1:+5",
                            "127.0.0.1:5x",
                            "127.0.0.1: 5",
                            "127.0.0.1:99999999999999999999",
                            "::1:502",
                            "[::1]",
                            "[127.0.0.1]:502",
                            "127.1:502",
                            "0127.0.0.1:5",
                            ":502",
                            "[]:502",
                            "[:502",
                            "[::1%lo]:502",
                            "a",
                            "]:5",
                            " 127.0.0.1:5"})
        EXPECT_EQ(errors_of("[modbus]\nlisten = '" + std::string(bad) + "'\nallow = ['10.0.0.1/32']").size(), 1u) << bad;
}

TEST(Config, RefusesEverybody) {
    const auto allow = [](const std::string& network) {
        const auto lines = errors_of("[modbus]\nallow = ['" + network + "']");
        return lines.empty() ? "" : lines.at(0);
    };
    for (const char* good : {"10.0.0.0/8", "192.168.0.10/32", "fd00::/8", "fd00::1/128", "128.0.0.0/1", "192.168.0.128/25"})
        EXPECT_EQ(allow(good), "") << good;
    for (const char* everybody : {"0.0.0.0/0", "::/0", "10.0.0.1/0"}) {
        EXPECT_NE(allow(everybody).find("is everybody; name the network or the address of the PLC"), std::string::npos)
            << everybody;
    }
    EXPECT_NE(allow("192.168.0.10").find("write \"192.168.0.10/32\""), std::string::npos);
    EXPECT_NE(allow("192.168.0.10/24").find("write \"192.168.0.10/32\" for the machine, \"192.168.0.0/24\" for the network"),
              std::string::npos);
    EXPECT_NE(allow("fd00::1/64").find("\"fd00::1/128\" for the machine, \"fd00::/64\" for the network"), std::string::npos);
    EXPECT_NE(allow("10.0.0.128/24"), "");  // the first bit beyond the network
    for (const char* bad :
         {"", "/8", "10.0.0.0/", "10.0.0.0/33", "10.0.0.0/-1", "fd00::/129", "plc/32", "10.0.0.0/8x", "10.0.0/8"})
        EXPECT_NE(allow(bad), "") << bad;
}

TEST(Config, TellsAllErrorsAtOnce) {
    EXPECT_EQ(errors("[node]\nwatchdog_ms = 'x'\n[realtime]\npriority = 99\n[[link]]\nname = 'usb0'\n[[sensor]]\nname = "
                     "'left'\nlink = 'usb'\n"
                     "stale_ms = 0\nmodel = 'generic'\ncalibration = 5\n[modbus]\nlisten = 'x'\n[shm]\nhistory = 100\n"),
              (Lines{
                  "t.toml:2: [node]: watchdog_ms = \"x\" is a string, should be an integer",
                  "t.toml:4: [realtime]: priority = 99 is outside 1 .. 98",
                  "t.toml:5: link \"usb0\": key \"driver\" is missing",
                  "t.toml:9: sensor \"left\": link = \"usb\" is no [[link]]; did you mean \"usb0\"?",
                  "t.toml:10: sensor \"left\": stale_ms = 0 is outside 1 .. 10000",
                  "t.toml:12: sensor \"left\": calibration = 5 is an integer, should be a string",
                  "t.toml:14: [modbus]: listen = \"x\" has no port; write ADDRESS:PORT, for example \"127.0.0.1:1502\"",
                  "t.toml:16: [shm]: history = 100 is no power of two; the next one is 128",
              }));
}

TEST(Config, SaysWhenThereIsNoFile) {
    Problems problems;
    Config config = load_config("/nowhere/t.toml", problems);
    config.root.finish();
    EXPECT_EQ(problems.lines(), Lines{"/nowhere/t.toml: there is no such file; give the path of one that exists"});
    EXPECT_TRUE(config.links.empty() && config.sensors.empty());
}

TEST(Config, LimitsAreThoseOfTheSegmentAndTheFrame) {
    EXPECT_EQ(kMostChannels, kMaxChannels);
    EXPECT_EQ(kLongestNameBytes + 1, std::size_t{TACTILED_NAME_SIZE});
    EXPECT_EQ(TACTILED_MAX_SENSORS, 16);
    EXPECT_EQ(TACTILED_MAX_LINKS, 16);
}

// ---- config/tactiled.toml ----

const std::string kDocumented = std::string(TACTILED_SOURCE_DIR) + "/config/tactiled.toml";

TEST(DocumentedConfig, LoadsWithoutAProblem) {
    Problems problems;
    Config config = load_config(kDocumented, problems);
    EXPECT_EQ(problems.lines(), Lines{});
    ASSERT_GE(config.links.size(), 1u);
    for (auto& link : config.links) {
        EXPECT_EQ(link.driver, "uart");
        link.options.text("device");
        link.options.integer("baud", {50, 12e6}, 115200);
        link.options.one_of("format", {"cobs", "lines"});
        link.options.integer("channels", {1, 32}, 1);
        for (const char* key : {"sequence", "time_us", "checksum"}) link.options.flag(key, false);
    }
    config.root.finish();
    EXPECT_EQ(problems.lines(), Lines{});
}

// The keys that load_config asks for are told by the error about a key that it does not.
TEST(DocumentedConfig, ShowsEveryKeyWithAComment) {
    const std::string bad = "zzzzzzzzzzzz = 1\n";
    Loaded loaded("[node]\n" + bad + "[realtime]\n" + bad + "[modbus]\n" + bad + "[modbus.rtu]\n" + bad + "[shm]\n" + bad +
                  "[grasp]\n" + bad + "[gpio]\nchip = 'a'\nfault = '1'\n" + bad +
                  "[[grasp.jaw]]\nsensor = 'left'\nx_S_in_G = [1, 0, 0]\nz_S_in_G = [0, 1, 0]\n" + bad + kLink + bad +
                  kSensor + bad);
    loaded.config.root.finish();
    const std::string text = test::read_file(kDocumented);
    std::size_t n_keys = 0;
    for (const auto& line : loaded.lines()) {
        const auto known = line.find("; known: ");
        ASSERT_NE(known, line.npos) << line;
        std::istringstream keys(line.substr(known + 9));
        for (std::string key; keys >> key; ++n_keys) {
            if (key.back() == ',') key.pop_back();
            if (text.find("\n[modbus." + key + "]") != text.npos) continue;   // a table
            if (text.find("\n[[grasp." + key + "]]") != text.npos) continue;  // tables
            const auto at = text.find("\n" + key + " = ");
            ASSERT_NE(at, text.npos) << line << ": " << key;
            EXPECT_NE(text.substr(at + 1, text.find('\n', at + 1) - at).find("  # "), std::string::npos) << key;
        }
    }
    EXPECT_EQ(n_keys, 77u);
}

TEST(DocumentedConfig, NamesTheDefaults) {
    const Loaded documented(test::read_file(kDocumented)), plain(std::string(kLink) + kSensor);
    const Config &a = documented.config, &b = plain.config;
    EXPECT_EQ(a.node.name, b.node.name);
    EXPECT_EQ(a.node.watchdog_ms, b.node.watchdog_ms);
    EXPECT_EQ(a.node.stuck_link_ms, b.node.stuck_link_ms);
    EXPECT_EQ(a.node.control, b.node.control);
    EXPECT_EQ(a.realtime.priority, b.realtime.priority);
    EXPECT_EQ(a.realtime.cpu, b.realtime.cpu);
    EXPECT_EQ(a.realtime.lock_memory, b.realtime.lock_memory);
    EXPECT_EQ(a.realtime.required, b.realtime.required);
    EXPECT_EQ(a.realtime.period_us, b.realtime.period_us);
    EXPECT_EQ(a.modbus.listen, b.modbus.listen);
    EXPECT_EQ(a.modbus.allow, b.modbus.allow);
    EXPECT_EQ(a.modbus.max_clients, b.modbus.max_clients);
    EXPECT_EQ(a.shm.group, b.shm.group);
    EXPECT_EQ(a.modbus.max_requests_per_s, b.modbus.max_requests_per_s);
    EXPECT_EQ(a.modbus.commands, b.modbus.commands);
    EXPECT_EQ(a.modbus.scratch, b.modbus.scratch);
    EXPECT_EQ(a.modbus.settings, b.modbus.settings);
    EXPECT_EQ(a.modbus.rtu.device, b.modbus.rtu.device);
    EXPECT_EQ(a.modbus.rtu.baud, b.modbus.rtu.baud);
    EXPECT_EQ(a.modbus.rtu.parity, b.modbus.rtu.parity);
    EXPECT_EQ(a.modbus.rtu.address, b.modbus.rtu.address);
    EXPECT_EQ(a.modbus.rtu.rs485, b.modbus.rtu.rs485);
    EXPECT_EQ(b.shm.history, 0);  // said in words: it depends on the number of sensors
    EXPECT_EQ(a.sensors.at(0).filter_Hz, b.sensors.at(0).filter_Hz);
    EXPECT_EQ(a.sensors.at(0).contact_on_N, b.sensors.at(0).contact_on_N);
    EXPECT_EQ(a.sensors.at(0).contact_off_N, b.sensors.at(0).contact_off_N);
    EXPECT_EQ(a.sensors.at(0).overload_N, b.sensors.at(0).overload_N);
    EXPECT_EQ(a.links.at(0).simulated, b.links.at(0).simulated);
    EXPECT_EQ(a.sensors.at(0).device, b.sensors.at(0).device);
    EXPECT_EQ(a.sensors.at(0).stale_ms, b.sensors.at(0).stale_ms);
    EXPECT_EQ(a.sensors.at(0).tare_ms, b.sensors.at(0).tare_ms);
    const Loaded grasps("[grasp]\n[[grasp.jaw]]\nsensor = 'left'\nx_S_in_G = [0, 0, -1]\nz_S_in_G = [1, 0, 0]\n" +
                        std::string(kLink) + kSensor);
    const GraspSettings &c = a.grasp.value(), &d = grasps.config.grasp.value();
    EXPECT_EQ(c.friction, d.friction);
    EXPECT_EQ(c.share_sd, d.share_sd);
    EXPECT_EQ(c.margin, d.margin);
    EXPECT_EQ(c.weigh_window_ms, d.weigh_window_ms);
    EXPECT_EQ(c.slip_sensitivity, d.slip_sensitivity);
    EXPECT_EQ(c.lift_acceleration_m_s2, d.lift_acceleration_m_s2);
    EXPECT_EQ(c.lift_accelerates_ms, d.lift_accelerates_ms);
    EXPECT_EQ(c.objects, d.objects);
    EXPECT_EQ(c.jaws.at(0).share, d.jaws.at(0).share);
    EXPECT_EQ(c.jaws.at(0).S_from_G, d.jaws.at(0).S_from_G);
}

TEST(DocumentedConfig, CutAnywhereIsNoCrash) {
    const Folder folder;
    const std::string text = test::read_file(kDocumented);
    for (std::size_t n = 0; n < text.size(); ++n) {
        Problems problems;
        Config config = load_config(folder.write("t.toml", text.substr(0, n)), problems);
        config.root.finish();
        if (n < text.find("model = ")) { EXPECT_FALSE(problems.empty()) << n; }
        for (const auto& line : problems.lines()) EXPECT_EQ(line.find(folder / "t.toml" + ":"), 0u) << line;
    }
}

TEST(DocumentedConfig, ChangedAnywhereIsNoCrash) {
    const Folder folder;
    const std::string text = test::read_file(kDocumented);
    for (std::size_t n = 0; n < text.size(); ++n)
        for (const char c : {'\0', '"', '[', '.', '\n', '=', '{', '\xff'}) {
            if (text[n] == c || (n % 32 != static_cast<unsigned char>(c) % 32)) continue;  // one in 32, to be quick
            std::string changed = text;
            changed[n] = c;
            Problems problems;
            load_config(folder.write("t.toml", changed), problems).root.finish();
            (void)problems.lines();
        }
}

}  // namespace
}  // namespace tactiled
