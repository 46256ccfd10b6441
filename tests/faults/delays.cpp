#include "delays.hpp"

namespace tactiled::faults {

// Without clock and counter, a link that goes down between the opening of a connection and its first frame makes a lag at
// the first frame.
void link_down(FreshnessRun& run, std::mt19937_64& random) {
    const double s = between(random, 0.5, 3.9);
    run.hold_until(run.now_s() + s);
    run.run_s(s + between(random, 2, 20));
}

namespace {

// The path has a lag, in which something else happens.
template <typename Change>
void change_in_a_lag(FreshnessRun& run, double lag_s, double before_s, const Change& change, double after_s,
                     double rest_s = 30) {
    run.extra_lag_s = lag_s;
    run.run_s(before_s);
    change();
    run.run_s(after_s);
    run.extra_lag_s = 0;
    run.run_s(rest_s);
}

}  // namespace

void slow_bridge(FreshnessRun& run, std::mt19937_64& random) {
    const double lag_s = between(random, 0.2, 10);
    change_in_a_lag(
        run, lag_s, between(random, 5, 60), [] {}, 0);
}

namespace {

// The link is opened again in the lag, also where the daemon does not ask for it.
void reopened_in_a_lag(FreshnessRun& run, std::mt19937_64& random, Closed when_closed) {
    run.when_closed = when_closed;
    const double lag_s = between(random, 0.2, 10);
    change_in_a_lag(
        run, lag_s, between(random, 5, 60), [&] { run.reopen(); }, 30, 0);
    run.when_closed = Closed::discards;
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
    const double lag_s = between(random, 0.3, 5);
    const auto jump = [&] { run.clock_jump_us = between(random, 0, 1) * std::pow(10, between(random, 4, 9)); };
    change_in_a_lag(run, lag_s, 3 + lag_s, jump, 10);
}

void clock_set_back_in_a_lag(FreshnessRun& run, std::mt19937_64& random) {
    const double lag_s = between(random, 0.3, 5);
    const auto jump = [&] { run.clock_jump_us = -between(random, 0.1, 1) * std::pow(10, between(random, 5, 9)); };
    change_in_a_lag(run, lag_s, 3 + lag_s, jump, 20);
}

void restart_after_a_pause(FreshnessRun& run, std::mt19937_64& random) {
    run.pause_for(between(random, 0.06, 3));
    run.restart_device();
}

}  // namespace

void restart_of_the_device(FreshnessRun& run, std::mt19937_64& random) {
    run.run_s(between(random, 60, 300));
    restart_after_a_pause(run, random);
    run.run_s(between(random, 60, 300));
}

namespace {

// The path holds some frames while it is down, and drops the rest.
void short_buffer(FreshnessRun& run, std::mt19937_64& random) {
    run.buffer_frames = between(random, 3, 60);
    link_down(run, random);
    run.buffer_frames = 1e9;
    run.run_s(5);
}

}  // namespace

// A bridge that is slower than the device for a while: no silence, and then a lag that stays.
void slower_bridge(FreshnessRun& run, std::mt19937_64& random) {
    const double lag_s = between(random, 0.3, 3), share = between(random, 0.05, 0.5);
    for (double grown_s = 0; grown_s < lag_s; grown_s += 0.01 * share, run.extra_lag_s += 0.01 * share) run.run_s(0.01);
    run.run_s(between(random, 5, 30));
    run.extra_lag_s = 0;
    run.run_s(30);
}

namespace {

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

}  // namespace

void pause_of_the_device(FreshnessRun& run, std::mt19937_64& random) {
    run.pause_for(between(random, 0.15, 5));
    run.run_s(between(random, 10, 20));
}

namespace {

void pause_and_link_down(FreshnessRun& run, std::mt19937_64& random) {
    run.pause_for(between(random, 0.15, 5));
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
    const double lag_s = between(random, 0.2, 3), before_s = between(random, 2, 10);
    change_in_a_lag(
        run, lag_s, before_s, [&] { restart_after_a_pause(run, random); }, between(random, 5, 30), 60);
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

// A power cut of all but this machine. In half of the cases a lag stays.
void restart_while_down(FreshnessRun& run, std::mt19937_64& random) {
    const double s = between(random, 0.5, 3.9);
    run.pauses = true;
    run.run_s(0.06);  // for what is on the way
    run.hold_until(run.now_s() + s);
    run.run_s(between(random, 0.06, 0.9) * s);
    run.pauses = false;
    run.restart_device();
    if (random() % 2 == 0) run.extra_lag_s = between(random, 0.2, s);
    run.run_s(s + between(random, 5, 20));
    run.extra_lag_s = 0;
    run.run_s(60);
}

// It looks as if the path caught up.
void faster_in_a_lag(FreshnessRun& run, std::mt19937_64& random) {
    const double lag_s = between(random, 0.3, 3), faster = between(random, 0.05, 0.19);
    const auto change = [&] { run.rate_factor = 1 + faster; };
    change_in_a_lag(run, lag_s, between(random, 2, 10), change, lag_s / faster + between(random, 1, 20), 10);
    run.rate_factor = 1;
    run.run_s(60);
}

void slower_in_a_lag(FreshnessRun& run, std::mt19937_64& random) {
    const double lag_s = between(random, 0.3, 3), slower = between(random, 0.05, 0.3);
    const auto change = [&] { run.rate_factor = 1 - slower; };
    change_in_a_lag(run, lag_s, between(random, 2, 10), change, between(random, 5, 30), 10);
    run.rate_factor = 1;
    run.run_s(60);
}

// A resonator that is faster than `clock_ppm` says: without a look at its rate, it runs away from a lag.
void clock_beyond_its_limits(FreshnessRun& run, std::mt19937_64& random) {
    run.clock_fast = between(random, 0.001, 0.0195);
    for (int i = 0; i < 20; ++i) {
        run.run_s(between(random, 60, 300));
        slow_bridge(run, random);
    }
}

// A device that sends several frames at once has a lag, too.
void bursts_in_a_lag(FreshnessRun& run, std::mt19937_64& random) {
    run.burst = 2 + unsigned(random() % 2);
    run.run_s(between(random, 5, 30));
    slow_bridge(run, random);
    run.burst = 1;
    run.run_s(20);
}

// A counter of all measurements, of which each second one is sent.
void counts_by_two(FreshnessRun& run, std::mt19937_64& random) {
    run.counts_by = 2;
    run.run_s(between(random, 5, 60));
    slow_bridge(run, random);
    run.counts_by = 1;
    run.run_s(60);
}

// The bridge catches up, except for a part.
void lag_that_ends_in_part(FreshnessRun& run, std::mt19937_64& random) {
    const double lag_s = between(random, 0.5, 10);
    run.extra_lag_s = lag_s;
    run.run_s(between(random, 5, 60));
    run.extra_lag_s = lag_s * between(random, 0.05, 0.6);
    run.run_s(between(random, 5, 60));
    run.extra_lag_s = 0;
    run.run_s(30);
}

// The device gets as fast as it was, and then a bridge is slower than the device.
void slower_bridge_at_the_old_rate(FreshnessRun& run, std::mt19937_64& random) {
    run.rate_factor = between(random, 1.05, 1.19);
    run.run_s(between(random, 10, 60));
    run.rate_factor = 1;
    run.run_s(between(random, 1, 30));
    slower_bridge(run, random);
}

// The connection is opened again for another reason, and is down before its first frame.
void down_after_opening(FreshnessRun& run, std::mt19937_64& random) {
    run.reopen();
    run.run_s(0.2);
    link_down(run, random);
}

// While its rate is measured, the device seems to be slower than it is.
void slower_bridge_at_first(FreshnessRun& run, std::mt19937_64& random) {
    const double share = between(random, 0.05, 0.2), for_s = between(random, 2, 5);
    for (double s = 0; s < for_s; s += 0.01, run.extra_lag_s += 0.01 * share) run.run_s(0.01);
    run.run_s(between(random, 5, 60));
    run.extra_lag_s = 0;
    run.run_s(60);
}

}  // namespace

const std::vector<Kind> kKinds = {
    {"link down for 0.5 to 3.9 s, then all at once", link_down, kByClocks},
    {"a bridge as fast as the device, lag 0.2 to 10 s", slow_bridge},
    {"a bridge slower than the device for a while", slower_bridge, kByClocks},
    {"reopened in a lag, what is due is dropped", relay_that_drops_what_is_due, kByNone},
    {"reopened in a lag, the relay keeps all", relay_that_keeps, kByClocks},
    {"the path drops what its buffer cannot hold", short_buffer, kByCounters},
    {"frames lost", lost_frames},
    {"frames swapped", swapped_frames, kByCounters},
    {"frames swapped in a lag", swapped_in_a_lag},
    {"an old frame under a new number", old_frame, kByClocks},
    {"the device's clock jumps", clock_jumps},
    {"the device's clock jumps ahead in a lag", clock_jumps_in_a_lag, kByAll, 1000},
    {"the device's clock is set back in a lag", clock_set_back_in_a_lag},
    {"the device restarts", restart_of_the_device},
    {"the clock ends, then the link is down", clock_ends, kByCounters, 0, true},
    {"the counter ends, then the link is down", counter_ends, kByCounters, 0, true},
    {"the device pauses", pause_of_the_device},
    {"the device pauses, then the link is down", pause_and_link_down, kByClocks},
    {"two bridges in series, the last one discards", two_bridges, kByClocks},
    {"a relay that sends evenly, hardly faster", relay_that_retimes},
    {"the device restarts in a lag", restart_in_a_lag, kByClocks},
    {"a clock with a period of 65.521 s, link down", clock_of_another_period, kByCounters, 0, false, 65.521},
    {"each frame comes again by a slower way", two_ways, kByCounters, 100, false, 0, longer_counter},
    {"the device gets faster, then a bridge is late", faster_device, kByClocks},
    {"the device gets faster in a lag", faster_in_a_lag, kByClocks},
    {"the device gets slower in a lag", slower_in_a_lag},
    {"a clock beyond clock_ppm, then a bridge is late", clock_beyond_its_limits, kByAll, 0, true},
    {"the device restarts while the link is down", restart_while_down, kByClocks},
    {"bursts of 2 or 3 frames, then a bridge is late", bursts_in_a_lag, kByClocks},
    {"a counter that counts by two, then a late bridge", counts_by_two, kByClocks},
    {"a lag of which a part remains", lag_that_ends_in_part},
    {"back to the old rate, then a slower bridge", slower_bridge_at_the_old_rate, kByClocks},
    {"the link is down after it was opened", down_after_opening, kByCounters},
    {"a bridge slower than the device at first", slower_bridge_at_first, kByClocks, 0, true},
    {"a lag at the first frame", lag_at_the_first_frame, kByNone, 0, true},
    {"a lag that grows by 150 ppm", lag_that_grows_slowly, kByCounters},
    {"a lag that grows by 250 ppm", lag_that_grows_faster, kByCounters}};

}  // namespace tactiled::faults
