// Every value that a PLC may write or may not: the sent command, the value read back, the stored value.
#include <fstream>

#include "controls_fixture.hpp"
#include "tests/unit/config/folder.hpp"
#include "tests/unit/modbus/no_threads.hpp"

namespace tactiled::modbus {
namespace {

class ControlsValues : public ControlsTest {
protected:
    ControlsValues() {
        tactiled_forget_grasp(&node_.grasp);
        beat();
    }
    // Writes a command block with the next sequence number; returns CMD_RESULT.
    int run(unsigned code, unsigned mask = 0, std::uint32_t parameter = 0) {
        EXPECT_EQ(put(kCmd, {code, mask, parameter >> 16, parameter & 0xFFFF, ++last_}), kNone);
        return global()[kCmdResult];
    }
    int coil(unsigned at, bool on = true) { return ask({5, 0, std::uint8_t(at), std::uint8_t(on ? 0xFF : 0), 0}); }
    void be_bad() {
        tactiled_sample s{};
        s.sequence = node_.sequence;
        s.t_ns = monotonic_ns();
        s.quality = TACTILED_BAD;
        writer_.publish(0, s);
        node_.count[0] = node_.sequence + 1;
        writer_.publish(node_);
        ++node_.sequence;
    }
    void fill() {
        while (Command* const slot = commands_.claim()) {
            *slot = Command{};
            commands_.push();
        }
        commands_.commit();
    }
    void restart() {
        controls_.reset();
        start();
    }
    // Returns the result after the end of the saving thread.
    std::uint16_t saved() {
        for (int i = 0; i < 400 && cell(kSave) == 1; ++i) ::usleep(5000);
        return cell(kSave);
    }
    bool nothing_was_sent() { return commands_.front() == nullptr; }
    unsigned last_ = 0;
};

TEST_F(ControlsValues, EachCommandOfTheBlockIsItsOwn) {
    struct Case {
        unsigned code, mask;
        Command::Kind kind;
    };
    for (const auto& [code, mask, kind] :
         {Case{kTare, 1, Command::Kind::tare}, Case{kUntare, 1, Command::Kind::untare},
          Case{kClearLatches, 0, Command::Kind::clear_latches}, Case{kResetPeaks, 1, Command::Kind::reset_peaks},
          Case{kSelfTest, 1, Command::Kind::self_test}, Case{kZeroWeight, 0, Command::Kind::zero_weight}}) {
        EXPECT_EQ(run(code, mask), TACTILED_COMMAND_OK);
        const Command command = sent();
        EXPECT_EQ(command.kind, kind);
        EXPECT_EQ(command.mask, mask);
        answer(command.number, TACTILED_COMMAND_DONE);
        EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_DONE) << code;
    }
}

TEST_F(ControlsValues, ACommandOfTheBlockThatIsWrongIsReportedInItsResult) {
    for (const unsigned code : {kTare, kUntare, kResetPeaks, kSelfTest}) EXPECT_EQ(run(code, 0), TACTILED_COMMAND_BAD_MASK);
    EXPECT_EQ(run(kTare, 2), TACTILED_COMMAND_BAD_MASK);  // there is no second sensor
    EXPECT_EQ(run(kClearLatches, 2), TACTILED_COMMAND_BAD_MASK);
    EXPECT_EQ(run(99, 2), TACTILED_COMMAND_UNKNOWN);
    EXPECT_EQ(run(0, 2), TACTILED_COMMAND_UNKNOWN);
    EXPECT_EQ(run(99), TACTILED_COMMAND_UNKNOWN);
    node_.grasp.weight_state = TACTILED_WEIGHT_STABLE;
    node_.grasp.weight_kg = 0.2;
    node_.grasp.weight_sd_kg = 0.001;
    beat();
    EXPECT_EQ(run(kTeach, 0, 0), TACTILED_COMMAND_BAD_PARAMETER);
    // OBJECT_ID is one register, and 65535 is not an id
    EXPECT_EQ(run(kTeach, 0, 65535), TACTILED_COMMAND_BAD_PARAMETER);
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_REJECTED);
    EXPECT_TRUE(nothing_was_sent());
}

TEST_F(ControlsValues, WhatThePipelineRefusesIsRejected) {
    EXPECT_EQ(run(kTare, 1), TACTILED_COMMAND_OK);
    answer(sent().number, TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_FAILED);
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_REJECTED);
    EXPECT_EQ(global()[kCmdResult], TACTILED_COMMAND_FAILED);
    fill();  // the pipeline hangs
    EXPECT_EQ(run(kClearLatches), TACTILED_COMMAND_FAILED);
    EXPECT_EQ(global()[kCmdState], TACTILED_COMMAND_REJECTED);
}

TEST_F(ControlsValues, ANoughtInACellAsksForNothing) {
    for (const unsigned at : {kTareCell, kUntareCell, kClearLatchCell, kResetPeakCell, kWeighCell, kTeachCell,
                              kZeroWeightCell, kKnownWeightCell})
        EXPECT_EQ(put(at, 0), kNone) << at;
    EXPECT_EQ(put(kCmdSeq, 0), kNone);  // unchanged
    EXPECT_TRUE(nothing_was_sent());
    EXPECT_EQ(put(kResetPeakCell, 1), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::reset_peaks);
    for (const unsigned at : {kTareCell, kUntareCell, kClearLatchCell, kResetPeakCell})
        EXPECT_EQ(put(at, 2), kIllegalValue) << at;  // no such sensor
}

TEST_F(ControlsValues, WhatHasNoValueCannotBeTared) {
    be_bad();
    EXPECT_EQ(put(kTareCell, 1), kDeviceFailure);
    EXPECT_EQ(coil(kTareCoils), kDeviceFailure);
    EXPECT_EQ(put(kUntareCell, 1), kNone);  // needs none
    answer(sent().number, TACTILED_COMMAND_DONE);
    EXPECT_EQ(coil(kTareCoils), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::tare);
    for (const unsigned at : {unsigned(kTareCoils), unsigned(kSlipCoils), unsigned(kClearAllCoil), unsigned(kWeighCoil)})
        EXPECT_EQ(coil(at), kBusy) << at;
    ::usleep(300'000);  // longer than watchdog_ms
    EXPECT_EQ(coil(kClearAllCoil), kDeviceFailure);
}

TEST_F(ControlsValues, ToWhoMayNotWriteAllIsReadOnly) {
    session_.may_write = false;
    EXPECT_EQ(put(kPlcHeartbeat, 1), kIllegalAddress);
    EXPECT_EQ(coil(kClearAllCoil), kIllegalAddress);
    session_.may_write = true;
    EXPECT_EQ(put(kPlcHeartbeat, 1), kNone);
    settings_.commands = false;
    restart();
    EXPECT_EQ(put(kPlcHeartbeat, 1), kIllegalAddress);
    EXPECT_TRUE(nothing_was_sent());
}

TEST_F(ControlsValues, ValuesThatMeanNothingAreRefused) {
    EXPECT_EQ(put(kPlcWatchdog, 9), kIllegalValue);  // ms; no PLC is that fast
    EXPECT_EQ(put(kPlcWatchdog, 10), kNone);
    EXPECT_EQ(put(kPlcWatchdog, 0), kNone);
    EXPECT_EQ(put(kUnlock, 1), kIllegalValue);
    EXPECT_EQ(put(kSave, 1), kIllegalValue);
    EXPECT_EQ(put(kUnlock, kUnlockWord), kNone);
    EXPECT_EQ(put(kSlipSensitivity, 101), kIllegalValue);  // %
    EXPECT_EQ(put(kSlipSensitivity, {101, 1}), kIllegalValue);
    EXPECT_EQ(put(kSlipSensitivity, kAsConfigured), kNone);
    EXPECT_EQ(put(kContactOn, 100), kNone);
    EXPECT_EQ(put(kContactOff, kAsConfigured), kNone);  // not compared with a limit that is not set here
    EXPECT_EQ(put(kContactOn, {kAsConfigured, 200}), kNone);
}

TEST_F(ControlsValues, AWatchdogThatIsWrittenAgainKeepsNothingAlive) {
    EXPECT_EQ(put(kPlcWatchdog, 1000, 1 * kSecond), kNone);
    EXPECT_EQ(put(kPlcWatchdog, 1000, 2 * kSecond), kNone);
    EXPECT_EQ(global(2 * kSecond)[kStatus], 0);
    EXPECT_EQ(global(2 * kSecond + 1)[kStatus], 1u << 12);
}

TEST_F(ControlsValues, WhatIsWrittenIsReadBack) {
    scratch_ = true;
    EXPECT_EQ(put(kUnlock, kUnlockWord), kNone);
    for (const auto& [at, value] : {std::pair<unsigned, unsigned>(kScratchAt, 0xBEEF),
                                    {kScratchAt + kScratchSize - 1, 7},
                                    {kFilterHz, 20},
                                    {kWeighWindow, 200},
                                    {kPlcHeartbeat, 77},
                                    {kPlcWatchdog, 500},
                                    {kGripperState, 2},
                                    {kCmdParamLow, 1234}}) {
        EXPECT_EQ(put(at, value), kNone) << at;
        EXPECT_EQ(cell(at), value) << at;
    }
    EXPECT_EQ(ask({22, 0x13, 0xEC, 0xF0, 0xFF, 0x0A, 0x00}), kNone);  // scratch: (0xBEEF & 0xF0FF) | (0x0A00 & ~0xF0FF)
    EXPECT_EQ(cell(kScratchAt), 0xBAEF);
    EXPECT_EQ(cell(kUnlock), 1);
    EXPECT_EQ(put(kUnlock, 0), kNone);
    EXPECT_EQ(cell(kUnlock), 0);
    EXPECT_EQ(cell(kCmdSeq), 0);
    EXPECT_EQ(cell(5018), 0);  // there is no register
}

TEST_F(ControlsValues, OneClientsLockLeavesTheOthersOpen) {
    EXPECT_EQ(put(kUnlock, kUnlockWord, kSecond), kNone);
    Session other;
    other.may_write = true;
    std::swap(session_, other);
    EXPECT_EQ(put(kFilterHz, 20, kSecond), kIllegalAddress);
    EXPECT_EQ(put(kUnlock, 0, 2 * kSecond), kNone);
    EXPECT_NE(global(2 * kSecond)[kStatus] & 1u << 13, 0u);  // set by the first one
    std::swap(session_, other);
    EXPECT_EQ(put(kFilterHz, 20, 3 * kSecond), kNone);
}

TEST_F(ControlsValues, CoilsShowWhatRuns) {
    std::array<std::uint8_t, kCoils> coils{};
    controls_->read_coils(view_of(segment_), coils);
    EXPECT_EQ(std::count(coils.begin(), coils.end(), 0), kCoils);
    tactiled_sample s{};
    s.sequence = node_.sequence;
    s.t_ns = monotonic_ns();
    s.quality = TACTILED_UNCERTAIN;
    s.reasons = TACTILED_TARING;
    writer_.publish(0, s);
    node_.grasp.weight_state = TACTILED_WEIGHT_STABLE;
    node_.grasp.weight_kg = 0.2;
    node_.count[0] = node_.sequence + 1;
    writer_.publish(node_);
    controls_->read_coils(view_of(segment_), coils);
    EXPECT_EQ(coils[kTareCoils], 1);
    EXPECT_EQ(coils[kTareCoils + 1], 0);
    EXPECT_EQ(coils[kWeighCoil], 1);
}

TEST_F(ControlsValues, WhatIsSavedIsThereAfterARestart) {
    EXPECT_EQ(put(kUnlock, kUnlockWord), kNone);
    EXPECT_EQ(put(kFilterHz, {20, 300, kAsConfigured, 5000}), kNone);
    EXPECT_EQ(put(kSave, kSaveWord), kNone);
    ASSERT_EQ(saved(), 0);
    while (!nothing_was_sent()) (void)sent();
    restart();
    EXPECT_EQ(cell(kFilterHz), 20);
    EXPECT_EQ(cell(kContactOff), kAsConfigured);
    EXPECT_EQ(cell(kOverloadAt), 5000);
    EXPECT_DOUBLE_EQ(sent().settable.contact_on_N, 3);
}

TEST_F(ControlsValues, OfADamagedFileNothingIsUsedAndItIsReported) {
    for (const char* text : {"filter_hz = 20\ncontact_on_N = -1\n", "filter_hz = 20\nfiltre = 1\n", "filter_hz = \n"}) {
        std::ofstream(settings_.settings) << text;
        restart();
        EXPECT_EQ(cell(kFilterHz), kAsConfigured) << text;
        EXPECT_EQ(global()[kFault], 1u << 6) << text;
        EXPECT_TRUE(nothing_was_sent());
    }
    EXPECT_EQ(put(kSave, kSaveWord), kNone);
    ASSERT_EQ(saved(), 0);
    EXPECT_EQ(global()[kFault], 0);
}

TEST_F(ControlsValues, WithoutAThreadASaveFailsAndTheNextMaySucceed) {
    {
        const test::NoThreads no_threads;
        EXPECT_EQ(put(kSave, kSaveWord), kNone);
        EXPECT_EQ(saved(), 2);
    }
    EXPECT_EQ(global()[kFault], 1u << 6);
    EXPECT_EQ(put(kSave, kSaveWord), kNone);
    EXPECT_EQ(saved(), 0);
    EXPECT_EQ(global()[kFault], 0);
}

}  // namespace
}  // namespace tactiled::modbus
