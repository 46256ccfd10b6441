// Hints of the robot expire, and one write in each cycle has all that a PLC writes.
#include <algorithm>

#include "controls_fixture.hpp"

namespace tactiled::modbus {
namespace {

class HintsTest : public ControlsTest {
protected:
    using Kinds = std::vector<Command::Kind>;
    static constexpr auto kGravity = Command::Kind::gravity, kSilence = Command::Kind::robot_is_silent;
    // Returns the kinds of the commands that were sent.
    std::vector<Command::Kind> kinds() {
        std::vector<Command::Kind> all;
        for (; commands_.front() != nullptr; commands_.pop()) all.push_back(commands_.front()->kind);
        return all;
    }
    void nothing_was_sent() { EXPECT_EQ(commands_.front(), nullptr); }
};

class ExpiringHints : public HintsTest {
protected:
    ExpiringHints() {
        settings_.hints_expire_ms = 2000;
        start();
    }
    static constexpr std::uint64_t kExpireNs = 2 * kSecond;
    static std::vector<unsigned> gravity() { return {0, 0, 9810}; }
    bool is_silent(std::uint64_t now_ns) { return (global(now_ns)[kStatus] >> 12 & 1) != 0; }
};

TEST_F(ExpiringHints, TwoSecondsAfterTheLastOneAllLoseForce) {
    EXPECT_EQ(cell(kPlcWatchdog), 2000);
    EXPECT_FALSE(is_silent(100 * kSecond)) << "no PLC has written anything";
    EXPECT_EQ(put(kGravityX, gravity()), kNone);  // at 1 s
    EXPECT_EQ(put(kGripperState, 2, 2 * kSecond), kNone);
    EXPECT_EQ(kinds(), (Kinds{kGravity, Command::Kind::hint}));
    EXPECT_FALSE(is_silent(2 * kSecond + kExpireNs)) << "any hint is a sign of life of all";
    EXPECT_EQ(kinds(), Kinds{});
    EXPECT_TRUE(is_silent(2 * kSecond + kExpireNs + 1));
    EXPECT_EQ(kinds(), Kinds{kSilence});
    EXPECT_EQ(put(kGripperForce, 5, 10 * kSecond), kNone);
    EXPECT_FALSE(is_silent(10 * kSecond));
    EXPECT_EQ(kinds(), Kinds{}) << "gravity is not in force again";
}

TEST_F(ExpiringHints, EachWriteOfAHintAndEachNewHeartbeatIsASignOfLife) {
    EXPECT_EQ(put(kGravityX, gravity()), kNone);
    std::uint64_t now_ns = kSecond;
    for (const unsigned at : {5022u, 5023u, 5040u, 5045u, 5046u}) {
        now_ns += kExpireNs;
        EXPECT_EQ(put(at, at == kGravityX ? 0 : 1, now_ns), kNone) << at;
    }
    for (unsigned beat = 1; beat < 4; ++beat) EXPECT_EQ(put(kPlcHeartbeat, beat, now_ns += kExpireNs), kNone);
    const Kinds before = kinds();
    EXPECT_EQ(std::count(before.begin(), before.end(), kSilence), 0);
    EXPECT_FALSE(is_silent(now_ns + kExpireNs));
    EXPECT_TRUE(is_silent(now_ns + kExpireNs + 1));
    EXPECT_EQ(put(kPlcHeartbeat, 3, now_ns + kExpireNs + 2), kNone);
    EXPECT_TRUE(is_silent(now_ns + kExpireNs + 2)) << "the same heartbeat again";
}

TEST_F(ExpiringHints, AScannerThatRepeatsTheLastWriteOfADeadPlcKeepsNothingInForce) {
    const std::vector<unsigned> cycle{0, 0, 0, 0, 0, 7, 2, 100, 0, 0, 9810, 0, 0, 0, 1};
    std::uint64_t now_ns = kSecond;
    const auto repeat = [&](const std::vector<unsigned>& values) { return put_at(kCycleAt, values, now_ns); };
    EXPECT_EQ(repeat(cycle), kNone);
    EXPECT_EQ(kinds(), (Kinds{Command::Kind::hint, kGravity, Command::Kind::acceleration}));
    for (now_ns += kSecond; now_ns < 10 * kSecond; now_ns += kSecond / 2) EXPECT_EQ(repeat(cycle), kNone);
    const Kinds sent = kinds();
    ASSERT_FALSE(sent.empty());
    EXPECT_EQ(sent.back(), kSilence);
    EXPECT_EQ(std::count(sent.begin(), sent.end(), kSilence), 1);
    EXPECT_TRUE(is_silent(now_ns));
    EXPECT_EQ(cell(kGravityX + 2), kNoI16) << "not in force";
    std::vector<unsigned> alive = cycle;
    alive[5] = 8;
    EXPECT_EQ(repeat(alive), kNone);
    EXPECT_FALSE(is_silent(now_ns));
    EXPECT_EQ(kinds(), (Kinds{Command::Kind::hint, kGravity}));
}

TEST_F(ExpiringHints, AWatchdogOfZeroKeepsThemForEver) {
    EXPECT_EQ(put(kPlcWatchdog, 0), kNone);
    EXPECT_EQ(put(kGravityX, gravity()), kNone);
    EXPECT_FALSE(is_silent(1000 * kSecond));
    EXPECT_EQ(kinds(), Kinds{kGravity});
    EXPECT_EQ(put(kPlcWatchdog, 500, 1000 * kSecond), kNone);  // its change is a sign of life
    EXPECT_FALSE(is_silent(1000 * kSecond + kSecond / 2));
    EXPECT_TRUE(is_silent(1000 * kSecond + kSecond / 2 + 1));
    EXPECT_EQ(kinds(), Kinds{kSilence});
}

TEST_F(ExpiringHints, ASilenceForWhichThePipelineHasNoRoomComesBeforeNewHints) {
    EXPECT_EQ(put(kGravityX, gravity()), kNone);
    while (Command* const slot = commands_.claim()) {
        *slot = Command{};
        commands_.push();
    }
    commands_.commit();
    EXPECT_TRUE(is_silent(10 * kSecond));
    EXPECT_EQ(put_at(kGravityX, gravity(), 11 * kSecond), kNone);
    (void)kinds();
    controls_->tick(11 * kSecond);
    EXPECT_EQ(kinds(), (Kinds{kSilence, kGravity}));
}

// ---- one write in each cycle -------------------------------------------------------------------------------------------

TEST_F(ExpiringHints, NoClientKeepsTheHintsOfAnotherInForce) {
    const auto as = [&](std::uint8_t host) { session_.host = HostAddress{host}; };
    as(1);
    EXPECT_EQ(put(kGravityX, gravity()), kNone);
    as(2);
    for (unsigned beat = 1; beat < 4; ++beat) EXPECT_EQ(put(kPlcHeartbeat, beat, beat * kSecond), kNone);
    EXPECT_EQ(kinds(), Kinds{kGravity});
    EXPECT_FALSE(is_silent(3 * kSecond + 1)) << "the client without hints is alive";
    EXPECT_EQ(kinds(), Kinds{kSilence});
    EXPECT_EQ(global(4 * kSecond)[kPlcHbEcho], 3);
    as(1);
    EXPECT_EQ(global(4 * kSecond)[kPlcHbEcho], 0) << "an echo is of the client's own heartbeat";
}

TEST_F(ExpiringHints, TwoGatewaysThatRepeatTheirLastWritesKeepNothingInForce) {
    const auto cycle = [&](unsigned host, std::uint64_t now_ns) {
        session_.host = HostAddress{std::uint8_t(host)};
        return put_at(kCycleAt, {0, 0, 0, 0, 0, host, 65535, 0, 0, 0, 9810, 0, 0, 0, host}, now_ns);
    };
    std::uint64_t now_ns = kSecond;
    for (; now_ns <= kSecond + kExpireNs; now_ns += kSecond / 10)
        for (const unsigned host : {1u, 2u}) EXPECT_EQ(cycle(host, now_ns), kNone);
    (void)kinds();
    EXPECT_TRUE(is_silent(now_ns));
    (void)kinds();
    for (const unsigned host : {1u, 2u}) EXPECT_EQ(cycle(host, now_ns), kNone);
    EXPECT_EQ(kinds(), Kinds{});
}

TEST_F(HintsTest, OneWriteOfACycleIsThatOfItsSingleRegisters) {
    const std::vector<unsigned> cycle{kResetPeaks, 1, 0, 0, 7, 9, 3, 250, 0, 0, 9810, 100, 200, 300, 1};
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
    EXPECT_EQ(put(kTareCell, 1), kNone);
    const Command tare = sent();
    EXPECT_EQ(refused(0, kResetPeaks), kBusy);
    answer(tare.number, TACTILED_COMMAND_DONE);
    EXPECT_EQ(put(kCycleAt, good), kNone);
}

TEST_F(HintsTest, AShorterWriteOfACycleLeavesTheHintsAsTheyAre) {
    EXPECT_EQ(put(kCycleAt, {kResetPeaks, 1, 0, 0, 7, 9}), kNone);
    EXPECT_EQ(sent().kind, Command::Kind::reset_peaks);
    nothing_was_sent();
    EXPECT_EQ(cell(kGravityX), kNoI16);
    EXPECT_EQ(cell(kPlcHeartbeat), 9);
}

TEST_F(HintsTest, AGripperWithoutAHintIsAHintOfNone) {
    EXPECT_EQ(put(kGripperState, kNoU16), kNone);
    EXPECT_EQ(sent().gripper, grasp::Hint::none);
    EXPECT_EQ(put(kGripperState, kNoU16 - 1), kIllegalValue);
}

}  // namespace
}  // namespace tactiled::modbus
