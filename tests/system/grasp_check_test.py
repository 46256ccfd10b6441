#!/usr/bin/env python3
"""tactilectl grasp-check, through the real daemon, for each error of a set-up: it names the error and prints lines that are right.

The hand is simulated: an object of known mass hangs on jaws around the palm's axis, each with its own frame. Truth and
configuration differ by one error; with the printed lines the same grasp is found to be good.
"""
import math
import pathlib
import random
import re
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN  # noqa: E402
from guided_hand import begin, guide  # noqa: E402

G_m_s2, TILT = 9.80665, math.radians(30)


def frame(jaw, jaws):
    """Rows x, y, z of the skin: z towards the palm's axis, y towards the palm."""
    psi = 2 * math.pi * jaw / jaws
    return [[-math.sin(psi), math.cos(psi), 0.0], [0.0, 0.0, -1.0], [-math.cos(psi), -math.sin(psi), 0.0]]


def turned(rows, degrees):
    a = math.radians(degrees)
    x, y, z = rows
    return [[math.cos(a) * p + math.sin(a) * q for p, q in zip(x, y)], [-math.sin(a) * p + math.cos(a) * q for p, q in zip(x, y)], z]


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


class GraspCheck(unittest.TestCase):
    JAWS, MASS_kg, PRESS_N = 2, 0.42, 9.0

    def config(self, frames, gravity=(0, 0, G_m_s2), shares=None):
        text = f"[grasp]\ngravity_G_m_s2 = {list(gravity)}\nobjects = \"objects.toml\"\n"
        for j, rows in enumerate(frames):
            text += f'\n[[grasp.jaw]]\nsensor = "{self.names[j]}"\nx_S_in_G = {rows[0]}\nz_S_in_G = {rows[2]}\n'
            if shares:
                text += f"share = {shares[j]}\n"
        return text

    def check(self, jaws, config_of, place=lambda j: j, contact_on_N=0.5, full_scale=100.0, dead=None, said_kg=None):
        """Runs the verb. `place`: where the sensor of jaw j truly sits. Returns (status, text)."""
        rng = random.Random(f"{jaws} {self.id()}")
        self.names = [f"jaw{j}" for j in range(jaws)]
        more = f"contact_on_N = {contact_on_N}\ncontact_off_N = {contact_on_N / 2}\n"
        gains = [rng.gauss(1, 0.01) for _ in range(jaws)]
        shares = [(1 + rng.gauss(0, 0.03)) / jaws for _ in range(jaws)]
        zeros = [[rng.gauss(0, 0.4) for _ in range(3)] for _ in range(jaws)]
        channels = {name: 3 for name in self.names}
        daemon, devices = begin(self, config_of(), channels, full_scale=full_scale, more=more)

        def put(pull, squeeze):
            for j, name in enumerate(self.names):
                rows = frame(place(j), jaws)
                x, y, z = (dot(row, pull) for row in rows)
                part = 0.5 if jaws == 2 else 1 / jaws
                force = [x * part, y * shares[place(j)], z * part - squeeze * self.PRESS_N]
                if dead == j:
                    force[0] = force[1] = 0.0
                devices[name].reading = [zeros[j][k] + gains[j] * force[k] for k in range(3)]

        weight = self.MASS_kg * G_m_s2
        # The person lowers the place that the configuration gives to the first jaw.
        lower = [-a for a in self.configured[0][2]]
        poses = [lambda: put((0, 0, 0), 0), lambda: put((0, 0, 0), 1), lambda: put((0, 0, weight), 1.02),
                 lambda: put((*(weight * math.sin(TILT) * a for a in lower[:2]), weight * math.cos(TILT)), 0.99)]
        steps = [lambda pose=pose: (pose(), time.sleep(0.2))[0] for pose in poses]
        status, text = guide(daemon, ["grasp-check", said_kg or self.MASS_kg, "--seconds", 0.4], steps)
        return status, text

    def run_with(self, jaws, frames, **more):
        self.configured = frames
        given = {key: more.pop(key) for key in ("gravity", "shares") if key in more}
        return self.check(jaws, lambda: self.config(frames, **given), **more)

    def right(self, jaws):
        return [frame(j, jaws) for j in range(jaws)]

    def axes_in(self, text, key="x_S_in_G"):
        return [[float(x) for x in found.split(",")] for found in re.findall(rf"{key} = \[(.*?)\]", text)]

    def test_a_right_set_up_is_good(self):
        for jaws in (2, 3):
            status, text = self.run_with(jaws, self.right(jaws))
            self.assertEqual((status, "good: " in text), (0, True), text)

    def test_without_an_object_no_line_is_printed(self):
        self.PRESS_N, self.MASS_kg, mass = 0, 0, self.MASS_kg
        self.configured = self.right(2)
        with self.assertRaisesRegex(AssertionError, "2 of 4: .*not taken: no jaw feels an object"):  # it asks again
            self.check(2, lambda: self.config(self.right(2)), said_kg=mass)

    def test_gravity_with_the_wrong_sign(self):
        status, text = self.run_with(2, self.right(2), gravity=(0, 0, -G_m_s2))
        self.assertEqual(status, 1, text)
        self.assertIn("error: gravity has the wrong sign", text)
        self.assertIn("gravity_G_m_s2 = [0, 0, 9.8", text)

    def test_a_jaw_turned_by_90_and_by_180_degrees(self):
        for jaws, jaw, degrees in ((2, 1, 90), (2, 0, 180), (3, 2, 180), (3, 1, -90)):
            frames = self.right(jaws)
            frames[jaw] = turned(frames[jaw], -degrees)
            status, text = self.run_with(jaws, frames)
            self.assertEqual(status, 1, text)
            self.assertIn(f'jaw "jaw{jaw}" is turned by {degrees} degrees', text)
            frames[jaw][0] = self.axes_in(text)[0]
            for seen, truth in zip(frames[jaw][0], frame(jaw, jaws)[0]):
                self.assertAlmostEqual(seen, truth, delta=1e-3)

    def test_left_and_right_exchanged(self):
        status, text = self.run_with(2, self.right(2), place=lambda j: 1 - j)
        self.assertEqual(status, 1, text)
        self.assertIn('jaws "jaw0" and "jaw1" are exchanged', text)
        axes = self.axes_in(text, "z_S_in_G")
        for j in range(2):
            for seen, truth in zip(axes[j], frame(1 - j, 2)[2]):
                self.assertAlmostEqual(seen, truth, delta=1e-3)

    def test_a_contact_threshold_beyond_the_press(self):
        status, text = self.run_with(2, self.right(2), contact_on_N=120, full_scale=None)  # the calibration does not tell it
        self.assertEqual(status, 1, text)
        for name in ("jaw0", "jaw1"):
            self.assertIn(f'jaw "{name}": contact_on_N = 120 is too large', text)
        for on_N in re.findall(r"contact_on_N = ([0-9.]+)\n", text):
            self.assertLess(float(on_N), self.PRESS_N / 3)

    def test_shares_that_do_not_add_up(self):
        status, text = self.run_with(2, self.right(2), shares=(0.8, 0.2))
        self.assertEqual(status, 1, text)
        shares = [float(share) for share in re.findall(r"share = ([0-9.]+)", text)]
        self.assertEqual(len(shares), 2, text)
        self.assertAlmostEqual(sum(shares), 1, delta=0.002)
        self.assertAlmostEqual(shares[0], 0.5, delta=0.06)

    def test_a_dead_shear(self):
        status, text = self.run_with(3, self.right(3), dead=1)
        self.assertEqual(status, 1, text)
        self.assertIn('jaw "jaw1" carries nothing', text)

    def test_no_answer_is_an_error(self):
        self.names, self.configured = ["jaw0", "jaw1"], self.right(2)
        daemon, _ = begin(self, self.config(self.configured), {name: 3 for name in self.names})
        done = subprocess.run([BIN / "tactilectl", "grasp-check", "0.1", "--node", daemon.name], stdin=subprocess.DEVNULL, capture_output=True,
                              text=True, env=daemon.reader_env, timeout=60)
        self.assertEqual(done.returncode, 1, done)


if __name__ == "__main__":
    unittest.main()
