#!/usr/bin/env python3
"""From an unknown port to newtons: identify, capture, calibrate and the daemon, on a device with a known matrix
behind a pty."""
import json
import os
import pathlib
import pty
import random
import re
import shutil
import subprocess
import tempfile
import threading
import time
import tty
import unittest

from daemon import BIN, Daemon, ctl, wait_for
from unit_daemon import quality_is, unit_daemon

MATRIX = [[120.0, 5.0, -8.0], [-4.0, 90.0, 6.0], [3.0, -2.0, 60.0], [-50.0, 20.0, 30.0]]  # counts per newton
ZERO = [512.0, 500.0, 480.0, 700.0]


def crc16(text):
    crc = 0xFFFF
    for byte in text.encode():
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


class Device:
    """An Arduino with four channels that respond to `load`. It prints until it is closed."""

    def __init__(self, rate=100, line=None, noise=0.3):
        self.load, self.rate, self.noise = [0.0, 0.0, 0.0], rate, noise
        self.line, self.end = line or self.full_line, "\r\n"
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        self.path = os.ttyname(self.slave)
        self.running, self.random = True, random.Random(7)
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def channels(self):
        return [zero + sum(a * f for a, f in zip(row, self.load)) + self.random.gauss(0, self.noise) for zero, row in zip(ZERO, MATRIX)]

    def full_line(self, n, t_us):
        text = ",".join([str(n), str(t_us)] + [f"{c:.2f}" for c in self.channels()])
        return f"{text}*{crc16(text):04X}"

    def run(self):
        began, n = time.monotonic(), 0
        while self.running:
            time.sleep(max(0, began + n / self.rate - time.monotonic()))
            try:
                os.write(self.master, (self.line(n, int((time.monotonic() - began) * 1e6)) + self.end).encode())
            except BlockingIOError:
                pass
            n += 1

    def close(self):
        self.running = False
        self.thread.join()
        os.close(self.master)
        os.close(self.slave)


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-test-"))
        self.addCleanup(shutil.rmtree, self.folder)

    def device(self, **kinds):
        device = Device(**kinds)
        self.addCleanup(device.close)
        return device


class Identify(Case):
    def keys(self, line, **kinds):
        done = ctl("identify", self.device(line=line, **kinds).path, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        answer = json.loads(done.stdout)
        return answer, dict(re.findall(r"(\w+) = (.*)", answer["link"]))

    def test_counter_clock_and_crc_are_found(self):
        answer, keys = self.keys(None)
        self.assertEqual((keys["channels"], keys.get("sequence"), keys.get("time_us"), keys.get("checksum")), ("4", "true", "true", '"crc16"'))
        self.assertAlmostEqual(answer["rate_Hz"], 100, delta=15)
        self.assertEqual(answer["notes"], [])

    def test_plain_numbers_in_other_separators_and_with_bad_lines(self):
        def line(n, _):
            return "booting..." if n % 50 == 20 else f"{512 + n % 3}\t{7.5 + n % 2}\t-3"
        answer, keys = self.keys(line)
        self.assertEqual((keys["channels"], keys.get("sequence"), keys.get("time_us"), keys.get("checksum")), ("3", None, None, None))
        self.assertEqual(answer["last_bad"], "booting...")
        self.assertGreaterEqual(answer["bad"], 1)
        self.assertEqual(len(answer["notes"]), 3)

    def test_milliseconds_are_no_clock_in_microseconds(self):
        answer, keys = self.keys(lambda n, t_us: f"{t_us // 1000} {n % 7} {n % 5}")
        self.assertEqual((keys["channels"], keys.get("time_us"), keys.get("sequence")), ("3", None, None))
        self.assertTrue(any("milliseconds" in note for note in answer["notes"]), answer["notes"])

    def test_binary_frames(self):
        table = pathlib.Path(__file__).parents[2] / "config/demo/table_demo.csv"
        player = subprocess.Popen([BIN / "tactilectl", "play", "--in", table, "--pty", self.folder / "dev", "--format", "cobs", "--bits", "32",
                                   "--counts-per-unit", "1e9", "--loop"], stderr=subprocess.DEVNULL)
        self.addCleanup(player.wait)
        self.addCleanup(player.terminate)
        wait_for((self.folder / "dev").is_symlink, "the port")
        answer = json.loads(ctl("identify", self.folder / "dev", "--json").stdout)
        self.assertIn('format = "cobs"', answer["link"])
        self.assertEqual(answer["channels"], 8)

    def test_numbers_with_words_are_told_the_line_to_send(self):
        for line, numbers in (("weight: 123.4", "123.4"), ("A:-12 B:7 C:300", "-12,7,300")):
            done = ctl("identify", self.device(line=lambda n, t, line=line: line).path)
            self.assertEqual(done.returncode, 1)
            self.assertIn("numbers with words", done.stderr)
            self.assertIn(f'let the device send the numbers alone, such as "{numbers}"', done.stderr)

    def test_numbers_without_the_end_of_a_line_are_named(self):
        device = self.device()
        device.line, device.end = lambda n, t: "1,2", ""
        done = ctl("identify", device.path, "--seconds", "0.5")
        self.assertEqual(done.returncode, 1)
        self.assertIn("no end of a line", done.stderr)
        self.assertIn("Serial.println()", done.stderr)

    @unittest.skipIf(os.geteuid() != 0, "root alone can act as another user")
    def test_a_pseudo_terminal_can_be_opened_again_by_a_normal_user(self):
        """Its master keeps it alive, with the flags of the last user; nobody but root could open an exclusive one."""
        device = self.device()
        os.chown(device.path, 65534, 65534)
        with tempfile.TemporaryDirectory() as folder:  # the user may be unable to enter the folder of the build
            os.chmod(folder, 0o755)
            for name in ("tactilectl", "tactilectl-lab"):
                shutil.copy(BIN / name, folder)
            for _ in range(2):
                done = subprocess.run([f"{folder}/tactilectl", "identify", device.path, "--seconds", "0.5"], capture_output=True, text=True,
                                      timeout=60, user=65534, group=65534, extra_groups=[], cwd="/")
                self.assertEqual(done.returncode, 0, done.stderr)

    def test_a_port_needs_no_folder_in_its_name(self):
        port = self.device(line=lambda n, t: f"{n % 7} 5").path
        (self.folder / "ttyX").symlink_to(port)
        done = ctl("identify", "ttyX", cwd=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(f'device = "{self.folder}/ttyX"', done.stdout)  # a daemon may start elsewhere
        done = ctl("identify", "ttyY", cwd=self.folder)
        self.assertEqual(done.returncode, 2)
        self.assertIn('"ttyY" is no port in this folder or in /dev', done.stderr)

    def test_silence_noise_and_a_missing_port_are_errors_that_say_so(self):
        silent = Device(rate=0.01, line=lambda n, t: "")
        self.addCleanup(silent.close)
        done = ctl("identify", silent.path)
        self.assertEqual(done.returncode, 1)
        self.assertIn("nothing arrived", done.stderr)
        done = ctl("identify", self.device(line=lambda n, t: "hello world, how are you").path)
        self.assertEqual(done.returncode, 1)
        self.assertIn("of no known format", done.stderr)
        self.assertIn("hello", done.stderr)
        self.assertEqual(ctl("identify", "/dev/no-such-port").returncode, 2)

    def test_the_printed_link_is_a_configuration(self):
        device = self.device()
        config = self.folder / "my.toml"
        config.write_text(ctl("identify", device.path).stdout)
        done = ctl("identify", "usb0", "--config", config)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn('name = "usb0"', done.stdout)
        self.assertIn('did you mean "usb0"', ctl("identify", "usb", "--config", config).stderr)


LOADS = [(0, 0, 0), (0, 0, -2), (0, 0, -4), (0, 0, -8), (2, 0, -4), (-2, 0, -4), (4, 0, -4), (-4, 0, -4), (0, 2, -4), (0, -2, -4),
         (0, 4, -4), (0, -4, -4), (2, 2, -6), (-2, -2, -6)]


class Capture(Case):
    def test_from_a_port_to_newtons(self):
        device = self.device()
        config, rows, calibration = self.folder / "my.toml", self.folder / "labelled.csv", self.folder / "skin.toml"
        config.write_text(ctl("identify", device.path).stdout)
        for session, gain in (("1", 1.0), ("2", 1.01)):
            for load in LOADS:
                device.load = [gain * f for f in load]
                label = "fx_N={},fy_N={},fz_N={}".format(*load)
                done = ctl("capture", "usb0", "--config", config, "--label", label, "--append", rows, "--session", session, "--seconds", "0.25",
                           "--settle", "0.05", "--json")
                self.assertEqual(done.returncode, 0, done.stderr)
        answer = json.loads(done.stdout)
        self.assertEqual(answer["missing"], [])
        self.assertEqual(len(answer["coverage"]), 3)
        self.assertEqual(rows.read_text().splitlines()[0], "t_s,c1,c2,c3,c4,fx_N,fy_N,fz_N,session")
        times = [float(line.split(",")[0]) for line in rows.read_text().splitlines()[1:]]
        self.assertEqual(times, sorted(times))
        done = ctl("calibrate", "--model", "generic", "--in", rows, "--out", calibration)
        self.assertEqual(done.returncode, 0, done.stderr)
        sensor = done.stdout[done.stdout.index("[[sensor]]"):]
        # Checks that the printed tables make a configuration that runs.
        with Daemon(config.read_text() + "\n" + sensor) as d:
            d.start()
            device.load = [1.5, -1.0, -5.0]
            wait_for(lambda: json.loads(d.ctl("status", "--json").stdout)["sensors"][0]["quality"].startswith(("good", "uncertain")), "a value")
            time.sleep(0.5)
            force = json.loads(d.ctl("status", "--json").stdout)["sensors"][0]["force_S_N"]
        for measured, true in zip(force, device.load):
            self.assertAlmostEqual(measured, true, delta=0.15)  # the sessions differ by 1 %; noise is 0.3 counts at
                                                                # 60 counts per newton

    def test_loads_are_asked_for_and_gaps_are_named(self):
        device = self.device()
        done = subprocess.run([BIN / "tactilectl", "capture", device.path, "--append", self.folder / "a.csv", "--seconds", "0.3", "--settle", "0",
                               "--channels", "A,B,C,D"], input="fz_N=0 fx_N=0\nfz_N=-1 fx_N=2\n\n", capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("fx_N was loaded to one side only (0 .. 2): add the mirrored load -2", done.stdout)
        self.assertIn("fy_N is not labelled", done.stdout)
        self.assertIn("fz_N has 2 loads", done.stdout)
        self.assertIn("one session", done.stdout)
        self.assertEqual((self.folder / "a.csv").read_text().splitlines()[0], "t_s,A,B,C,D,fx_N,fz_N,session")
        # Another label set, another number of channels and a wrong word are refused, and the file is unchanged.
        before = (self.folder / "a.csv").read_bytes()
        for words, said in ((["--label", "fz_N=-1"], "add fx_N=0"), (["--label", "fz_N=-1,fx_N=0,fy_N=1"], "have no fy_N"),
                            (["--label", "fz=-1"], 'known: "fx_N", "fy_N", "fz_N"'), (["--label", "fz_N=ten"], "NUMBER"),
                            (["--label", "fz_N=-1,fx_N=0", "--channels", "A,B"], "names 2"), (["--label", "fx_N=0,fz_N=0", "--session", "a,b"], "session")):
            done = ctl("capture", device.path, "--append", self.folder / "a.csv", "--seconds", "0.1", *words)
            self.assertEqual(done.returncode, 2, (words, done))
            self.assertIn(said, done.stderr)
        self.assertEqual((self.folder / "a.csv").read_bytes(), before)
        # A further session needs a row without a load, too: its zero is its own.
        done = ctl("capture", device.path, "--append", self.folder / "a.csv", "--seconds", "0.1", "--session", "2", "--label", "fz_N=-1,fx_N=2")
        self.assertIn("session 2 has no row without a load", done.stdout)

    def guided(self, lines, terminal, **kinds):
        """Types `lines` as answers of a guided capture; returns its exit status, output and errors."""
        words = [BIN / "tactilectl", "capture", self.device(**kinds).path, "--append", self.folder / "a.csv", "--seconds", "0.2", "--settle", "0"]
        if not terminal:
            done = subprocess.run(words, input=lines, capture_output=True, text=True, timeout=60)
            return done.returncode, done.stdout, done.stderr
        master, slave = pty.openpty()
        try:
            os.write(master, lines.encode())
            done = subprocess.run(words, stdin=slave, capture_output=True, text=True, timeout=60)
        finally:
            os.close(master)
            os.close(slave)
        return done.returncode, done.stdout, done.stderr

    def loads_of_file(self):
        return sorted({line.split(",")[5] for line in (self.folder / "a.csv").read_text().splitlines()[1:]})

    def test_a_mistyped_load_is_explained_and_asked_for_again(self):
        # A typing error, a wrong number, a label that the file lacks and one empty line end nothing; two empty lines do.
        lines = "fz_N=0\nfz=-1\nfz_N=ten\nfx_N=1\n\nfz_N=-2\n\n\nfz_N=-3\n"
        for terminal, status in ((True, 0), (False, 1)):  # a program does not read the question: its status shows the refused lines
            with self.subTest(terminal=terminal):
                got, out, err = self.guided(lines, terminal)
                self.assertEqual(got, status, err)
                self.assertIn('known: "fx_N", "fy_N", "fz_N"', err)
                self.assertIn("NUMBER", err)
                self.assertIn("its rows have no fx_N; leave it out", err)
                self.assertEqual(self.loads_of_file(), ["-2", "0"])
                self.assertIn("fz_N has 2 loads", out)
                (self.folder / "a.csv").unlink()

    def test_the_end_of_the_input_ends_a_guided_capture(self):
        self.assertEqual(self.guided("fz_N=0\n\x04", True)[0], 0)
        self.assertEqual(self.guided("fz_N=-1", False)[0], 0)
        self.assertEqual(self.loads_of_file(), ["-1", "0"])

    def test_a_channel_that_never_changes_is_named(self):
        def third_is_stuck(n, t_us):
            return f"{n},{t_us},{500 + n % 3},{700 + n % 5},431.25,{90 + n % 2}"

        def warnings(line):
            done = ctl("capture", self.device(line=line).path, "--label", "fz_N=0", "--append", self.folder / "a.csv", "--seconds", "0.3", "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
            return json.loads(done.stdout)["loads"][0]["warnings"]
        self.assertEqual(warnings(third_is_stuck), ["channel 3 (c3) did not change while the others did: check its wire and its input"])
        self.assertEqual(warnings(None), [])
        self.assertEqual(warnings(lambda n, t_us: f"{n},{t_us},1,2,3,4"), [])  # no channel changes: a quiet or simulated device
        got, out, err = self.guided("fz_N=0\n", False, line=third_is_stuck)
        self.assertEqual(got, 0, err)
        self.assertIn("warning: channel 3 (c3) did not change while the others did", out)

    def test_a_file_without_a_last_line_end_and_with_a_later_clock_is_continued(self):
        file = self.folder / "a.csv"
        file.write_text("t_s,A,B,C,D,fz_N,session\n1e9,1,2,3,4,-1,monday")  # times (t_s) of another boot, and no line
                                                                            # end
        done = ctl("capture", self.device().path, "--append", file, "--label", "fz_N=-2", "--seconds", "0.2")
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = [line.split(",") for line in file.read_text().splitlines()]
        self.assertEqual({len(row) for row in rows}, {7})
        self.assertTrue(all(row[6] == "monday" for row in rows[1:]))
        self.assertGreater(float(rows[2][0]), 1e9)

    def test_noise_and_drift_are_shown(self):
        began = time.monotonic()

        def drifting(n, t_us):
            return f"{n},{t_us},{500 + 100 * (time.monotonic() - began):.3f},{700 + (n % 2):.1f}"
        done = ctl("capture", self.device(line=drifting).path, "--label", "fz_N=0", "--append", self.folder / "a.csv", "--json")
        channels = json.loads(done.stdout)["loads"][0]["channels"]
        self.assertAlmostEqual(channels[0]["drift"], 150, delta=30)  # three quarters of 2 s at 100 per second
        self.assertAlmostEqual(channels[1]["sd"], 0.5, delta=0.05)
        self.assertLess(abs(channels[1]["drift"]), 0.2)

    def test_a_load_that_changes_is_not_appended(self):
        device, file = self.device(), self.folder / "a.csv"
        for load in (0.0, -5.0):
            device.load[2] = load
            words = ("capture", device.path, "--append", file, "--seconds", "0.5", "--label", f"fx_N=0,fy_N=0,fz_N={load}")
            self.assertEqual(ctl(*words).returncode, 0)
        before = file.read_text()
        began, full_line = time.monotonic(), device.line

        def slowly_unloaded(n, t_us):
            device.load[2] = -5.0 + 0.5 * (time.monotonic() - began)
            return full_line(n, t_us)
        device.line = slowly_unloaded
        words = [*words[:5], "2", *words[6:]]
        moved = ctl(*words)
        self.assertEqual(moved.returncode, 1, moved.stdout)
        self.assertIn("the load changed while it was read (c", moved.stderr)
        self.assertEqual(file.read_text(), before)
        self.assertEqual(ctl(*words, "--force").returncode, 0)
        self.assertGreater(len(file.read_text()), len(before))
        done = ctl("capture", device.path, "--append", file, "--label", "5")
        self.assertIn("write a decimal point", done.stderr)

    def test_a_sensor_of_the_daemon_is_the_reference(self):
        with unit_daemon("0,0,0,-5\n0.01,0,0,-5\n") as d:
            d.start()
            wait_for(quality_is(d, "good"), "a good sample")
            done = ctl("capture", self.device().path, "--reference", "left", "--node", d.name, "--append", self.folder / "a.csv", "--seconds", "0.5")
            self.assertEqual(done.returncode, 0, done.stderr)
            row = (self.folder / "a.csv").read_text().splitlines()[-1].split(",")
            self.assertEqual([float(f) for f in row[5:8]], [0, 0, -5])
            done = ctl("capture", self.device().path, "--reference", "lfet", "--node", d.name, "--append", self.folder / "a.csv")
            self.assertEqual(done.returncode, 2)

    def test_a_scale_is_the_reference(self):
        scale = self.device(line=lambda n, t: "ST,GS,+   123.4 g" if n % 9 else "US,noise", rate=20)
        done = ctl("capture", self.device().path, "--scale", scale.path, "--append", self.folder / "a.csv", "--seconds", "0.5", "--settle", "0.3")
        self.assertEqual(done.returncode, 0, done.stderr)
        row = (self.folder / "a.csv").read_text().splitlines()[-1].split(",")
        self.assertAlmostEqual(float(row[7]), -0.1234 * 9.80665, places=6)


if __name__ == "__main__":
    unittest.main(verbosity=2)
