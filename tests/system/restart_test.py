#!/usr/bin/env python3
"""Tares over a restart of the daemon: restored, or known to be lost; a held force never becomes zero, nor a zero a
force."""
import pathlib
import random
import re
import signal
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN  # noqa: E402
from held_force import Held, wait_for  # noqa: E402

FORGET = 'zero_after = "forget"\n'
ENDS = (signal.SIGTERM, signal.SIGKILL)
FAULT, ZERO_UNKNOWN = 102, 22  # FAULT: the register and its number
MOUNTING_N = -10.0  # reading without a load, after the sensor was mounted


class Restart(unittest.TestCase):
    def test_with_restore_the_zero_is_the_same_without_and_under_a_load(self):
        with Held() as held:
            held.press(MOUNTING_N)
            self.assertEqual(held.daemon.ctl("tare", "left").returncode, 0)
            for end in ENDS:
                for load_N in (0.0, -20.0):
                    held.press(MOUNTING_N + load_N)
                    held.restart(end)
                    quality, force_N = held.read_force()
                    self.assertEqual(quality, "good")
                    self.assertAlmostEqual(force_N, load_N, delta=0.02)
                    self.assertEqual(held.sample()["tare_count"], 1)

    def test_a_zero_is_doubted_if_the_force_has_changed_during_the_restart(self):
        for more, quality in (("", "uncertain"), ('zero_after = "keep"\n', "good")):
            with Held(more) as held:
                held.press(MOUNTING_N)
                self.assertEqual(held.daemon.ctl("tare", "left").returncode, 0)
                for end in ENDS:
                    held.press(MOUNTING_N - 20)
                    held.restart(end, then_N=MOUNTING_N - 15)
                    self.assertEqual(held.read_force()[0].split(":")[0], quality)
                    self.assertEqual("zero-unknown" in held.read_force()[0], quality != "good")
                    held.press(MOUNTING_N)
                    self.assertEqual(held.daemon.ctl("tare", "left").returncode, 0)

    def test_with_forget_a_tared_sensor_is_uncertain_until_it_is_tared_again(self):
        with Held(FORGET) as held:
            held.press(MOUNTING_N)
            self.assertEqual(held.daemon.ctl("tare", "left").returncode, 0)
            plc = held.plc()
            for end in ENDS:
                held.press(MOUNTING_N - 20)
                held.restart(end)
                self.assertIn("zero-unknown", held.read_force()[0])
                self.assertTrue(held.read_force()[0].startswith("uncertain"))
                self.assertEqual(plc.read(FAULT, 1), [ZERO_UNKNOWN])
                self.assertEqual(plc.read(101, 1)[0] & 0x0101, 0, "neither ok nor tared")
            held.press(MOUNTING_N)
            self.assertEqual(held.daemon.ctl("tare", "left").returncode, 0)
            quality, force_N = held.read_force()
            self.assertEqual(quality, "good")
            self.assertAlmostEqual(force_N, 0, delta=0.02)

    def test_a_sensor_that_was_never_tared_or_was_untared_is_good_after_a_restart(self):
        for more in ("", FORGET):
            with Held(more) as held:
                held.press(-3.0)
                held.restart()
                self.assertEqual(held.read_force()[0], "good")
                self.assertEqual(held.daemon.ctl("tare", "left").returncode, 0)
                self.assertEqual(held.daemon.ctl("tare", "left", "--remove").returncode, 0)
                held.restart(signal.SIGKILL)
                quality, force_N = held.read_force()
                self.assertEqual(quality, "good")
                self.assertAlmostEqual(force_N, -3, delta=0.02)

    def test_another_calibration_has_lost_the_tare_at_a_restart_and_at_a_reload(self):
        for reloads in (False, True):
            with Held() as held:
                held.press(MOUNTING_N)
                self.assertEqual(held.daemon.ctl("tare", "left").returncode, 0)
                path = held.daemon.folder / "unit.toml"
                path.write_text(path.read_text().replace("[1.0, 0.0, 0.0]", "[1.5, 0.0, 0.0]"))
                if reloads:
                    held.daemon.process.send_signal(signal.SIGHUP)
                    wait_for(lambda: "zero-unknown" in held.read_force()[0], "the reload")
                    held.restart()
                else:
                    held.restart()
                self.assertIn("zero-unknown", held.read_force()[0])

    def test_a_tare_that_was_acknowledged_is_in_the_file(self):
        with Held() as held:
            zeros = held.daemon.folder / "zeros.toml"
            for force_N in (-1.0, -2.0, -3.0):
                held.press(force_N)
                self.assertEqual(held.daemon.ctl("tare", "left").returncode, 0)
                kept = float(re.search(r"wrench_S = \[[^,]*, [^,]*, ([^,]*),", zeros.read_text()).group(1))
                self.assertAlmostEqual(kept, force_N, delta=0.02)
            self.assertEqual([f.name for f in held.daemon.folder.glob(".zeros*")], [], "no temporary file is left")

    def test_a_kill_at_any_moment_of_a_tare_leaves_the_zero_before_the_new_one_or_an_unknown_one(self):
        chance = random.Random(5)
        with Held() as held:
            held.press(-1.0)
            self.assertEqual(held.daemon.ctl("tare", "left").returncode, 0)
            before_N = -1.0
            for turn in range(12):
                next_N = before_N - 0.5
                held.press(next_N)
                asked = subprocess.Popen([BIN / "tactilectl", "tare", "left", "--node", held.daemon.name], stdout=subprocess.PIPE,
                                         stderr=subprocess.DEVNULL, text=True)
                time.sleep(chance.uniform(0, 0.25))
                held.daemon.process.kill()
                held.daemon.process.wait(timeout=60)
                was_told = "done" in asked.communicate()[0]
                held.start()
                quality, force_N = held.read_force()
                if "zero-unknown" in quality:
                    self.assertFalse(was_told)
                    self.assertEqual(held.daemon.ctl("tare", "left").returncode, 0)
                    before_N = next_N
                    continue
                zero_N = next_N - force_N
                self.assertEqual(quality, "good")
                self.assertLess(min(abs(zero_N - next_N), abs(zero_N - before_N)), 0.02, (turn, zero_N))
                if was_told:
                    self.assertAlmostEqual(zero_N, next_N, delta=0.02)
                before_N = zero_N

    def test_where_zeros_cannot_be_kept_a_tare_is_refused_and_values_go_on(self):
        held = Held()
        zeros = held.daemon.folder / "zeros.toml"
        zeros.mkdir()
        (zeros / "full").mkdir()
        with held:
            held.press(-3.0)
            held.sample()
            refused = held.daemon.ctl("tare", "left")
            self.assertEqual(refused.returncode, 1)
            self.assertIn("zeros cannot be written", refused.stderr)
            plc = held.plc()
            self.assertEqual(plc.command(7, 1, 1), (7, 3, 11))
            self.assertEqual(plc.command(8, 1, 1), (8, 3, 10))
            self.assertTrue(plc.read(8, 1)[0] & 1 << 6, "FAULT: storage")

    def test_the_weight_of_a_restart_under_load_is_not_a_number(self):
        grasp = """
[grasp]
gravity_G_m_s2 = [0, 0, 9.81]

[[grasp.jaw]]
sensor = "left"
x_S_in_G = [0, 0, -1]
z_S_in_G = [1, 0, 0]
"""
        for more, state in (("", None), (FORGET, 0xFFFF)):
            with Held(more + grasp) as held:
                self.assertEqual(held.daemon.ctl("tare", "left").returncode, 0)
                held.device.force_N = [-8.0, 0.0, -15.0]
                wait_for(lambda: (held.sample()["raw_force_S_N"][2] or 0) < -14, "the grip")
                held.restart()
                plc = held.plc()
                for _ in range(100):
                    node = plc.read(0, 32)
                    self.assertEqual(node[18], 0xFFFF, "WEIGHT_G")
                    if state is not None:
                        self.assertEqual(node[17], state, "GRIP_STATE")


if __name__ == "__main__":
    unittest.main(verbosity=2)
