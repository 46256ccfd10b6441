// The grasp in the pipeline: the estimator's input, and its commands.
#include "node/grasping.hpp"
#include "tests/unit/placed.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/milliseconds.hpp"

namespace tactiled {
namespace {

// Two jaws that face each other along y of G, gravity along -z; sensors 1 and 3 of the node.
std::optional<Grasping::Setup> two_jaws() {
    Grasping::Setup setup;
    setup.estimator.jaws.resize(2);
    setup.estimator.jaws[0].sensor = 1;
    setup.estimator.jaws[0].S_from_G = {{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}};
    setup.estimator.jaws[1].sensor = 3;
    setup.estimator.jaws[1].S_from_G = {{{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}}};
    setup.estimator.gravity_G = {0, 0, -9.81};
    setup.estimator.friction = 0.8;
    setup.estimator.lift_accelerates_ms = 150;
    TaughtObject bolt;
    bolt.id = 4;
    bolt.name = "bolt";
    bolt.mass_kg = 0.2;
    bolt.sd_kg = 0.004;
    setup.objects = {bolt};
    return setup;
}

class GraspingTest : public testing::Test {
protected:
    // Sends `ms` of samples of both jaws, each with this press and this pull along its x; raw values have an
    // additional zero.
    void observe(double press_N, double pull_N, int ms, std::uint32_t tare_count = 1, std::uint32_t method = 0) {
        for (int i = 0; i < ms; ++i) {
            t_ns_ += kMs;
            for (const std::uint32_t sensor : {1u, 3u}) {
                tactiled_sample s{};
                s.t_ns = t_ns_;
                s.quality = TACTILED_GOOD;
                s.tare_count = tare_count;
                s.state = method << 16;
                s.force_S_N[2] = 1000;  // low-passed: must not be used
                s.raw_force_S_N[0] = zero_[0] + pull_N + 0.001 * (i % 2);
                s.raw_force_S_N[2] = zero_[2] - press_N + 0.001 * (i % 2);
                for (auto& sd : s.sd_force_N) sd = 0.005;
                grasping_.observe(sensor, placed(s), zero_);
            }
        }
    }
    void hold_200_g() {
        observe(0, 0, 500);
        observe(5, 0, 300);
        observe(5, -0.981, 900);
    }
    static Command command(Command::Kind kind) {
        Command c;
        c.kind = kind;
        return c;
    }
    Grasping grasping_{two_jaws()};
    Wrench zero_{0.3, 0, -2, 0, 0, 0};
    std::uint64_t t_ns_ = 1'000'000'000;
};

TEST_F(GraspingTest, TwoJawsThatPressAndCarryHoldWhatTheyCarry) {
    hold_200_g();
    const tactiled_grasp g = grasping_.state();
    EXPECT_EQ(g.state, unsigned(TACTILED_GRIP_HOLDING));
    EXPECT_EQ(g.weight_state, unsigned(TACTILED_WEIGHT_STABLE));
    EXPECT_NEAR(g.weight_kg, 0.2, 0.002);
    EXPECT_EQ(g.object_id, 4u);
    EXPECT_STREQ(g.object, "bolt");
    EXPECT_NEAR(g.grip_N, 5, 0.05);
    EXPECT_EQ(g.slip_state[1], TACTILED_SLIP_NONE);
    EXPECT_EQ(g.slip_state[0], TACTILED_SLIP_UNKNOWN);  // no jaw
    EXPECT_EQ(g.grasps, 1u);
}

TEST_F(GraspingTest, ASensorThatIsNoJawIsNobodysConcern) {
    hold_200_g();
    tactiled_sample bad{};
    bad.quality = TACTILED_BAD;
    grasping_.observe(0, placed(bad), {});
    EXPECT_EQ(grasping_.state().state, unsigned(TACTILED_GRIP_HOLDING));
}

TEST_F(GraspingTest, AJawWithoutAValueMakesTheGraspUnknown) {
    hold_200_g();
    tactiled_sample bad{};
    bad.t_ns = t_ns_;
    tactiled_invalidate(&bad, TACTILED_STALE);
    grasping_.observe(3, placed(bad), zero_);
    const tactiled_grasp g = grasping_.state();
    EXPECT_EQ(g.state, unsigned(TACTILED_GRIP_UNKNOWN));
    EXPECT_TRUE(std::isnan(g.weight_kg));
}

TEST_F(GraspingTest, ANewZeroIsADiscontinuityAndNoEventOfTheWorld) {
    hold_200_g();
    zero_ = {0.3 - 0.981, 0, -7, 0, 0, 0};  // tared during the grasp: press and load read 0
    observe(5, -0.981, 1, 2);
    const tactiled_grasp g = grasping_.state();
    EXPECT_NE(g.state, unsigned(TACTILED_GRIP_LOST));
    EXPECT_TRUE(std::isnan(g.weight_kg));  // the weight is unknown until the release
}

TEST_F(GraspingTest, AnotherMethodIsADiscontinuityAndNoEventOfTheWorld) {
    observe(0, 0, 500, 1, 1);
    observe(5, 0, 300, 1, 1);
    observe(5, -0.981, 900, 1, 1);
    ASSERT_NEAR(grasping_.state().weight_kg, 0.2, 0.002);
    for (int i = 0; i < 300; ++i) {
        observe(5, -0.883, 1, 1, 2);  // reads shear 10 % lower
        const tactiled_grasp g = grasping_.state();
        ASSERT_EQ(g.slips, 0u) << i;
        ASSERT_NE(g.weight_state, unsigned(TACTILED_WEIGHT_STABLE)) << i;  // 0.18 kg of 0.2
    }
}

TEST_F(GraspingTest, ABadSampleNamesNoMethodAndIsNoStep) {
    observe(0, 0, 500, 1, 1);
    tactiled_sample bad{};
    bad.t_ns = t_ns_;
    bad.tare_count = 1;
    tactiled_invalidate(&bad, TACTILED_MISSING_CHANNEL);
    grasping_.observe(3, placed(bad), zero_);
    observe(0, 0, 500, 1, 1);
    observe(5, 0, 300, 1, 1);
    observe(5, -0.981, 900, 1, 1);
    EXPECT_NEAR(grasping_.state().weight_kg, 0.2, 0.002);
}

TEST_F(GraspingTest, CommandsReachTheEstimator) {
    EXPECT_FALSE(grasping_.carry_out(command(Command::Kind::start_weighing)));  // no object is held
    hold_200_g();
    EXPECT_TRUE(grasping_.carry_out(command(Command::Kind::stop_weighing)));
    EXPECT_TRUE(std::isnan(grasping_.state().weight_kg));
    EXPECT_TRUE(grasping_.carry_out(command(Command::Kind::start_weighing)));
    observe(5, -0.981, 1000);
    Command known = command(Command::Kind::known_weight);
    known.mass_kg = 0.21;
    EXPECT_TRUE(grasping_.carry_out(known));
    EXPECT_NEAR(grasping_.state().weight_kg, 0.21, 1e-6);
    EXPECT_TRUE(grasping_.carry_out(command(Command::Kind::zero_weight)));
    observe(5, -0.981, 20);
    EXPECT_NEAR(grasping_.state().weight_kg, 0, 0.002);
    EXPECT_FALSE(grasping_.carry_out(command(Command::Kind::tare)));  // not a command of the grasp
}

TEST_F(GraspingTest, GravityThatIsNotKnownAnyMoreIsNoWeight) {
    hold_200_g();
    Command gravity = command(Command::Kind::gravity);
    gravity.robot_G_m_s2 = {NAN, NAN, NAN};
    EXPECT_TRUE(grasping_.carry_out(gravity));
    observe(5, -0.981, 20);
    EXPECT_EQ(grasping_.state().weight_state, unsigned(TACTILED_WEIGHT_NOT_OBSERVABLE));
    EXPECT_TRUE(std::isnan(grasping_.state().weight_kg));
}

TEST_F(GraspingTest, AHintThatExpiredIsShownUntilAllAreRenewedAndSurvivesAReload) {
    Command hint = command(Command::Kind::hint);
    hint.gripper = grasp::Hint::none;
    hint.hints_expired = true;
    hold_200_g();
    EXPECT_TRUE(grasping_.carry_out(hint));
    EXPECT_TRUE(grasping_.hints_expired());
    observe(5, -0.981, 20);
    EXPECT_NEAR(grasping_.state().weight_kg, 0.2, 0.002) << "the configured gravity is in force";
    Grasping next(two_jaws());
    next.succeed(grasping_);
    EXPECT_TRUE(next.hints_expired());
    hint.hints_expired = false;
    EXPECT_TRUE(next.carry_out(hint));
    EXPECT_FALSE(next.hints_expired());
}

TEST_F(GraspingTest, ObjectsAreReplacedAllAtOnce) {
    hold_200_g();
    TaughtObject nut;
    nut.id = 9;
    nut.name = "nut";
    nut.mass_kg = 0.2;
    nut.sd_kg = 0.004;
    Command objects = command(Command::Kind::objects);
    objects.objects = {&nut, 1};
    EXPECT_TRUE(grasping_.carry_out(objects));
    EXPECT_EQ(grasping_.state().object_id, 9u);
    objects.objects = {};
    EXPECT_TRUE(grasping_.carry_out(objects));
    EXPECT_EQ(grasping_.state().object_id, 0u);
}

TEST_F(GraspingTest, OnlyObjectsThatWereTaughtUnderTheScaleInForceAreRecognised) {
    TaughtObject nut;  // taught after a known weight was shown, before a restart
    nut.id = 9;
    nut.name = "nut";
    nut.mass_kg = 0.2;
    nut.sd_kg = 0.004;
    nut.scaled = true;
    Command objects = command(Command::Kind::objects);
    objects.objects = {&nut, 1};
    hold_200_g();
    EXPECT_EQ(grasping_.state().object_id, 4u);  // the bolt, taught without a scale
    EXPECT_TRUE(grasping_.carry_out(objects));
    observe(5, -0.981, 20);
    EXPECT_EQ(grasping_.state().object_id, 0u);
    EXPECT_EQ(grasping_.state().scale_shown, 0u);
    Command known = command(Command::Kind::known_weight);
    known.mass_kg = 0.2;
    EXPECT_TRUE(grasping_.carry_out(known));
    observe(5, -0.981, 20);
    EXPECT_EQ(grasping_.state().object_id, 9u);
    EXPECT_EQ(grasping_.state().scale_shown, 1u);
}

TEST_F(GraspingTest, ASuccessorCountsOnAndKnowsNothingElse) {
    hold_200_g();
    for (int ms = 0; ms < 300; ++ms) observe(5, -0.981 - 0.0099 * ms, 1);  // to the friction limit 0.8
    for (int ms = 0; ms < 5; ++ms) observe(5, -3.95 + 0.17 * ms, 1);       // and beyond it
    observe(5, -3.1, 5);
    const tactiled_grasp before = grasping_.state();
    ASSERT_GE(before.slips, 1u);
    ASSERT_NE(before.slip_latch, 0u);
    Grasping next(two_jaws());
    next.succeed(grasping_);
    tactiled_grasp after = next.state();
    EXPECT_EQ(after.slips, before.slips);
    EXPECT_EQ(after.grasps, before.grasps);
    EXPECT_EQ(after.slip_latch, before.slip_latch);
    EXPECT_EQ(after.slip_count[1], before.slip_count[1]);
    EXPECT_EQ(after.state, unsigned(TACTILED_GRIP_UNKNOWN));
    EXPECT_TRUE(std::isnan(after.weight_kg));
    Command clear = command(Command::Kind::clear_slips);
    clear.mask = 1u << 1;
    next.carry_out(clear);
    after = next.state();
    EXPECT_EQ(after.slip_latch, before.slip_latch & ~(1u << 1));
}

TEST_F(GraspingTest, ASuccessorKnowsWhatTheRobotHasReported) {
    Command gravity = command(Command::Kind::gravity);
    gravity.robot_G_m_s2 = {NAN, NAN, NAN};
    EXPECT_TRUE(grasping_.carry_out(gravity));
    Grasping next(two_jaws());  // its configuration has a direction that is no longer valid
    next.succeed(grasping_);
    std::swap(grasping_, next);
    hold_200_g();
    EXPECT_EQ(grasping_.state().weight_state, unsigned(TACTILED_WEIGHT_NOT_OBSERVABLE));
    EXPECT_TRUE(std::isnan(grasping_.state().weight_kg));
}

TEST_F(GraspingTest, ASuccessorKnowsWhatWasTaught) {
    Command teach = command(Command::Kind::objects);
    TaughtObject nut;
    nut.id = 5;
    nut.name = "nut";
    nut.mass_kg = 0.2;
    nut.sd_kg = 0.004;
    teach.objects = {&nut, 1};
    EXPECT_TRUE(grasping_.carry_out(teach));
    Grasping next(two_jaws());
    next.succeed(grasping_);
    std::swap(grasping_, next);
    hold_200_g();
    EXPECT_STREQ(grasping_.state().object, "nut");
}

TEST(GraspingWithoutASetup, NothingIsKnownAndNoCommandTaken) {
    Grasping none{std::nullopt};
    tactiled_sample s{};
    s.quality = TACTILED_GOOD;
    none.observe(0, placed(s), {});
    none.set({});
    EXPECT_EQ(none.state().state, unsigned(TACTILED_GRIP_UNKNOWN));
    EXPECT_TRUE(std::isnan(none.state().weight_kg));
    EXPECT_EQ(none.state().slip_state[0], TACTILED_SLIP_UNKNOWN);
    Command start;
    start.kind = Command::Kind::start_weighing;
    EXPECT_FALSE(none.carry_out(start));
}

}  // namespace
}  // namespace tactiled
