#!/usr/bin/env python3
"""SIGHUP on the release daemon while two devices stream: changes, refusals, and that no sample is lost."""
import contextlib
import pathlib
import random
import signal
import socket
import sys
import threading
import time
import unittest

from pymodbus.client import ModbusTcpClient

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import ROOT, Daemon, free_port, wait_for  # noqa: E402
from unit_daemon import CALIBRATION  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

RATE_HZ = 500
CAL_ID, WARN = 28, 9
WARN_RELOAD = 1 << 7
LINK = """
[[link]]
name = "{0}"
driver = "uart"
device = "{{folder}}/{0}.dev"
path = "direct"
format = "lines"
channels = 3
sequence = true
"""
SENSOR = """
[[sensor]]
name = "{0}"
link = "{0}"
model = "generic"
calibration = "{{folder}}/{0}.toml"
stale_ms = 2000
"""


class Follower(threading.Thread):
    """Collects all samples of one sensor, until close()."""

    def __init__(self, node, sensor):
        super().__init__(daemon=True)
        self.node, self.sensor, self.samples, self.until = node, sensor, [], None
        self.start()

    def run(self):
        with tactiled.open(self.node).follow(self.sensor, 1) as follower:
            while self.until is None or self.samples[-1].sequence < self.until:
                self.samples.append(next(follower))

    def close(self):
        with tactiled.open(self.node) as node:
            self.until = node.latest(self.sensor).sequence
        self.join(30)
        assert not self.is_alive(), f"{self.sensor}: {len(self.samples)} samples read, up to {self.until} published"
        return self.samples


class Reload(unittest.TestCase):
    def setUp(self):
        names = ("a", "b")
        self.d = d = self.enterContext(Daemon("[shm]\nhistory = 16384\n" + "".join(LINK.format(n) for n in names) +
                                              "".join(SENSOR.format(n) for n in names)))
        (d.folder / "rows.csv").write_text("t_s,c1,c2,c3\n0,1,2,-3\n0.01,1,2,-3\n")
        for name in names:
            (d.folder / f"{name}.toml").write_text(CALIBRATION)
            d.play("--in", d.folder / "rows.csv", "--pty", d.folder / f"{name}.dev", "--format", "lines", "--sequence", "--rate",
                   RATE_HZ, "--loop")
        d.start()
        self.node = self.enterContext(tactiled.open(d.name))
        wait_for(lambda: all(self.node.latest(n).quality == tactiled.GOOD for n in names), "good samples")
        self.plc = ModbusTcpClient("127.0.0.1", port=d.port)
        self.plc.connect()
        self.addCleanup(self.plc.close)
        self.followers = {name: Follower(d.name, name) for name in names}

    def register(self, at):
        return self.plc.read_input_registers(at, count=1, slave=1).registers[0]

    def wait_for_warning(self, wanted):
        wait_for(lambda: self.register(WARN) == wanted, f"WARN to be {wanted}: the log is ahead of it by a turn of the loop")

    def reload(self, says):
        """Sends SIGHUP and waits until the daemon has logged `says`."""
        before = len(self.d.log())
        self.d.process.send_signal(signal.SIGHUP)
        wait_for(lambda: "SIGHUP: " in self.d.log()[before:] and self.d.log().endswith("\n"), "an answer to SIGHUP")
        self.assertRegex(self.d.log()[before:], says)

    def edit(self, what, by, path=None):
        path = path or self.d.config
        text = path.read_text()
        self.assertEqual(text.count(what), 1, (what, path))
        path.write_text(text.replace(what, by))

    def samples(self):
        """Returns the samples of both sensors after checking that none was lost between the device and the reader."""
        time.sleep(0.1)
        seen = {name: follower.close() for name, follower in self.followers.items()}
        for name, samples in seen.items():
            self.assertEqual([s.sequence for s in samples], list(range(samples[0].sequence, samples[-1].sequence + 1)), name)
            frames = [s.device_sequence for s in samples if s.quality != tactiled.BAD]
            self.assertEqual(frames, list(range(frames[0], frames[-1] + 1)), f"{name}: a frame of the device is missing")
            self.assertEqual(samples[-1].lost, 0)
        return seen

    def check_untouched(self, samples):
        self.assertEqual({(s.quality, s.epoch, s.force_S_N) for s in samples},
                         {(tactiled.GOOD, samples[0].epoch, (1.0, 2.0, -3.0))})

    def test_a_filter_changes_without_a_discontinuity_and_the_tare_stays(self):
        self.assertEqual(self.d.ctl("tare", "a").returncode, 0)
        calibration_id = self.register(CAL_ID)
        self.edit('name = "a"\nlink', 'name = "a"\nfilter_hz = 10\ncontact_on_N = 0.2\nlink')
        self.reload(r'changed sensor "a"\n')
        wait_for(lambda: self.node.latest("a").state & tactiled.LOW_PASS, "the low pass")
        self.assertNotEqual(self.register(CAL_ID), calibration_id)
        self.assertEqual(self.register(WARN), 0)
        seen = self.samples()
        self.assertEqual({(s.quality, s.epoch) for s in seen["a"]}, {(tactiled.GOOD, seen["a"][0].epoch)})
        last = seen["a"][-1]
        self.assertEqual(last.tare_count, 1)
        self.assertAlmostEqual(last.force_S_N[0], 0, delta=1e-9)
        self.check_untouched(seen["b"])

    def test_a_calibration_changes_in_a_new_epoch_and_without_the_old_tare(self):
        self.assertEqual(self.d.ctl("tare", "a").returncode, 0)
        self.edit("[1.0, 0.0, 0.0]", "[2.0, 0.0, 0.0]", self.d.folder / "a.toml")
        self.edit('serial = "unit"', 'serial = "second"', self.d.folder / "a.toml")
        self.reload(r'changed sensor "a" \(a new epoch, without its tare\)')
        wait_for(lambda: self.node.latest("a").force_S_N == (2.0, 2.0, -3.0), "the new calibration")
        self.assertEqual((self.node.info("a").serial, self.node.info("b").serial), ("second", "unit"))
        seen = self.samples()
        self.assertEqual(sum(s.quality == tactiled.BAD for s in seen["a"]), 1, "one BAD sample marks the break")
        at = next(i for i, s in enumerate(seen["a"]) if s.quality == tactiled.BAD)
        before, after = seen["a"][:at], seen["a"][at + 1:]
        self.assertEqual({s.raw_force_S_N[0] for s in before}, {1.0})
        self.assertEqual({(s.force_S_N, s.tare_count) for s in after}, {((2.0, 2.0, -3.0), 0)})
        self.assertEqual({s.epoch - before[0].epoch for s in after}, {1})
        self.check_untouched(seen["b"])

    def test_a_file_that_lacks_keys_which_it_had_is_accepted_the_second_time(self):
        self.edit('name = "a"\nlink', 'name = "a"\nfilter_hz = 10\nlink')
        self.reload(r'changed sensor "a"\n')
        self.edit("filter_hz = 10\n", "")
        self.reload(r'sensor "a": filter_hz is not in the file any more; if that is right, reload again(.|\n)*nothing was changed\n')
        time.sleep(0.1)
        self.assertTrue(self.node.latest("a").state & tactiled.LOW_PASS)
        self.reload(r'changed sensor "a"\n')
        wait_for(lambda: not self.node.latest("a").state & tactiled.LOW_PASS, "no low pass")
        self.samples()

    def test_what_is_wrong_or_needs_a_restart_changes_nothing_at_all(self):
        good = self.d.config.read_text()
        calibration = (self.d.folder / "a.toml").read_text()
        for what, by, says in (
                ('name = "a"\nlink', 'name = "a"\nfilter_hz = 10\nfiltre = 1\nlink', r"tactiled\.toml:\d+: .*filtre(.|\n)*refused"),
                ('name = "a"\nlink', 'name = "a"\nfilter_hz = 99999\nlink', r"tactiled\.toml:\d+: .*filter_hz(.|\n)*refused"),
                ('history = 16384', 'history = 1024', r"tactiled\.toml:\d+: .*shm.* restart"),
                ('name = "a"\nlink', 'name = "a"\ndevice = 1\nlink', r"tactiled\.toml:\d+: .*device .* restart"),
                ('name = "a"\nlink', 'name = "c"\nlink', r"tactiled\.toml:\d+: .*which \[\[sensor\]\] .*restart"),
                ('name = "a"\ndriver', 'baud = 9600\nname = "a"\ndriver', r"tactiled\.toml:\d+: .*link.* restart")):
            self.edit(what, by)
            (self.d.folder / "a.toml").write_text(calibration.replace("[1.0,", "[2.0,"))  # valid, but the reload is
                                                                                          # all or nothing
            self.reload(says)
            self.wait_for_warning(WARN_RELOAD)
            self.d.config.write_text(good)
            (self.d.folder / "a.toml").write_text(calibration)
        (self.d.folder / "a.toml").write_text(calibration[:200])
        self.reload(r"a\.toml:\d+(.|\n)*refused")
        (self.d.folder / "a.toml").write_text(calibration)
        self.reload("neither the configuration nor a calibration has changed")
        self.wait_for_warning(0)
        for samples in self.samples().values():
            self.check_untouched(samples)

    def test_a_storm_of_signals_with_broken_files_and_good_ones_loses_no_sample(self):
        good, made = self.d.config.read_text(), random.Random(7)
        tuned = good.replace('name = "a"\nlink', 'name = "a"\ncontact_on_N = 0.3\nlink')
        until = time.monotonic() + 3
        while time.monotonic() < until:
            text = made.choice((good, tuned, tuned[:made.randrange(len(tuned))]))
            self.d.config.with_suffix(".new").write_text(text)
            self.d.config.with_suffix(".new").rename(self.d.config)
            for _ in range(made.randrange(1, 20)):
                self.d.process.send_signal(signal.SIGHUP)
            time.sleep(made.uniform(0, 0.005))
        self.d.config.write_text(tuned)
        self.reload("SIGHUP")
        self.wait_for_warning(0)
        for samples in self.samples().values():
            self.check_untouched(samples)
        self.assertIn("refused", self.d.log())
        self.assertIn("changed", self.d.log())


class Device(threading.Thread):
    """Lines with a counter over TCP, to one client at a time; `rate_Hz` may change."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.rate_Hz, self.listener = 100, socket.create_server(("127.0.0.1", port))
        self.start()

    def run(self):
        sequence, client, due = 0, None, time.monotonic()
        while True:
            self.listener.settimeout(0 if client else None)
            with contextlib.suppress(BlockingIOError):
                client = self.listener.accept()[0]
            try:
                step = sequence // 200  # at rest between them
                client.sendall(b"%d %d %d %d\n" % (sequence, step % 2, step % 3, step % 5))
            except OSError:
                client = None
            sequence += 1
            due = max(due + 1 / self.rate_Hz, time.monotonic() - 0.05)
            time.sleep(max(0, due - time.monotonic()))


class ReloadRate(unittest.TestCase):
    def test_a_device_over_tcp_that_sends_faster_is_proved_again_as_after_a_restart(self):
        port = free_port()
        device = Device(port)
        link = f'[[link]]\nname = "a"\ndriver = "tcp"\naddress = "127.0.0.1:{port}"\nformat = "lines"\nchannels = 3\nsequence = true\n'
        with Daemon(link + SENSOR.format("a") + "rate_Hz = 100\n") as d:
            (d.folder / "a.toml").write_text(CALIBRATION)
            d.start()
            with tactiled.open(d.name) as node:
                wait_for(lambda: node.latest("a").quality == tactiled.GOOD, "a good sample")
                d.config.write_text(d.config.read_text().replace("rate_Hz = 100", "rate_Hz = 300"))
                device.rate_Hz = 300
                d.process.send_signal(signal.SIGHUP)
                wait_for(lambda: "SIGHUP: changed" in d.log(), "an answer to SIGHUP")
                time.sleep(6)  # to settle
                follower = Follower(d.name, "a")
                time.sleep(4)
                samples = follower.close()
                good = sum(s.quality == tactiled.GOOD and s.reasons == 0 for s in samples)
                self.assertGreater(len(samples), 600)
                self.assertGreater(good / len(samples), 0.97, {str(s.reasons_text) for s in samples})

if __name__ == "__main__":
    unittest.main(verbosity=2)
