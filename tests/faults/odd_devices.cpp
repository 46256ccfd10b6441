// Devices, servers and machines that differ from what the formats and the method expect.
#include "delays.hpp"

namespace tactiled::faults {

void longer_counter(Stream& stream, std::mt19937_64&) {
    if (std::ldexp(1 / stream.rate_Hz, int(stream.counter_bits)) < 2) stream.counter_bits = 16;
}

namespace {

// A bridge that is 0.1 to 5 % slower than the device until it is late by 0.3 to 3 s: no lag grows by much before a short
// counter begins again.
void hardly_slower_bridge(FreshnessRun& run, std::mt19937_64& random) {
    const double lag_s = between(random, 0.3, 3), share = std::pow(10, between(random, -3, -1.3));
    for (double grown_s = 0; grown_s < lag_s; grown_s += 0.01 * share, run.extra_lag_s += 0.01 * share) run.run_s(0.01);
    run.run_s(between(random, 5, 30));
    run.extra_lag_s = 0;
    run.run_s(30);
}

// A counter that the device prints with a fixed number of digits, or of a width that no format states.
void other_counter(Stream& stream, std::mt19937_64& random) {
    constexpr std::uint32_t kPeriods[] = {10, 16, 60, 100, 128, 1000, 1024, 4096, 10000};
    stream.counter_period = kPeriods[random() % std::size(kPeriods)];
    stream.counter_bits = 32;
    stream.format = Stream::Format::lines;
}

// Half microseconds of a timer, tenths, nanoseconds; milliseconds. It begins again after 32 bits.
void other_unit(Stream& stream, std::mt19937_64& random) {
    constexpr double kScales[] = {1e-3, 2, 10, 16, 1000};
    stream.clock_scale = kScales[random() % std::size(kScales)];
    stream.format = Stream::Format::lines;
    stream.rate_Hz = std::pow(10, between(random, 0.7, 3));
}

void coarse_clock(Stream& stream, std::mt19937_64& random) {
    stream.clock_step_us = std::pow(10, between(random, 4, 6));
    stream.format = Stream::Format::lines;
}

// The device has died. The connection ends again and again, and the server sends the last frame to each new one.
void dead_behind_a_server(FreshnessRun& run, std::mt19937_64& random) {
    run.pauses = run.retains = true;
    run.run_s(between(random, 0.5, 5));
    for (int i = 0; i < 10; ++i) {
        run.reopen();
        run.run_s(between(random, 0.5, 30));
    }
    run.pauses = run.retains = false;
    run.run_s(30);
}

void machine_stands_still(FreshnessRun& run, std::mt19937_64& random) {
    run.stand_still(between(random, 0.5, 30));
    run.run_s(between(random, 5, 30));
}

// Another device takes its place, or its clock is set, while the link is closed in a lag. The path keeps the lag.
void set_on_while_closed_in_a_lag(FreshnessRun& run, std::mt19937_64& random) {
    run.extra_lag_s = between(random, 0.3, 5);
    run.when_closed = Closed::keeps;
    run.run_s(3 + run.extra_lag_s);
    run.clock_jump_us = run.extra_lag_s * 1e6 + std::pow(10, between(random, 6, 9));
    run.reopen();
    run.run_s(10);
    run.extra_lag_s = 0;
    run.run_s(60);
    run.when_closed = Closed::discards;
}

// A busy machine: the last relay runs for 1 to 50 ms, and then waits for up to 0.4 s. The first frame is on time.
void starved(FreshnessRun& run, std::mt19937_64& random, double for_s) {
    run.run_s(between(random, 0.1, 0.3));
    for (const double end_s = run.now_s() + for_s; run.now_s() < end_s;) {
        const double waits_s = std::pow(between(random, 0, 1), 4) * 0.4;
        run.starve_until(run.now_s() + waits_s);
        run.run_s(waits_s + between(random, 0.001, 0.05));
    }
}

void busy_machine(FreshnessRun& run, std::mt19937_64& random) {
    starved(run, random, between(random, 1, 60));
    run.run_s(between(random, 5, 30));
}

// A lag begins before or while the machine is busy. In half of the cases a relay keeps its frames when the link is opened
// again.
void lag_on_a_busy_machine(FreshnessRun& run, std::mt19937_64& random) {
    if (random() % 2 == 0) run.when_closed = Closed::keeps;
    starved(run, random, between(random, 0.1, 5));
    run.extra_lag_s = between(random, 0.2, 3);
    starved(run, random, between(random, 1, 30));
    run.run_s(between(random, 0, 5));
    run.extra_lag_s = 0;
    run.when_closed = Closed::discards;
    starved(run, random, between(random, 1, 10));
    run.run_s(30);
}

void down_on_a_busy_machine(FreshnessRun& run, std::mt19937_64& random) {
    starved(run, random, between(random, 0.1, 5));
    const double s = between(random, 0.5, 3.9);
    run.hold_until(run.now_s() + s);
    run.run_s(s);
    starved(run, random, between(random, 1, 30));
    run.run_s(30);
}

void of_lines(Stream& stream, std::mt19937_64&) {
    stream.format = Stream::Format::lines;
    stream.counter_bits = 32;
}

// A relay sends its last frames again once, or until the device comes back; or that is the end of the device's program, and
// its converter's memory is sent in a ring.
void old_frames_again(FreshnessRun& run, std::mt19937_64& random, double rounds) {
    run.run_s(between(random, 0.5, 20));
    const double s = std::pow(10, between(random, -0.7, 1.2));
    run.repeats = std::max(std::size_t(s * run.rate_Hz()), std::size_t{20});
    run.run_s(std::max(double(run.repeats) / run.rate_Hz() * rounds, rounds > 1 ? 20.0 : 0.0));
    run.repeats = 0;
    run.run_s(60);
}
void old_frames_once(FreshnessRun& run, std::mt19937_64& random) { old_frames_again(run, random, 1); }
void old_frames_in_a_ring(FreshnessRun& run, std::mt19937_64& random) { old_frames_again(run, random, 5); }

// Two to five causes at the same time, or shortly after one another. No clock is set by about as much as a lag may have.
void several_causes(FreshnessRun& run, std::mt19937_64& random) {
    const auto one_in = [&](unsigned n) { return random() % n == 0; };
    if (one_in(3)) run.when_closed = Closed::keeps;
    for (std::uint64_t n = 2 + random() % 4; n > 0; --n) {
        const double s = between(random, 0, 4);
        switch (random() % 8) {
            case 0: run.extra_lag_s = one_in(3) ? 0 : 0.2 + s; break;
            case 1: run.clock_jump_us += (one_in(2) ? 1 : -1) * std::pow(10, between(random, 7, 9)); break;
            case 2:
                run.pause_for(one_in(3) ? 0 : s);
                run.restart_device();
                break;
            case 3: run.reopen(); break;
            case 4: run.hold_until(run.now_s() + s); break;
            case 5: run.count_on((one_in(2) ? 1 : -1) * std::pow(10, between(random, 0, 5))); break;
            case 6: run.pause_for(s); break;
            case 7:
                run.drop = 1;
                run.run_s(s);
                run.drop = 0;
                break;
        }
        if (!one_in(3)) run.run_s(one_in(2) ? s / 10 : s);
    }
    run.run_s(10);
    run.extra_lag_s = 0;
    run.when_closed = Closed::discards;
    run.run_s(70);
}

void doubled(FreshnessRun& run, std::mt19937_64& random) {
    run.copies_late_s = 1e-9;
    run.run_s(10);
    link_down(run, random);
    slow_bridge(run, random);
    run.copies_late_s = 0;
    run.run_s(10);
}

}  // namespace

const std::vector<Kind> kOddKinds = {
    {"a counter of another period, a slower bridge", hardly_slower_bridge, kByClocks, 0, false, 0, other_counter},
    {"a counter of another period, a late bridge", slow_bridge, kByAll, 0, false, 0, other_counter},
    {"a clock in another unit, then a late bridge", slow_bridge, kByClocks, 1, false, 0, other_unit},
    {"a clock in another unit, then the link is down", link_down, kByClocks, 1, false, 0, other_unit},
    {"a clock with ticks of 10 ms to 1 s, a late bridge", slow_bridge, kByAll, 0, false, 0, coarse_clock},
    {"a dead device, the server sends its last frame", dead_behind_a_server, kByCounters},
    {"this machine and its clock stand still", machine_stands_still, kByClocks},
    {"the clock is set on while closed in a lag", set_on_while_closed_in_a_lag, kByCounters},
    {"a busy machine", busy_machine, kByClocks, 0, false, 0, longer_counter},
    {"a busy machine from the start", busy_machine, kByClocks, 0, true, 0, longer_counter},
    {"a lag on a busy machine", lag_on_a_busy_machine, kByClocks, 1, false, 0, longer_counter},
    {"a lag on a busy machine from the start", lag_on_a_busy_machine, kByClocks, 1, true, 0, longer_counter},
    {"a link is down on a busy machine", down_on_a_busy_machine, kByClocks, 0, false, 0, longer_counter},
    {"a link is down on a busy machine from the start", down_on_a_busy_machine, kByClocks, 0, true, 0, longer_counter},
    {"old frames come again, once", old_frames_once, kByClocks, 0, false, 0, of_lines},
    {"old frames come again in a ring", old_frames_in_a_ring, kByClocks, 0, false, 0, of_lines},
    {"two to five causes at once", several_causes, kByClocks, 0, false, 0, of_lines},
    {"each frame is sent twice", doubled, kByCounters}};

}  // namespace tactiled::faults
