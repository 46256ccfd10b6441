// Rates, losses, ages and bus time of the i2c driver's schedule, in virtual time against model chips whose clocks are off.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/unit/drivers/chip_bench.hpp"

namespace tactiled::test {
namespace {

struct Reached {
    double rate_Hz, p50_us, p99_us, bus, polls;
    std::uint32_t missed, lost;  // conversions that ended and reached no frame, and what the counter says
    std::uint64_t foreign;       // values that no conversion gave
};

Reached reach(const ChipKind& kind, double scale, double clock_Hz, double seconds) {
    ChipBench bench(clock_Hz);
    ModelChip& model = bench.add(kind);
    model.period_scale = scale;
    EXPECT_EQ(bench.schedule.open(), "");
    bench.run(1.0);  // learning
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
                // One more or fewer may be under way at either end.
                EXPECT_NEAR(r.missed, r.lost, 1) << what;
                if (r.bus < 0.8) { EXPECT_EQ(r.lost, 0u) << what; }
            }
    }
}

}  // namespace
}  // namespace tactiled::test
