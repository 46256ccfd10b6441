// Hours of streams through paths that delay them. HOURS=1000 and the like: longer runs.
#include "freshness.hpp"
#include "delays.hpp"

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

TEST(Freshness, HoursOfDriftJitterPollsAndTemperatureAreNoLagOverTcp) {
    for (const bool clock : {true, false})
        for (const double ppm : {100.0, -100.0, 30.0}) {
            FreshnessRun run({.clock = clock, .ppm = ppm, .temperature_ppm = 20, .reopening_discards = true},
                             std::uint64_t(number("SEED", 1)));
            run.run_s(3600 * number("HOURS", 4));
            const std::uint64_t alarms = run.tally.frames - run.tally.good;
            fmt::print("{} {:+} ppm: {} frames, {} not GOOD, opened {} times\n", clock ? "clock" : "sequence", ppm,
                       run.tally.frames, alarms, run.tally.reopened);
            EXPECT_LE(double(alarms), (clock ? 0.001 : 0.02) * double(run.tally.frames));
        }
}

// ---- no undetected old value ---------------------------------------------------------------------------------------------

struct Case {
    const char* name;
    Stream stream;
};
const Case kStreams[] = {{"clock", {}},
                         {"clock, TCP", {.reopening_discards = true}},
                         {"clock only", {.sequence = false}},
                         {"clock only, TCP", {.sequence = false, .reopening_discards = true}},
                         {"sequence", {.clock = false}},
                         {"sequence, TCP", {.clock = false, .reopening_discards = true}},
                         {"arrival", {.clock = false, .sequence = false}},
                         {"arrival, TCP", {.clock = false, .sequence = false, .reopening_discards = true}}};

// Another rate, jitter, format, counter and clock for each run.
void vary(Stream& stream, std::mt19937_64& random) {
    const auto one_of = [&](std::initializer_list<double> values) { return values.begin()[random() % values.size()]; };
    stream.rate_Hz = one_of({20, 37, 50, 80, 100, 333, 1000, 4000});
    stream.declared = one_of({1, 1, 0, 0.85, 1.15});
    stream.jitter_ms = one_of({0, 0.2, 2, 20});
    stream.grid_ms = one_of({0, 0, 1, 16});
    stream.temperature_ppm = one_of({0, 20});
    stream.format = random() % 2 == 0 ? Stream::Format::lines : Stream::Format::cobs;
    const bool text = stream.format == Stream::Format::lines;
    stream.counter_bits = text ? unsigned(one_of({8, 16, 32})) : 16;
    stream.clock_bits = text ? unsigned(one_of({30, 32})) : 32;
    stream.clock_step_us = text && stream.clock_bits == 32 ? one_of({1, 4, 1000}) : 1;
}

bool must_see(SeenBy seen, bool clock, bool counter) {
    return seen == kByAll || (seen == kByClocks && clock) || (seen == kByCounters && counter);
}

// KIND and STREAM: only the rows whose name contains KIND, of the stream STREAM.
bool is_asked_for(const char* variable, std::string_view name, bool is_whole) {
    const char* text = std::getenv(variable);
    return text == nullptr || (is_whole ? name == text : name.find(text) != name.npos);
}

void no_undetected_old_value(const std::vector<Kind>& kinds, double hours, bool is_attack) {
    for (const Kind& kind : kinds)
        for (const Case& each : kStreams) {
            if (!is_asked_for("KIND", kind.name, false) || !is_asked_for("STREAM", each.name, true)) continue;
            std::mt19937_64 random(std::uint64_t(number("SEED", 7)));
            Tally sum;
            double simulated_s = 0;
            unsigned episodes = 0;
            while (simulated_s < hours * 3600) {
                Stream stream = each.stream;
                stream.ppm = between(random, -100, 100);
                if (is_attack) vary(stream, random);
                stream.clock_period_s = kind.clock_period_s;
                if (kind.change != nullptr) kind.change(stream, random);
                FreshnessRun run(stream, random());
                if (!kind.from_the_start) run.run_s(300);
                run.tally = {};
                const double begin_s = run.now_s();
                for (int i = 0; i < (kind.from_the_start ? 1 : 20) && run.now_s() - begin_s < 7200; ++i, ++episodes)
                    kind.episode(run, random);
                simulated_s += run.now_s() - begin_s;
                sum.wrong_s += run.tally.wrong_s;
                if (run.tally.wrong_s > 0 && is_attack && kind.seen != kByNone)
                    fmt::print("  {} {}: {} s, {} Hz, declared {}, jitter {} grid {}, {} bits, clock {} bits of {} us, {}\n",
                               kind.name, each.name, run.tally.wrong_s, stream.rate_Hz, stream.declared, stream.jitter_ms,
                               stream.grid_ms, stream.counter_bits, stream.clock_bits, stream.clock_step_us,
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
            const bool clock = each.stream.clock;
            const bool counter = clock || each.stream.sequence;
            if (must_see(kind.seen, clock, counter)) {
                EXPECT_LE(sum.wrong_s * to_1000_h, kind.may_last_s) << kind.name << ", " << each.name;
            }
        }
}

TEST(Freshness, NoKindOfDelayMakesAnUndetectedOldValue) { no_undetected_old_value(kKinds, number("HOURS", 1), false); }

TEST(Freshness, NoRateCounterOrClockMakesAnUndetectedOldValue) {
    no_undetected_old_value(kKinds, number("HOURS", 0.05), true);
}

TEST(Freshness, NoOddDeviceServerOrMachineMakesAnUndetectedOldValue) {
    no_undetected_old_value(kOddKinds, number("HOURS", 1), false);
    no_undetected_old_value(kOddKinds, number("HOURS", 0.2), true);
}

}  // namespace
}  // namespace tactiled::faults
