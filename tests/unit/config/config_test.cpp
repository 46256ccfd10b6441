// The whole file: its defaults, its keys, their bounds, and all its errors at once.
#include "config/config.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "config/names.hpp"
#include "drivers/frame.hpp"
#include "folder.hpp"
#include "loaded.hpp"
#include "tactiled/layout.h"

namespace tactiled {
namespace {

using test::errors, test::errors_of, test::kLink, test::kSensor, test::Lines, test::Loaded, test::sensor;

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
    EXPECT_EQ(c.realtime.period_us, 10'000);
    EXPECT_TRUE(c.modbus.enabled());
    EXPECT_EQ(c.modbus.listen, "127.0.0.1:1502");
    EXPECT_TRUE(c.modbus.allow.empty());
    EXPECT_EQ(c.modbus.max_clients, 8);
    EXPECT_EQ(c.modbus.hints_expire_ms, 2000);
    EXPECT_EQ(c.shm.group, "");
    EXPECT_EQ(c.shm.history, 0);  // automatic: within 2 MB
    ASSERT_EQ(c.links.size(), 1u);
    EXPECT_EQ(c.links[0].simulated, std::nullopt);
    EXPECT_EQ(c.links[0].sensors, 1);
    ASSERT_EQ(c.sensors.size(), 1u);
    const SensorSettings& s = c.sensors[0];
    EXPECT_EQ(s.device, 0);
    EXPECT_TRUE(s.channels.empty());
    EXPECT_EQ(s.counts_per_unit, 1.0);
    EXPECT_EQ(s.saturates_at[0], -std::numeric_limits<double>::infinity());
    EXPECT_EQ(s.saturates_at[1], std::numeric_limits<double>::infinity());
    EXPECT_EQ(s.method, "");
    EXPECT_EQ(s.stale_ms, 100);
    EXPECT_EQ(s.frozen_after, -1);  // by the calibration or the driver
    EXPECT_EQ(s.delay_ms, -1);
    EXPECT_EQ(s.rate_Hz, 0.0);
    EXPECT_EQ(s.rate_tolerance, 0.2);
    EXPECT_EQ(s.drift_limit_N, 0.0);
    EXPECT_EQ(s.tare_ms, 100);
    EXPECT_EQ(s.tare_limit_N, -1.0);
    EXPECT_EQ(s.zero_after, "doubt");
    EXPECT_EQ(s.pair, PairSettings{.agree_ms = 100});
}

TEST(Config, ReadsEveryKey) {
    const Loaded loaded(
        "[node]\nname = 'a.b_c-1'\nwatchdog_ms = 10\ncontrol = '/tmp/x'\n[realtime]\npriority = 1\ncpu = 1023\nlock_memory "
        "= false\n"
        "required = true\nperiod_us = 50\n[modbus]\nlisten = '0.0.0.0:502'\nallow = ['10.0.0.0/8', "
        "'fd00::/16']\nmax_clients = 64\nhints_expire_ms = 0\n"
        "[shm]\ngroup = 'robots'\nhistory = 64\n[[link]]\nname = 'l'\ndriver = 'd'\nsimulated = true\n[[sensor]]\nname = "
        "'s'\nlink = 'l'\n"
        "device = 65535\nchannels = ['a', '-', '-']\ncounts_per_unit = 0.5\nsaturates_at = [-2, 3]\nmodel = "
        "'m'\ncalibration = '/c'\n"
        "method = 'x'\nstale_ms = 1\ntare_ms = 10000\nfrozen_after = 2\nrate_Hz = 4\nrate_tolerance "
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
    EXPECT_EQ(c.modbus.hints_expire_ms, 0);
    EXPECT_EQ(c.shm.group, "robots");
    EXPECT_EQ(c.shm.history, 64);
    ASSERT_EQ(c.links.size(), 1u);
    EXPECT_EQ(c.links[0].name, "l");
    EXPECT_EQ(c.links[0].driver, "d");
    EXPECT_EQ(c.links[0].simulated, true);
    ASSERT_EQ(c.sensors.size(), 1u);
    const SensorSettings& s = c.sensors[0];
    EXPECT_EQ(s.name, "s");
    EXPECT_EQ(s.link, "l");
    EXPECT_EQ(s.device, 65535);
    EXPECT_EQ(s.channels, (Lines{"a", "-", "-"}));
    EXPECT_EQ(s.counts_per_unit, 0.5);
    EXPECT_EQ(s.saturates_at[0], -2.0);
    EXPECT_EQ(s.saturates_at[1], 3.0);
    EXPECT_EQ(s.model, "m");
    EXPECT_EQ(s.calibration, "/c");
    EXPECT_EQ(s.method, "x");
    EXPECT_EQ(s.stale_ms, 1);
    EXPECT_EQ(s.frozen_after, 2);
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

TEST(Config, NamesWhatReplacesAKeyThatWasRemoved) {
    Loaded loaded(std::string(kLink) + kSensor + "slew_limit_per_s = 1\n");
    loaded.config.root.finish();
    EXPECT_EQ(loaded.lines(), Lines{"t.toml:9: sensor \"left\": \"slew_limit_per_s\" was removed; jumps are found without a "
                                    "limit: delete the line"});
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
    EXPECT_EQ(errors(""), (Lines{"t.toml:1: there is no [[link]]; add at least one, the source of the data",
                                 "t.toml:1: there is no [[sensor]]; add at least one, the meaning of the data"}));
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
    EXPECT_EQ(kMaxChannels, kMaxChannels);
    EXPECT_EQ(kLongestNameBytes + 1, std::size_t{TACTILED_NAME_SIZE});
    EXPECT_EQ(TACTILED_MAX_SENSORS, 16);
    EXPECT_EQ(TACTILED_MAX_LINKS, 16);
}

}  // namespace
}  // namespace tactiled
