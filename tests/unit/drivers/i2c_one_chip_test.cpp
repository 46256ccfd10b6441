// Properties of single chips of the i2c driver, against their models in virtual time.
#include <gtest/gtest.h>

#include "tests/unit/drivers/chip_bench.hpp"

namespace tactiled::test {
namespace {

TEST(Ad7746, MarksSaturationLimitsMissingExcitationAndAddsTheTemperature) {
    ChipBench bench;
    const ChipKind kind{
        "ad7746", "temperature = true\ncapdac_a = [100]\nrate_Hz = 50", 0x48, {0}, 1, 0, make_model<ModelAd7746>};
    auto& model = dynamic_cast<ModelAd7746&>(bench.add(kind));
    ASSERT_EQ(bench.schedule.open(), "");
    const auto good = bench.run(1);
    ASSERT_GT(good.size(), 20u);
    const Frame& frame = good.back().frame;
    ASSERT_EQ(frame.n_channels, 2);
    EXPECT_NEAR(frame.channel[1], 25, 1e-9);  // degC
    EXPECT_EQ(frame.saturated, 0u);
    EXPECT_EQ(model.reg[11], 0x80 | 100);
    EXPECT_EQ(model.reg[12], 0);

    Frame rail;
    const auto next = [&](std::uint32_t code, std::uint8_t status) {
        model.ends_at_code(code, status);
        while (bench.schedule.read(rail, 50) != Status::frame) {}
    };
    next(0xFFFFFF, 0);
    EXPECT_EQ(rail.saturated, 1u);
    EXPECT_NEAR(rail.channel[0], 4.096, 1e-6);  // pF
    next(0, 0);
    EXPECT_EQ(rail.saturated, 1u);
    EXPECT_NEAR(rail.channel[0], -4.096, 1e-6);
    next(0x900000, 0x08);
    EXPECT_EQ(rail.missing, 1u);
    EXPECT_TRUE(std::isnan(rail.channel[0]));
}

TEST(Ad7746, WhoseSwitchGoesAwayIsDisconnectedWithItsLinkAndGivesNoOtherElectrodesValue) {
    ChipBench bench;
    for (const ChipKind& kind : chip_kinds())
        if (kind.keys.find("electrodes") != std::string::npos) bench.add(kind);
    ASSERT_EQ(bench.schedule.open(), "");
    for (const auto& one : bench.run(1)) EXPECT_GE(one.age_ns, 0);
    bench.selectors.front()->is_disconnected = true;
    const auto last = bench.run(1);
    EXPECT_LE(last.size(), 1u);  // conversions that were already complete
    for (const auto& one : last) EXPECT_GE(one.age_ns, 0);
    EXPECT_EQ(bench.status, Status::disconnected);
    bench.selectors.front()->is_disconnected = false;
    ASSERT_EQ(bench.schedule.open(), "");
    bench.status = Status::timeout;
    const auto again = bench.run(1);
    EXPECT_GT(again.size(), 15u);  // 5 conversions of 11 ms each
    for (const auto& one : again) EXPECT_GE(one.age_ns, 0);
}

TEST(Ads122c04, DropsAndCountsWhatItsChecksumRefuses) {
    ChipBench bench;
    auto& model = dynamic_cast<ModelAds122c04&>(bench.add(kind_of("ads122c04")));
    ASSERT_EQ(bench.schedule.open(), "");
    bench.run(0.5);
    model.n_flipped = 5;
    for (const auto& one : bench.run(0.5)) ASSERT_GE(one.age_ns, 0);
    EXPECT_EQ(bench.counts[TACTILED_LINK_BAD_CHECKSUM], 5u);
    model.n_flipped_registers = 5;
    for (const auto& one : bench.run(0.5)) ASSERT_GE(one.age_ns, 0);
    EXPECT_EQ(bench.counts[TACTILED_LINK_BAD_CHECKSUM], 10u);
    EXPECT_EQ(bench.counts[TACTILED_LINK_RESTARTED], 0u);
}

// Input and gain, rate, counter and CRC, current sources: a wrong one gives values that seem valid.
TEST(Ads122c04, IsSetUpAnewWithinFourValuesOfASettingThatChangedByItself) {
    for (const std::string crc : {"true", "false"})
        for (unsigned which = 0; which < 4; ++which) {
            ChipBench bench;
            const ChipKind kind{"ads122c04", "rate_Hz = 330\ncrc = " + crc, 0x40, {0}, 1, 0, make_model<ModelAds122c04>};
            ModelChip& model = bench.add(kind);
            ASSERT_EQ(bench.schedule.open(), "");
            bench.run(0.5);
            model.disturb(which, 0x3A);
            const std::uint32_t frames = bench.counts[TACTILED_LINK_FRAMES];
            Frame frame;
            while (bench.counts[TACTILED_LINK_RESTARTED] == 0 && bench.counts[TACTILED_LINK_FRAMES] < frames + 10)
                (void)bench.schedule.read(frame, 50);
            // The last one of them arrived after it.
            EXPECT_LE(bench.counts[TACTILED_LINK_FRAMES], frames + 3 + 1) << "register " << which << ", crc " << crc;
        }
}

// A register that is read with a wrong bit is read again.
TEST(Ads122c04, IsSetUpAnewWithinFourValuesThoughARegisterIsReadWithAWrongBit) {
    for (unsigned begin = 0; begin < 4; ++begin)
        for (unsigned after = 0; after < 4; ++after) {
            ChipBench bench;
            auto& model = dynamic_cast<ModelAds122c04&>(bench.add(kind_of("ads122c04")));
            ASSERT_EQ(bench.schedule.open(), "");
            const std::uint32_t& frames = bench.counts[TACTILED_LINK_FRAMES];
            Frame frame;
            const auto read_until = [&](std::uint32_t n) {
                while (frames < n && bench.counts[TACTILED_LINK_RESTARTED] == 0) (void)bench.schedule.read(frame, 50);
            };
            read_until(40 + begin);
            model.disturb(0, 0x3A);
            read_until(40 + begin + after);
            model.n_flipped_registers = 1;
            read_until(60);
            EXPECT_LE(frames, 40 + begin + 3 + 1) << begin << " " << after;
        }
}

TEST(Ads122c04, GivesNoValueWithASettingThatWasWrittenWrongly) {
    for (unsigned which = 1; which <= 4; ++which) {
        ChipBench bench;
        auto& model = dynamic_cast<ModelAds122c04&>(bench.add(kind_of("ads122c04")));
        model.n_flipped_writes = which;
        (void)bench.schedule.open();
        EXPECT_EQ(model.n_flipped_writes, 0u);
        bench.run(0.5);
        EXPECT_GT(bench.counts[TACTILED_LINK_BUS_ERROR], 0u) << which;
        const auto right = model.reg;
        EXPECT_GT(bench.run(0.5).size(), 100u);
        EXPECT_EQ(model.reg, right);
    }
}

TEST(Fdc1004, ThatNeverSaysDoneIsResetAndAskedSeldom) {
    ChipBench bench;
    auto& model = dynamic_cast<ModelFdc1004&>(bench.add(kind_of("fdc1004")));
    ASSERT_EQ(bench.schedule.open(), "");
    bench.run(0.5);
    model.never_done = true;
    bench.run(0.1);
    EXPECT_GE(bench.counts[TACTILED_LINK_RESTARTED], 1u);
    model.never_done = false;
    bench.run(1.5);
    EXPECT_GT(bench.run(1).size(), 300u);
}

TEST(Fdc1004, WhoseDoneStaysGivesNoMeasurementTwice) {
    ChipBench bench;
    auto& model = dynamic_cast<ModelFdc1004&>(bench.add(kind_of("fdc1004")));
    ASSERT_EQ(bench.schedule.open(), "");
    bench.run(0.5);
    model.done_stays = true;
    model.period_scale = 1.4;
    bench.run(0.1);
    std::int64_t before = -1;
    for (const auto& one : bench.run(2)) {
        const std::int64_t code = bench.kinds[0]->code(one.frame, 0);
        EXPECT_NE(code, before);
        before = code;
    }
}

TEST(Fdc1004, AddsItsCapdac) {
    ChipBench bench;
    const ChipKind kind{
        "fdc1004", "inputs = [\"CIN2\", \"CIN3-CIN4\"]\ncapdac = [4]", 0x50, {0, 1}, 1, 0, make_model<ModelFdc1004>};
    auto& model = dynamic_cast<ModelFdc1004&>(bench.add(kind));
    ASSERT_EQ(bench.schedule.open(), "");
    const auto taken = bench.run(0.5);
    ASSERT_FALSE(taken.empty());
    EXPECT_NEAR(taken.back().frame.channel[0], 12.5 + 2, 0.01);  // pF: 4 steps of 3.125, and 2^20 counts
    EXPECT_NEAR(taken.back().frame.channel[1], 2 * 0x100000 / 524288.0, 0.01);
    EXPECT_EQ(model.word[8], 1 << 13 | 4 << 10 | 4 << 5);
    EXPECT_EQ(model.word[9], 2 << 13 | 3 << 10);
}

}  // namespace
}  // namespace tactiled::test
