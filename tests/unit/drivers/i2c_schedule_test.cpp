// Rates, losses, ages and bus time of the i2c driver's schedule, in virtual time against model chips whose clocks are off.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/unit/drivers/chip_bench.hpp"

namespace tactiled::test {
namespace {

struct Reached {
    double rate_Hz, p50_us, p99_us, bus, polls;
    std::uint32_t missed;  // conversions that ended and reached no frame
    std::uint64_t foreign;
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
    const std::vector<Frame> frames = bench.run(seconds);
    std::vector<double> ages;
    Reached reached{};
    for (const Frame& frame : frames) {
        const std::int64_t age = bench.age_ns(frame);
        reached.foreign += age < 0;
        ages.push_back(double(age) * 1e-3);
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
    if (bench.kinds[0]->inputs.size() == 1 && kind.name != "mpr121") EXPECT_LE(bench.counts[TACTILED_LINK_LOST], 0u);
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
                const bool every = kind.inputs.size() == 1 && r.bus < 0.8;
                // One more or fewer may be under way at either end.
                if (every) EXPECT_LE(r.missed, 1u) << kind.name << " " << keys << " " << scale << " " << clock_Hz;
            }
    }
}

}  // namespace
}  // namespace tactiled::test
