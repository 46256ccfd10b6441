// The behaviour of each chip of the i2c driver under faults, against model chips in virtual time.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/unit/drivers/chip_bench.hpp"

namespace tactiled::test {
namespace {

class EveryChip : public testing::TestWithParam<ChipKind> {
protected:
    EveryChip() : model(bench.add(GetParam())) { EXPECT_EQ(bench.schedule.open(), ""); }
    // All values were converted by the model, for their channels.
    std::size_t take(double seconds) {
        const auto taken = bench.run(seconds);
        for (const auto& one : taken) EXPECT_GE(one.age_ns, 0);
        return taken.size();
    }
    ChipBench bench;
    ModelChip& model;
};
INSTANTIATE_TEST_SUITE_P(I2c, EveryChip, testing::ValuesIn(chip_kinds()),
                         [](const auto& chip) { return fmt::format("{}_{}", chip.param.name, chip.index); });

TEST_P(EveryChip, GivesFramesOfItsDeviceWithAnIncreasingTime) {
    const auto taken = bench.run(2);
    ASSERT_GT(taken.size(), 5u);
    for (std::size_t i = 1; i < taken.size(); ++i) EXPECT_GT(taken[i].frame.t_ns, taken[i - 1].frame.t_ns);
    EXPECT_EQ(bench.counts[TACTILED_LINK_FRAMES], taken.size());
    EXPECT_EQ(taken[0].frame.device, 0);
    EXPECT_EQ(bench.counts[TACTILED_LINK_BUS_ERROR], 0u);
}

TEST_P(EveryChip, ThatWasResetGivesNoValueBeforeItIsSetUpAndHasConverted) {
    take(1.5);
    for (int k = 1; k <= 20; ++k) {
        bench.run(0.0137);  // another phase of the conversion each time
        model.reset();
        const std::uint64_t reset_ns = bench.bus.now_ns();
        const auto taken = bench.run(2.5);
        ASSERT_FALSE(taken.empty());
        for (const auto& one : taken) {
            ASSERT_GE(one.age_ns, 0);
            EXPECT_GT(std::int64_t(one.frame.t_ns) - one.age_ns, std::int64_t(reset_ns)) << "converted before the reset";
        }
        EXPECT_EQ(bench.counts[TACTILED_LINK_RESTARTED], std::uint32_t(k));
    }
}

TEST_P(EveryChip, ThatIsResetBetweenTwoTransfersGivesNoValueThatItDidNotConvert) {
    take(1.5);
    std::uint64_t reset_ns = 0;
    bench.bus.accident = [&] {
        model.reset();
        reset_ns = bench.bus.now_ns();
    };
    for (unsigned n = 1; n <= 30; ++n) {
        bench.bus.n_until_accident = n;
        for (const auto& one : bench.run(2)) {
            ASSERT_GE(one.age_ns, 0) << n;
            const auto converted_ns = std::uint64_t(std::int64_t(one.frame.t_ns) - one.age_ns);
            // Read before the reset, while the next conversion was begun.
            EXPECT_TRUE(one.frame.t_ns <= reset_ns + 6'000'000 || converted_ns > reset_ns) << n;
        }
        EXPECT_LE(bench.counts[TACTILED_LINK_RESTARTED], n);  // fewer if it was just being configured then
    }
    EXPECT_GT(bench.counts[TACTILED_LINK_RESTARTED], 10u);
}

TEST_P(EveryChip, ThatMissesOneTransferGoesOnWithoutBeingSetUpAnew) {
    take(1.5);
    bench.bus.n_failing = 1;
    bench.bus.failing_with = Answer::absent;
    EXPECT_GT(take(1.5), 3u);
    EXPECT_EQ(bench.counts[TACTILED_LINK_BUS_ERROR], 1u);
    // A missed command is detected by reading back. These chips get no commands during operation.
    const bool only_read = GetParam().inputs.size() == 1 && GetParam().name != "ads1115" && GetParam().name != "fdc1004";
    EXPECT_LE(bench.counts[TACTILED_LINK_RESTARTED], only_read || GetParam().name == "mpr121" ? 0u : 1u);
}

TEST_P(EveryChip, ThatIsAwayIsAskedSeldomAndSetUpAnewWhenItIsBack) {
    take(1.5);
    model.is_dead = true;
    const unsigned transfers = bench.bus.n_transfers;
    EXPECT_EQ(take(20), 0u);
    EXPECT_LT(bench.bus.n_transfers - transfers, 40u);
    model.is_dead = false;
    model.reset();
    EXPECT_GT(take(4), 3u);
    EXPECT_EQ(bench.counts[TACTILED_LINK_RESTARTED], 1u);
    EXPECT_EQ(bench.counts[TACTILED_LINK_BUS_ERROR], bench.bus.n_nacks);
}

TEST_P(EveryChip, WhoseSettingChangesGivesNoValueOfAnotherChannel) {
    take(1.5);
    for (unsigned which = 0; which < 6; ++which) {
        model.disturb(which, std::uint8_t(0x5A + which));
        take(2.5);
    }
    EXPECT_GT(take(1), 1u);
}

TEST_P(EveryChip, IsDisconnectedWithItsAdapterAndWithAHangingBus) {
    take(1.5);
    bench.bus.is_disconnected = true;
    Frame frame;
    while (bench.status != Status::disconnected) bench.status = bench.schedule.read(frame, 50);
    EXPECT_NE(bench.schedule.open().find("plug it in"), std::string::npos);
    bench.bus.is_disconnected = false;
    ASSERT_EQ(bench.schedule.open(), "");
    bench.status = Status::timeout;
    take(1.5);
    bench.bus.hangs = true;
    while (bench.status != Status::disconnected) bench.status = bench.schedule.read(frame, 50);
    EXPECT_NE(bench.schedule.open().find("SDA or SCL is held low"), std::string::npos);
}

TEST_P(EveryChip, OfAnotherKindIsRefusedAtOpening) {
    for (const ChipKind& other : chip_kinds()) {
        if (other.name == GetParam().name) continue;
        ChipBench wrong;
        Problems problems;
        Options options = Options::parse_text(GetParam().keys, "test.toml", problems);
        const auto model_of_other = other.make_model();
        wrong.bus.wires.put(GetParam().address, *model_of_other);
        wrong.schedule.add(GetParam().name, Chips::find(GetParam().name)->make(options), {GetParam().address}, 0,
                           wrong.counts);
        const bool opened = wrong.schedule.open().empty();
        EXPECT_TRUE(!opened || GetParam().name == "ads122c04") << other.name;  // it has no identification
        Frame frame;
        for (int k = 0; opened && k < 50; ++k) EXPECT_NE(wrong.schedule.read(frame, 50), Status::frame) << other.name;
    }
}

TEST(I2cChips, AChipThatDoesNotAnswerLeavesTheOthersAlone) {
    ChipBench bench;
    bench.add(kind_of("nau7802"), 0);
    ModelChip& dead = bench.add(kind_of("fdc1004"), 1);
    dead.is_dead = true;
    ASSERT_EQ(bench.schedule.open(), "");
    bench.run(2);
    const std::uint32_t lost = bench.counts[TACTILED_LINK_LOST];
    EXPECT_NEAR(double(bench.run(10).size()), 3200, 2);
    EXPECT_EQ(bench.counts[TACTILED_LINK_LOST], lost);
    dead.is_dead = false;
    bench.run(2);
    std::size_t of_second = 0;
    for (const auto& one : bench.run(1)) of_second += one.frame.device == 1;
    EXPECT_GT(of_second, 100u);
    EXPECT_EQ(bench.counts[TACTILED_LINK_RESTARTED], 0u);  // it was never configured before
}

TEST(I2cChips, NoChipAtAllIsSaidAtOpening) {
    ChipBench bench;
    bench.add(kind_of("ad7746")).is_dead = true;
    EXPECT_NE(bench.schedule.open().find("ad7746 at 0x48 does not answer"), std::string::npos);
}

TEST(I2cChips, AWrongChipIsSaidWithWhatItReads) {
    ChipBench bench;
    auto& model = dynamic_cast<ModelFdc1004&>(bench.add(kind_of("fdc1004")));
    model.word[0xFF] = 0x1005;
    EXPECT_EQ(bench.schedule.open(),
              "fdc1004 at 0x50: its registers 0xfe and 0xff read 0x54491005, should be 0x54491004: another chip, or another "
              "chip's address");
}

TEST(I2cMux, TwoChipsOfOneAddressNeverAnswerAtOnce) {
    ChipBench bench;
    const ChipKind& kind = kind_of("ad7746");
    for (unsigned n = 0; n < 4; ++n) bench.add(kind, std::uint16_t(n), std::uint8_t(0x70 + n / 2), std::uint8_t(n % 2 * 3));
    for (unsigned n = 0; n < 4; ++n) bench.models[n]->n_converted = n * 0x10000;  // codes identify the chips
    ASSERT_EQ(bench.schedule.open(), "");
    std::size_t of[4] = {};
    for (int k = 0; k < 10; ++k) {
        for (const auto& one : bench.run(0.5)) {
            ASSERT_GE(one.age_ns, 0);
            ++of[one.frame.device];
        }
        bench.bus.wires.reset_muxes();
    }
    for (const std::size_t n : of) EXPECT_GT(n, 300u);
    EXPECT_EQ(bench.bus.wires.n_collisions, 0u);
}

TEST(I2cMux, IsSelectedOnceNotForEachTransfer) {
    ChipBench direct, behind;
    direct.add(kind_of("ad7746"));
    behind.add(kind_of("ad7746"), 0, 0x70, 2);
    for (ChipBench* const bench : {&direct, &behind}) {
        ASSERT_EQ(bench->schedule.open(), "");
        bench->run(5);
    }
    EXPECT_LE(behind.bus.n_transfers, direct.bus.n_transfers + 3);
    behind.bus.wires.reset_muxes();
    EXPECT_GT(behind.run(1).size(), 80u) << "not selected again";
}

}  // namespace
}  // namespace tactiled::test
