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
            FreshnessRun run({.clock = clock, .ppm = ppm, .temperature_ppm = 20}, std::uint64_t(number("SEED", 1)));
            run.run_s(3600 * number("HOURS", 10));
            fmt::print("{} {:+} ppm: {} frames, {} not GOOD\n", clock ? "clock" : "sequence", ppm, run.tally.frames,
                       run.tally.frames - run.tally.good);
            EXPECT_EQ(run.tally.good, run.tally.frames);
        }
}

// The device measures nothing for 0.1 to 30 s, 20 to 120 s after the last time.
TEST(Freshness, HoursOfADeviceThatPausesCostOneSampleOfAPauseOrTheTimeUntilTheLinkWasOpenedAgain) {
    std::mt19937_64 random(std::uint64_t(number("SEED", 1)));
    const auto between = [&](double a, double b) { return a + (b - a) * double(random() >> 11) * 0x1p-53; };
    for (const bool tcp : {false, true})
        for (const auto& [clock, sequence] : {std::pair{true, true}, {true, false}, {false, true}, {false, false}}) {
            if (!clock && !tcp) continue;  // unproved from the first pause on
            double last_alarm_s = 0, longest_s = 0;
            std::uint64_t pauses = 0, alarms = 0, max_alarms = 0;
            FreshnessRun run({.clock = clock,
                              .sequence = sequence,
                              .ppm = between(-100, 100),
                              .temperature_ppm = 20,
                              .reopening_discards = tcp},
                             random());
            run.see = [&](const Seen& seen, double t_s) {
                if (seen.good) return;
                last_alarm_s = t_s;
                ++alarms;
            };
            run.run_s(10);
            for (const double end_s = run.now_s() + 3600 * number("HOURS", 2); run.now_s() < end_s; ++pauses) {
                run.pauses = true;
                run.run_s(between(0.1, 30));
                run.pauses = false;
                const double pause_end_s = run.now_s();
                const std::uint64_t before = alarms;
                run.run_s(between(20, 120));
                max_alarms = std::max(max_alarms, alarms - before);
                longest_s = std::max(longest_s, last_alarm_s - pause_end_s);
            }
            fmt::print("{}{}: {} pauses, {} not GOOD, at most {} of a pause, the last {:.2f} s after its end\n",
                       clock      ? "clock"
                       : sequence ? "sequence"
                                  : "arrival",
                       tcp ? ", TCP" : "", pauses, alarms, max_alarms, longest_s);
            if (clock)
                EXPECT_LE(max_alarms, 1u);
            else  // until the daemon asks, while it is closed, and the delay of the path
                EXPECT_LE(longest_s, 0.5 + 0.2 + 0.1);
        }
}

// ---- no undetected old value ---------------------------------------------------------------------------------------------

// Streams of which no receiver can see this, see drivers/wire/freshness.md.
enum Seen { kByAll, kByClocks, kByCounters, kByAllButRelays, kByCountersAndPty, kByNone };

struct Kind {
    const char* name;
    void (*episode)(FreshnessRun& run, std::mt19937_64& random);  // ends as it began
    Seen seen = kByAll;
    double may_last_s = 0;  // allowed seconds in 1000 h where it is seen
    bool from_the_start = false;
    double clock_period_s = 0;
};

double between(std::mt19937_64& random, double a, double b) { return a + (b - a) * double(random() >> 11) * 0x1p-53; }

// Without clock and counter, a link that goes down between the opening of a connection and its first frame makes a lag at
// the first frame.
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

// The link is opened again in the lag, also where the daemon does not ask for it.
void reopened_in_a_lag(FreshnessRun& run, std::mt19937_64& random, Closed when_closed) {
    run.when_closed = when_closed;
    run.extra_lag_s = between(random, 0.2, 10);
    run.run_s(between(random, 5, 60));
    run.reopen();
    run.run_s(30);
    run.when_closed = Closed::discards;
    run.extra_lag_s = 0;
    run.run_s(30);
}

void relay_that_keeps(FreshnessRun& run, std::mt19937_64& random) { reopened_in_a_lag(run, random, Closed::keeps); }
void relay_that_drops_what_is_due(FreshnessRun& run, std::mt19937_64& random) {
    reopened_in_a_lag(run, random, Closed::drops_due);
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

void clock_set_back_in_a_lag(FreshnessRun& run, std::mt19937_64& random) {
    run.extra_lag_s = between(random, 0.3, 5);
    run.run_s(3 + run.extra_lag_s);
    run.clock_jump_us = -between(random, 0.1, 1) * std::pow(10, between(random, 5, 9));
    run.run_s(20);
    run.extra_lag_s = 0;
    run.run_s(30);
}

void restart_of_the_device(FreshnessRun& run, std::mt19937_64& random) {
    run.run_s(between(random, 60, 300));
    run.pauses = true;
    run.run_s(between(random, 0.06, 3));
    run.pauses = false;
    run.restart_device();
    run.run_s(between(random, 60, 300));
}

// The path holds some frames while it is down, and drops the rest.
void short_buffer(FreshnessRun& run, std::mt19937_64& random) {
    run.buffer_frames = between(random, 3, 60);
    link_down(run, random);
    run.buffer_frames = 1e9;
    run.run_s(5);
}

// A bridge that is slower than the device for a while: no silence, and then a lag that stays.
void slower_bridge(FreshnessRun& run, std::mt19937_64& random) {
    const double lag_s = between(random, 0.3, 3), share = between(random, 0.05, 0.5);
    for (double grown_s = 0; grown_s < lag_s; grown_s += 0.01 * share, run.extra_lag_s += 0.01 * share) run.run_s(0.01);
    run.run_s(between(random, 5, 30));
    run.extra_lag_s = 0;
    run.run_s(30);
}

void clock_ends(FreshnessRun& run, std::mt19937_64& random) {
    run.wrap_clock_in(between(random, 297, 301));
    run.run_s(300);
    link_down(run, random);
}

void counter_ends(FreshnessRun& run, std::mt19937_64& random) {
    run.count_to_end(unsigned(between(random, 297, 301) * run.rate_Hz()));
    run.run_s(300);
    link_down(run, random);
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

void lag_that_grows(FreshnessRun& run, double share) {
    for (int i = 0; i < 3600; ++i, run.extra_lag_s += share) run.run_s(1);
    run.extra_lag_s = 0;
    run.run_s(30);
}

void lag_that_grows_slowly(FreshnessRun& run, std::mt19937_64&) {
    lag_that_grows(run, 150e-6);
}  // like the drift of two crystals
void lag_that_grows_faster(FreshnessRun& run, std::mt19937_64&) {
    run.run_s(900);
    lag_that_grows(run, 250e-6);
}

// Two bridges, one behind the other. The last one learns that the link was closed, and discards what it holds.
void two_bridges(FreshnessRun& run, std::mt19937_64& random) {
    run.inner_lag_s = between(random, 0.2, 3);
    run.run_s(between(random, 1, 10));
    run.extra_lag_s = between(random, 0.2, 3);
    run.run_s(between(random, 5, 30));
    run.inner_lag_s = 0;
    run.run_s(between(random, 1, 10));
    run.extra_lag_s = 0;
    run.run_s(30);
}

// The backlog of a link that was down drains slowly, and evenly.
void relay_that_retimes(FreshnessRun& run, std::mt19937_64& random) {
    run.retime = between(random, 0.005, 0.5);
    link_down(run, random);
    run.run_s(60);
    run.retime = 0;
    run.run_s(10);
}

void restart_in_a_lag(FreshnessRun& run, std::mt19937_64& random) {
    run.extra_lag_s = between(random, 0.2, 3);
    run.run_s(between(random, 2, 10));
    run.pauses = true;
    run.run_s(between(random, 0.06, 3));
    run.pauses = false;
    run.restart_device();
    run.run_s(between(random, 5, 30));
    run.extra_lag_s = 0;
    run.run_s(60);
}

// The path holds its frames while the clock begins again; in half of the cases a lag stays.
void clock_of_another_period(FreshnessRun& run, std::mt19937_64& random) {
    if (const double left_s = run.clock_left_s() - between(random, 0, 1.5); left_s > 0) run.run_s(left_s);
    const double s = between(random, 0.5, 3.9);
    run.hold_until(run.now_s() + s);
    if (random() % 2 == 0) run.extra_lag_s = s;
    run.run_s(s + between(random, 5, 50));
    run.extra_lag_s = 0;
    run.run_s(100);
}

void two_ways(FreshnessRun& run, std::mt19937_64& random) {
    run.copies_late_s = between(random, 0.2, 1);
    run.run_s(30);
    run.copies_late_s = 0;
    run.run_s(10);
}

// The device was set to another rate, and then a bridge is late.
void faster_device(FreshnessRun& run, std::mt19937_64& random) {
    run.rate_factor = between(random, 1.05, 1.19);
    run.run_s(between(random, 5, 30));
    slow_bridge(run, random);
    run.rate_factor = 1;
    run.run_s(60);
}

constexpr Kind kKinds[] = {
    {"link down for 0.5 to 3.9 s, then all at once", link_down, kByCountersAndPty},
    {"a bridge as fast as the device, lag 0.2 to 10 s", slow_bridge},
    {"a bridge slower than the device for a while", slower_bridge, kByCounters},
    {"reopened in a lag, what is due is dropped", relay_that_drops_what_is_due, kByAllButRelays},
    {"reopened in a lag, the relay keeps all", relay_that_keeps, kByCountersAndPty},
    {"the path drops what its buffer cannot hold", short_buffer},
    {"frames lost", lost_frames},
    {"frames swapped", swapped_frames},
    {"frames swapped in a lag", swapped_in_a_lag},
    {"an old frame under a new number", old_frame, kByClocks},
    {"the device's clock jumps", clock_jumps},
    {"the device's clock jumps ahead in a lag", clock_jumps_in_a_lag, kByAll, 100},
    {"the device's clock is set back in a lag", clock_set_back_in_a_lag},
    {"the device restarts", restart_of_the_device},
    {"the clock ends, then the link is down", clock_ends, kByAll, 0, true},
    {"the counter ends, then the link is down", counter_ends, kByAll, 0, true},
    {"the device pauses", pause_of_the_device},
    {"the device pauses, then the link is down", pause_and_link_down, kByCounters},
    {"two bridges in series, the last one discards", two_bridges, kByAllButRelays},
    {"a relay that sends evenly, hardly faster", relay_that_retimes, kByCounters},
    {"the device restarts in a lag", restart_in_a_lag},
    {"a clock with a period of 65.521 s, link down", clock_of_another_period, kByAll, 0, false, 65.521},
    {"each frame comes again by a slower way", two_ways, kByCounters},
    {"the device gets faster, then a bridge is late", faster_device, kByClocks},
    {"a lag at the first frame", lag_at_the_first_frame, kByNone, 0, true},
    {"a lag that grows by 150 ppm", lag_that_grows_slowly, kByNone},
    {"a lag that grows by 250 ppm", lag_that_grows_faster, kByClocks}};

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

// Another rate, jitter, format, counter and clock for each run.
void vary(Stream& stream, std::mt19937_64& random) {
    const auto one_of = [&](std::initializer_list<double> values) { return values.begin()[random() % values.size()]; };
    stream.rate_Hz = one_of({20, 37, 50, 80, 100, 333, 1000, 4000});
    stream.jitter_ms = one_of({0, 0.2, 2, 20});
    stream.grid_ms = one_of({0, 0, 1, 16});
    stream.temperature_ppm = one_of({0, 20});
    stream.format = random() % 2 == 0 ? Stream::Format::lines : Stream::Format::cobs;
    const bool text = stream.format == Stream::Format::lines;
    stream.counter_bits = text ? unsigned(one_of({8, 16, 32})) : 16;
    stream.clock_bits = text ? unsigned(one_of({30, 32})) : 32;
    stream.clock_step_us = text && stream.clock_bits == 32 ? one_of({1, 4, 1000}) : 1;
}

void no_undetected_old_value(double hours, bool is_attack) {
    for (const Kind& kind : kKinds)
        for (const Case& each : kStreams) {
            std::mt19937_64 random(std::uint64_t(number("SEED", 7)));
            Tally sum;
            double simulated_s = 0;
            unsigned episodes = 0;
            while (simulated_s < hours * 3600) {
                Stream stream = each.stream;
                stream.ppm = between(random, -100, 100);
                if (is_attack) vary(stream, random);
                stream.clock_period_s = kind.clock_period_s;
                // A counter of 8 bits that begins again may look as if frames were lost (freshness.md).
                if (kind.episode == restart_in_a_lag && !stream.clock)
                    stream.counter_bits = std::max(stream.counter_bits, 16u);
                FreshnessRun run(stream, random());
                if (!kind.from_the_start) run.run_s(300);
                run.tally = {};
                const double begin_s = run.now_s();
                for (int i = 0; i < (kind.from_the_start ? 1 : 20) && run.now_s() - begin_s < 7200; ++i, ++episodes)
                    kind.episode(run, random);
                simulated_s += run.now_s() - begin_s;
                sum.wrong_s += run.tally.wrong_s;
                if (run.tally.wrong_s > 0 && is_attack && kind.seen != kByNone)
                    fmt::print("  {} {}: {} s, {} Hz, jitter {} grid {}, {} bits, clock {} bits of {} us, {}\n", kind.name,
                               each.name, run.tally.wrong_s, stream.rate_Hz, stream.jitter_ms, stream.grid_ms,
                               stream.counter_bits, stream.clock_bits, stream.clock_step_us,
                               stream.format == Stream::Format::lines ? "lines" : "cobs");
                sum.wrong_before_s += run.tally.wrong_before_s;
                sum.alarms += run.tally.alarms;
                sum.frames += run.tally.frames;
                sum.reopened += run.tally.reopened;
                sum.worst_ms = std::max(sum.worst_ms, run.tally.worst_ms);
            }
            const double to_1000_h = 1000 / (simulated_s / 3600);
            fmt::print(
                "{:<50} {:<14} before {:>9.0f} s, now {:>7.1f} s of 1000 h, oldest {:>6.0f} ms; not GOOD for nothing: "
                "{:.2f} in an episode; reopened {}\n",
                kind.name, each.name, sum.wrong_before_s * to_1000_h, sum.wrong_s * to_1000_h, sum.worst_ms,
                double(sum.alarms) / episodes, sum.reopened);
            const bool clock = each.stream.clock, tcp = each.stream.reopening_discards;
            const bool counter = clock || each.stream.sequence;
            if (kind.seen == kByAll || (kind.seen == kByClocks && clock) || (kind.seen == kByCounters && counter) ||
                (kind.seen == kByAllButRelays && (clock || !tcp)) || (kind.seen == kByCountersAndPty && (counter || !tcp))) {
                EXPECT_LE(sum.wrong_s * to_1000_h, kind.may_last_s) << kind.name << ", " << each.name;
            }
            if (kind.episode == pause_of_the_device && clock) {
                EXPECT_LE(sum.alarms, episodes) << "at most one sample of a pause";
            }
            if (kind.episode == restart_of_the_device && counter && !is_attack) {
                EXPECT_LE(sum.alarms, episodes) << "at most one sample of a restart";
            }
            if (kind.episode == pause_of_the_device && tcp && !is_attack) {
                EXPECT_LE(sum.alarms, 70 * episodes) << "0.5 s and the opening";
            }
        }
}

TEST(Freshness, NoKindOfDelayMakesAnUndetectedOldValue) { no_undetected_old_value(number("HOURS", 1), false); }

TEST(Freshness, NoRateCounterOrClockMakesAnUndetectedOldValue) { no_undetected_old_value(number("HOURS", 0.05), true); }

}  // namespace
}  // namespace tactiled::faults
