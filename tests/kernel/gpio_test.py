#!/usr/bin/env python3
"""GPIO lines of the simulated chip "tactile": edges, missed ones, a chip that is taken away, and the node's outputs. Inside the test
machine."""
import os
import pathlib
import signal
import subprocess
import time
import unittest

from machine import BIN, Witness, gpio_chip, link_of, machine_daemon, now_ns, wait_for
from tactiled import GOOD

LIVE = pathlib.Path("/sys/kernel/config/gpio-sim/tactile/live")
OUTPUTS = """
[gpio]
chip = "tactile"
fault = "fault"
alive = "alive"
"""


def sim(line):
    return gpio_chip()[1] / f"sim_gpio{line}"


def pull(line, up):
    (sim(line) / "pull").write_text("pull-up" if up else "pull-down")


def value(line):
    return int((sim(line) / "value").read_text())


def plug(there):
    if bool(int(LIVE.read_text())) != there:
        LIVE.write_text("1" if there else "0")
    if there:
        wait_for(lambda: pathlib.Path(gpio_chip()[0]).exists(), "the chip")


class Edges:
    def __init__(self, line, edge="rising", chip="tactile"):
        self.process = subprocess.Popen([BIN / "gpio_edges", chip, line, edge], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def begin(self, command):
        self.process.stdin.write(f"{command}\n")
        self.process.stdin.flush()

    def ask(self, command):
        self.begin(command)
        return self.process.stdout.readline().strip()

    def close(self):
        self.process.stdin.close()
        self.process.wait(10)
        self.process.stdout.close()


class TheLines(unittest.TestCase):
    def setUp(self):
        plug(True)
        pull(0, False)

    def test_an_edge_has_the_timestamp_of_its_interrupt(self):
        line = Edges("drdy0")
        self.assertEqual(line.ask("open"), "ok")
        for _ in range(20):
            before = now_ns()
            pull(0, True)
            after = now_ns()
            pull(0, False)  # not this one
            time.sleep(0.01)
            edge, stamp, edges = line.ask("1000").split()
            self.assertEqual((edge, edges), ("edge", "1"))
            self.assertTrue(before <= int(stamp) <= after)
        self.assertEqual(line.ask("10"), "timeout")
        self.assertEqual(line.ask("level"), "level 0")
        pull(0, True)
        self.assertEqual(line.ask("level"), "level 1")
        line.close()

    def test_missed_edges_are_counted_and_never_stop_the_next_ones(self):
        line = Edges("drdy0")
        self.assertEqual(line.ask("open"), "ok")
        for turn in range(3):
            for _ in range(5):
                pull(0, True)
                pull(0, False)
            self.assertEqual(line.ask("1000").split()[2], "5")
        for _ in range(400):  # more than any of the kernel's queues
            pull(0, True)
            pull(0, False)
        _, stamp, edges = line.ask("1000").split()
        # the first interface keeps the 16 oldest, the second the newest and their number
        self.assertIn((stamp == "0", int(edges)), ((True, 16), (False, 400)))
        self.assertEqual(line.ask("10"), "timeout")
        before = now_ns()
        pull(0, True)
        _, stamp, edges = line.ask("1000").split()
        self.assertEqual(edges, "1")
        self.assertGreaterEqual(int(stamp), before)
        line.close()

    def test_a_chip_that_is_taken_away_is_disconnected_within_a_wait_and_opens_again(self):
        line = Edges("drdy0")
        self.assertEqual(line.ask("open"), "ok")
        line.begin("500")
        time.sleep(0.1)
        plug(False)
        # the kernel's first interface wakes no reader: the present wait ends at its time limit
        self.assertIn(line.process.stdout.readline().strip(), ("gone", "timeout"))
        began = now_ns()
        self.assertEqual(line.ask("20000"), "gone")
        self.assertLess(now_ns() - began, 5e9)
        self.assertEqual(line.ask("level"), "level -1")
        self.assertIn("gpiodetect", line.ask("open"))
        plug(True)
        self.assertEqual(line.ask("open"), "ok")
        pull(0, True)
        self.assertTrue(line.ask("1000").startswith("edge"))
        line.close()

    def test_says_what_is_wrong_with_a_line(self):
        held = Edges("drdy0")
        self.assertEqual(held.ask("open"), "ok")
        for line, chip, expected in (("0", "tactile", "another program"), ("drdy9", "tactile", "gpioinfo"), ("99", "tactile", "gpioinfo"),
                                     ("0", "nochip", "gpiodetect")):
            other = Edges(line, chip=chip)
            self.assertIn(expected, other.ask("open"))
            other.close()
        held.close()


class TheOutputs(unittest.TestCase):
    FAULT, ALIVE = 4, 7

    def setUp(self):
        plug(True)

    def turns_of_alive(self, seconds=1.0):
        seen, turns, until = value(self.ALIVE), 0, time.monotonic() + seconds
        while time.monotonic() < until:
            if (now := value(self.ALIVE)) != seen:
                seen, turns = now, turns + 1
            time.sleep(0.005)
        return turns

    def test_fault_is_low_until_all_is_well_and_when_a_sensor_ends(self):
        with machine_daemon(OUTPUTS) as daemon:
            daemon.start()
            wait_for(lambda: value(self.FAULT) == 1, "fault to be off")
            self.assertTrue(5 <= self.turns_of_alive() <= 12)  # 10 a second
            daemon.others[0].kill()
            wait_for(lambda: value(self.FAULT) == 0, "fault: the sensor is gone")
            wait_for(lambda: self.turns_of_alive(0.5) == 0, "alive to stand still")

    def test_an_output_that_is_not_to_be_had_holds_back_no_other(self):
        with machine_daemon('[gpio]\nchip = "tactile"\nfault = "fault"\nalive = "4"\n') as daemon:  # one line, named twice
            daemon.start()
            wait_for(lambda: value(self.FAULT) == 1, "fault to be off")
            wait_for(lambda: '[gpio]: alive: GPIO line "4"' in daemon.log(), "what is refused in the log")
            self.assertIn('drives 1 of 2 lines of chip "tactile"', daemon.log())
            daemon.others[0].kill()
            wait_for(lambda: value(self.FAULT) == 0, "fault: the sensor is gone")
        held = Edges("alive")  # by another program, for a while
        self.assertEqual(held.ask("open"), "ok")
        with machine_daemon(OUTPUTS) as daemon:
            daemon.start()
            wait_for(lambda: value(self.FAULT) == 1, "fault to be off")
            held.close()
            wait_for(lambda: self.turns_of_alive(0.3) > 0, "alive to be driven, too")

    # The chip determines the level of a released line, here its pull, so the final fault level is not visible.
    def test_a_killed_daemon_stops_alive_and_its_successor_drives_the_lines(self):
        with machine_daemon(OUTPUTS) as daemon:
            daemon.start()
            wait_for(lambda: value(self.FAULT) == 1, "fault to be off")
            os.kill(daemon.process.pid, signal.SIGKILL)
            daemon.process.wait()
            time.sleep(0.1)
            self.assertEqual(self.turns_of_alive(), 0)
            daemon.start()
            wait_for(lambda: value(self.FAULT) == 1, "fault to be off")

    def test_a_chip_taken_away_touches_no_sensor_and_is_driven_again(self):
        with machine_daemon(OUTPUTS) as daemon:
            daemon.start()
            other = Witness(daemon, "other")
            other.wait_for_quality(GOOD)
            wait_for(lambda: value(self.FAULT) == 1, "fault to be off")
            for _ in range(3):
                plug(False)
                time.sleep(0.5)
                plug(True)
                wait_for(lambda: value(self.FAULT) == 1 and self.turns_of_alive(0.3) > 0, "the lines to be driven again")
            self.assertEqual(daemon.log().count("is disconnected"), 1, daemon.log())
            self.assertEqual(len({sample.epoch for _, sample in other.samples}), 1)
            self.assertEqual(link_of(daemon, "other")["lost"], 0)
            other.close()


if __name__ == "__main__":
    unittest.main()
