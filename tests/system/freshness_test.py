"""Frames that are delayed outside this machine, with the release daemon: a bridge between device and daemon holds
them back and releases them.

Each line contains the time of its measurement, so that a reader knows the true age of every GOOD value."""
import contextlib
import json
import os
import pathlib
import pty
import re
import signal
import socket
import sys
import threading
import time
import tty
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/system"), str(ROOT / "node/python")]
import tactiled  # noqa: E402
from pymodbus.client import ModbusTcpClient  # noqa: E402
from daemon import PATIENCE_S, Daemon, Stopwatch, wait_for  # noqa: E402

STALE_MS, PERIOD_S = 100, 0.01
ORDINARY_MS = 60  # allowed delay of a busy machine, beyond stale_ms
UNSEEN_MS = STALE_MS  # without a clock, delays below stale_ms are not seen (drivers/wire/freshness.md)
CALIBRATION = """format = 1
model = "generic"
method = "matrix"
channels = ["a"]
channel_unit = "counts"
zero = [0.0]
components = ["fz"]
matrix = [[0.001]]
sd = [0.01]
full_scale = [5000.0]
"""
SENSOR = """
[[link]]
name = "line"
{driver}
format = "lines"
channels = 1
checksum = "crc16"
{keys}

[[sensor]]
name = "s"
link = "line"
model = "generic"
calibration = "{{folder}}/unit.toml"
stale_ms = 100
rate_Hz = 100
{sensor}
"""


def crc16(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = ((crc << 1) ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


class Bridge(threading.Thread):
    """A device of 100 Hz and the path from it: `lag_s` is the delay of each line after its measurement."""

    def __init__(self, write, sequence, clock):
        super().__init__(daemon=True)
        self.write, self.has_sequence, self.has_clock = write, sequence, clock
        self.began = time.monotonic()
        self.lag_s, self.paused, self.ends = 0.0, False, False
        self.held_until, self.sent = 0.0, 0
        self.late_ms = {}  # time of a measurement in ms, as it was sent: the time by which this machine delayed its line here
        self.start()

    def end(self):
        self.ends = True
        self.join()

    def ms(self):
        return (time.monotonic() - self.began) * 1000

    def run(self):
        way, n, due = [], 0, time.monotonic()
        while not self.ends:
            due += PERIOD_S
            time.sleep(max(0.0, due - time.monotonic()))
            now = time.monotonic()
            if not self.paused:
                cells = [str(n)] * self.has_sequence + [str(int(now * 1e6) & 0xFFFFFFFF)] * self.has_clock
                measured = "%.3f" % ((now - self.began) * 1000)
                body = ",".join([*cells, measured]).encode()
                way.append((max(now + self.lag_s, way[-1][0] if way else 0), float(measured), body + b"*%04X\n" % crc16(body)))
                n += 1
            while way and way[0][0] <= now and now >= self.held_until:
                due_s, measured_ms, line = way.pop(0)
                due_s = max(due_s, self.held_until)  # a hold that begins from here on is none of this line
                with contextlib.suppress(OSError):
                    self.write(line)
                self.late_ms[measured_ms] = (time.monotonic() - due_s) * 1000
                self.sent += 1

    def hold(self, seconds):
        self.held_until = time.monotonic() + seconds


class Rig:
    def __init__(self, sequence=True, clock=True, keys="", sensor="", tcp=False):
        self.stack = contextlib.ExitStack()
        keys += f"\nsequence = {str(sequence).lower()}\ntime_us = {str(clock).lower()}"
        if tcp:
            server = self.stack.enter_context(socket.create_server(("127.0.0.1", 0)))
            driver = f'driver = "tcp"\naddress = "127.0.0.1:{server.getsockname()[1]}"'
            self.clients, self.accepted = [], 0
            threading.Thread(target=self.accept, args=(server,), daemon=True).start()
            write = lambda data: [c.sendall(data) for c in self.clients[-1:]]  # noqa: E731
        else:
            self.master, slave = pty.openpty()
            tty.setraw(slave)
            driver = f'driver = "uart"\ndevice = "{os.ttyname(slave)}"'
            self.stack.callback(os.close, slave)
            write = lambda data: os.write(self.master, data)  # noqa: E731
        self.daemon = Daemon(SENSOR.format(driver=driver, keys=keys, sensor=sensor))
        (self.daemon.folder / "unit.toml").write_text(CALIBRATION)
        self.bridge = Bridge(write, sequence, clock)

    def accept(self, server):
        with contextlib.suppress(OSError):
            while True:
                client = server.accept()[0]
                self.accepted += 1
                self.clients.append(client)

    def __enter__(self):
        self.stack.enter_context(self.daemon)
        self.daemon.start()
        self.node = self.stack.enter_context(tactiled.open(self.daemon.name))
        wait_for(lambda: self.node.latest("s").quality == tactiled.GOOD, "a GOOD sample")
        self.watch(1.5)
        return self

    def __exit__(self, *what):
        self.bridge.end()
        self.stack.close()

    def watch(self, seconds, until=None):
        """Polls each ms. Returns (largest true age of a GOOD value in ms, [(time, quality, reasons)] at changes).

        The age is that before the read, and without the delay of the bridge by this machine: neither is one of the daemon."""
        oldest, seen, end = 0.0, [], time.monotonic() + seconds
        while time.monotonic() < end and not (until and until()):
            before_ms = self.bridge.ms()
            sample = self.node.latest("s")
            if sample.quality == tactiled.GOOD:
                measured_ms = round(sample.raw_force_S_N[2] * 1000, 3)
                oldest = max(oldest, before_ms - measured_ms - self.bridge.late_ms.get(measured_ms, 0))
            if not seen or seen[-1][1:] != (sample.quality, sample.reasons):
                seen.append((time.monotonic(), sample.quality, sample.reasons))
            time.sleep(0.001)
        return oldest, seen

    def latest(self):
        return self.node.latest("s")


class Freshness(unittest.TestCase):
    def assert_young(self, rig, oldest):
        self.assertLess(oldest, STALE_MS + ORDINARY_MS + UNSEEN_MS * (not rig.bridge.has_clock))

    def wait_for_state(self, rig, *state):
        """On a busy machine a frame may be late at any moment, and its value BAD."""
        wait_for(lambda: (lambda sample: (sample.quality, sample.reasons))(rig.latest()) == state, f"{state}")

    def test_a_backlog_and_a_bridge_that_never_drains_are_not_good_where_the_device_sends_its_time(self):
        with Rig() as rig:
            rig.bridge.hold(2)
            oldest, _ = rig.watch(3)
            self.assert_young(rig, oldest)
            self.wait_for_state(rig, tactiled.GOOD, 0)
            rig.bridge.lag_s = 2
            self.assert_young(rig, rig.watch(5)[0])
            self.wait_for_state(rig, tactiled.BAD, tactiled.STALE)
            refused = rig.daemon.ctl("tare", "s")
            self.assertNotEqual(refused.returncode, 0)
            rig.bridge.lag_s = 0
            self.assert_young(rig, rig.watch(3)[0])
            self.wait_for_state(rig, tactiled.GOOD, 0)
            rig.bridge.paused = True
            time.sleep(1)
            rig.bridge.paused = False
            _, seen = rig.watch(1)
            # The first value of a stream waits for the second.
            self.assertNotIn(tactiled.UNCERTAIN, [quality for _, quality, reasons in seen if reasons != tactiled.STEPPED])
            status = json.loads(rig.daemon.ctl("status", "--json").stdout)
            self.assertEqual(status["sensors"][0]["freshness"], "clock")

    def test_the_bound_of_the_age_is_the_same_for_all_readers(self):
        with Rig() as rig:
            def bound_ms():
                return rig.node.info("s").age_bound_us / 1000

            def of_json():
                return json.loads(rig.daemon.ctl("status", "--json").stdout)["sensors"][0]["age_bound_ms"]

            def of_text():
                return float(re.search(r"age of s: proved by clock, at most ([\d.]+) ms\n", rig.daemon.ctl("status").stdout)[1])

            def of_register():
                with ModbusTcpClient("127.0.0.1", port=rig.daemon.port) as client:
                    bound, none = client.read_input_registers(9100, count=2).registers
                self.assertEqual(none, 0xFFFF)
                return bound

            wait_for(lambda: bound_ms() < STALE_MS, "a bound below stale_ms while frames come")
            rig.bridge.end()
            # From the last frame on the bound only grows: what a reader shows lies between the bounds before and after it.
            wait_for(lambda: rig.latest().device_sequence == rig.bridge.sent - 1, "the last frame")
            wait_for(lambda: bound_ms() > STALE_MS, "a bound above stale_ms")
            for of_reader, rounded_ms in ((of_json, 0.001), (of_text, 0.05), (of_register, 1)):
                before_ms, seen_ms, after_ms = bound_ms(), of_reader(), bound_ms()
                self.assertLessEqual(before_ms - rounded_ms, seen_ms, of_reader)
                self.assertLessEqual(seen_ms, after_ms + rounded_ms, of_reader)
            self.assertEqual(rig.latest().quality, tactiled.BAD)

    def test_the_same_with_a_counter_is_uncertain_and_is_not_tared(self):
        with Rig(clock=False) as rig:
            rig.watch(2.5)  # until the rate of the counter is known
            rig.bridge.hold(2)
            # A rate that is known for seconds only may hide a part of the lag for twice the time that it lasted.
            oldest, seen = rig.watch(2 + 2 * 2 + 1)
            self.assert_young(rig, oldest)
            states = [state[1:] for state in seen]
            # Without a proof the bound grows on: it exceeds stale_ms some seconds later.
            self.assertIn((tactiled.GOOD, 0), states[states.index((tactiled.BAD, tactiled.STALE)):], "the missing time was caught up")
            rig.bridge.lag_s = 2
            self.assert_young(rig, rig.watch(5)[0])
            self.wait_for_state(rig, tactiled.UNCERTAIN, tactiled.UNPROVED_AGE)
            self.assertNotEqual(rig.daemon.ctl("tare", "s").returncode, 0)

    def test_over_tcp_a_pause_costs_the_samples_until_the_connection_was_opened_again(self):
        with Rig(clock=False, tcp=True) as rig:
            before = rig.accepted  # the first opening, and others until the interval is known
            samples = self.enterContext(rig.node.follow("s", 0))
            next(samples)
            rig.bridge.paused = True
            time.sleep(1)
            rig.bridge.paused = False
            began_s = time.monotonic()
            with Stopwatch() as watch:
                rig.watch(PATIENCE_S, lambda: rig.accepted > before and rig.latest().quality == tactiled.GOOD)
                took_s = watch.seconds()
            print(f"GOOD again {took_s:.3f} s after the pause")
            self.assertTrue(any(sample.reasons & tactiled.UNPROVED_AGE for sample in samples))
            self.assertLess(took_s, 1.5)
            rig.watch(3)
            self.assertLess(rig.accepted - before, time.monotonic() - began_s + 1, "at most one a second")

    def test_a_stream_without_either_is_tared_only_where_that_is_accepted(self):
        for accept in (False, True):
            with self.subTest(accept=accept), Rig(False, False, sensor=f"accept_unproved_age = {str(accept).lower()}\ntare_ms = 200") as rig:
                self.wait_for_state(rig, tactiled.GOOD, 0 if accept else tactiled.ARRIVAL_ONLY)
                # The value is the time: its means over quarters of the window differ by 0.15 N, three times what a tare lets pass.
                done = rig.daemon.ctl("tare", "s")
                self.assertNotEqual(done.returncode, 0)
                self.assertEqual("no clock and no counter would show a delay" in done.stderr, not accept, done)
                rig.bridge.hold(1)
                self.assert_young(rig, rig.watch(2)[0])
                self.wait_for_state(rig, tactiled.GOOD, 0 if accept else tactiled.ARRIVAL_ONLY)  # the missing lines have come

    def test_a_device_on_a_cable_may_pause_and_is_not_opened_again(self):
        for sequence in (True, False):
            with self.subTest(sequence=sequence), Rig(sequence, False, keys='path = "direct"') as rig:
                rig.bridge.paused = True
                time.sleep(1)
                rig.bridge.paused = False
                self.wait_for_state(rig, tactiled.GOOD, 0)
                status = json.loads(rig.daemon.ctl("status", "--json").stdout)
                self.assertEqual((status["sensors"][0]["freshness"], status["links"][0]["opened"]), ("cable", 1))

    def test_what_waited_for_a_stopped_process_is_as_old_as_it_may_be(self):
        for keys in ('path = "direct"', 'path = "network"'):
            for sequence, clock in ((True, True), (True, False), (False, False)):
                with self.subTest(keys=keys, sequence=sequence, clock=clock), Rig(sequence, clock, keys=keys) as rig:
                    rig.daemon.process.send_signal(signal.SIGSTOP)
                    time.sleep(0.05)  # the bytes of this time wait in the kernel
                    rig.bridge.paused = True  # the device dies
                    time.sleep(0.88)
                    rig.daemon.process.send_signal(signal.SIGCONT)
                    self.assert_young(rig, rig.watch(0.5)[0])

    def test_check_states_how_the_age_is_proved_and_warns_of_weak_checksums(self):
        with Rig(clock=False) as rig:
            said = rig.daemon.ctl("check", rig.daemon.config).stdout
            self.assertIn('sensor "s": age proved by sequence', said)
            self.assertIn("whose counter begins again within 60 s", said)
            self.assertNotIn("warning: link", said)
            for weak in ("true", '"xor"', "false"):
                rig.daemon.config.write_text(rig.daemon.config.read_text().replace(
                    next(line for line in rig.daemon.config.read_text().splitlines() if line.startswith("checksum")), f"checksum = {weak}"))
                self.assertIn("warning: link \"line\"", rig.daemon.ctl("check", rig.daemon.config).stdout, weak)
            doctor = json.loads(rig.daemon.ctl("doctor", "--config", rig.daemon.config, "--json").stdout)
            self.assertIn("freshness", [finding["check"] for finding in doctor["findings"]])


if __name__ == "__main__":
    unittest.main()
