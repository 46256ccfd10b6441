// Hints of the robot expire, and one write in each cycle has all that a PLC writes.
#include <algorithm>
#include <cmath>

#include "controls_fixture.hpp"

namespace tactiled::modbus {
namespace {

class HintsTest : public ControlsTest {
protected:
    using Sent = std::vector<std::string>;
    // Returns what was sent: "gravity", or "no gravity" if it is not known; with "!" while a hint has expired.
    Sent seen() {
        Sent all;
        for (; const Command* const command = commands_.front(); commands_.pop()) {
            const bool is_state = command->kind == Command::Kind::hint;
            const bool is_known = is_state ? command->gripper != grasp::Hint::none : !std::isnan(command->robot_G_m_s2[0]);
            const char* const name = is_state                                       ? "state"
                                     : command->kind == Command::Kind::gravity      ? "gravity"
                                     : command->kind == Command::Kind::acceleration ? "acceleration"
                                                                                    : "command";
            all.push_back(std::string(is_known ? "" : "no ") + name + (command->hints_expired ? "!" : ""));
        }
        return all;
    }
    void nothing_was_sent() { EXPECT_EQ(commands_.front(), nullptr); }
    void be(unsigned host) { session_.host = HostAddress{std::uint8_t(host)}; }
    static std::vector<unsigned> gravity() { return {0, 0, 9810}; }
    static std::vector<unsigned> unknown() { return {kNoI16, kNoI16, kNoI16}; }
};

class ExpiringHints : public HintsTest {
protected:
    ExpiringHints() {
        settings_.hints_expire_ms = 2000;
        start();
    }
    static constexpr std::uint64_t kExpireNs = 2 * kSecond;
    bool is_silent(std::uint64_t now_ns) { return (global(now_ns)[kStatus] >> 12 & 1) != 0; }
};

TEST_F(ExpiringHints, TwoSecondsAfterTheLastOneAllOfAClientLoseForce) {
    EXPECT_EQ(cell(kPlcWatchdog), 2000);
    EXPECT_FALSE(is_silent(100 * kSecond)) << "no PLC has written anything";
    EXPECT_EQ(put(kGravityX, gravity()), kNone);  // at 1 s
    EXPECT_EQ(put(kGripperState, 2, 2 * kSecond), kNone);
    EXPECT_EQ(seen(), (Sent{"gravity", "state"}));
    EXPECT_FALSE(is_silent(2 * kSecond + kExpireNs)) << "any hint is a sign of life of all";
    EXPECT_EQ(seen(), Sent{});
    EXPECT_TRUE(is_silent(2 * kSecond + kExpireNs + 1));
    EXPECT_EQ(seen(), (Sent{"no state!", "no gravity!"}));
    EXPECT_EQ(put(kGripperForce, 5, 10 * kSecond), kNone);
    EXPECT_FALSE(is_silent(10 * kSecond));
    EXPECT_EQ(seen(), Sent{}) << "gravity is not in force again";
}

TEST_F(ExpiringHints, EachWriteOfAHintAndEachNewHeartbeatIsASignOfLife) {
    EXPECT_EQ(put(kGravityX, gravity()), kNone);
    std::uint64_t now_ns = kSecond;
    for (const unsigned at : {5022u, 5023u, 5040u, 5045u, 5046u}) {
        now_ns += kExpireNs;
        EXPECT_EQ(put(at, at == kGravityX ? 0 : 1, now_ns), kNone) << at;
    }
    for (unsigned beat = 1; beat < 4; ++beat) EXPECT_EQ(put(kPlcHeartbeat, beat, now_ns += kExpireNs), kNone);
    EXPECT_EQ(seen(), (Sent{"gravity", "state"}));
    EXPECT_FALSE(is_silent(now_ns + kExpireNs));
    EXPECT_TRUE(is_silent(now_ns + kExpireNs + 1));
    EXPECT_EQ(put(kPlcHeartbeat, 3, now_ns + kExpireNs + 2), kNone);
    EXPECT_TRUE(is_silent(now_ns + kExpireNs + 2)) << "the same heartbeat again";
}

TEST_F(ExpiringHints, AScannerThatRepeatsTheLastWriteOfADeadPlcKeepsNothingInForce) {
    std::vector<unsigned> cycle{0, 0, 0, 0, 0, 7, 2, 100, 0, 0, 9810, 0, 0, 0, 1};
    std::uint64_t now_ns = kSecond;
    const auto repeat = [&](const std::vector<unsigned>& values) { return put_at(kCycleAt, values, now_ns); };
    EXPECT_EQ(repeat(cycle), kNone);
    EXPECT_EQ(seen(), (Sent{"state", "gravity"})) << "the first acceleration may be an old one";
    for (now_ns += kSecond; now_ns < 10 * kSecond; now_ns += kSecond / 2) EXPECT_EQ(repeat(cycle), kNone);
    const Sent sent = seen();
    ASSERT_GE(sent.size(), 2u);
    EXPECT_EQ(Sent(sent.end() - 2, sent.end()), (Sent{"no state!", "no gravity!"}));
    EXPECT_EQ(std::count(sent.begin(), sent.end(), "no gravity!"), 1);
    EXPECT_TRUE(is_silent(now_ns));
    EXPECT_EQ(cell(kGravityX + 2), kNoI16) << "not in force";
    cycle[5] = 8;
    EXPECT_EQ(repeat(cycle), kNone);
    EXPECT_FALSE(is_silent(now_ns));
    EXPECT_EQ(seen(), (Sent{"state", "gravity"}));
}

TEST_F(ExpiringHints, AWatchdogOfZeroKeepsThoseOfItsWriterForEver) {
    be(2);
    EXPECT_EQ(put(kGripperState, 2), kNone);
    be(1);
    EXPECT_EQ(put(kPlcWatchdog, 0), kNone);
    EXPECT_EQ(put(kGravityX, gravity()), kNone);
    be(2);
    EXPECT_EQ(cell(kPlcWatchdog), 2000);
    EXPECT_EQ(seen(), (Sent{"state", "gravity"}));
    EXPECT_TRUE(is_silent(1000 * kSecond)) << "the one that is watched";
    EXPECT_EQ(seen(), Sent{"no state!"});
    be(1);
    EXPECT_EQ(put(kPlcWatchdog, 500, 1000 * kSecond), kNone);  // its change is a sign of life
    EXPECT_FALSE(is_silent(1000 * kSecond + kSecond / 2));
    EXPECT_TRUE(is_silent(1000 * kSecond + kSecond / 2 + 1));
    EXPECT_EQ(seen(), Sent{"no gravity!"});
}

TEST_F(ExpiringHints, AnEndForWhichThePipelineHasNoRoomIsSentUnlessItIsStatedAgain) {
    EXPECT_EQ(put(kGravityX, gravity()), kNone);
    EXPECT_EQ(put(kGripperState, 2), kNone);
    while (Command* const slot = commands_.claim()) {
        *slot = Command{};
        commands_.push();
    }
    commands_.commit();
    EXPECT_TRUE(is_silent(10 * kSecond));
    EXPECT_EQ(put_at(kGravityX, gravity(), 11 * kSecond), kNone);
    (void)seen();
    controls_->tick(11 * kSecond);
    EXPECT_EQ(seen(), (Sent{"no state!", "gravity!"}));
}

// ---- several clients ---------------------------------------------------------------------------------------------------

TEST_F(ExpiringHints, NoClientKeepsTheHintsOfAnotherInForce) {
    be(1);
    EXPECT_EQ(put(kGravityX, gravity()), kNone);
    be(2);
    for (unsigned beat = 1; beat < 4; ++beat) EXPECT_EQ(put(kPlcHeartbeat, beat, beat * kSecond), kNone);
    EXPECT_EQ(seen(), Sent{"gravity"});
    EXPECT_FALSE(is_silent(3 * kSecond + 1)) << "the client without hints is alive";
    EXPECT_EQ(seen(), Sent{"no gravity!"});
    EXPECT_EQ(global(4 * kSecond)[kPlcHbEcho], 3);
    be(1);
    EXPECT_EQ(global(4 * kSecond)[kPlcHbEcho], 0) << "an echo is of the client's own heartbeat";
}

TEST_F(ExpiringHints, TwoGatewaysThatRepeatTheirLastWritesKeepNothingInForce) {
    const auto cycle = [&](unsigned host, std::uint64_t now_ns) {
        be(host);
        return put_at(kCycleAt, {0, 0, 0, 0, 0, host, 65535, 0, 0, 0, 9810, 0, 0, 0, host}, now_ns);
    };
    std::uint64_t now_ns = kSecond;
    for (; now_ns <= kSecond + kExpireNs; now_ns += kSecond / 10)
        for (const unsigned host : {1u, 2u}) EXPECT_EQ(cycle(host, now_ns), kNone);
    (void)seen();
    EXPECT_TRUE(is_silent(now_ns));
    (void)seen();
    for (const unsigned host : {1u, 2u}) EXPECT_EQ(cycle(host, now_ns), kNone);
    EXPECT_EQ(seen(), Sent{});
}

TEST_F(ExpiringHints, WordsThatStateNothingNeitherExpireNorKeepAWatch) {
    EXPECT_EQ(put(kCycleAt, {0, 0, 0, 0, 0, 1, kNoU16, kNoU16, 0, 0, 0, kNoI16, kNoI16, kNoI16, 7}), kNone);
    EXPECT_EQ(put(kGravityX, unknown()), kNone);
    EXPECT_EQ(put(kAccelCount, 8), kNone);
    EXPECT_EQ(seen(), (Sent{"no state", "no gravity", "no acceleration"}));
    EXPECT_FALSE(controls_->watches_plc());
    controls_->tick(100 * kSecond);
    EXPECT_EQ(seen(), Sent{});
}

TEST_F(ExpiringHints, ClientsThatStateNothingWithdrawNoHintOfAnother) {
    be(1);
    EXPECT_EQ(put(kGravityX, gravity()), kNone);
    EXPECT_EQ(put(kGripperState, 2), kNone);
    be(2);
    for (const auto& nothing : {unknown(), std::vector<unsigned>{0, 0, 0}}) EXPECT_EQ(put(kGravityX, nothing), kNone);
    EXPECT_EQ(put(kGripperState, kNoU16), kNone);
    EXPECT_EQ(seen(), (Sent{"gravity", "state"}));
    EXPECT_EQ(cell(kGravityX + 2), 9810);
    be(1);
    EXPECT_EQ(put(kGravityX, {0, 0, 0}), kNone);
    EXPECT_EQ(seen(), Sent{"no gravity"});
    EXPECT_EQ(cell(kGravityX + 2), kNoI16);
}

TEST_F(ExpiringHints, TheWarningLastsUntilEachHintThatExpiredIsStatedAgainOrWithdrawnByItsWriter) {
    be(1);
    EXPECT_EQ(put(kGravityX, gravity()), kNone);
    EXPECT_EQ(put(kGripperState, 2), kNone);
    controls_->tick(10 * kSecond);
    EXPECT_EQ(seen(), (Sent{"gravity", "state", "no state!", "no gravity!"}));
    be(2);
    EXPECT_EQ(put_at(kGripperState, {3}, 10 * kSecond), kNone);
    EXPECT_EQ(put_at(kGravityX, unknown(), 10 * kSecond), kNone);
    EXPECT_EQ(seen(), Sent{"state!"}) << "gravity is still missing";
    be(1);
    EXPECT_EQ(put_at(kGravityX, unknown(), 10 * kSecond), kNone);
    EXPECT_EQ(seen(), Sent{"no gravity"});
}

TEST_F(ExpiringHints, AClientWhosePlaceIsTakenLeavesNoHintInForce) {
    be(1);
    EXPECT_EQ(put(kGravityX, gravity()), kNone);
    for (unsigned host = 2; host < 60; ++host) {
        be(host);
        EXPECT_EQ(put_at(kPlcHeartbeat, {host}, 2 * kSecond), kNone);
    }
    EXPECT_EQ(seen(), Sent{"gravity"});
    controls_->tick(kSecond + kExpireNs + 1);
    EXPECT_EQ(seen(), Sent{"no gravity!"});
}

// ---- one register at a time --------------------------------------------------------------------------------------------

TEST_F(ExpiringHints, APartOfAGravityIsNeitherInForceNorShown) {
    EXPECT_EQ(put(kGravityX, {0, 0, 9810}), kNone);
    for (const unsigned at : {5040u, 5041u}) EXPECT_EQ(put(at, 5000), kNone);
    EXPECT_EQ(seen(), Sent{"gravity"});
    EXPECT_EQ(cell(kGravityX), 0);
    EXPECT_EQ(put(kGravityX + 2, 9810), kIllegalValue) << "no gravity on Earth";
    EXPECT_EQ(put(kGravityX + 2, 6800), kNone);
    EXPECT_DOUBLE_EQ(sent().robot_G_m_s2[0], 5);
    EXPECT_EQ(cell(kGravityX), 5000);
    be(2);
    EXPECT_EQ(put(kGravityX + 2, 9810), kIllegalValue) << "X and Y of this client are missing";
}

TEST_F(ExpiringHints, TheFirstCountOfAClientConfirmsNothing) {
    const std::vector<unsigned> cycle{5, 6, 7, 41};
    EXPECT_EQ(put(kAccelX, cycle), kNone) << "the daemon has restarted, the PLC's acceleration is an old one";
    EXPECT_EQ(put(kAccelX, cycle), kNone);
    EXPECT_EQ(seen(), Sent{});
    EXPECT_EQ(cell(kAccelX), kNoI16) << "not in force";
    EXPECT_EQ(put(kAccelX, {5, 6, 7, 42}), kNone);
    EXPECT_EQ(seen(), Sent{"acceleration"});
    EXPECT_EQ(put(kAccelX, {kNoI16, kNoI16, kNoI16, 0}), kNone) << "the PLC has restarted";
    EXPECT_EQ(seen(), Sent{"no acceleration"});
}

TEST_F(ExpiringHints, AnAccelerationThatEndsIsNotKnownAndNoWarning) {
    EXPECT_EQ(put(kAccelCount, 0), kNone);
    EXPECT_EQ(put(kAccelX, {5, 6, 7, 1}), kNone);
    EXPECT_EQ(put(kPlcHeartbeat, 1), kNone) << "a sign of life makes no acceleration last longer";
    EXPECT_EQ(put(kGripperForce, 250), kNone);
    controls_->tick(kSecond + kSecond / 10);
    EXPECT_EQ(seen(), Sent{"acceleration"});
    EXPECT_EQ(cell(kAccelX), 5);
    controls_->tick(kSecond + kSecond / 10 + 1);
    EXPECT_EQ(seen(), Sent{"no acceleration"});
    EXPECT_EQ(cell(kAccelX), kNoI16);
    EXPECT_EQ(cell(kGripperForce), 250);
    controls_->tick(10 * kSecond);
    EXPECT_EQ(seen(), Sent{});
    EXPECT_FALSE(controls_->watches_plc());
    EXPECT_EQ(put(kPlcHeartbeat, 2, 10 * kSecond), kNone);
    EXPECT_EQ(cell(kGripperForce), kNoU16) << "it expired with its client";
    EXPECT_EQ(put(kPlcWatchdog, 10, 11 * kSecond), kNone);
    EXPECT_EQ(put_at(kAccelX, {5, 6, 7, 1}, 11 * kSecond), kNone);
    EXPECT_EQ(put_at(kAccelX, {5, 6, 7, 2}, 11 * kSecond), kNone);
    controls_->tick(11 * kSecond + kSecond / 50);
    EXPECT_EQ(seen(), (Sent{"acceleration", "no acceleration"})) << "its client is silent";
}

TEST_F(ExpiringHints, TheForceOfAClientIsNoneOfAnother) {
    be(1);
    EXPECT_EQ(put(kGripperForce, 250), kNone);
    be(2);
    EXPECT_EQ(cell(kGripperForce), kNoU16);
}

TEST_F(ExpiringHints, NoAccelerationHasAxesOfTwo) {
    EXPECT_EQ(put(kAccelX, {5, 6, 7, 1}), kNone);
    EXPECT_EQ(put(kAccelX, 500), kNone);
    EXPECT_EQ(put(kAccelCount, 2), kNone);
    EXPECT_EQ(seen(), Sent{}) << "Y and Z are those of the one before";
    EXPECT_EQ(put_at(kAccelX + 1, {8, 9, 3}, 10 * kSecond), kNone);
    EXPECT_EQ(put_at(kAccelX + 1, {8, 9, 4}, 10 * kSecond), kNone);
    EXPECT_EQ(seen(), Sent{}) << "X is from before a silence";
    EXPECT_EQ(put_at(kAccelX, {7, 8, 9, 5}, 10 * kSecond), kNone);
    EXPECT_EQ(seen(), Sent{"acceleration"});
    EXPECT_EQ(put_at(kAccelX, {7, 8, 9, 6}, 20 * kSecond), kNone)
        << "it may have waited for as long as its client was silent";
    EXPECT_EQ(seen(), Sent{"no acceleration"});
}

// ---- one write in each cycle -------------------------------------------------------------------------------------------

TEST_F(HintsTest, OneWriteOfACycleIsThatOfItsSingleRegisters) {
    const std::vector<unsigned> cycle{kResetPeaks, 1, 0, 0, 7, 9, 3, 250, 0, 0, 9810, 100, 200, 300, 1};
    EXPECT_EQ(put(kAccelCount, 0), kNone);
    EXPECT_EQ(put(kCycleAt, cycle), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::reset_peaks);
    EXPECT_EQ(sent().gripper, grasp::Hint::lifting);
    EXPECT_DOUBLE_EQ(sent().robot_G_m_s2[2], 9.81);
    EXPECT_DOUBLE_EQ(sent().robot_G_m_s2[1], 0.2);
    nothing_was_sent();
    const unsigned origins[] = {5000, 5001, 5002, 5003, 5004, 5020, 5022, 5023, 5040, 5041, 5042, 5043, 5044, 5045, 5046};
    for (unsigned i = 0; i < kCycleSize; ++i) {
        EXPECT_EQ(cell(origins[i]), cycle[i]) << i;
        EXPECT_EQ(cell(kCycleAt + i), cycle[i]) << i;
    }
    EXPECT_EQ(global()[kCmdSeqAck], 7);
    EXPECT_EQ(global()[kPlcHbEcho], 9);
}

TEST_F(HintsTest, AWriteOfACycleThatIsRepeatedRunsNothingTwice) {
    const std::vector<unsigned> cycle{kResetPeaks, 1, 0, 0, 7, 9, kNoU16, 0, kNoI16, kNoI16, kNoI16, 0, 0, 0, 0};
    EXPECT_EQ(put(kCycleAt, cycle), kNone);
    answer(sent().number, TACTILED_COMMAND_DONE);
    while (commands_.front() != nullptr) commands_.pop();  // the hints
    for (int i = 0; i < 5; ++i) {
        EXPECT_EQ(put(kCycleAt, cycle), kNone);
        for (; commands_.front() != nullptr; commands_.pop()) EXPECT_GE(commands_.front()->kind, Command::Kind::hint);
    }
    EXPECT_EQ(put(kCmdSeq, 7), kNone);  // nor by the other address
    nothing_was_sent();
}

TEST_F(HintsTest, AWriteOfACycleIsTakenWholeOrNotAtAll) {
    const std::vector<unsigned> good{kResetPeaks, 1, 0, 0, 7, 9, 3, 250, 0, 0, 9810, 0, 0, 0, 1};
    const auto refused = [&](unsigned i, unsigned value) {
        std::vector<unsigned> bad = good;
        bad[i] = value;
        const int exception = put(kCycleAt, bad);
        EXPECT_EQ(cell(kPlcHeartbeat), 0) << i;
        EXPECT_EQ(cell(kCmd), 0) << i;
        nothing_was_sent();
        return exception;
    };
    EXPECT_EQ(refused(6, 6), kIllegalValue);      // no such state of the gripper
    EXPECT_EQ(refused(10, 1000), kIllegalValue);  // no gravity on Earth
    EXPECT_EQ(put(kCycleAt, good), kNone);
}

TEST_F(HintsTest, ACommandInACycleThatCannotRunWaitsAndTheRestIsTaken) {
    std::vector<unsigned> cycle{kResetPeaks, 1, 0, 0, 7, 9, 3, 250, 0, 0, 9810, 0, 0, 0, 1};
    EXPECT_EQ(put(kTareCell, 1), kNone);
    const Command tare = sent();
    EXPECT_EQ(put(kCycleAt, cycle), kNone);
    EXPECT_EQ(seen(), (Sent{"state", "gravity"}));
    EXPECT_EQ(global()[kPlcHbEcho], 9);
    EXPECT_EQ(global()[kCmdSeqAck], 0);
    EXPECT_EQ(put(kCmd, {kResetPeaks, 1, 0, 0, 7}), kBusy) << "elsewhere it is refused";
    answer(tare.number, TACTILED_COMMAND_DONE);
    cycle[5] = 10;
    EXPECT_EQ(put(kCycleAt, cycle), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::reset_peaks);
    EXPECT_EQ(global()[kCmdSeqAck], 7);
}

TEST_F(HintsTest, AShorterWriteOfACycleLeavesTheHintsAsTheyAre) {
    EXPECT_EQ(put(kCycleAt, {kResetPeaks, 1, 0, 0, 7, 9}), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::reset_peaks);
    nothing_was_sent();
    EXPECT_EQ(cell(kGravityX), kNoI16);
    EXPECT_EQ(cell(kPlcHeartbeat), 9);
}

TEST_F(HintsTest, AGripperWithoutAHintIsAHintOfNone) {
    EXPECT_EQ(put(kGripperState, 2), kNone);
    EXPECT_EQ(put(kGripperState, kNoU16), kNone);
    EXPECT_EQ(seen(), (Sent{"state", "no state"}));
    EXPECT_EQ(put(kGripperState, kNoU16 - 1), kIllegalValue);
}

}  // namespace
}  // namespace tactiled::modbus
