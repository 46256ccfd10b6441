// The wrench on the gripper: turned, about the gripper's origin, less the weight of the hand; and the fit of that weight.
#include "decoupling/tool/tool.hpp"
#include "tests/unit/placed.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

#include "decoupling/tool/tool_fit.hpp"

namespace tactiled::tool {
namespace {

constexpr double kG = 9.80665;
using Vector3 = Eigen::Vector3d;

Vector3 down(double tilt_deg, double towards_deg) {
    const double a = tilt_deg * 3.14159265358979 / 180, b = towards_deg * 3.14159265358979 / 180;
    return kG * Vector3(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
}
Vector as_vector(const Vector3& v) { return {v.x(), v.y(), v.z()}; }

// A hand behind a wrist sensor that is turned and sits behind the palm.
struct SimulatedHand {
    Eigen::Matrix3d S_from_G = Eigen::AngleAxisd(0.7, Vector3(0.3, -0.5, 0.8).normalized()).toRotationMatrix();
    Vector3 position_G{0.01, -0.005, -0.12}, centre_G{0.004, 0.012, -0.03};
    double mass_kg = 0.8, noise_N = 0.01, noise_Nm = 0.0005, gain = 1.003, told_wrong_rad = 0.002;
    Vector3 zero_S{3.1, -2.2, 1.4}, zero_S_Nm{0.05, 0.02, -0.08};
    Vector3 force_G{0, 0, 0}, at_G{0, 0, 0.02};  // force of the world
    std::mt19937_64 random{5};

    double normal(double sd) { return std::normal_distribution<double>(0, sd)(random); }
    Sample read(const Vector3& gravity_G, std::uint64_t t_ns) {
        const Vector3 weight_G = mass_kg * gravity_G, force = S_from_G * (weight_G + force_G);
        const Vector3 torque = S_from_G * ((centre_G - position_G).cross(weight_G) + (at_G - position_G).cross(force_G));
        Sample s{.t_ns = t_ns, .quality = TACTILED_GOOD};
        for (std::size_t i = 0; i < 3; ++i) {
            const auto k = Eigen::Index(i);
            s.raw_S[i] = gain * force[k] + zero_S[k] + normal(noise_N);
            s.raw_S[i + 3] = gain * torque[k] + zero_S_Nm[k] + normal(noise_Nm);
            s.sd[i] = noise_N;
            s.sd[i + 3] = noise_Nm;
        }
        s.budget = unrelated_budget(s.sd);
        return s;
    }
    Vector told(const Vector3& gravity_G) {
        const Vector3 axis = Vector3(normal(1), normal(1), normal(1)).normalized();
        return as_vector(Eigen::AngleAxisd(told_wrong_rad, axis) * gravity_G);
    }
    [[nodiscard]] std::array<Vector, 3> rows() const {
        return {as_vector(S_from_G.row(0)), as_vector(S_from_G.row(1)), as_vector(S_from_G.row(2))};
    }
    Fit fit(std::size_t n) {
        std::vector<Pose> poses;
        for (std::size_t i = 0; i < n; ++i) {
            const Vector3 g = down(i == 0 ? 0 : 35 + 70.0 * double(i % 2), 137.5 * double(i));
            Pose pose{told(g), {}};
            for (int k = 0; k < 500; ++k) {
                const Sample s = read(g, 0);
                for (std::size_t c = 0; c < 6; ++c) pose.raw_S[c] += s.raw_S[c] / 500;
            }
            poses.push_back(pose);
        }
        return fit_tool(poses, rows(), as_vector(position_G));
    }
    [[nodiscard]] Setup setup(const Fit& f) const {
        return {.sensors = {{.sensor = 0,
                             .S_from_G = rows(),
                             .position_G_m = as_vector(position_G),
                             .mass_kg = f.mass_kg,
                             .mass_sd_kg = f.mass_sd_kg,
                             .centre_G_m = f.centre_G_m,
                             .centre_sd_m = f.centre_sd_m,
                             .zero_S_N = f.zero_S_N,
                             .zero_S_Nm = f.zero_S_Nm,
                             .zero_sd_N = f.zero_sd_N,
                             .zero_sd_Nm = f.zero_sd_Nm}}};
    }
};

// Means over `seconds` at rest, after so long that the hand counts as still.
struct Rested {
    Vector3 force_N = Vector3::Zero(), torque_Nm = Vector3::Zero();
    tactiled_tool last{};
};
Rested rest(Tool& tool, SimulatedHand& hand, const Vector3& gravity_G, std::uint64_t& t_ns) {
    tool.gravity(hand.told(gravity_G));
    Rested out;
    for (int i = 0; i < 1500; ++i) {
        tool.sample(0, hand.read(gravity_G, t_ns += 1'000'000));
        if (i < 1000) continue;
        out.last = tool.state();
        out.force_N += Vector3(out.last.force_G_N) / 500;
        out.torque_Nm += Vector3(out.last.torque_G_Nm) / 500;
    }
    return out;
}

TEST(Tool, TwentyPosesOfAHandLeaveLessThanOnePercentOfItsWeight) {
    for (const std::size_t n : {std::size_t(4), std::size_t(6), std::size_t(10)}) {
        SimulatedHand hand;
        const Fit fit = hand.fit(n);
        ASSERT_EQ(fit.fault, "");
        EXPECT_NEAR(fit.mass_kg, 0.8, 0.008);
        Tool tool(hand.setup(fit));
        std::mt19937_64 random(n);
        std::uniform_real_distribution<double> any(0, 1);
        std::uint64_t t_ns = 1'000'000'000;
        double worst = 0, worst_Nm = 0;
        for (int pose = 0; pose < 20; ++pose) {
            const Rested left =
                rest(tool, hand, down(std::acos(1 - 2 * any(random)) * 180 / 3.14159, 360 * any(random)), t_ns);
            ASSERT_EQ(left.last.quality, TACTILED_GOOD) << left.last.why;
            worst = std::max(worst, left.force_N.norm() / (0.8 * kG));
            worst_Nm = std::max(worst_Nm, left.torque_Nm.norm());
            for (int k = 0; k < 3; ++k) {
                EXPECT_LT(std::abs(left.last.force_G_N[k]), 4 * left.last.sd_force_N[k]);
                EXPECT_LT(std::abs(left.last.torque_G_Nm[k]), 4 * left.last.sd_torque_Nm[k]);
            }
        }
        std::printf("fitted in %zu poses: worst remaining force %.2f %% of the weight, torque %.4f Nm\n", n, 100 * worst,
                    worst_Nm);
        EXPECT_LT(worst, 0.01);
        EXPECT_LT(worst_Nm, 0.02);
    }
}

TEST(Tool, AForceIsThatOfTheWorldAndItsTorqueIsAboutTheOrigin) {
    SimulatedHand hand;
    Tool tool(hand.setup(hand.fit(6)));
    hand.force_G = {1.5, -4, 6};
    std::uint64_t t_ns = 1'000'000'000;
    const Rested seen = rest(tool, hand, down(40, 70), t_ns);
    EXPECT_LT((seen.force_N - hand.force_G).norm(), 0.1);
    EXPECT_LT((seen.torque_Nm - hand.at_G.cross(hand.force_G)).norm(), 0.02);
}

TEST(Tool, ATareInOnePoseHoldsInAnother) {
    SimulatedHand hand;
    const Fit fit = hand.fit(6);
    hand.zero_S += Vector3(0.8, -0.6, 0.4);  // has drifted since
    Tool tool(hand.setup(fit));
    std::uint64_t t_ns = 1'000'000'000;
    const Vector3 then = down(30, 10);
    tool.gravity(as_vector(then));
    std::array<double, 6> zero{};
    for (int i = 0; i < 200; ++i) {
        Sample s = hand.read(then, t_ns += 1'000'000);
        for (std::size_t c = 0; c < 6; ++c) zero[c] += s.raw_S[c] / 200;
        s.taring = true;
        tool.sample(0, s);
    }
    Vector3 left = Vector3::Zero();
    const Vector3 now = down(120, 200);
    tactiled_tool state{};
    for (int i = 0; i < 2000; ++i) {
        if (i == 10) tool.gravity(as_vector(now));
        Sample s = hand.read(i < 10 ? then : now, t_ns += 1'000'000);
        s.tare_count = 1;
        s.tare_S = zero;
        tool.sample(0, s);
        state = tool.state();
        if (i >= 1500) left += Vector3(state.force_G_N) / 500;
    }
    EXPECT_EQ(state.quality, TACTILED_GOOD);
    EXPECT_LT(left.norm(), 0.01 * 0.8 * kG);
}

TEST(Tool, ATareWhileGravityIsNotKnownLeavesNoValue) {
    SimulatedHand hand;
    Tool tool(hand.setup(hand.fit(6)));
    std::uint64_t t_ns = 1'000'000'000;
    Sample s = hand.read(down(0, 0), t_ns += 1'000'000);
    s.taring = true;
    tool.sample(0, s);
    s.taring = false;
    s.tare_count = 1;
    tool.sample(0, s);
    tool.gravity(as_vector(down(0, 0)));
    tool.sample(0, s);
    const tactiled_tool state = tool.state();
    EXPECT_EQ(state.quality, TACTILED_BAD);
    EXPECT_EQ(state.why & TACTILED_TOOL_TARE, TACTILED_TOOL_TARE);
    EXPECT_TRUE(std::isnan(state.force_G_N[0]));
}

TEST(Tool, ATareOfAnEarlierRunLeavesNoValueOnceTheHandTurns) {
    SimulatedHand hand;
    tool::Setup setup = hand.setup(hand.fit(6));
    setup.gravity_G_m_s2 = {0, 0, kG};
    Tool tool(setup);
    Sample s = hand.read(down(0, 0), 1'000'000'000);
    s.tare_count = 1;
    tool.sample(0, s);
    EXPECT_EQ(tool.state().quality, TACTILED_GOOD);  // a hand that does not turn
    tool.gravity(as_vector(down(60, 0)));
    EXPECT_EQ(tool.state().why & TACTILED_TOOL_TARE, TACTILED_TOOL_TARE);
    EXPECT_EQ(tool.state().quality, TACTILED_BAD);
}

TEST(Tool, WithoutGravityOrASensorThereIsNoSum) {
    SimulatedHand hand;
    tool::Setup setup = hand.setup(hand.fit(6));
    setup.sensors.push_back({.sensor = 3});
    Tool tool(setup);
    Sample s = hand.read(down(0, 0), 1'000'000'000), light{.t_ns = 1'000'000'000, .quality = TACTILED_GOOD};
    tool.sample(0, s);
    tool.sample(1, light);
    tactiled_tool state = tool.state();
    EXPECT_EQ(state.quality, TACTILED_BAD);
    EXPECT_EQ(state.why & TACTILED_TOOL_GRAVITY, TACTILED_TOOL_GRAVITY);
    EXPECT_EQ(state.sensor_quality[3], TACTILED_GOOD);  // carries nothing: gravity does not matter
    EXPECT_EQ(state.sensors, 1u | 8u);
    EXPECT_EQ(state.bad, 1u);
    tool.gravity(as_vector(down(0, 0)));
    EXPECT_EQ(tool.state().quality, TACTILED_GOOD);
    light.quality = TACTILED_UNCERTAIN;
    tool.sample(1, light);
    EXPECT_EQ(tool.state().quality, TACTILED_UNCERTAIN);
    light.quality = TACTILED_BAD;
    tool.sample(1, light);
    state = tool.state();
    EXPECT_EQ(state.quality, TACTILED_BAD);
    EXPECT_EQ(state.bad, 8u);
    for (int k = 0; k < 3; ++k) {
        EXPECT_TRUE(std::isnan(state.force_G_N[k] * state.torque_G_Nm[k] * state.sd_force_N[k] * state.sd_torque_Nm[k]));
        EXPECT_TRUE(std::isnan(state.sensor_force_G_N[3][k]));
        EXPECT_FALSE(std::isnan(state.sensor_force_G_N[0][k]));
    }
    tool.gravity({kNaN, kNaN, kNaN});
    EXPECT_EQ(tool.state().why & TACTILED_TOOL_GRAVITY, TACTILED_TOOL_GRAVITY);
}

TEST(Tool, AnAccelerationThatNothingReportsIsInTheDeviation) {
    SimulatedHand hand;
    Tool tool(hand.setup(hand.fit(6)));
    std::uint64_t t_ns = 1'000'000'000;
    rest(tool, hand, down(0, 0), t_ns);
    EXPECT_EQ(tool.state().why & TACTILED_TOOL_MOVES, 0u);
    for (int i = 0; i < 50; ++i) tool.sample(0, hand.read(down(0, 0) + Vector3(0, 0, 2), t_ns += 1'000'000));
    tactiled_tool moving = tool.state();
    EXPECT_EQ(moving.why & TACTILED_TOOL_MOVES, TACTILED_TOOL_MOVES);
    EXPECT_LT(std::abs(moving.force_G_N[2]), 2 * moving.sd_force_N[2]);
    tool.acceleration({0, 0, -2}, t_ns);  // upward acceleration adds to the weight
    moving = tool.state();
    EXPECT_EQ(moving.why & TACTILED_TOOL_MOVES, 0u);
    EXPECT_LT(std::abs(moving.force_G_N[2]), 0.1);
}

TEST(Tool, AComponentThatIsNotSeenIsNoNumber) {
    Tool tool({.sensors = {{.sensor = 0, .S_from_G = {{{0, -1, 0}, {0, 0, -1}, {1, 0, 0}}}, .position_G_m = {0, 0.02, 0}}}});
    Sample s{.t_ns = 1,
             .raw_S = {kNaN, 2, -3, kNaN, kNaN, kNaN},
             .sd = {0.1, 0.1, 0.1, kNaN, kNaN, kNaN},
             .quality = TACTILED_GOOD};
    s.budget = unrelated_budget(s.sd);
    tool.sample(0, s);
    const tactiled_tool state = tool.state();
    EXPECT_DOUBLE_EQ(state.force_G_N[0], -3);
    EXPECT_TRUE(std::isnan(state.force_G_N[1]));
    EXPECT_DOUBLE_EQ(state.force_G_N[2], -2);
    EXPECT_EQ(state.why & TACTILED_TOOL_TORQUE, TACTILED_TOOL_TORQUE);
    EXPECT_TRUE(std::isnan(state.torque_G_Nm[0]));
}

TEST(Tool, SamplesFarApartAreUncertain) {
    Tool tool({.sensors = {{.sensor = 0}, {.sensor = 1}}});
    tool.sample(0, {.t_ns = 1'000'000'000, .quality = TACTILED_GOOD});
    tool.sample(1, {.t_ns = 1'300'000'000, .quality = TACTILED_GOOD});
    EXPECT_EQ(tool.state().quality, TACTILED_UNCERTAIN);
    EXPECT_EQ(tool.state().why, TACTILED_TOOL_APART);
    EXPECT_EQ(tool.state().t_ns, 1'000'000'000u);
}

TEST(ToolFit, RefusesPosesThatDoNotTellTheMass) {
    SimulatedHand hand;
    EXPECT_NE(hand.fit(3).fault, "");
    std::vector<Pose> same;
    for (int i = 0; i < 6; ++i) {
        const Vector3 g = down(5, 60.0 * i);
        same.push_back({as_vector(g), hand.read(g, 0).raw_S});
    }
    EXPECT_NE(fit_tool(same, hand.rows(), {}).fault.find("turn the hand about two axes"), std::string::npos);
    std::vector<Pose> reversed;
    for (int i = 0; i < 6; ++i) {
        const Vector3 g = down(30.0 * i, 137.0 * i);
        reversed.push_back({as_vector(-g), hand.read(g, 0).raw_S});
    }
    EXPECT_NE(fit_tool(reversed, hand.rows(), {}).fault.find("wrong sign"), std::string::npos);
}

}  // namespace
}  // namespace tactiled::tool
