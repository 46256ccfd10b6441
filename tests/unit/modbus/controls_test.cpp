// Permitted writes and their effects.
#include "controls_fixture.hpp"

namespace tactiled::modbus {
namespace {

TEST_F(ControlsTest, TheCommandBlockIsBusyUntilItsOwnCommandIsAnswered) {
    EXPECT_EQ(put(kCmd, {kClearLatches, 0, 0, 0, 1}), kNone);
    EXPECT_EQ(put(kCmd, {kClearLatches, 0, 0, 0, 2}), kBusy);  // no tare, and the node does not report it
    EXPECT_EQ(put(kResetPeakCell, 1), kBusy);
    const Command command = sent();
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_RUNNING);
    answer(command.number - 1, TACTILED_COMMAND_DONE);  // acknowledges another one
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_RUNNING);
    answer(command.number, TACTILED_COMMAND_DONE);
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_DONE);
    EXPECT_EQ(put(kCmd, {kClearLatches, 0, 0, 0, 2}), kNone);
}

TEST_F(ControlsTest, ACommandThatThePipelineNeverAnswersTimesOut) {
    EXPECT_EQ(put(kCmd, {kSelfTest, 1, 0, 0, 1}), kNone);
    EXPECT_EQ(sent().until_ns, 16 * kSecond);
    EXPECT_EQ(global(16 * kSecond)[kCmdState], TACTILED_COMMAND_RUNNING);
    EXPECT_EQ(global(16 * kSecond + 1)[kCmdState], TACTILED_COMMAND_REJECTED);
    EXPECT_EQ(global(16 * kSecond + 1)[kCmdResult], TACTILED_COMMAND_TIMED_OUT);
}

TEST_F(ControlsTest, AWrongAddressComesBeforeABusyCommand) {
    EXPECT_EQ(put(kTareCell, 1), kNone);
    EXPECT_EQ(ask({15, 0, 0, 0, 1, 1, 1}), kBusy);
    EXPECT_EQ(ask({15, 0, 0, 0, 2, 1, 3}), kIllegalAddress);  // there is no second sensor
}

TEST_F(ControlsTest, OneWriteIsOneCommand) {
    EXPECT_EQ(put(kTareCell, {1, 1}), kIllegalValue);  // tare and untare
    EXPECT_EQ(put(kTareCell, {1, 0, 0, 0, 1}), kIllegalValue);
    EXPECT_EQ(ask({15, 0, 0, 0, 33, 5, 1, 0, 0, 0, 1}), kIllegalValue);  // a tare and clear all
    EXPECT_EQ(commands_.front(), nullptr);
    EXPECT_EQ(put(kTareCell, {1, 0, 0, 0, 0}), kNone);
}

TEST_F(ControlsTest, ContactMayEndWhereItBeginsAndNotAbove) {
    EXPECT_EQ(put(kUnlock, kUnlockWord), kNone);
    EXPECT_EQ(put(kContactOn, {100, 100}), kNone);
    EXPECT_EQ(put(kContactOff, 101), kIllegalValue);
}

TEST_F(ControlsTest, UnlockLastsThirtySeconds) {
    EXPECT_EQ(put(kUnlock, kUnlockWord, kSecond), kNone);
    EXPECT_EQ(put(kFilterHz, 100, 31 * kSecond), kNone);
    EXPECT_EQ(put(kFilterHz, 100, 31 * kSecond + 1), kIllegalAddress);
}

TEST_F(ControlsTest, StatusSaysThatSettingsAreOpen) {
    EXPECT_EQ(global()[kStatus] & 1u << 13, 0u);
    EXPECT_EQ(put(kUnlock, kUnlockWord), kNone);
    EXPECT_NE(global()[kStatus] & 1u << 13, 0u);
    EXPECT_EQ(put(kUnlock, 0), kNone);
    EXPECT_EQ(global()[kStatus] & 1u << 13, 0u);
}

TEST_F(ControlsTest, NoCommandIsTakenForALoopThatStands) {
    ::usleep(300'000);  // longer than watchdog_ms
    EXPECT_EQ(put(kResetPeakCell, 1), kDeviceFailure);
    EXPECT_EQ(put(kClearLatchCell, 1), kDeviceFailure);
    EXPECT_EQ(put(kCmd, {kClearLatches, 0, 0, 0, 1}), kDeviceFailure);
    EXPECT_EQ(put(kGripperForce, 5), kNone);  // no command
    EXPECT_EQ(commands_.front(), nullptr);
}

TEST_F(ControlsTest, ClearAllClearsLatches) {
    EXPECT_EQ(ask({5, 0, kClearAllCoil, 0xFF, 0}), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::clear_latches);
}

TEST_F(ControlsTest, AStandingHeartbeatExpires) {
    EXPECT_EQ(put(kPlcWatchdog, 1000, 1 * kSecond), kNone);
    EXPECT_EQ(put(kPlcHeartbeat, 1, 2 * kSecond), kNone);
    EXPECT_EQ(global(3 * kSecond)[kStatus], 0);
    EXPECT_EQ(put(kPlcHeartbeat, 1, 3 * kSecond), kNone);  // the same value again is not a heartbeat
    EXPECT_EQ(global(3 * kSecond + 1)[kStatus], 1u << 12);
    EXPECT_EQ(put(kPlcHeartbeat, 2, 4 * kSecond), kNone);
    EXPECT_EQ(global(4 * kSecond)[kStatus], 0);
}

TEST_F(ControlsTest, NothingIsSentBehindAnUntareThatRuns) {
    EXPECT_EQ(put(kUntareCell, 1), kNone);
    EXPECT_EQ(put(kTareCell, 1), kBusy);
    answer(sent().number, TACTILED_COMMAND_DONE);
    EXPECT_EQ(put(kTareCell, 1), kNone);
}

TEST_F(ControlsTest, SettingsReachThePipelineEachInItsPlace) {
    EXPECT_EQ(put(kUnlock, kUnlockWord), kNone);
    EXPECT_EQ(put(kFilterHz, {20, 300, 200, 5000}), kNone);
    const Command command = sent();
    EXPECT_EQ(command.kind, Command::Kind::set);
    EXPECT_EQ(command.settable.filter_Hz, 20);
    EXPECT_DOUBLE_EQ(command.settable.contact_on_N, 3);
    EXPECT_DOUBLE_EQ(command.settable.contact_off_N, 2);
    EXPECT_DOUBLE_EQ(command.settable.overload_N, 50);
}

TEST_F(ControlsTest, SettingsThatFindNoRoomAreSentLater) {
    EXPECT_EQ(put(kUnlock, kUnlockWord), kNone);
    while (Command* const slot = commands_.claim()) {
        *slot = Command{};
        commands_.push();
    }
    commands_.commit();
    EXPECT_EQ(put(kFilterHz, 20), kNone);
    while (commands_.front() != nullptr) commands_.pop();
    controls_->tick(kSecond);
    EXPECT_EQ(sent().settable.filter_Hz, 20);
}

TEST_F(ControlsTest, OneSaveAtATime) {
    int busy = 0;  // a thread that has yet to start is slower than the next line
    for (int i = 0; i < 100 && busy == 0; ++i) {
        while (put(kSave, kSaveWord) != kNone) ::usleep(1000);
        busy += put(kSave, kSaveWord) == kBusy ? 1 : 0;
    }
    EXPECT_EQ(busy, 1);
}

TEST_F(ControlsTest, ASaveThatFailsIsSaid) {
    ::mkdir(settings_.settings.c_str(), 0700);
    ::mkdir((settings_.settings + "/full").c_str(), 0700);
    EXPECT_EQ(put(kSave, kSaveWord), kNone);
    for (int i = 0; i < 200 && cell(kSave) == 1; ++i) ::usleep(10'000);
    EXPECT_EQ(cell(kSave), 2);
    EXPECT_EQ(global()[kFault], 1u << 6);
    EXPECT_NE(global()[kStatus] & TACTILED_FAULT, 0);
    std::filesystem::remove_all(settings_.settings);
    EXPECT_EQ(put(kSave, kSaveWord), kNone);
    for (int i = 0; i < 200 && cell(kSave) != 0; ++i) ::usleep(10'000);
    EXPECT_EQ(global()[kFault], 0);
}

}  // namespace
}  // namespace tactiled::modbus
