#!/usr/bin/env python3
"""Hostile Modbus TCP clients against the release daemon; a valid one reads 200 times a second and must not be
affected."""
import multiprocessing
import pathlib
import re
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import hostile_cases as cases  # noqa: E402
import hostile_frames as frames  # noqa: E402
import hostile_requests as requests  # noqa: E402
import hostile_sockets as sockets  # noqa: E402
from daemon import PATIENCE_S, wait_for  # noqa: E402
from hostile_client import CONTROL, PLACES, PLC, Client, witness  # noqa: E402
from hostile_pdus import OURS, Case, mb, register, tcp  # noqa: E402
from hostile_suite import Suite  # noqa: E402
from unit_daemon import CONFIG, quality_is, unit_daemon  # noqa: E402

WRITABLE = f"""commands = true
scratch = true
max_clients = {PLACES}
max_requests_per_s = 0
allow = ["127.0.0.0/24"]
command_allow = ["127.0.0.1/32"]
plc = ["{PLC}", "{CONTROL}"]
settings = "{{folder}}/settings.toml"
"""
SENSOR = CONFIG + "tare_ms = 1500\n"
MAX_GROWTH_KIB = 8 * 1024
WORST_WAIT_MS = 250  # by a Stopwatch

# name, sent data, expected answer, section, function
IN_PARALLEL = [
    ("a deaf client", "reads of 125, answers not taken", "closed after 2 s", OURS, sockets.deaf),
    ("a second deaf client", "reads of 125, answers not taken", "closed after 2 s", OURS, sockets.deaf),
    ("a greedy client", "100 reads at a time for 2 s", "all answers", tcp("4.4.1.2"), requests.greedy),
    ("a second greedy client", "100 reads at a time for 2 s", "all answers", tcp("4.4.1.2"), requests.greedy),
    ("a slow reader", "1000 reads, 512 bytes taken each 5 ms", "all answers", tcp("4.4.2.3"), sockets.slow_reader),
    ("a half-closed socket", "100 reads, FIN", "100 answers, closed", OURS, sockets.half_closed),
    ("FIN at once", "FIN", "closed", OURS, sockets.half_closed_at_once),
    ("FIN in the middle of a frame", "a read and a half, FIN", "one answer, closed", OURS,
     sockets.half_closed_in_a_frame),
]
ONE_BY_ONE = [
    ("an address outside allow", "a read from 127.0.1.1", "closed", tcp("4.2.3"), sockets.outside_the_allow_list),
    ("RST in the middle of a frame", "1 .. 11 bytes, RST", "nothing", OURS, sockets.reset_in_a_frame),
    ("eight clients byte by byte", "a read each, in turns", "each its own answer", tcp("3.1.3"),
     requests.eight_clients_byte_by_byte),
    ("UNLOCK of a connection that was closed", "UNLOCK, close, a setting", "exception 2", OURS,
     requests.unlock_is_not_inherited),
    ("RST before the answers", "50 reads, RST, 200 times", "nothing", OURS, sockets.reset_before_the_answers),
    ("close in the middle of a frame", "1 .. 11 bytes, close", "nothing", OURS, sockets.closed_in_a_frame),
    ("mutated frames", "400 of them", "others are served", OURS, requests.mutated_frames),
    ("noise", "200 times up to 600 bytes", "nothing", OURS, requests.noise),
    ("a tare while one runs", "a tare, 0.05 s later 5 more", "one accepted, exception 6, one tare", mb("7"),
     lambda port: requests.tare_while_taring(port, 0.05)),
    ("a tare right behind a tare", "6 tares in one segment", "one accepted, exception 6, one tare", mb("7"),
     requests.tare_while_taring),
    ("a SAVE while one runs", "20 SAVEs in one segment", "accepted or exception 6, at the end 0", mb("7"),
     requests.save_while_saving),
]
BURST = ("a burst of connections", "64 within 10 ms, the daemon is halted", "all connected within 0.7 s", OURS)
CROWDS = [
    ("connect and close", "500 times", "nothing", OURS, sockets.connect_and_close),
    ("connect and RST", "500 times", "nothing", OURS, sockets.connect_and_reset),
    ("silent clients in every place", "48 connections", "one that speaks is served", OURS, sockets.silent_clients),
    ("more clients than places", "16 that poll, 20 more, 5 of a PLC", "16 and 4 served", OURS, sockets.full_house),
    ("1100 connections that stay", "nothing", "at most 16 open", OURS, sockets.connections_that_stay),
]


def resident_kib(process):
    return int(re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{process.pid}/status").read_text())[1])


class Hostile(unittest.TestCase):
    def play(self, config, cases_of):
        """Starts a daemon with `config` and a witness, lets `cases_of` run its cases, and checks the state
        afterwards."""
        with unit_daemon(rows="0,1,2,-3\n0.005,1,2,-3\n", config=config + SENSOR) as daemon:
            daemon.start()
            wait_for(quality_is(daemon, "good"), "a good sample")
            began = time.monotonic()
            stop = multiprocessing.Event()
            mine, its = multiprocessing.Pipe()
            good_client = multiprocessing.Process(target=witness, args=(daemon.port, stop, its), daemon=True)
            good_client.start()
            try:
                suite = Suite(daemon)
                with Client(daemon.port, source=CONTROL if "plc" in config else "127.0.0.1") as suite.control:
                    suite.state()
                    resident = resident_kib(daemon.process)
                    cases_of(suite)
            finally:
                stop.set()
            self.assertTrue(mine.poll(PATIENCE_S), "the witness is gone")
            bad, waits_ms = mine.recv()
            good_client.join()
            waits_ms.sort()
            p50, p99, worst = waits_ms[len(waits_ms) // 2], waits_ms[len(waits_ms) * 99 // 100], waits_ms[-1]
            grown = resident_kib(daemon.process) - resident
            print(f"{suite.count} cases in {time.monotonic() - began:.1f} s; witness: {len(waits_ms)} reads, waits "
                  f"p50 {p50:.2f} p99 {p99:.2f} worst {worst:.2f} ms, {bad}; memory grew by {grown} KiB", flush=True)
            self.assertIsNone(daemon.process.poll(), "the daemon is gone")
            self.assertEqual(suite.failures, [])
            self.assertEqual(sum(bad.values()), 0, bad)
            self.assertLess(worst, WORST_WAIT_MS, "ms, the witness's worst wait")
            self.assertLess(grown, MAX_GROWTH_KIB)
            self.assertNotRegex(daemon.log().lower(), r"error|<[0-3]>")

    def test_a_daemon_that_may_be_written_to(self):
        def run(suite):
            with Client(suite.port) as client:  # the first number of an address is adopted and runs nothing
                client.ask(register(5004, 0xFFFF))
            suite.run_parallel(frames.SLOW, IN_PARALLEL)
            for table in (cases.READS, cases.UNSUPPORTED, cases.WRITES_OF_BAD_FORM, cases.WRITES_TO_BAD_ADDRESSES,
                          cases.WRITES_OF_BAD_VALUES, cases.SETTINGS_OUT_OF_RANGE, cases.UNLOCKING,
                          cases.NOT_FROM_HERE, cases.WRITES_OF_GOOD_FORM, cases.SETTINGS_IN_RANGE, cases.COMMANDS,
                          frames.FRAMES):
                suite.run(table)
            suite.run_each(ONE_BY_ONE)
            suite.judge(BURST, lambda: sockets.burst_while_the_daemon_is_halted(suite), seconds=2)
            suite.run_each(CROWDS, seconds=2)

        self.play(WRITABLE, run)

    def test_a_daemon_that_is_read_only(self):
        def run(suite):
            suite.run(cases.WRITES_OF_BAD_FORM)
            for table in (cases.WRITES_TO_BAD_ADDRESSES, cases.WRITES_OF_BAD_VALUES, cases.WRITES_OF_GOOD_FORM,
                          cases.READS_OF_SCRATCH):
                suite.run([Case(case.name, case.sent, 2, OURS) for case in table])

        self.play("", run)


if __name__ == "__main__":
    unittest.main(verbosity=2)
