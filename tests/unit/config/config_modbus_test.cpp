// Tests the address of the Modbus server and its allowed clients.
#include <gtest/gtest.h>

#include "config/config.hpp"
#include "loaded.hpp"

namespace tactiled {
namespace {

using test::errors_of, test::kLink, test::kSensor, test::Lines, test::Loaded;

TEST(Config, LetsOthersReachModbusOnlyWhereTheyAreNamed) {
    const auto modbus = [](const std::string& keys) { return errors_of("[modbus]\n" + keys); };
    EXPECT_EQ(modbus("listen = '0.0.0.0:502'"),
              Lines{"t.toml:2: [modbus]: listen = \"0.0.0.0:502\" is open to other machines, and Modbus has no passwords: "
                    "name the machines that may connect, for example allow = [\"192.168.0.10/32\"]"});
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
        EXPECT_NE(allow(everybody).find("is every machine; name the network or the address of the PLC"), std::string::npos)
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

}  // namespace
}  // namespace tactiled
