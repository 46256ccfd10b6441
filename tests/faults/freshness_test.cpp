// Hours of streams through paths that delay them. HOURS=1000 and the like: longer runs.
#include "freshness.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>

namespace tactiled::faults {
namespace {

double number(const char* name, double otherwise) {
    const char* text = std::getenv(name);
    return text != nullptr ? std::strtod(text, nullptr) : otherwise;
}

// ---- no false alarm ------------------------------------------------------------------------------------------------------

TEST(Freshness, TenHoursOfDriftJitterPollsAndTemperatureAreNoLag) {
    for (const bool clock : {true, false})
        for (const double ppm : {100.0, -100.0, 30.0}) {
            FreshnessRun run({.clock = clock, .ppm = ppm, .temperature_ppm = 20}, 1);
            run.run_s(3600 * number("HOURS", 10));
            fmt::print("{} {:+} ppm: {} frames, {} not GOOD\n", clock ? "clock" : "sequence", ppm, run.tally.frames,
                       run.tally.frames - run.tally.good);
            EXPECT_EQ(run.tally.good, run.tally.frames);
        }
}

// ---- no undetected old value
// -----------------------------------------------------------------------------------------------

// Streams of which no receiver can see this, see drivers/wire/freshness.md.
enum Seen { kByAll, kByClocks, kByAllButRelays, kByNone };

struct Kind {
    const char* name;
    void (*episode)(FreshnessRun& run, std::mt19937_64& random);  // ends as it began
    Seen seen = kByAll;
    double may_last_s = 0;  // allowed seconds in 1000 h where it is seen
    bool from_the_start = false;
};

double between(std::mt19937_64& random, double a, double b) { return a + (b - a) * double(random() >> 11) * 0x1p-53; }

void link_down(FreshnessRun& run, std::mt19937_64& random) {
    const double s = between(random, 0.5, 3.9);
    run.hold_until(run.now_s() + s);
    run.run_s(s + between(random, 2, 20));
}

void slow_bridge(FreshnessRun& run, std::mt19937_64& random) {
    run.extra_lag_s = between(random, 0.2, 10);
    run.run_s(between(random, 5, 60));
    run.extra_lag_s = 0;
    run.run_s(30);
}

void bridge_and_reopening(FreshnessRun& run, std::mt19937_64& random) {
    run.extra_lag_s = between(random, 0.2, 10);
    run.run_s(between(random, 5, 60));
    run.reopen(run.extra_lag_s);  // the bridge keeps what it holds
    run.run_s(30);
    run.extra_lag_s = 0;
    run.run_s(30);
}

void lost_frames(FreshnessRun& run, std::mt19937_64& random) {
    run.drop = between(random, 0, 0.3);
    run.run_s(10);
    run.drop = 0;
    run.run_s(2);
}

void swapped_frames(FreshnessRun& run, std::mt19937_64& random) {
    run.swap = between(random, 0, 0.3);
    run.run_s(10);
    run.swap = 0;
    run.run_s(2);
}

void swapped_in_a_lag(FreshnessRun& run, std::mt19937_64& random) {
    run.swap = 0.1;
    slow_bridge(run, random);
    run.swap = 0;
}

void old_frame(FreshnessRun& run, std::mt19937_64& random) {
    run.forwards_old = true;
    run.run_s(between(random, 1, 3));
}

void clock_jumps(FreshnessRun& run, std::mt19937_64& random) {
    run.clock_jump_us = between(random, -1, 1) * std::pow(10, between(random, 4, 9));
    run.run_s(between(random, 5, 20));
}

void clock_jumps_in_a_lag(FreshnessRun& run, std::mt19937_64& random) {
    run.extra_lag_s = between(random, 0.3, 5);
    run.run_s(3 + run.extra_lag_s);
    run.clock_jump_us = between(random, 0, 1) * std::pow(10, between(random, 4, 9));
    run.run_s(10);
    run.extra_lag_s = 0;
    run.run_s(30);
}

void pause_of_the_device(FreshnessRun& run, std::mt19937_64& random) {
    run.pauses = true;
    run.run_s(between(random, 0.15, 5));
    run.pauses = false;
    run.run_s(between(random, 10, 20));
}

void pause_and_link_down(FreshnessRun& run, std::mt19937_64& random) {
    run.pauses = true;
    run.run_s(between(random, 0.15, 5));
    run.pauses = false;
    link_down(run, random);
}

void lag_at_the_first_frame(FreshnessRun& run, std::mt19937_64& random) {
    run.extra_lag_s = between(random, 0.2, 10);
    run.run_s(60);
}

// 150 ppm, as two crystals may drift.
void lag_that_grows_slowly(FreshnessRun& run, std::mt19937_64&) {
    for (int i = 0; i < 3600; ++i, run.extra_lag_s += 150e-6) run.run_s(1);
    run.extra_lag_s = 0;
    run.run_s(30);
}

constexpr Kind kKinds[] = {{"link down for 0.5 to 3.9 s, then all at once", link_down},
                           {"a bridge as fast as the device, lag 0.2 to 10 s", slow_bridge},
                           {"the same, and the link is opened again", bridge_and_reopening, kByAllButRelays},
                           {"frames lost", lost_frames},
                           {"frames swapped", swapped_frames},
                           {"frames swapped in a lag", swapped_in_a_lag},
                           {"an old frame under a new number", old_frame, kByClocks},
                           {"the device's clock jumps", clock_jumps},
                           {"the device's clock jumps ahead in a lag", clock_jumps_in_a_lag, kByAll, 100},
                           {"the device pauses", pause_of_the_device},
                           {"the device pauses, then the link is down", pause_and_link_down},
                           {"a lag at the first frame", lag_at_the_first_frame, kByNone, 0, true},
                           {"a lag that grows by 150 ppm", lag_that_grows_slowly, kByNone}};

struct Case {
    const char* name;
    Stream stream;
};
const Case kStreams[] = {{"clock", {}},
                         {"clock, TCP", {.reopening_discards = true}},
                         {"sequence", {.clock = false}},
                         {"sequence, TCP", {.clock = false, .reopening_discards = true}},
                         {"arrival", {.clock = false, .sequence = false}},
                         {"arrival, TCP", {.clock = false, .sequence = false, .reopening_discards = true}}};

TEST(Freshness, NoKindOfDelayMakesAnUndetectedOldValue) {
    const double hours = number("HOURS", 1);
    for (const Kind& kind : kKinds)
        for (const Case& each : kStreams) {
            std::mt19937_64 random(7);
            Tally sum;
            double simulated_s = 0;
            unsigned episodes = 0;
            while (simulated_s < hours * 3600) {
                Stream stream = each.stream;
                stream.ppm = between(random, -100, 100);
                FreshnessRun run(stream, random());
                if (!kind.from_the_start) run.run_s(300);
                run.tally = {};
                const double begin_s = run.now_s();
                for (int i = 0; i < (kind.from_the_start ? 1 : 20) && run.now_s() - begin_s < 7200; ++i, ++episodes)
                    kind.episode(run, random);
                simulated_s += run.now_s() - begin_s;
                sum.wrong += run.tally.wrong;
                sum.wrong_before += run.tally.wrong_before;
                sum.alarms += run.tally.alarms;
                sum.frames += run.tally.frames;
                sum.reopened += run.tally.reopened;
                sum.worst_ms = std::max(sum.worst_ms, run.tally.worst_ms);
            }
            const double to_1000_h = 0.01 * 1000 / (simulated_s / 3600);
            fmt::print(
                "{:<50} {:<14} before {:>9.0f} s, now {:>7.1f} s of 1000 h, oldest {:>6.0f} ms; not GOOD for nothing: "
                "{:.2f} in an episode; reopened {}\n",
                kind.name, each.name, double(sum.wrong_before) * to_1000_h, double(sum.wrong) * to_1000_h, sum.worst_ms,
                double(sum.alarms) / episodes, sum.reopened);
            const bool clock = each.stream.clock, tcp = each.stream.reopening_discards;
            if (kind.seen == kByAll || (kind.seen == kByClocks && clock) ||
                (kind.seen == kByAllButRelays && (clock || !tcp))) {
                EXPECT_LE(double(sum.wrong) * to_1000_h, kind.may_last_s) << kind.name << ", " << each.name;
            }
            if (kind.episode == pause_of_the_device && clock) {
                EXPECT_LE(sum.alarms, episodes) << "at most one sample of a pause";
            }
            if (kind.episode == pause_of_the_device && tcp) {
                EXPECT_LE(sum.alarms, 70 * episodes) << "0.5 s and the opening";
            }
        }
}

}  // namespace
}  // namespace tactiled::faults
