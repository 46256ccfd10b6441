// Command numbers: each address has its own, the first one after a start is adopted, a repeated one runs nothing.
#include "controls_fixture.hpp"

namespace tactiled::modbus {
namespace {

class CommandClientsTest : public ControlsTest {
protected:
    CommandClientsTest() { controls_ = std::make_unique<Controls>(settings_, commands_); }  // no number is adopted yet
    void be(std::uint8_t last_of_address) {
        session_.host = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF, 192, 168, 0, last_of_address};
    }
    int run(unsigned code, unsigned mask, unsigned number) { return put(kCmd, {code, mask, 0, 0, number}); }
    // Returns acknowledgement, state and result, as this client reads them.
    std::array<unsigned, 3> read() {
        const auto now = global();
        controls_->note_read(session_);
        return {now[kCmdSeqAck], now[kCmdState], now[kCmdResult]};
    }
    std::array<std::uint16_t, kCommandsSize> more() {
        std::array<std::uint16_t, kCommandsSize> out{};
        controls_->follow(view_of(segment_), kSecond);
        encode(area_with(Block::commands), out, view_of_nothing(), 0, controls_->report(session_, kSecond));
        return out;
    }
    // Lets the pipeline carry out the sent command; returns false if there is none.
    bool carry_out(tactiled_command_result result = TACTILED_COMMAND_OK) {
        if (commands_.front() == nullptr) return false;
        answer(sent().number, result == TACTILED_COMMAND_OK ? TACTILED_COMMAND_DONE : TACTILED_COMMAND_REJECTED, result);
        return true;
    }
    using Read = std::array<unsigned, 3>;
};

TEST_F(CommandClientsTest, TheFirstNumberAfterAStartIsAdoptedAndTheNextOneRuns) {
    for (const unsigned first : {5u, 0u}) {
        controls_ = std::make_unique<Controls>(settings_, commands_);
        EXPECT_EQ(read(), (Read{0, TACTILED_COMMAND_IDLE, TACTILED_COMMAND_OK}));
        for (int i = 0; i < 3; ++i) {  // a PLC that writes its block in every cycle
            EXPECT_EQ(run(kTare, 1, first), kNone);
            EXPECT_EQ(read(), (Read{first, TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_ADOPTED}));
            EXPECT_FALSE(carry_out());
        }
        EXPECT_EQ(run(kTare, 1, first + 1), kNone);
        EXPECT_TRUE(carry_out());
        EXPECT_EQ(read(), (Read{first + 1, TACTILED_COMMAND_DONE, TACTILED_COMMAND_OK}));
    }
}

TEST_F(CommandClientsTest, TwoAddressesDoNotAnswerForEachOther) {
    be(1), run(kTare, 1, 1), run(kTare, 1, 2);
    EXPECT_TRUE(carry_out());
    be(2), run(kUntare, 1, 1);
    EXPECT_EQ(read(), (Read{1, TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_ADOPTED}));
    EXPECT_EQ(run(kUntare, 3, 2), kNone);  // no such sensor; the same number as the other client's
    EXPECT_EQ(read(), (Read{2, TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_BAD_MASK}));
    EXPECT_EQ(cell(kCmdMask), 3);
    be(1);
    EXPECT_EQ(read(), (Read{2, TACTILED_COMMAND_DONE, TACTILED_COMMAND_OK}));
    EXPECT_EQ(cell(kCmdMask), 1);
}

TEST_F(CommandClientsTest, AnAddressKeepsItsStateOverAReconnection) {
    be(1), run(kTare, 1, 1), run(kTare, 1, 2);
    EXPECT_TRUE(carry_out());
    session_ = Session{};
    session_.may_write = true;
    be(1);
    EXPECT_EQ(read(), (Read{2, TACTILED_COMMAND_DONE, TACTILED_COMMAND_OK}));
    run(kTare, 1, 2);
    EXPECT_FALSE(carry_out());
    run(kTare, 1, 3);
    EXPECT_TRUE(carry_out());
}

TEST_F(CommandClientsTest, ARepeatedNumberIsAnsweredAsRepeatedOnceTheOutcomeWasRead) {
    run(kTare, 1, 1), run(kTare, 1, 2);
    run(kTare, 1, 2);
    EXPECT_EQ(read()[1], unsigned(TACTILED_COMMAND_RUNNING));
    EXPECT_TRUE(carry_out());
    run(kTare, 1, 2);
    EXPECT_EQ(read(), (Read{2, TACTILED_COMMAND_DONE, TACTILED_COMMAND_OK}))
        << "a PLC that writes cyclically reads the result";
    run(kTare, 1, 2);
    EXPECT_EQ(read(), (Read{2, TACTILED_COMMAND_DONE, TACTILED_COMMAND_REPEATED}));
    EXPECT_FALSE(carry_out());
    EXPECT_EQ(more()[kCmdRepeats], 3);
    run(kTare, 1, 3);
    EXPECT_TRUE(carry_out());
    EXPECT_EQ(read(), (Read{3, TACTILED_COMMAND_DONE, TACTILED_COMMAND_OK}));
    EXPECT_EQ(more()[kCmdRepeats], 0);
}

TEST_F(CommandClientsTest, AnotherCommandUnderTheNumberOfTheLastOneIsRejectedAtOnce) {
    run(kTare, 1, 1), run(kTare, 1, 2);
    EXPECT_TRUE(carry_out());
    run(kUntare, 1, 2);
    EXPECT_EQ(read(), (Read{2, TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_REPEATED}));
    EXPECT_FALSE(carry_out());
}

TEST_F(CommandClientsTest, AnotherCommandUnderTheNumberOfARunningOneDoesNotGetItsResult) {
    run(kTare, 1, 1), run(kTare, 1, 2);
    run(kUntare, 1, 2);
    EXPECT_TRUE(carry_out());
    EXPECT_EQ(read(), (Read{2, TACTILED_COMMAND_REJECTED, TACTILED_COMMAND_REPEATED}));
    EXPECT_EQ(run(kTare, 1, 3), kNone);
    EXPECT_TRUE(carry_out());
}

TEST_F(CommandClientsTest, TheOutcomeOfARegisterOrCoilIsReadByTheClientThatWroteIt) {
    be(1);
    EXPECT_EQ(put(kTareCell, 1), kNone);
    EXPECT_EQ(more()[kDirectState], TACTILED_COMMAND_RUNNING);
    EXPECT_TRUE(carry_out(TACTILED_COMMAND_UNDER_LOAD));
    be(2);
    EXPECT_EQ(more()[kDirectCount], 0);
    EXPECT_EQ(ask({5, 0, kTareCoils, 0xFF, 0}), kNone);
    EXPECT_TRUE(carry_out());
    EXPECT_EQ(more()[kDirectState], TACTILED_COMMAND_DONE);
    be(1);
    const auto mine = more();
    EXPECT_EQ(mine[kDirectCmd], kTare);
    EXPECT_EQ(mine[kDirectState], TACTILED_COMMAND_REJECTED);
    EXPECT_EQ(mine[kDirectResult], TACTILED_COMMAND_UNDER_LOAD);
    EXPECT_EQ(mine[kDirectCount], 1);
}

TEST_F(CommandClientsTest, OfMoreAddressesThanPlacesTheOldestIsForgottenAndAdoptedAnew) {
    be(1), run(kTare, 1, 1);
    for (unsigned i = 2; i <= 32; ++i) be(std::uint8_t(i)), put(kCmd, {kTare, 1, 0, 0, 1}), put(kCmdMask, 1, kSecond + i);
    be(33), put(kCmdSeq, 1, 2 * kSecond);
    be(2);
    EXPECT_EQ(read()[0], 1u);
    be(1);
    EXPECT_EQ(read(), (Read{0, TACTILED_COMMAND_IDLE, TACTILED_COMMAND_OK}));
    run(kTare, 1, 2);
    EXPECT_FALSE(carry_out());
    EXPECT_EQ(read()[2], unsigned(TACTILED_COMMAND_ADOPTED));
}

}  // namespace
}  // namespace tactiled::modbus
