// The keys of driver "can". tests/kernel/can_test.py tests its behaviour on a bus.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "drivers/can_plan.hpp"
#include "drivers/driver.hpp"

namespace tactiled {
namespace {

using Lines = std::vector<std::string>;

constexpr const char* kDbc = R"(BO_ 291 Tip: 8 G
 SG_ Fx : 7|16@0- (0.01,0) [0|0] "N" P
 SG_ Fy : 23|16@0- (0.01,0) [0|0] "N" P
 SG_ Count : 56|8@1+ (1,0) [0|0] "" P
BO_ 292 Torque: 8 G
 SG_ Mx : 7|16@0- (0.01,0) [0|0] "Nm" P
 SG_ Count : 56|8@1+ (1,0) [0|0] "" P
BO_ 2147484200 Taxels: 64 G
 SG_ Which M : 0|4@1+ (1,0) [0|0] "" P
 SG_ Count : 8|8@1+ (1,0) [0|0] "" P
 SG_ T0 m0 : 32|32@1- (1,0) [0|0] "" P
 SG_ T1 m1 : 32|32@1- (1,0) [0|0] "" P
BO_ 300 Nested: 8 G
 SG_ S M : 0|4@1+ (1,0) [0|0] "" P
 SG_ A m0M : 8|8@1+ (1,0) [0|0] "" P
)";

class CanKeys : public testing::Test {
protected:
    CanKeys() : folder_(fmt::format("{}/can-keys-{}", testing::TempDir(), ::getpid())) {
        std::filesystem::create_directories(folder_);
        std::ofstream(folder_ + "/g.dbc") << kDbc;
    }
    ~CanKeys() override { std::filesystem::remove_all(folder_); }

    // The errors of the link's table, without the folder.
    Lines problems_of(const std::string& keys, bool link_keys = true) {
        Problems problems;
        Options options =
            Options::parse_text((link_keys ? "interface = \"can0\"\n" : "") + keys, folder_ + "/t.toml", problems);
        if (link_keys) {
            (void)Drivers::find("can")->make(options);
        } else {
            plan_ = read_can_plan(options);
        }
        options.finish();
        Lines lines = problems.lines();
        for (auto& line : lines)
            for (std::size_t at; (at = line.find(folder_ + "/")) != line.npos;) line.erase(at, folder_.size() + 1);
        return lines;
    }
    const CanPlan& plan_of(const std::string& keys) {
        EXPECT_EQ(problems_of(keys, false), Lines{});
        return plan_;
    }

    std::string folder_;
    CanPlan plan_;
};

const std::string kFx = "{name = \"Fx\", start = 0, length = 16, order = \"intel\", type = \"signed\", factor = 0.5}";

// Indices of the frame's channels in each message.
using Indices = std::vector<unsigned>;
std::vector<Indices> channels_of(const CanDevice& device) {
    std::vector<Indices> all;
    for (const CanPart& part : device.parts) {
        all.emplace_back();
        for (const auto& channel : part.channels) all.back().push_back(channel.index);
    }
    return all;
}

TEST_F(CanKeys, ReadSignalsInPlace) {
    const CanPlan& plan = plan_of("[[device]]\ndevice = 3\nid = 0x123\nextended = true\nbytes = 12\nsignals = [" + kFx +
                                  ", {id = 0x124, start = 7, length = 32, order = \"motorola\", type = \"float\"}]\n"
                                  "sequence = {start = 88, length = 8, order = \"intel\"}");
    ASSERT_EQ(plan.devices.size(), 1u);
    const CanDevice& device = plan.devices[0];
    EXPECT_EQ(device.device, 3);
    EXPECT_EQ(device.n_channels, 2);
    ASSERT_EQ(channels_of(device), (std::vector<Indices>{{0}, {1}}));
    EXPECT_EQ(device.parts[0].id, 0x123 | kCanExtended);
    EXPECT_EQ(device.parts[0].bytes, 12u);
    EXPECT_EQ(device.parts[0].channels[0].signal.factor, 0.5);
    EXPECT_EQ(device.parts[1].id, 0x124 | kCanExtended);
    EXPECT_EQ(device.parts[1].channels[0].signal.type, CanSignal::Type::is_float);
    EXPECT_TRUE(device.is_assembled_by_counter());
    EXPECT_EQ(device.window_ns, 20'000'000u);
    EXPECT_EQ(plan.ids, (std::vector<std::uint32_t>{0x123 | kCanExtended, 0x124 | kCanExtended}));
    EXPECT_EQ(plan.max_bytes, 12u);
}

TEST_F(CanKeys, ASampleOfSeveralFramesHasItsSignalsAnywhereInTheMessage) {
    const CanPlan& plan = plan_of("[[device]]\ndevice = 0\nid = 0x7E8\nisotp_reply_id = 0x7E0\nbytes = 300\nsignals = [" +
                                  kFx + ", {start = 2368, length = 32, order = \"intel\", type = \"float\"}]");
    EXPECT_EQ(plan.devices.at(0).parts.at(0).bytes, 300u);
    ASSERT_EQ(plan.transports.size(), 1u);
    EXPECT_EQ(plan.transports[0].id, 0x7E8u);
    EXPECT_EQ(plan.transports[0].reply_id, 0x7E0u);
    EXPECT_EQ(plan.max_bytes, 0u);  // its frames are classic ones
    const std::string head = "[[device]]\ndevice = 0\nid = 0x7E8\nisotp_reply_id = 0x7E0\n";
    EXPECT_NE(problems_of(head + "bytes = 513\nsignals = [" + kFx + "]").at(0).find("bytes = 513 is outside 1 .. 512"),
              std::string::npos);
    EXPECT_NE(
        problems_of(head + "signals = [" + kFx + ", {id = 0x7E9, start = 16, length = 8, order = \"intel\"}]\nwindow_ms = 1")
            .at(0)
            .find("in the device's own message"),
        std::string::npos);
}

TEST_F(CanKeys, ReadSignalsOfADbcFileBesideTheConfiguration) {
    const CanPlan& plan = plan_of(
        "[[device]]\ndevice = 0\ndbc = \"g.dbc\"\nsignals = [\"Tip.Fx\", \"Torque.Mx\", \"Tip.Fy\"]\n"
        "sequence = \"Count\"\nwindow_ms = 3");
    const CanDevice& device = plan.devices.at(0);
    EXPECT_EQ(channels_of(device), (std::vector<Indices>{{0, 2}, {1}}));
    EXPECT_EQ(device.parts[0].id, 291u);
    EXPECT_TRUE(device.is_assembled_by_counter());
    EXPECT_EQ(device.window_ns, 3'000'000u);
    EXPECT_EQ(plan.max_bytes, 8u);
}

TEST_F(CanKeys, APlainSignalOfAMultiplexedMessageIsReadOnceASample) {
    const CanPlan& plan = plan_of(
        "[[device]]\ndevice = 0\ndbc = \"g.dbc\"\nsignals = [\"Taxels.Count\", \"Taxels.T1\", \"Taxels.T0\"]\nwindow_ms = "
        "3");
    const CanDevice& device = plan.devices.at(0);
    EXPECT_EQ(channels_of(device), (std::vector<Indices>{{0, 1}, {2}}));
    EXPECT_TRUE(device.parts[0].multiplexed);
    EXPECT_EQ(device.parts[0].selected, 1u);
    EXPECT_EQ(device.parts[1].selected, 0u);
    EXPECT_EQ(plan.ids.size(), 1u);
}

TEST_F(CanKeys, TellWhatIsWrongAndWhatWouldBeRight) {
    const std::string head = "[[device]]\ndevice = 0\n";
    const auto one = [&](const std::string& keys) {
        const Lines lines = problems_of(keys);
        return lines.size() == 1 ? lines[0] : fmt::format("{} problems", lines.size());
    };
    EXPECT_EQ(one(""), "t.toml:1: there is no [[link.device]]; add one with the messages of the channels");
    EXPECT_EQ(one(head + "id = 0x800\nsignals = [" + kFx + "]"), "t.toml:4: [[device]]: id = 2048 is outside 0 .. 2047");
    EXPECT_EQ(one(head + "id = 1\nbytes = 1\nsignals = [" + kFx + "]"),
              "t.toml:6: signals \"Fx\": 16 bits from start bit 0 (Intel) need 2 bytes, but the message has 1");
    EXPECT_EQ(one(head + "id = 1\nsignals = [{start = 0, length = 8, order = \"intel\", type = \"int\"}]"),
              "t.toml:5: [[signals]]: type = \"int\" is unknown; known: \"signed\", \"unsigned\", \"float\"");
    EXPECT_EQ(one(head + "id = 1\nsignals = [{start = 0, length = 8, order = \"intel\", type = \"signed\", mux = 2}]"),
              "t.toml:5: [[signals]]: mux needs the device's key selector = {start, length, order}, whose value it is");
    EXPECT_EQ(one(head + "id = 1\nsignals = [" + kFx + "]\n" + head + "id = 2\nsignals = [" + kFx + "]"),
              "t.toml:7: [[device]]: device = 0 is there already; give each its own number");
    EXPECT_EQ(one(head + "id = 1\nsignals = [" + kFx + "]\nwindow_ms = 3"),
              "t.toml:6: [[device]]: window_ms has no meaning where the sample is one message; leave it out");
    EXPECT_EQ(one(head + "dbc = \"none.dbc\"\nsignals = [\"Tip.Fx\"]"),
              "t.toml:4: [[device]]: none.dbc: there is no such file; give the path of one that exists");
    const std::string with_dbc = head + "dbc = \"g.dbc\"\n";
    EXPECT_EQ(one(with_dbc + "signals = [\"Tip.Fz\"]"),
              "t.toml:5: [[device]]: g.dbc:1: message \"Tip\" has no signal \"Fz\"; did you mean \"Fx\"?");
    EXPECT_EQ(one(with_dbc + "signals = [\"Top.Fx\"]"),
              "t.toml:5: [[device]]: g.dbc has no message \"Top\"; did you mean \"Tip\"?");
    EXPECT_EQ(one(with_dbc + "signals = [\"Fx\"]"), "t.toml:5: [[device]]: \"Fx\" should be \"MESSAGE.SIGNAL\"");
    EXPECT_EQ(
        one(with_dbc + "signals = [\"Nested.A\"]"),
        "t.toml:5: [[device]]: g.dbc:15: message \"Nested\" is multiplexed in several stages or by ranges, which is not "
        "understood; its signals without m can be used");
    EXPECT_EQ(one(with_dbc + "signals = [\"Tip.Fx\", \"Torque.Mx\"]"),
              "t.toml:2: [[device]]: the sample comes in 2 messages and no counter is in all of them: give window_ms, "
              "shorter than "
              "half the time between two samples, or a sequence");
    EXPECT_EQ(one(with_dbc + "signals = [\"Tip.Fx\"]\nsequence = \"Tip.Fy\""),
              "t.toml:6: [[device]]: a sequence counter is unsigned and has 2 .. 32 bits");
    EXPECT_EQ(one(with_dbc + "signals = [\"Tip.Fx\"]\nsequence = \"Torque.Count\""),
              "t.toml:6: [[device]]: sequence is in a message that none of the signals is in");
    EXPECT_EQ(one("stamp = \"hard\"\n" + head + "id = 1\nsignals = [" + kFx + "]"),
              "t.toml:2: stamp = \"hard\" is unknown; did you mean \"hardware\"? known: \"software\", \"hardware\"");
    std::ofstream(folder_ + "/bad.dbc") << "BO_ 1 A: 8 X\n SG_ F : 60|8@1+ (1,0)\n";
    EXPECT_EQ(one(head + "dbc = \"bad.dbc\"\nsignals = [\"A.F\"]"),
              "t.toml:4: [[device]]: bad.dbc:2: signal \"F\": 8 bits from start bit 60 (Intel) need 9 bytes, but the "
              "message has 8");
}

TEST_F(CanKeys, TheExampleOfTheDocumentedConfigurationIsRight) {
    std::ifstream file(TACTILED_SOURCE_DIR "/config/tactiled.toml");
    std::string example;
    bool inside = false;
    for (std::string line; std::getline(file, line);) {  // a commented [[link]] of driver "can", to the next empty line
        if (line == "# [[link]]") example.clear(), inside = true;
        if (line.empty() || line[0] != '#') inside = false;
        if (inside) example += line.substr(std::min<std::size_t>(2, line.size())) + "\n";  // "#" alone, too
        if (!inside && example.find("driver = \"can\"") != example.npos) break;
    }
    ASSERT_NE(example.find("driver = \"can\""), example.npos);
    Problems problems;
    Options root = Options::parse_text(example, TACTILED_SOURCE_DIR "/config/tactiled.toml", problems);
    for (auto& link : root.tables("link")) {
        (void)link.text("name");
        (void)Drivers::find(link.text("driver"))->make(link);
    }
    root.finish();
    EXPECT_EQ(problems.lines(), Lines{});
}

TEST_F(CanKeys, AnInterfaceThatIsNotThereIsSaidSo) {
    Problems problems;
    Options options = Options::parse_text("interface = \"nocan7\"\n[[device]]\ndevice = 0\nid = 1\nsignals = [" + kFx + "]",
                                          "t.toml", problems);
    const auto driver = Drivers::find("can")->make(options);
    const std::string why = driver->open();
    EXPECT_TRUE(why == "there is no interface nocan7: plug it in; `ip -br link` lists the interfaces" ||
                why.starts_with("no CAN in this kernel"))
        << why;
    EXPECT_FALSE(driver->has_more());
    driver->close();
}

}  // namespace
}  // namespace tactiled
