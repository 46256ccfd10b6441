// Configurations with one mistake each: the line of the file and the remedy.
#include <gtest/gtest.h>

#include "loaded.hpp"

namespace tactiled {
namespace {

using test::kLink, test::kSensor;

// Returns the one problem, without the file's folder; "" if there is none.
std::string problem_of(const std::string& text) {
    const test::Folder folder;
    Problems problems;
    (void)load_config(folder.write("t.toml", text), problems);
    const auto lines = problems.lines();
    EXPECT_LE(lines.size(), 1u) << lines.back();
    return lines.empty() ? "" : lines.front().substr(folder.path().size() + 1);
}
std::string of_table(const std::string& table) { return problem_of(table + "\n" + kLink + kSensor); }
std::string of_sensor(const std::string& keys) { return problem_of(std::string(kLink) + kSensor + keys + "\n"); }

TEST(ConfigRefused, PathsAreFullOnes) {
    EXPECT_EQ(of_table("[node]\ncontrol = ''"), "t.toml:2: [node]: control = \"\" should be a full path, starting with /");
    EXPECT_EQ(of_table("[modbus]\nsettings = ''"),
              "t.toml:2: [modbus]: settings = \"\" should be a full path, starting with /");
    EXPECT_EQ(of_table("[modbus]\nsettings = 'kept.toml'"),
              "t.toml:2: [modbus]: settings = \"kept.toml\" should be a full path, starting with /");
    EXPECT_EQ(of_table("[modbus]\nsettings = '/kept.toml'"), "");
}

TEST(ConfigRefused, WhoMayConnectIsNamedByAddress) {
    for (const char* good : {"['192.168.0.10']", "['fd00::7', '127.0.0.1']", "[]"})
        EXPECT_EQ(of_table(std::string("[modbus]\nplc = ") + good), "") << good;
    for (const char* bad : {"plc", "192.168.0.0/24", "fd00::/16", "192.168.0"})
        EXPECT_EQ(of_table(std::string("[modbus]\nplc = ['") + bad + "']"),
                  std::string("t.toml:2: [modbus]: plc has \"") + bad + "\"; each is one address, such as \"192.168.0.10\"");
    EXPECT_EQ(of_table("[modbus]\nlisten = '0.0.0.0:502'\nplc = ['192.168.0.10']"), "");
    EXPECT_EQ(of_table("[modbus]\nlisten = '0.0.0.0:502'").substr(0, 49),
              "t.toml:2: [modbus]: listen = \"0.0.0.0:502\" is ope");
    EXPECT_EQ(of_table("[modbus]\nlisten = ''"), "");
    EXPECT_EQ(of_table("[modbus]\nhints_expire_ms = 9"),
              "t.toml:2: [modbus]: hints_expire_ms = 9 is outside 10 .. 60000; 0 = never");
    EXPECT_EQ(of_table("[modbus]\nhints_expire_ms = 10"), "");
    EXPECT_EQ(of_table("[modbus]\ncommand_allow = ['10.0.0.1/32']"),
              "t.toml:2: [modbus]: command_allow has no effect without commands = true");
    EXPECT_EQ(of_table("[modbus]\ncommands = true\ncommand_allow = ['10.0.0.1/32']"), "");
}

TEST(ConfigRefused, SimulatedIsSetUnsetOrAnError) {
    const auto simulated = [](const std::string& key, std::size_t n_problems) {
        const test::Folder folder;
        Problems problems;
        const Config config = load_config(folder.write("t.toml", kLink + key + kSensor), problems);
        EXPECT_EQ(problems.lines().size(), n_problems) << key;
        return config.links.at(0).simulated;
    };
    EXPECT_EQ(simulated("", 0), std::nullopt);
    EXPECT_EQ(simulated("simulated = false\n", 0), false);
    EXPECT_EQ(simulated("simulated = true\n", 0), true);
    EXPECT_EQ(simulated("simulated = 1\n", 1), std::nullopt);  // the driver decides; one error is enough
}

TEST(ConfigRefused, ContactEndsBelowWhereItBegins) {
    EXPECT_EQ(of_sensor("contact_on_N = 1\ncontact_off_N = 1"), "");
    EXPECT_EQ(of_sensor("contact_on_N = 1\ncontact_off_N = 1.5"),
              "t.toml:10: sensor \"left\": contact_off_N = 1.5 is above contact_on_N = 1");
}

TEST(ConfigRefused, APairIsOfTwoThatAreThere) {
    EXPECT_EQ(of_sensor("agrees_with = 'zzzzzz'\nagree_N = 1"),
              "t.toml:9: sensor \"left\": agrees_with = \"zzzzzz\" is no [[sensor]]");
    const auto sensor = [](const std::string& name, const std::string& of) {
        return "[[sensor]]\nname = '" + name +
               "'\nlink = 'usb0'\nmodel = 'generic'\ncalibration = 'c.toml'\ndevice = " + std::to_string(name[0] - 'a') +
               "\nagrees_with = '" + of + "'\nagree_N = 1\n";
    };
    EXPECT_EQ(problem_of(kLink + sensor("a", "b") + sensor("b", "a")).substr(0, 52),
              "t.toml:18: sensor \"b\": agrees_with = \"a\" is in a pai");
}

TEST(ConfigRefused, TwoNamelessOnesAreNotTheSameName) {
    const test::Folder folder;
    Problems problems;
    (void)load_config(folder.write("t.toml", std::string(kLink) + "[[sensor]]\n[[sensor]]\n"), problems);
    for (const auto& line : problems.lines()) EXPECT_NE(line.find("is missing"), std::string::npos) << line;
    EXPECT_EQ(problems.lines().size(), 8u);
}

TEST(ConfigRefused, AGraspThatNamesNothing) {
    const auto grasp = [](const std::string& keys, const std::string& jaw) {
        return problem_of(std::string(kLink) + kSensor + "[grasp]\n" + keys + "\n[[grasp.jaw]]\n" + jaw);
    };
    const std::string jaw = "sensor = 'left'\nx_S_in_G = [0, 0, -1]\nz_S_in_G = [1, 0, 0]\n";
    EXPECT_EQ(grasp("", jaw), "");
    EXPECT_EQ(grasp("gravity_G_m_s2 = [0, 0, 0]", jaw), "");  // its direction is unknown
    EXPECT_EQ(grasp("gravity_G_m_s2 = [0, 0, 9.69]", jaw).substr(0, 52),
              "t.toml:10: [grasp]: gravity_G_m_s2 has a length of 9");
    EXPECT_EQ(grasp("objects = ''", jaw),
              "t.toml:10: [grasp]: objects = \"\" names no file; leave the key out for the default");
    EXPECT_EQ(grasp("", "sensor = 'left'\nx_S_in_G = [0, 0]\nz_S_in_G = [1, 0, 0]\n").substr(0, 27),
              "t.toml:13: [[jaw]]: x_S_in_");
    EXPECT_EQ(grasp("", "sensor = 'zzzz'\nx_S_in_G = [0, 0, -1]\nz_S_in_G = [1, 0, 0]\n").substr(11),
              "[[jaw]]: sensor = \"zzzz\" is no [[sensor]]; known: left");
}

TEST(NearestName, OfWordsThatAreNoNamesIsNone) {
    const std::string text(65, 'a');
    EXPECT_EQ(nearest_name(text, {text}), std::nullopt);
    EXPECT_EQ(nearest_name("baud", {text, "baud_"}), "baud_");
}

TEST(InQuotes, CutsBetweenCharactersAndShowsWhatSteersATerminal) {
    EXPECT_EQ(in_quotes(std::string(59, 'a') + "\xC3\xA4z"), "\"" + std::string(59, 'a') + "\xC3\xA4...\"");
    EXPECT_EQ(in_quotes("\xC2\x9B"
                        "31m"),
              "\"\\x9b31m\"");
    EXPECT_EQ(in_quotes("\xC2\xB0"), "\"\xC2\xB0\"");  // a degree sign
    EXPECT_EQ(in_quotes("\xC2"), "\"\xC2\"");
    EXPECT_EQ(in_quotes("\xC2z"), "\"\xC2z\"");
    EXPECT_EQ(in_quotes("\x1B\x7F"), "\"\\x1b\\x7f\"");
}

}  // namespace
}  // namespace tactiled
