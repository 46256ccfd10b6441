// Texts and deadband of tactiled-mqtt.
#include "node/bridges/mqtt_message.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

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
    const auto message = nlohmann::json::parse(wrench_text({good(-3), 4, 1}));
    EXPECT_EQ(message["force_N"], nlohmann::json::array({0.0, 0.0, -3.0}));
    EXPECT_EQ(message["torque_Nm"], nlohmann::json::array({nullptr, nullptr, nullptr}));
    EXPECT_EQ(message["quality"], "good");
    EXPECT_EQ(message["samples"], 4);
    EXPECT_EQ(message["bad"], 1);
    EXPECT_NEAR(message["t_s"], double(::time(nullptr)), 1.1);
}

TEST(MqttMessage, ABadSampleHasNoNumbers) {
    tactiled_sample s = good(-3);
    tactiled_invalidate(&s, TACTILED_STALE);
    const auto message = nlohmann::json::parse(wrench_text({s, 1, 1}));
    EXPECT_EQ(message["force_N"], nlohmann::json::array({nullptr, nullptr, nullptr}));
    EXPECT_EQ(message["reasons"], nlohmann::json::array({"stale"}));
}

TEST(MqttMessage, AGraspThatIsNotKnownHasNoWeight) {
    tactiled_grasp grasp{};
    tactiled_forget_grasp(&grasp);
    const auto message = nlohmann::json::parse(grasp_text(grasp));
    EXPECT_EQ(message["state"], "unknown");
    EXPECT_TRUE(message["weight_kg"].is_null());
}

TEST(MqttMessage, DiscoveryNamesTheMeasuredComponentsAlone) {
    tactiled_sensor sensor{};
    std::string("left").copy(sensor.name, 31);
    sensor.components = 0b000111;
    const auto messages = discovery("homeassistant", {"tactiled", "gripper-7"}, sensor);
    ASSERT_EQ(messages.size(), 3u);
    EXPECT_EQ(messages[2].first, "homeassistant/sensor/tactiled_gripper_7_left/Fz/config");
    const auto text = nlohmann::json::parse(messages[2].second);
    EXPECT_EQ(text["state_topic"], "tactiled/gripper-7/left/wrench");
    EXPECT_EQ(text["value_template"], "{{ value_json.force_N[2] }}");
}

TEST(Deadband, LeavesSmallMovesOutAndAddsThemUp) {
    Deadband band(0.1, 0.1, 10);
    std::uint64_t now_ns = 1'000'000'000'000;
    EXPECT_TRUE(band.passes(good(0), now_ns));
    EXPECT_FALSE(band.passes(good(0.06), now_ns));
    EXPECT_TRUE(band.passes(good(0.12), now_ns));
    EXPECT_FALSE(band.passes(good(0.12), now_ns + 9'000'000'000));
    EXPECT_TRUE(band.passes(good(0.12), now_ns + 10'000'000'000));
    tactiled_sample bad = good(0.12);
    tactiled_invalidate(&bad, TACTILED_STALE);
    EXPECT_TRUE(band.passes(bad, now_ns + 10'000'000'001));
    EXPECT_FALSE(band.passes(bad, now_ns + 10'000'000'002));
    EXPECT_TRUE(band.passes(good(0.12), now_ns + 10'000'000'003));
}

TEST(Deadband, OfZeroLetsEachSampleOfAKnownValuePass) {
    Deadband band(0, 0, 10);
    EXPECT_TRUE(band.passes(good(1), 1));
    EXPECT_TRUE(band.passes(good(1), 2));
}

}  // namespace
}  // namespace tactiled::bridges::mqtt
