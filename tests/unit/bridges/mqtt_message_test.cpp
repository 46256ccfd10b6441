// Texts and deadband of tactiled-mqtt.
#include "node/bridges/mqtt_message.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "node/bridges/mqtt_discovery.hpp"

namespace tactiled::bridges::mqtt {
namespace {

tactiled_sample good(double fz_N) {
    tactiled_sample s{};
    s.quality = TACTILED_GOOD;
    s.t_ns = monotonic_ns();
    s.sequence = 5;
    s.force_S_N[2] = fz_N;
    for (double& m : s.torque_S_Nm) m = std::nan("");
    return s;
}

TEST(MqttMessage, AnUnknownValueIsNull) {
    const auto message = nlohmann::json::parse(wrench_text({good(-3), 4, 1}, monotonic_ns() + 100'000'000, true));
    EXPECT_EQ(message["force_N"], nlohmann::json::array({0.0, 0.0, -3.0}));
    EXPECT_EQ(message["torque_Nm"], nlohmann::json::array({nullptr, nullptr, nullptr}));
    EXPECT_EQ(message["quality"], "good");
    EXPECT_EQ(message["simulated"], true);
    EXPECT_EQ(message["samples"], 4);
    EXPECT_EQ(message["bad"], 1);
    EXPECT_NEAR(message["t_s"], double(::time(nullptr)), 1.1);
    EXPECT_NEAR(double(message["valid_until_s"]) - double(message["t_s"]), 0.1, 0.01);
}

TEST(MqttMessage, ABadSampleHasNoNumbers) {
    tactiled_sample s = good(-3);
    tactiled_invalidate(&s, TACTILED_STALE);
    const auto message = nlohmann::json::parse(wrench_text({s, 1, 1}, s.t_ns, false));
    EXPECT_EQ(message["force_N"], nlohmann::json::array({nullptr, nullptr, nullptr}));
    EXPECT_EQ(message["reasons"], nlohmann::json::array({"stale"}));
}

TEST(MqttMessage, TheLaterOneOfTwoSendersGivesWay) {
    const Sender first{"b", 1.0}, later{"a", 2.0}, same_time{"c", 1.0};
    EXPECT_TRUE(gives_way(later, first));
    EXPECT_FALSE(gives_way(first, later));
    EXPECT_NE(gives_way(first, same_time), gives_way(same_time, first));
    EXPECT_FALSE(gives_way(first, first));
    EXPECT_FALSE(gives_way(first, sender_of(last_will_text())));
    EXPECT_TRUE(gives_way(later, sender_of(R"({"online":true,"bridge":"b","since_s":1})")));
    for (const char* rubbish : {"", "[]", "{", R"({"online":true})", R"({"online":true,"bridge":1,"since_s":"x"})"})
        EXPECT_FALSE(gives_way(later, sender_of(rubbish))) << rubbish;
}

TEST(MqttMessage, ABridgeSendsWhenItWouldHaveHeardAnEarlierOne) {
    constexpr std::uint64_t kStart = 5'000'000'000, kListen = Precedence::kListenNs, kExpiry = kExpiryS * 1'000'000'000ull;
    const std::string first = R"({"online":true,"bridge":"b","since_s":1})";
    Precedence precedence("gripper");
    EXPECT_TRUE(precedence.is_silent());
    precedence.listen(kStart);
    EXPECT_FALSE(precedence.hear("", kStart + kListen - 1));
    EXPECT_TRUE(precedence.is_silent());
    EXPECT_FALSE(precedence.gives_way());
    EXPECT_TRUE(precedence.hear(last_will_text(), kStart + kListen));
    EXPECT_FALSE(precedence.is_silent());
    EXPECT_FALSE(precedence.hear("", kStart + kListen + 1)) << "it has sent before";

    const std::uint64_t again = kStart + 2 * kListen;
    precedence.listen(again);
    EXPECT_TRUE(precedence.is_silent());
    EXPECT_FALSE(precedence.hear(first, again + 1));
    EXPECT_FALSE(precedence.hear("", again + kExpiry));
    EXPECT_TRUE(precedence.gives_way());
    precedence.listen(again + kExpiry);  // a connection that begins as the other one ends
    EXPECT_FALSE(precedence.hear("", again + kExpiry + 1));
    EXPECT_TRUE(precedence.hear("", again + kExpiry + kListen));
    EXPECT_FALSE(precedence.gives_way());
}

TEST(MqttMessage, AGraspThatIsNotKnownHasNoWeight) {
    tactiled_grasp grasp{};
    tactiled_forget_grasp(&grasp);
    const auto message = nlohmann::json::parse(grasp_text(grasp, TACTILED_GOOD, false));
    EXPECT_EQ(message["state"], "unknown");
    EXPECT_EQ(message["quality"], "bad");
    const auto weight = nlohmann::json::parse(weight_text(grasp, TACTILED_GOOD, {}, false));
    EXPECT_TRUE(weight["weight_kg"].is_null());
    EXPECT_EQ(weight["quality"], "bad");
}

TEST(MqttMessage, AWeightNamesItsDoubtsAndJaws) {
    tactiled_grasp grasp{};
    grasp.state = TACTILED_GRIP_HOLDING;
    grasp.weight_state = TACTILED_WEIGHT_ESTIMATING;
    grasp.weight_kg = 0.2;
    grasp.weight_doubts = TACTILED_DOUBT_BALANCE | TACTILED_DOUBT_LATE;
    grasp.doubtful = 2;
    const auto weight = nlohmann::json::parse(weight_text(grasp, TACTILED_GOOD, {"left", "right"}, false));
    EXPECT_EQ(weight["quality"], "uncertain");
    EXPECT_EQ(weight["doubts"], nlohmann::json::array({"balance", "late"}));
    EXPECT_EQ(weight["doubtful"], nlohmann::json::array({"right"}));
    EXPECT_NEAR(double(weight["valid_until_s"]) - double(weight["t_s"]), 2, 0.001);
    EXPECT_EQ(without_times(weight_text(grasp, TACTILED_GOOD, {}, false)),
              without_times(weight_text(grasp, TACTILED_GOOD, {}, false)));
}

TEST(MqttMessage, AWrenchOnTheGripperHasItsReasons) {
    tactiled_tool tool{};
    tool.t_ns = monotonic_ns();
    tool.quality = TACTILED_GOOD;
    tool.why = TACTILED_TOOL_GRAVITY | TACTILED_TOOL_APART;
    tactiled_forget_tool(&tool);
    const auto message = nlohmann::json::parse(tool_text(tool, tool.t_ns, false));
    EXPECT_EQ(message["quality"], "bad");
    EXPECT_EQ(message["reasons"], nlohmann::json::array({"gravity", "apart"}));
    EXPECT_EQ(message["force_N"], nlohmann::json::array({nullptr, nullptr, nullptr}));
}

TEST(MqttDiscovery, NamesTheMeasuredComponentsAndTheQuality) {
    tactiled_sensor sensor{};
    std::string("left").copy(sensor.name, 31);
    sensor.components = 0b000111;
    const auto messages = discovery("homeassistant", {"tactiled", "gripper-7"}, sensor);
    ASSERT_EQ(messages.size(), 4u);
    EXPECT_EQ(messages[2].first, "homeassistant/sensor/tactiled_gripper_7_left/Fz/config");
    const auto text = nlohmann::json::parse(messages[2].second);
    EXPECT_EQ(text["state_topic"], "tactiled/gripper-7/left/wrench");
    EXPECT_EQ(text["value_template"], "{{ value_json.force_N[2] }}");
    EXPECT_EQ(messages[3].first, "homeassistant/sensor/tactiled_gripper_7_left/quality/config");
}

TEST(MqttDiscovery, EachEntityEndsWithTheStateAndExpires) {
    const Topics topics{"tactiled", "gripper"};
    tactiled_sensor sensor{};
    std::string("left").copy(sensor.name, 31);
    sensor.components = 0b111111;
    auto messages = discovery("ha", topics, sensor);
    for (auto& message : discovery("ha", topics, true, true)) messages.push_back(message);
    EXPECT_EQ(messages.size(), 7u + 3u + 6u + 1u);
    EXPECT_EQ(discovery("ha", topics, false, false).size(), 1u);  // the faults
    for (const auto& [topic, text] : messages) {
        const auto entity = nlohmann::json::parse(text);
        EXPECT_EQ(entity["expire_after"], 2) << topic;
        EXPECT_EQ(entity["availability_mode"], "all") << topic;
        EXPECT_EQ(entity["availability"][0]["topic"], "tactiled/gripper/state") << topic;
        ASSERT_EQ(entity["availability"].size(), 2u) << topic;
        EXPECT_NE(entity["availability"][1]["topic"], "tactiled/gripper/state") << topic << ": it is retained";
    }
}

TEST(Deadband, LeavesSmallMovesOutAndAddsThemUp) {
    Deadband band(0.1, 0.1);
    std::uint64_t now_ns = 1'000'000'000'000;
    EXPECT_TRUE(band.passes(good(0), now_ns));
    EXPECT_FALSE(band.passes(good(0.06), now_ns));
    EXPECT_TRUE(band.passes(good(0.12), now_ns));
    EXPECT_FALSE(band.passes(good(0.12), now_ns + kRenewNs - 1));
    EXPECT_TRUE(band.passes(good(0.12), now_ns + kRenewNs));
    tactiled_sample bad = good(0.12);
    tactiled_invalidate(&bad, TACTILED_STALE);
    EXPECT_TRUE(band.passes(bad, now_ns + kRenewNs + 1));
    EXPECT_FALSE(band.passes(bad, now_ns + kRenewNs + 2));
    EXPECT_TRUE(band.passes(good(0.12), now_ns + kRenewNs + 3));
}

TEST(Deadband, OfZeroLetsEachSampleOfAKnownValuePass) {
    Deadband band(0, 0);
    EXPECT_TRUE(band.passes(good(1), 1));
    EXPECT_TRUE(band.passes(good(1), 2));
}

}  // namespace
}  // namespace tactiled::bridges::mqtt
