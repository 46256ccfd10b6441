// Rates, losses, ages and bus time of the i2c driver's schedule, in virtual time against model chips with inaccurate
// clocks.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "drivers/wire/stream_age.hpp"
#include "tests/unit/drivers/chip_bench.hpp"

namespace tactiled::test {
namespace {

struct Reached {
    double rate_Hz, p50_us, p99_us, bus, polls;
    std::uint32_t missed, lost;  // conversions that ended and reached no frame, and the reported count
    std::uint64_t foreign;       // values that no conversion gave
};

Reached reach(const ChipKind& kind, double scale, double clock_Hz, double seconds) {
    ChipBench bench(clock_Hz);
    ModelChip& model = bench.add(kind);
    model.period_scale = scale;
    EXPECT_EQ(bench.schedule.open(), "");
    bench.run(1.0);  // time for learning
    const std::uint32_t converted = model.n_converted;
    const std::uint64_t busy_ns = bench.bus.busy_ns, began_ns = bench.bus.now_ns();
    const unsigned transfers = bench.bus.n_transfers;
    const std::uint32_t lost_before = bench.counts[TACTILED_LINK_LOST];
    const auto frames = bench.run(seconds);
    std::vector<double> ages;
    Reached reached{};
    for (const auto& taken : frames) {
        reached.foreign += taken.age_ns < 0;
        ages.push_back(double(taken.age_ns) * 1e-3);
    }
    std::sort(ages.begin(), ages.end());
    const double passed_s = double(bench.bus.now_ns() - began_ns) * 1e-9;
    reached.rate_Hz = double(frames.size()) / passed_s;
    reached.p50_us = ages.at(ages.size() / 2);
    reached.p99_us = ages.at(ages.size() * 99 / 100);
    reached.bus = double(bench.bus.busy_ns - busy_ns) * 1e-9 / passed_s;
    reached.polls = double(bench.bus.n_transfers - transfers) / double(frames.size());
    reached.missed = model.n_converted - converted - std::uint32_t(frames.size());
    EXPECT_EQ(bench.counts[TACTILED_LINK_BUS_ERROR], 0u);
    EXPECT_EQ(bench.counts[TACTILED_LINK_RESTARTED], 0u);
    reached.lost = bench.counts[TACTILED_LINK_LOST] - lost_before;
    return reached;
}

TEST(I2cSchedule, TakesEveryConversionOfAChipWhoseClockIsTenPercentOff) {
    std::printf("%-10s %-34s %5s %6s %8s %7s %7s %6s %6s\n", "chip", "keys", "clock", "bus", "frames/s", "p50 us", "p99 us",
                "bus %", "trans.");
    for (const ChipKind& kind : chip_kinds()) {
        std::string keys = kind.keys;
        std::replace(keys.begin(), keys.end(), '\n', ' ');
        for (const double clock_Hz : {400e3, 100e3})
            for (const double scale : {0.9, 1.0, 1.1}) {
                const Reached r = reach(kind, scale, clock_Hz, 20);
                std::printf("%-10s %-34.34s %+4.0f%% %3.0fkHz %8.1f %7.0f %7.0f %6.2f %6.2f\n", kind.name.c_str(),
                            keys.c_str(), (1 / scale - 1) * 100, clock_Hz * 1e-3, r.rate_Hz, r.p50_us, r.p99_us, r.bus * 100,
                            r.polls);
                EXPECT_EQ(r.foreign, 0u) << kind.name << " " << keys;
                if (kind.inputs.size() > 1) continue;  // a frame is several conversions
                const std::string what = fmt::format("{} {} {} {}", kind.name, keys, scale, clock_Hz);
                // One more or one less may be in progress at either end.
                EXPECT_NEAR(r.missed, r.lost, 1) << what;
                if (r.bus < 0.8) { EXPECT_EQ(r.lost, 0u) << what; }
            }
    }
}

TEST(I2cSchedule, AnEdgeOfTheDataReadyLineGivesTheTimestampAndAMissedOneStopsNothing) {
    std::printf("%-10s %5s %7s %8s %7s %7s %6s\n", "chip", "clock", "missed", "frames/s", "p50 us", "worst", "trans.");
    for (const std::size_t which : {0u, 2u, 6u})  // ad7746, nau7802, ads122c04
        for (const double scale : {0.9, 1.0, 1.1})
            for (const unsigned misses : {0u, 5u}) {
                const ChipKind& kind = chip_kinds()[which];
                ChipBench bench;
                ModelChip& model = bench.add(kind, 0, 0, 0, true);
                model.period_scale = scale;
                bench.line->misses = misses;
                bench.bus.oversleeps_max_ns = 100'000;
                ASSERT_EQ(bench.schedule.open(), "");
                bench.run(1.0);
                const std::uint32_t converted = model.n_converted, lost = bench.counts[TACTILED_LINK_LOST];
                const unsigned transfers = bench.bus.n_transfers;
                const auto frames = bench.run(20);
                std::vector<std::int64_t> ages;
                std::uint64_t before_ns = 0;
                for (const auto& taken : frames) {
                    EXPECT_GE(taken.age_ns, 0) << "a value that was not converted, or a stamp before its conversion's end";
                    EXPECT_GT(taken.frame.t_ns, before_ns);
                    before_ns = taken.frame.t_ns;
                    ages.push_back(taken.age_ns);
                }
                std::sort(ages.begin(), ages.end());
                std::printf("%-10s %+4.0f%% %7s %8.1f %7.1f %7.1f %6.2f\n", kind.name.c_str(), (1 / scale - 1) * 100,
                            misses != 0 ? "each 5th" : "none", double(frames.size()) / 20,
                            double(ages[ages.size() / 2]) * 1e-3, double(ages.back()) * 1e-3,
                            double(bench.bus.n_transfers - transfers) / double(frames.size()));
                const std::string what = fmt::format("{} {} {}", kind.name, scale, misses);
                EXPECT_NEAR(double(model.n_converted) - converted - double(frames.size()),
                            bench.counts[TACTILED_LINK_LOST] - lost, 1)
                    << what;
                EXPECT_EQ(bench.counts[TACTILED_LINK_RESTARTED], 0u);
                EXPECT_LT(ages[ages.size() / 2], 1000) << what;  // ns: the time of the edge
                if (misses == 0) { EXPECT_LT(ages[ages.size() * 99 / 100], 1000) << what; }
            }
}

TEST(I2cSchedule, KnowsWhatItLostWhenItsThreadSlept) {
    for (const char* name : {"ad7746", "nau7802", "ads122c04"}) {
        ChipBench bench;
        ModelChip& model = bench.add(kind_of(name));
        model.period_scale = 1.07;
        ASSERT_EQ(bench.schedule.open(), "");
        bench.run(3);
        const std::uint32_t converted = model.n_converted;
        std::size_t frames = 0;
        std::uint32_t lost = 0;
        for (int k = 0; k < 50; ++k) {
            bench.bus.wait_until(bench.bus.now_ns() + 37'000'000);
            for (const auto& one : bench.run(0.2)) {
                ++frames;
                lost += one.frame.lost;
            }
        }
        EXPECT_GE(lost, 100u) << name;
        EXPECT_NEAR(double(model.n_converted - converted), double(frames + lost), 2) << name;
    }
}

// A thread without time to run reads a conversion, or the next part of a frame, long after it ended.
TEST(I2cSchedule, AValueThatWaitedInTheChipIsNotNew) {
    for (const ChipKind& kind : chip_kinds())
        for (const double scale : {0.9, 1.1}) {
            ChipBench bench;
            bench.add(kind).period_scale = scale;
            ASSERT_EQ(bench.schedule.open(), "");
            std::int64_t usual_ns = 0;
            for (const auto& one : bench.run(3)) usual_ns = std::max(usual_ns, one.age_ns);
            StreamAge age(100'000'000);
            age.open({.path = Route::Path::polled});
            Frame frame;
            for (std::uint64_t phase = 0; phase < 40; ++phase) {
                const std::uint64_t until_ns = bench.bus.now_ns() + 200'000'000 + phase * 1'370'000;
                while (bench.bus.now_ns() < until_ns) (void)bench.schedule.read(frame, 1);
                bench.bus.wait_until(bench.bus.now_ns() + 400'000'000);
                for (const auto& one : bench.run(0.5)) {
                    ASSERT_GE(one.age_ns, 0) << kind.name << " " << kind.keys;
                    Frame judged = one.frame;
                    age.judge(judged, judged.taken_ns);
                    ASSERT_LE(one.age_ns - std::int64_t(one.frame.t_ns - judged.t_ns), usual_ns + 100'000'000)
                        << kind.name << " " << kind.keys << ", phase " << phase;
                }
            }
        }
}

TEST(I2cSchedule, NoConversionWaitsOnASlowBus) {
    ChipBench bench(100e3);
    const ChipKind kind{
        "ad7746", "rate_Hz = 91\nelectrodes = 16\ntemperature = true", 0x48, {}, 1, 0, make_model<ModelAd7746>};
    bench.add(kind).period_scale = 1.1;
    ASSERT_EQ(bench.schedule.open(), "");
    const auto frames = bench.run(10);
    EXPECT_GT(frames.size(), 30u);
    for (const auto& one : frames) ASSERT_EQ(one.frame.since_ns, one.frame.taken_ns);
}

TEST(I2cSchedule, LosesNothingWhereItsThreadWakesLate) {
    for (const char* name : {"ad7746", "nau7802", "ads122c04"}) {
        ChipBench bench;
        ModelChip& model = bench.add(kind_of(name));
        bench.bus.oversleeps_max_ns = 300'000;
        ASSERT_EQ(bench.schedule.open(), "");
        bench.run(3);
        const std::uint32_t converted = model.n_converted, lost = bench.counts[TACTILED_LINK_LOST];
        const std::size_t frames = bench.run(20).size();
        EXPECT_EQ(bench.counts[TACTILED_LINK_LOST], lost) << name;
        EXPECT_NEAR(double(model.n_converted - converted), double(frames), 1) << name;
    }
}

// For a chip whose clock is 3 % off, during that time: its conversions, those without a frame, and those reported as
// lost.
struct Losses {
    double converted, missed, reported;
};
Losses losses_of(ChipBench& bench, const char* name, double settle_s, double seconds) {
    ModelChip& model = bench.add(kind_of(name));
    model.period_scale = 1.03;
    EXPECT_EQ(bench.schedule.open(), "");
    bench.run(settle_s);
    const std::uint32_t converted = model.n_converted, lost = bench.counts[TACTILED_LINK_LOST];
    const std::size_t frames = bench.run(seconds).size();
    const double all = model.n_converted - converted;
    return {all, all - double(frames), double(bench.counts[TACTILED_LINK_LOST] - lost)};
}

TEST(I2cSchedule, KnowsAboutWhatItLostOnAnAdapterTooSlowForTheChip) {
    for (const double overhead_ms : {1.0, 2.5, 4.0, 9.0})
        for (const char* name : {"ad7746", "nau7802"}) {
            ChipBench bench;
            bench.bus.overhead_ns = overhead_ms * 1e6;
            const Losses of = losses_of(bench, name, 1, 20);
            // If the clock cannot be learned, the data sheet's is used, which is 3 % off here; the count is rather
            // too high than too low.
            EXPECT_NEAR(of.reported, of.missed, 0.05 * of.converted * (of.missed > 2) + 1) << name << " " << overhead_ms;
        }
}

TEST(I2cSchedule, KnowsAboutWhatItLostWhereTransfersAreHeldUp) {
    for (const std::uint64_t max_ms : {5u, 15u, 40u})
        for (const char* name : {"ad7746", "nau7802"}) {
            ChipBench bench;
            bench.bus.held_up_max_ns = max_ms * 1'000'000;
            bench.bus.oversleeps_max_ns = 3'000'000;
            const Losses of = losses_of(bench, name, 3, 30);
            EXPECT_NEAR(of.reported, of.missed, 0.04 * of.converted) << name << " " << max_ms;
            std::printf("%s held up to %d ms: %.0f conversions, %.0f missed, %.0f counted\n", name, int(max_ms),
                        of.converted, of.missed, of.reported);
        }
}

TEST(I2cSchedule, FollowsAClockThatDrifts) {
    ChipBench bench;
    ModelChip& model = bench.add(kind_of("nau7802"));
    ASSERT_EQ(bench.schedule.open(), "");
    bench.run(3);
    const std::uint32_t converted = model.n_converted;
    std::size_t frames = 0;
    for (int k = 0; k < 400; ++k) {
        model.period_scale = 1 + 0.08 * std::sin(k * 0.05);  // 8 % within 6 s
        frames += bench.run(0.2).size();
    }
    EXPECT_NEAR(double(model.n_converted - converted), double(frames), 1);
    EXPECT_EQ(bench.counts[TACTILED_LINK_LOST], 0u);
}

TEST(I2cSchedule, FourChipsOnOneBusLoseNothing) {
    ChipBench bench;
    bench.add(kind_of("ad7746"), 0, 0x70, 0);
    bench.add(kind_of("ad7746"), 1, 0x70, 5);
    bench.add(kind_of("nau7802"), 2);
    bench.add(kind_of("mpr121"), 3);
    bench.models[1]->period_scale = 1.004;  // a beat with the first
    ASSERT_EQ(bench.schedule.open(), "");
    bench.run(3);
    const std::uint32_t converted = bench.models[2]->n_converted;
    std::size_t of[4] = {};
    for (const auto& one : bench.run(30)) {
        ++of[one.frame.device];
        ASSERT_GE(one.age_ns, 0);
    }
    EXPECT_NEAR(double(of[0]), 30 / 0.011, 2);
    EXPECT_NEAR(double(of[2]), double(bench.models[2]->n_converted - converted), 1);
    EXPECT_EQ(bench.counts[TACTILED_LINK_LOST], 0u);
}

}  // namespace
}  // namespace tactiled::test
