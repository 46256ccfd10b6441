// config/tactiled.toml, the file with every key: it loads, it is complete, and its values are the defaults.
#include <gtest/gtest.h>

#include <map>
#include <sstream>

#include "config/config.hpp"
#include "config/keys.hpp"
#include "folder.hpp"
#include "loaded.hpp"

namespace tactiled {
namespace {

using test::Folder, test::kLink, test::kSensor, test::Lines, test::Loaded;

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
        for (const char* key : {"sequence", "time_us", "echo"}) link.options.flag(key, false);
        link.options.one_of("checksum", {"crc16", "xor"}, "");
        link.options.one_of("path", {"direct", "network"}, "");
        link.options.integer("clock_ppm", {1, 20'000}, 200);
    }
    config.root.finish();
    EXPECT_EQ(problems.lines(), Lines{});
}

// The error for an unknown key lists the keys that load_config reads.
TEST(DocumentedConfig, ShowsEveryKeyWithAComment) {
    const std::string bad = "zzzzzzzzzzzz = 1\n";
    Loaded loaded("[node]\n" + bad + "[realtime]\n" + bad + "[modbus]\n" + bad + "[modbus.rtu]\n" + bad + "[shm]\n" + bad +
                  "[grasp]\n" + bad + "[tool]\n" + bad + "[[tool.sensor]]\nsensor = 'left'\n" + bad +
                  "[gpio]\nchip = 'a'\nfault = '1'\n" + bad +
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
            if (text.find("\n[[tool." + key + "]]") != text.npos) continue;
            const auto at = text.find("\n" + key + " = ");
            ASSERT_NE(at, text.npos) << line << ": " << key;
            EXPECT_NE(text.substr(at + 1, text.find('\n', at + 1) - at).find("  # "), std::string::npos) << key;
        }
    }
    EXPECT_EQ(n_keys, 111u);
}

// Returns the comment of each key at its first place in its table, on one line; "" if the key has none.
std::map<std::string, std::string> comments_of(const std::string& text, const std::string& header) {
    std::map<std::string, std::string> comments;
    std::istringstream lines(text.substr(text.find("\n" + header + "\n") + header.size() + 2));
    std::string key;
    for (std::string line; std::getline(lines, line) && line[0] != '[';) {
        const std::size_t hash = line.find("  # "), equals = line.find(" = ");
        const std::string comment = hash == line.npos ? "" : line.substr(hash + 4);
        if (line.empty() || line[0] == '#')
            key = "";
        else if (line[0] != ' ')
            comments[key = line.substr(0, equals)] = comment;
        else
            comments[key] += " " + comment;
    }
    return comments;
}

TEST(DocumentedConfig, HasTheKeysAndCommentsOfTheFieldsAndNoOther) {
    const std::string text = test::read_file(kDocumented);
    for (const auto& table : key_tables()) {
        auto comments = comments_of(text, table.header);
        for (const auto& key : table.keys) {
            ASSERT_EQ(comments.count(key.name), 1u) << table.header << " has no " << key.name;
            EXPECT_EQ(comments[key.name], key_comment(key)) << table.header << " " << key.name;
            comments.erase(key.name);
        }
        if (table.header == "[[link]]") {
            for (const char* of_the_driver : {"device", "baud", "format"}) EXPECT_EQ(comments.erase(of_the_driver), 1u);
        }
        for (const auto& [key, comment] : comments) ADD_FAILURE() << table.header << " has no field " << key;
    }
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
    EXPECT_EQ(a.modbus.hints_expire_ms, b.modbus.hints_expire_ms);
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
    EXPECT_EQ(b.shm.history, 0);  // documented in words: it depends on the number of sensors
    EXPECT_EQ(a.sensors.at(0).filter_hz, b.sensors.at(0).filter_hz);
    EXPECT_EQ(a.sensors.at(0).contact_on_N, b.sensors.at(0).contact_on_N);
    EXPECT_EQ(a.sensors.at(0).contact_off_N, b.sensors.at(0).contact_off_N);
    EXPECT_EQ(a.sensors.at(0).overload_N, b.sensors.at(0).overload_N);
    EXPECT_EQ(a.links.at(0).simulated, false);  // documented for this driver, which measures
    EXPECT_EQ(b.links.at(0).simulated, std::nullopt);
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
    for (std::size_t n = 0; n < text.size(); n += n < 1000 ? 1 : 17) {
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
            if (text[n] == c || (n % 67 != static_cast<unsigned char>(c) % 67)) continue;  // one in 67, to be quick
            std::string changed = text;
            changed[n] = c;
            Problems problems;
            load_config(folder.write("t.toml", changed), problems).root.finish();
            (void)problems.lines();
        }
}

}  // namespace
}  // namespace tactiled
