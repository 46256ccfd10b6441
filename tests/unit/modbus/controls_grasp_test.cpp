// Weighing, slips, data of the robot, teaching: the writes of a PLC.
#include "controls_fixture.hpp"
#include "node/objects.hpp"

namespace tactiled::modbus {
namespace {

class GraspControls : public ControlsTest {
protected:
    GraspControls() {
        tactiled_forget_grasp(&node_.grasp);
        beat();
    }
    void hold(double mass_kg, double sd_kg) {
        node_.grasp.state = TACTILED_GRIP_HOLDING;
        node_.grasp.weight_state = TACTILED_WEIGHT_STABLE;
        node_.grasp.weight_kg = mass_kg;
        node_.grasp.weight_sd_kg = sd_kg;
        beat();
    }
    void restart_without_grasp() {
        settings_.objects = "";
        controls_.reset();
        start();
    }
    void acknowledge(const Command& command, tactiled_command_state state = TACTILED_COMMAND_DONE) {
        answer(command.number, state);
    }
    int coil(unsigned at, bool on) { return ask({5, 0, std::uint8_t(at), std::uint8_t(on ? 0xFF : 0), 0}); }
    void nothing_was_sent() { EXPECT_EQ(commands_.front(), nullptr); }
    std::vector<TaughtObject> taught() const {
        Problems problems;
        auto objects = load_objects(settings_.objects, problems);
        EXPECT_TRUE(problems.empty());
        return objects;
    }
    // Waits for the thread that stores.
    Command handed_over() {
        for (int i = 0; i < 500 && commands_.front() == nullptr; ++i) {
            ::usleep(10'000);
            controls_->tick(kSecond);
        }
        return sent();
    }
};

TEST_F(GraspControls, WeighingIsStartedByCellCoilAndBlockAndStoppedByCoilAndBlock) {
    EXPECT_EQ(put(kWeighCell, 1), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::start_weighing);
    EXPECT_EQ(coil(kWeighCoil, true), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::start_weighing);
    EXPECT_EQ(coil(kWeighCoil, false), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::stop_weighing);
    EXPECT_EQ(put(kCmd, {kStartWeighing, 0, 0, 0, 1}), kNone);
    Command command = sent();
    EXPECT_EQ(command.kind, Command::Kind::start_weighing);
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_RUNNING);
    acknowledge(command);
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_DONE);
    EXPECT_EQ(put(kCmd, {kStopWeighing, 0, 0, 0, 2}), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::stop_weighing);
}

TEST_F(GraspControls, ANoughtAmongOtherCoilsStopsNothing) {
    EXPECT_EQ(ask({15, 0, 32, 0, 2, 1, 1}), kNone);  // clear all, and 0 to WEIGH
    EXPECT_EQ(sent().kind, Command::Kind::clear_latches);
    nothing_was_sent();
}

TEST_F(GraspControls, WithoutAGraspThereIsNothingToWeigh) {
    restart_without_grasp();
    EXPECT_EQ(put(kWeighCell, 1), kDeviceFailure);
    EXPECT_EQ(coil(kWeighCoil, true), kDeviceFailure);
    EXPECT_EQ(put(kZeroWeightCell, 1), kDeviceFailure);
    EXPECT_EQ(put(kTeachCell, 1), kDeviceFailure);
    EXPECT_EQ(put(kCmd, {kStartWeighing, 0, 0, 0, 1}), kNone);
    EXPECT_EQ(global()[kCmdResult], TACTILED_COMMAND_NOT_NOW);
    nothing_was_sent();
}

TEST_F(GraspControls, AKnownWeightIsTakenOnlyWhileTheWeightIsStable) {
    EXPECT_EQ(put(kKnownWeightCell, 250), kDeviceFailure);
    EXPECT_EQ(put(kCmd, {kKnownWeight, 0, 0, 2500, 1}), kNone);
    EXPECT_EQ(global()[kCmdResult], TACTILED_COMMAND_NOT_NOW);
    hold(0.24, 0.01);
    EXPECT_EQ(put(kKnownWeightCell, 250), kNone);  // g
    EXPECT_DOUBLE_EQ(sent().mass_kg, 0.25);
    EXPECT_EQ(put(kCmd, {kKnownWeight, 0, 1, 0, 2}), kNone);  // 65536 * 0.1 g
    const Command command = sent();
    EXPECT_EQ(command.kind, Command::Kind::known_weight);
    EXPECT_DOUBLE_EQ(command.mass_kg, 6.5536);
    acknowledge(command);
    EXPECT_EQ(put(kCmd, {kKnownWeight, 0, 0, 0, 3}), kNone);
    EXPECT_EQ(global()[kCmdResult], TACTILED_COMMAND_BAD_PARAMETER);
}

TEST_F(GraspControls, ZeroWeightTakesAOneAndNothingElse) {
    EXPECT_EQ(put(kZeroWeightCell, 2), kIllegalValue);
    EXPECT_EQ(put(kZeroWeightCell, 0), kNone);
    nothing_was_sent();
    EXPECT_EQ(put(kZeroWeightCell, 1), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::zero_weight);
}

TEST_F(GraspControls, SlipLatchesAreClearedOneByOneOrAll) {
    EXPECT_EQ(coil(kSlipCoils, true), kNone);
    Command command = sent();
    EXPECT_EQ(command.kind, Command::Kind::clear_slips);
    EXPECT_EQ(command.mask, 1u);
    EXPECT_EQ(coil(kSlipCoils + 1, true), kIllegalAddress);         // no such sensor
    EXPECT_EQ(ask({15, 0, 16, 0, 17, 3, 1, 0, 1}), kIllegalValue);  // clear slip and clear all: two commands
    EXPECT_EQ(put(kClearLatchCell, 1), kNone);
    EXPECT_EQ(sent().mask, 1u);
}

TEST_F(GraspControls, GravityCountsWhenItsLastAxisIsWritten) {
    EXPECT_EQ(cell(kGravityX), kNoI16);
    EXPECT_EQ(put(kGravityX, 0), kNone);
    EXPECT_EQ(put(kGravityX + 1, std::uint16_t(-9810)), kNone);
    nothing_was_sent();
    EXPECT_EQ(put(kGravityX + 2, 0), kNone);
    const Command command = sent();
    EXPECT_EQ(command.kind, Command::Kind::gravity);
    EXPECT_DOUBLE_EQ(command.robot_G_m_s2[1], -9.81);
    EXPECT_EQ(cell(kGravityX + 1), std::uint16_t(-9810));
}

TEST_F(GraspControls, GravityOfNothingLeavesTheConfiguredOneAndEndsTheOneThatWasWritten) {
    EXPECT_EQ(put(kGravityX, {0, 0, 0}), kNone);
    nothing_was_sent();
    EXPECT_EQ(put(kGravityX, {0, 0, std::uint16_t(-9810)}), kNone);
    EXPECT_DOUBLE_EQ(sent().robot_G_m_s2[2], -9.81);
    EXPECT_EQ(put(kGravityX, {0, 0, 0}), kNone);
    EXPECT_TRUE(std::isnan(sent().robot_G_m_s2[2]));
}

TEST_F(GraspControls, GravityInAWrongScaleIsRefusedWhole) {
    EXPECT_EQ(put(kGravityX, {0, 0, std::uint16_t(-981)}), kIllegalValue);  // 0.01 m/s^2
    EXPECT_EQ(put(kGravityX, {0, 0, 1000}), kIllegalValue);                 // 0.001 g
    EXPECT_EQ(cell(kGravityX), kNoI16);
    nothing_was_sent();
}

TEST_F(GraspControls, GravityThatIsNotKnownEndsTheConfiguredOne) {
    const std::vector<unsigned> unknown{kNoI16, kNoI16, kNoI16};
    EXPECT_EQ(put(kGravityX, unknown), kNone);
    EXPECT_TRUE(std::isnan(sent().robot_G_m_s2[2]));
    for (const auto& words : {unknown, std::vector<unsigned>{0, 0, 0}}) EXPECT_EQ(put(kGravityX, words), kNone);
    nothing_was_sent();  // once
}

TEST_F(GraspControls, AnAccelerationIsOfTheMomentOfItsCount) {
    EXPECT_EQ(put(kAccelX, {0, 0, 500, 0}), kNone);
    nothing_was_sent();  // the count stands at 0
    EXPECT_EQ(put(kAccelX, {0, 0, 500, 1}), kNone);
    const Command command = sent();
    EXPECT_EQ(command.kind, Command::Kind::acceleration);
    EXPECT_DOUBLE_EQ(command.robot_G_m_s2[2], 0.5);
    EXPECT_EQ(command.reported_ns, kSecond);
    EXPECT_EQ(put(kAccelX, {0, 0, 600, 1}), kNone);  // a PLC that writes repeatedly, but without new data of the robot
    nothing_was_sent();
}

TEST_F(GraspControls, WhatASilentPlcReportedIsForgotten) {
    EXPECT_EQ(put(kPlcWatchdog, 100), kNone);
    EXPECT_EQ(put(kGripperState, 3), kNone);
    EXPECT_EQ(sent().gripper, grasp::Hint::lifting);
    EXPECT_EQ(put(kGravityX, {0, 0, std::uint16_t(-9810)}), kNone);
    (void)sent();
    controls_->tick(kSecond + 100'000'000);
    nothing_was_sent();
    controls_->tick(kSecond + 100'000'001);
    EXPECT_EQ(sent().gripper, grasp::Hint::none);
    EXPECT_TRUE(std::isnan(sent().robot_G_m_s2[0]));
    controls_->tick(kSecond + 200'000'000);
    nothing_was_sent();  // once
    for (const unsigned at : {5040u, 5041u, 5042u}) EXPECT_EQ(cell(at), kNoI16) << at;
    EXPECT_EQ(cell(kGripperState), kNoU16);
    EXPECT_EQ(put(kGravityX + 2, std::uint16_t(-9810), 2 * kSecond), kIllegalValue);  // X and Y are of an old direction
    nothing_was_sent();
}

TEST_F(GraspControls, NoHintIsSentThatNobodyWrote) {
    controls_->tick(kSecond);
    nothing_was_sent();
    EXPECT_EQ(cell(kGripperState), kNoU16);
}

TEST_F(GraspControls, SensitivityAndWindowReachThePipeline) {
    EXPECT_EQ(put(kUnlock, kUnlockWord), kNone);
    EXPECT_EQ(put(kSlipSensitivity, {80, 250}), kNone);
    const Command command = sent();
    EXPECT_DOUBLE_EQ(command.grasp.slip_sensitivity, 0.8);
    EXPECT_EQ(command.grasp.weigh_window_ms, 250);
    EXPECT_EQ(put(kSlipSensitivity, kAsConfigured), kNone);
    EXPECT_TRUE(std::isnan(sent().grasp.slip_sensitivity));
}

TEST_F(GraspControls, TeachingStoresTheWeightAndHandsTheObjectsOver) {
    EXPECT_EQ(put(kTeachCell, 7), kDeviceFailure);  // no stable weight
    hold(0.250, 0.002);
    EXPECT_EQ(put(kTeachCell, 7), kNone);
    EXPECT_EQ(put(kTeachCell, 7), kBusy);
    Command command = handed_over();
    EXPECT_EQ(command.kind, Command::Kind::objects);
    ASSERT_EQ(command.objects.size(), 1u);
    EXPECT_EQ(command.objects[0].id, 7u);
    EXPECT_EQ(command.objects[0].name, "object7");
    EXPECT_EQ(put(kTeachCell, 7), kBusy);  // the pipeline may still be reading the list
    acknowledge(command);
    hold(0.252, 0.002);
    EXPECT_EQ(put(kCmd, {kTeach, 0, 0, 7, 1}), kNone);
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_RUNNING);
    command = handed_over();
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_RUNNING);
    acknowledge(command);
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_DONE);
    ASSERT_EQ(taught().size(), 1u);
    EXPECT_EQ(taught()[0].grasps, 2u);
    EXPECT_NEAR(taught()[0].mass_kg, 0.251, 1e-9);
}

TEST_F(GraspControls, AWeightThatMayBeNoneIsNotTaught) {
    for (const double mass_kg : {0.0, -0.02, 0.005}) {  // empty, with a zero taken under load, within 3 sd of 0
        hold(mass_kg, 0.002);
        EXPECT_EQ(put(kTeachCell, 7), kDeviceFailure) << mass_kg;
        EXPECT_EQ(put(kCmd, {kTeach, 0, 0, 7, unsigned(100 + mass_kg * 1000)}), kNone);
        EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_REJECTED) << mass_kg;
        EXPECT_EQ(global()[kCmdResult], TACTILED_COMMAND_NOT_NOW) << mass_kg;
    }
    EXPECT_TRUE(taught().empty());
    nothing_was_sent();
}

TEST_F(GraspControls, ATeachByTheCellThatFailedIsReported) {
    std::filesystem::create_directory(settings_.objects);  // no file can be written there
    hold(0.25, 0.002);
    EXPECT_EQ(put(kTeachCell, 7), kNone);
    for (int i = 0; i < 500 && (global()[kFault] & (1u << 6)) == 0; ++i) ::usleep(10'000);
    EXPECT_NE(global()[kFault] & (1u << 6), 0u);
    EXPECT_NE(global()[kStatus] & TACTILED_FAULT, 0u);
    std::filesystem::remove(settings_.objects);
    hold(0.25, 0.002);  // the first weight is too old after a long wait
    EXPECT_EQ(put(kTeachCell, 7), kNone);
    acknowledge(handed_over());
    EXPECT_EQ(global()[kFault], 0u);
    EXPECT_EQ(put(kTeachCell, 7), kNone);
    acknowledge(handed_over(), TACTILED_COMMAND_REJECTED);  // stored, but the pipeline does not have it
    EXPECT_NE(global()[kFault] & (1u << 6), 0u);
}

TEST_F(GraspControls, AnObjectThatCannotBeDistinguishedFromAnotherIsNotTaught) {
    TaughtObject bolt;
    bolt.id = 1;
    bolt.name = "bolt";
    bolt.mass_kg = 0.25;
    bolt.sd_kg = 0.002;
    bolt.grasps = 5;
    store_objects(settings_.objects, std::vector{bolt});
    hold(0.255, 0.002);
    EXPECT_EQ(put(kCmd, {kTeach, 0, 0, 2, 1}), kNone);
    for (int i = 0; i < 500 && global()[kCmdState] == TACTILED_COMMAND_RUNNING; ++i) ::usleep(10'000);
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_REJECTED);
    EXPECT_EQ(global()[kCmdResult], TACTILED_COMMAND_FAILED);
    EXPECT_EQ(taught().size(), 1u);
    nothing_was_sent();
    EXPECT_EQ(put(kTeachCell, 3), kNone);  // and the next may be tried
}

}  // namespace
}  // namespace tactiled::modbus
