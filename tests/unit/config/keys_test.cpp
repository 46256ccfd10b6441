// The lists of fields: each key is parsed and treated by a reload as its entry states, and the pages are made from
// the lists.
#include "config/keys.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "folder.hpp"
#include "loaded.hpp"

namespace tactiled {
namespace {

using test::errors, test::Lines;

// Returns a valid configuration with `line` in the table, in place of its present line with that key.
std::string with(const KeyTable& table, const std::string& key, const std::string& value) {
    const std::pair<std::string, Lines> tables[] = {
        {"[node]", {}},
        {"[realtime]", {}},
        {"[[link]]", {"name = 'usb0'", "driver = 'uart'"}},
        {"[[sensor]]", {"name = 'left'", "link = 'usb0'", "model = 'generic'", "calibration = 'left.toml'"}},
        {"[grasp]", {}},
        {"[[grasp.jaw]]", {"sensor = 'left'", "x_S_in_G = [1, 0, 0]", "z_S_in_G = [0, 1, 0]"}},
        {"[tool]", {}},
        {"[[tool.sensor]]", {"sensor = 'left'", "x_S_in_G = [1, 0, 0]", "z_S_in_G = [0, 1, 0]"}},
        {"[modbus]", {}},
        {"[modbus.rtu]", {}},
        {"[shm]", {}},
        {"[gpio]", {"chip = 'a'", "fault = '1'"}},
    };
    std::string text;
    for (const auto& [header, lines] : tables) {
        text += header + "\n";
        for (const auto& line : lines)
            if (header != table.header || line.rfind(key + " = ", 0) != 0) text += line + "\n";
        if (header == table.header) text += key + " = " + value + "\n";
    }
    return text;
}

// Returns the errors that start with the name of the key.
Lines errors_of_key(const KeyTable& table, const std::string& key, const std::string& value) {
    Lines of_key;
    for (const auto& line : errors(with(table, key, value)))
        if (line.find(": " + key + " ") != line.npos) of_key.push_back(line);
    return of_key;
}

template <typename Each>
void for_each_key(Each each) {
    for (const auto& table : key_tables())
        for (const auto& key : table.keys) each(table, key);
}

TEST(Keys, ThePageIsWhatTheProgramPrints) {
    EXPECT_EQ(test::read_file(std::string(TACTILED_SOURCE_DIR) + "/config/KEYS.md"), keys_markdown())
        << "tactilectl check --keys > config/KEYS.md";
}

TEST(Keys, AreUniqueAndExplained) {
    std::set<std::string> seen;
    for_each_key([&](const KeyTable& table, const ConfigKey& key) {
        EXPECT_TRUE(seen.insert(table.header + key.name).second) << key.name;
        EXPECT_GT(key.help.size(), 10u) << key.name;
        EXPECT_EQ(key.help.back(), '.') << key.name;
        EXPECT_EQ(key_comment(key).find('|'), std::string::npos) << key.name;  // it would end a cell of the page
        const bool names_unit = key.name.find("_ms") != key.name.npos || key.name.find("_us") != key.name.npos ||
                                key.name.find("_N") != key.name.npos || key.name.find("_hz") != key.name.npos;
        if (names_unit) {
            EXPECT_NE(key.name.find("_" + std::string(key.unit == "Hz" ? "hz" : key.unit)), std::string::npos) << key.name;
        }
    });
    EXPECT_EQ(seen.size(), 108u);
}

TEST(Keys, AValueOfAnotherTypeIsAnErrorOfThatKey) {
    for_each_key([](const KeyTable& table, const ConfigKey& key) {
        const Lines lines = errors_of_key(table, key.name, "{a = 1}");
        ASSERT_EQ(lines.size(), 1u) << table.header << key.name;
        EXPECT_NE(lines[0].find(": " + key.name + " is a table, should be "), std::string::npos) << lines[0];
    });
}

TEST(Keys, AMisspeltOneIsAnErrorThatNamesTheRightOne) {
    for_each_key([](const KeyTable& table, const ConfigKey& key) {
        std::string text = with(table, key.name, "1");
        text.insert(text.find("\n" + key.name + " = 1\n") + 1 + key.name.size(), "x");
        test::Loaded loaded(text);
        loaded.config.root.finish();
        const std::string start = "unknown key \"" + key.name + "x\"; did you mean \"";
        std::string hint;
        for (const auto& line : loaded.lines())
            if (const auto at = line.find(start); at != line.npos) hint = line.substr(at + start.size());
        ASSERT_NE(hint, "") << table.header << key.name;
        EXPECT_EQ(key.name.find(hint.substr(0, hint.find('"'))), 0u) << hint;  // or a key that begins it: slip of slip_ms
    });
}

TEST(Keys, ARequiredKeyThatIsMissingIsAnError) {
    for_each_key([](const KeyTable& table, const ConfigKey& key) {
        if (!key.otherwise.empty()) return;
        std::string text = with(table, key.name, "0");
        text.erase(text.find(key.name + " = 0\n"), key.name.size() + 5);
        bool said = false;
        for (const auto& line : errors(text))
            said |= line.find(key.name) != line.npos && line.find("is missing") != line.npos;
        EXPECT_TRUE(said) << table.header << key.name;
    });
}

TEST(Keys, NumbersAreAcceptedWithinTheirRangeOnly) {
    std::size_t n = 0;
    for_each_key([&](const KeyTable& table, const ConfigKey& key) {
        const std::size_t dots = key.range.find(" .. ");
        if ((key.type != "integer" && key.type != "number") || dots == key.range.npos) return;
        ++n;
        const double min = std::stod(key.range), max = std::stod(key.range.substr(dots + 4));
        EXPECT_LT(min, max) << key.name;
        const std::string outside = "is outside " + key.range;
        const auto said = [&](double value) {
            for (const auto& line : errors_of_key(table, key.name, fmt::format("{}", value)))
                if (line.find(outside) != line.npos) return true;
            return false;
        };
        EXPECT_FALSE(said(min) || said(max)) << table.header << key.name;
        const bool whole = key.type == "integer";
        EXPECT_TRUE(said(whole ? min - 1 : min - 1e-6 * (max - min))) << table.header << key.name;
        EXPECT_TRUE(said(whole ? max + 1 : max * 1.001)) << table.header << key.name;
        char* end = nullptr;
        const double otherwise = std::strtod(key.otherwise.c_str(), &end);
        if (*end == '\0') { EXPECT_TRUE(otherwise >= min && otherwise <= max) << table.header << key.name; }
    });
    EXPECT_GT(n, 30u);
}

TEST(Keys, AReloadChangesWhatIsTunedAndCalibrated) {
    const std::set<std::string> tuned = {"saturates_at",
                                         "tare_ms",
                                         "filter_hz",
                                         "contact_on_N",
                                         "contact_off_N",
                                         "overload_N",
                                         "frozen_after",
                                         "delay_ms",
                                         "rate_Hz",
                                         "rate_tolerance",
                                         "drift_limit_N",
                                         "tare_limit_N",
                                         "agrees_with",
                                         "agree_N",
                                         "agree_ms",
                                         "zero_after",
                                         "accept_too_quiet",
                                         "undetected_damage_limit",
                                         "accept_unproved_age",
                                         "temperature_frozen_after",
                                         "temperature_jump_K"};
    const std::set<std::string> fixed = {"name", "link", "device", "model", "stale_ms", "register_N"};
    for_each_key([&](const KeyTable& table, const ConfigKey& key) {
        const Reload expected = table.name() == "sensor"         ? fixed.count(key.name) != 0   ? Reload::restart
                                                                   : tuned.count(key.name) != 0 ? Reload::tune
                                                                                                : Reload::epoch
                                : table.name().find("tool") == 0 ? Reload::tune
                                : table.name().find("grasp") == 0 && key.name != "objects" ? Reload::tune
                                                                                           : Reload::restart;
        EXPECT_EQ(reload_rule(table.name(), key.name), expected) << table.header << key.name;
    });
    EXPECT_EQ(reload_rule("sensor", "a_key_of_the_model"), Reload::epoch);
    EXPECT_EQ(reload_rule("link", "baud"), Reload::restart);
    EXPECT_EQ(reload_rule("grasp", "jaw"), Reload::tune);
    for (const char* table : {"node", "realtime", "link", "modbus", "shm", "gpio", "unknown"})
        EXPECT_TRUE(needs_restart(table)) << table;
    EXPECT_FALSE(needs_restart("sensor") || needs_restart("grasp"));
}

TEST(Keys, DefaultsThatNameTheNodeFollowItsName) {
    const test::Loaded loaded(
        "[node]\nname = 'arm'\n[grasp]\n[[grasp.jaw]]\nsensor = 'left'\nx_S_in_G = [1, 0, 0]\nz_S_in_G = "
        "[0, 1, 0]\n" +
        std::string(test::kLink) + test::kSensor);
    EXPECT_EQ(loaded.lines(), Lines{});
    EXPECT_EQ(loaded.config.node.control, "/run/tactiled/arm.sock");
    EXPECT_EQ(loaded.config.modbus.settings, "/var/lib/tactiled/arm.settings.toml");
    EXPECT_EQ(loaded.config.grasp->objects, "/var/lib/tactiled/arm.objects.toml");
}

}  // namespace
}  // namespace tactiled
