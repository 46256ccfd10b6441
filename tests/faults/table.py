#!/usr/bin/env python3
"""The fault table: every fault of the list, struck at the release binary here, or where it is tested, or why it is not.

    table.py            all that are struck here; prints the table; exit 1 where one is not as it must be
    table.py 11 34      only these
    table.py --page     also writes the table into TABLE.md; with numbers, these rows
"""
import pathlib
import platform
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import client_faults  # noqa: E402
import process_faults  # noqa: E402
import serial_faults  # noqa: E402
import shared_memory_faults  # noqa: E402
import value_faults  # noqa: E402
from rig import ROOT, with_ptys_of_its_own  # noqa: E402

PAGE = pathlib.Path(__file__).parent / "TABLE.md"
BEGIN, END = "<!-- table.py writes from here -->", "<!-- to here -->"

# number: (fault, how it is struck) and a function; a text: the test that strikes it; None and a reason: nobody does.
LIST = [
    (1, "cable pulled", "pty master closed", serial_faults.unplugged),
    (2, "comes back under another name", "the by-id link points to another tty", serial_faults.comes_back_elsewhere),
    (3, "another device under the old name", "", "`Sensor.AFrameOfAnotherShapeIsAnotherDevice`; one of the same shape cannot be told: no serial number in the formats"),
    (4, "the port cannot be opened at start", "strace: EBUSY from four openat()", serial_faults.refused_at_open),
    (5, "garbage at line rate", "random bytes instead of lines", serial_faults.garbage),
    (6, "flipped bits, every tenth line", "one bit each", serial_faults.flipped_bits),
    (7, "wrong length", "lines of 600 bytes", serial_faults.too_long_lines),
    (8, "lines cut in half, every fourth", "", serial_faults.cut_lines),
    (9, "one byte a write", "", serial_faults.chopped),
    (10, "gaps, repeats, overtakings", "one in twenty each", serial_faults.gaps_repeats_and_overtakings),
    (11, "silent stop", "nothing is sent", serial_faults.silent),
    (12, "half the rate", "", serial_faults.half_rate),
    (13, "EINTR", "strace: every seventh read, every fifth ppoll", serial_faults.interrupted_calls),
    (14, "the process stands for 200 ms", "SIGSTOP", serial_faults.stopped_200_ms),
    (15, "a device refuses its configuration", "", "`UartTest.AsksAnFt300ForItsStreamAtOpeningAndAgainWhenItFellSilentAndStopsItAtTheEnd`"),
    (16, "another program reads the port, too", "a second open, read each ms", serial_faults.another_opens_it),
    *((n, what, "", "kernel: `can`, `can_adapter`") for n, what in (
        (17, "bus-off"), (18, "error-passive, warning"), (19, "interface down or removed"), (20, "flood of foreign identifiers"), (21, "wrong DLC, RTR, short record"))),
    (22, "ENOBUFS on send", "", "nothing is sent on CAN"),
    (23, "two nodes with one identifier", "a second device's lines among the first's", serial_faults.two_devices_of_one_name),
    (24, "a sample of several messages with one missing", "", "kernel: `can`, `test_a_sample_of_two_messages_of_a_dbc_file_is_whole_or_lost`"),
    (25, "stamps of the controller jump", "", "`bin/stamps`; kernel: `can_adapter`"),
    *((n, what, "", "kernel: `i2c`; `i2c_chips_test`") for n, what in (
        (26, "no acknowledge"), (27, "stuck bus"), (28, "arbitration lost"), (30, "a chip is reset"), (31, "the adapter vanishes"), (32, "another chip at the address"))),
    (33, "data-ready line never or always active", "", "kernel: `i2c`; `i2c_one_chip_test`"),
    (29, "all zeros", "values 0, 0, 0", value_faults.all_zeros),
    (34, "frozen", "the same values under new sequence numbers, 20 allowed", value_faults.frozen),
    (35, "a channel at its rail", "", value_faults.at_its_rail),
    (36, "impossible steps", "one value in nine is 200 N off", value_faults.impossible_step),
    (37, "NaN in the stream", "the word nan in a cell", value_faults.not_a_number),
    (37, "infinity in the stream", "the word inf in a cell", value_faults.infinite),
    (38, "NaN, huge or singular calibration", "", "`Calibration.RefusesWhatDoesNotFitTogether`, `fuzz_config`"),
    (39, "a force beyond its register", "", "`Registers.AnyDoubleSaturatesOrIsNotAvailableAndNeverWraps`"),
    (40, "one of several channels dead", "", "`three_sensors_test`: `test_missing_gauge`, `test_stuck_gauge`"),
    (41, "the zero drifts", "", "`StreamQuality.AZeroThatWandersAtRestAsksForMaintenanceAndAPressDoesNot`"),
    (42, "tare while BAD", "tactilectl tare beside a silent device", value_faults.tare_while_bad),
    (42, "tare in motion", "tactilectl tare while the force grows by 10 N/s", value_faults.tare_in_motion),
    (42, "tare under load", "tactilectl tare with 20 N, tare_limit_N = 5", value_faults.tare_under_load),
    (43, "redundant sensors disagree", "one creeps away, agrees_with, agree_ms = 100; channels of one sensor: stability H12", value_faults.redundant_sensors_differ),
    (44, "configuration missing, binary, with BOM, huge", "", "`Options.*`, `DocumentedConfig.*`"),
    (45, "configuration cut anywhere", "", "`DocumentedConfig.CutAnywhereIsNoCrash`"),
    (46, "reload with a broken file", "", "`reload_test`: `test_what_is_wrong_or_needs_a_restart_changes_nothing_at_all`"),
    (47, "reload of one sensor", "", "`reload_test`: `test_a_calibration_changes_in_a_new_epoch_and_without_the_old_tare`"),
    (48, "SIGHUP storm", "", "`reload_test`: `test_a_storm_of_signals_with_broken_files_and_good_ones_loses_no_sample`"),
    (49, "calibration corrupt, cut, of another version", "", "`Calibration.OneChangedBitAnywhereIsAnErrorOrTheSame`, `CutAnywhereIsAnErrorOrTheSame`"),
    (50, "killed at every call of a save", "", "`save_test`: `test_killed_at_any_call_it_leaves_the_old_file_or_the_new_one`"),
    (51, "ENOSPC, EIO .. at every call of a save", "", "`save_test`: `test_an_error_of_any_call_is_reported_and_leaves_no_half_of_a_file`"),
    (52, "power loss after \"saved\"", "", "`save_test`: the order of write, sync, rename, sync of the folder, saved"),
    (53, "state folder missing or read-only", "", "`ControlsTest.ASaveThatFailsIsSaid`, `MethodCosts.ThatCannotBeKeptStopNobody`"),
    (54, "recorder: disk full", "", "`record_test`: `test_a_full_disk_ends_the_recording_and_nothing_else`"),
    (55, "recorder: slow disk", "", "the recorder is a reader of its own: 62"),
    (56, "the run-time folder full", "private mount of 64 KiB", shared_memory_faults.full_shm),
    (57, "the run-time folder read-only", "private mount", shared_memory_faults.read_only_shm),
    (58, "the name is squatted by another user, in /dev/shm", "a file of user 65534", shared_memory_faults.squatted),
    (59, "a segment that a killed daemon left", "SIGKILL, start", process_faults.killed),
    (60, "started twice", "", process_faults.started_twice),
    (61, "readers killed", "50 of them", shared_memory_faults.readers_killed),
    (62, "a reader stands", "", "world: a reader is stopped; `ASlowReaderCountsWhatItLost`"),
    (63, "killed within a write", "", "`kill_witness`; `NoReadIsTornAndNoneWaits`"),
    (64, "reader of another version, size, byte order", "", "`SegmentTest.AReaderRefusesWhatItCannotRead`"),
    (65, "hostile reader", "", "`SegmentTest.ReadersMayNotWrite`; `daemon_test`"),
    (66, "segment shrunk", "", "only the daemon's own user could: not defended"),
    (67, "64 readers", "tactilectl read --follow", shared_memory_faults.many_readers),
    (68, "malformed requests", "", "`modbus_hostile_test`: 506; `fuzz_modbus`"),
    (69, "slow client", "a byte each 0.3 s", client_faults.slow_client),
    (70, "flood of connections", "300 at once, held", client_faults.flood_of_connections),
    (71, "client that never reads", "", client_faults.client_that_never_reads),
    (72, "reset in the middle of a request", "200 times", client_faults.reset_in_the_middle),
    (73, "100 requests in one segment", "", "`ServerTest.AnswersAHundredPipelinedRequestsInOrder`"),
    (74, "port in use", "", "`daemon_test`: `test_a_taken_port_stops_neither_sensors_nor_shared_memory`"),
    (75, "write to what is read-only, or from elsewhere", "", "`ServerTest.RefusesAddressesThatAreNotAllowed`; `modbus_hostile_test`"),
    (76, "the PLC falls silent", "", "`ControlsTest.AStandingHeartbeatExpires`"),
    (77, "one answer is one snapshot", "", "`tests/bench/torn_reads.py`; `ServerTest.OneAnswerIsOneFrame`"),
    (78, "RTU: noise, gaps, broadcasts, echo", "", "`modbus_rtu_test`"),
    (79, "RTU: two masters", "", "`modbus_rtu_test`: `test_a_request_inside_the_answer_of_a_neighbour_is_none`"),
    (80, "no descriptors left", "prlimit 40, 60 connections, then the cable pulled", client_faults.few_descriptors),
    (81, "ECONNABORTED", "strace: every third accept4", client_faults.failing_accepts),
    (82, "no right to real time", "", "`daemon_test`: `test_refused_rights_degrade_and_do_not_stop`"),
    (83, "four times the processor's work", "", "`latency_bench` beside hogs; not a test"),
    (84, "the process stands for 2 s", "SIGSTOP", process_faults.stalled_2_s),
    (85, "a driver's thread blocks for ever", "", "`tests/service`: a link's thread is stopped; systemd starts the daemon again"),
    (86, "a driver's thread throws", "", "drivers are noexcept: the process ends, 96"),
    (87, "the main thread hangs", "", "`tests/service`: the loop's thread is stopped; systemd starts the daemon again"),
    (88, "a runaway real-time thread", "the loop jumps to itself, LimitRTTIME= of the unit", process_faults.runaway_thread),
    (89, "memory pressure", "", "`tests/guard`: no page fault in a million turns"),
    (90, "rings full", "", "world: the loop stands for 1.2 s; `PipelineTest.RefusesTheNewestWhenTheLoopIsLateAndTellsHowMany`"),
    (91, "the wall clock is set", "", "kernel: `can`, `test_the_wall_clock_may_be_set_at_any_moment`"),
    (92, "uptime beyond 2^32 ms", "time namespace that passes it while running", lambda: process_faults.in_time_namespace(4294960)),
    (93, "counters wrap", "first number 2^32 - 101", serial_faults.counter_wraps),
    (94, "stands for 10 s", "SIGSTOP; a suspend moves CLOCK_BOOTTIME besides", process_faults.stopped_10_s),
    (95, "year 2038, no RTC", "", "the wall clock stands in no sample: nothing to strike"),
    (96, "killed eleven times at random moments", "SIGKILL, start", process_faults.killed_ten_times),
    (97, "terminated", "SIGTERM, start", process_faults.terminated),
    (98, "signals that nobody waits for", "PIPE WINCH URG CHLD CONT", process_faults.signals),
    (99, "malloc fails", "", "`memory_test`: each allocation of a start and of a reload"),
    (100, "killed for its memory", "", "as 96"),
    (101, "closed descriptors 0, 1, 2", "", process_faults.closed_descriptors),
    (101, "a log that nobody reads", "a full pipe", process_faults.full_log_pipe),
    (102, "loose plug, 100 times a second", "pty closed and made anew for 3 s", serial_faults.flapping),
    (103, "restart loop", "", "systemd's StartLimit; not struck"),
    (104, "empty environment, decimal comma", "env -i LC_ALL=de_DE.UTF-8", process_faults.other_locale_and_empty_environment),
    (105, "new daemon, old reader", "", "`SegmentVersions.*`, `install_test`"),
    (106, "two at once", "", "world: every pair of the likely ones"),
]


def row_of(number, name, how, strike):
    if callable(strike):
        try:
            seen = strike()
        except Exception as error:  # the daemon did not start, or a quality did not appear: that is the finding
            return f"| {number} | {name} | {how} | | | | **{type(error).__name__}: {error}** |", False
        bad = f"{seen['bad_ms']:.0f} ms, {seen['reasons']}" if seen["bad_ms"] is not None else seen["reasons"] or "stays GOOD"
        good = f"{seen['good_ms']:.0f} ms" if seen["bad_ms"] is not None else ""
        note = seen["note"] or ("" if seen["fine"] else "not as it must be")
        first = f" ({seen['first_lie']})" if seen["lies"] else ""
        return f"| {number} | {name} | {how} | {bad} | {good} | {seen['lies']}{first} | {note if seen['fine'] else f'**{note}**'} |", seen["fine"]
    where = f"not here: {strike}" if strike is not None else "**nobody strikes it yet**"
    return f"| {number} | {name} |  |  |  |  | {where} |", True


def main():
    with_ptys_of_its_own()
    only = {int(word) for word in sys.argv[1:] if word.isdigit()}
    commit = subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip()
    dirty = subprocess.run(["git", "-C", ROOT, "status", "--porcelain", "-uno"], capture_output=True, text=True).stdout.strip()
    head = ["| # | fault | how | not GOOD after | GOOD again after | lies | |", "|--|--|--|--|--|--|--|"]
    rows, fine = [], True
    print(*head, sep="\n", flush=True)
    for number, name, how, strike in sorted(LIST, key=lambda entry: entry[0]):
        if only and number not in only:
            continue
        row, good = row_of(number, name, how, strike)
        rows.append(row)
        fine &= good
        print(row, flush=True)
    if "--page" in sys.argv:
        cpu = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), platform.machine())
        struck = sum(callable(strike) for *_, strike in LIST)
        said = (f"{time.strftime('%Y-%m-%d')}, commit {commit}{' and changes' if dirty else ''}, 2 CPUs ({cpu}) of a shared host with other work on it, so that times are upper "
                f"bounds of that hour: `/usr/bin/python3 tests/faults/table.py --page`. {struck} struck here.")
        text = PAGE.read_text()
        before, after = text.split(BEGIN)[0], text.split(END)[1]
        if only:  # the other rows are unchanged
            fresh = {row.split("|")[2]: f"{row[:-2]} (commit {commit}) |" for row in rows}
            fresh |= {f" {entry[1]} ": row_of(*entry)[0] for entry in LIST if not callable(entry[3])}
            old = text.split(BEGIN)[1].split(END)[0].strip().splitlines()
            said = old[0]
            fresh = {row.split("|")[2]: row for row in old if row.startswith("| ") and row[2].isdigit()} | fresh
            rows = [fresh[f" {name} "] for _, name, *_ in sorted(LIST, key=lambda entry: entry[0])]
        PAGE.write_text(before + "\n".join([BEGIN, "", said, "", *head, *rows, "", END]) + after)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
