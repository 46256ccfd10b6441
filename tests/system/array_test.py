#!/usr/bin/env python3
"""Arrays of taxels as users see them: tactilectl read --array and the maps of tactilectl top, beside simulated devices that
send datagrams."""
import csv
import io
import json
import os
import pathlib
import pty
import re
import shutil
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from array_device import ArrayDevice, array_daemon  # noqa: E402
from daemon import BIN, wait_for  # noqa: E402
from unit_daemon import quality_is  # noqa: E402

DEAD, MISSING, PRESS_N = 5, 17, 2.0
CURVED_M = [(0.002 * x, 0.003 * y, 0.02 - 0.0004 * x * x) for y in range(-2, 3) for x in range(-4, 5)]


class ArrayCase(unittest.TestCase):
    devices = [lambda: ArrayDevice("skin")]

    def setUp(self):
        self.sent = [self.enterContext(make()) for make in self.devices]
        self.skin = self.sent[0]
        self.skin.missing.add(MISSING)
        self.daemon = array_daemon(*self.sent, dead=[DEAD])
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)

    def read(self, *words, sensor="skin"):
        done = self.daemon.ctl("read", sensor, "--array", *words)
        return done.returncode, done.stdout

    def array(self, sensor="skin"):
        return json.loads(self.read("--json", sensor=sensor)[1])


class Read(ArrayCase):
    devices = [lambda: ArrayDevice("skin"), lambda: ArrayDevice("tip", values=3, places_m=CURVED_M)]

    def test_each_form_has_the_press_the_centre_and_the_taxels_that_are_out(self):
        code, text = self.read()
        self.assertEqual(code, 0)
        self.assertRegex(text, r"^skin  96 taxels, 8 x 12  sequence \d+  good\n")
        self.assertRegex(text, r"centre of pressure/mm  x -?0\.\d\d \+- 0\.\d\d  y ")
        self.assertRegex(text, r"peak/N 0\.1\d+ \+- 0\.0\d+ at taxel \d+ \(row [34], column [56]\)\ntaxels without a force: 2\n")
        rows = text.splitlines()[5:]
        self.assertEqual([len(row) for row in rows], [9 * 12] * 8)
        self.assertEqual((rows[0][9 * DEAD:][:9].strip(), rows[1][9 * (MISSING - 12):][:9].strip()), ("dead", "missing"))
        array = self.array()
        self.assertNotIn("fx_N", array)
        self.assertAlmostEqual(-sum(force or 0 for force in array["fz_N"]), PRESS_N, delta=0.2)
        self.assertEqual([i for i, state in enumerate(array["state"]) if state], [DEAD, MISSING])
        table = list(csv.DictReader(io.StringIO(self.read("--csv")[1])))
        self.assertEqual(len(table), 96)
        self.assertEqual([(row["fz_N"], row["state"]) for row in table if row["state"]], [("", "dead"), ("", "missing")])
        self.assertAlmostEqual(float(table[0]["x_m"]), -0.011, 6)

    def test_a_curved_skin_is_a_list_with_three_components(self):
        code, text = self.read(sensor="tip")
        self.assertEqual(code, 0)
        self.assertEqual(len(text.splitlines()), 5 + 45)
        self.assertIn("    44     8.000     6.000    13.600 ", text)
        tip = self.array("tip")
        self.assertEqual({len(tip[f"f{axis}_N"]) for axis in "xyz"}, {45})
        self.assertGreater(sum(force or 0 for force in tip["fx_N"]), 0.1)

    def test_a_silent_device_has_no_numbers(self):
        self.skin.is_paused = True
        wait_for(quality_is(self.daemon, "bad"), "the end of the frames")
        code, text = self.read()
        self.assertEqual(code, 1)
        self.assertNotRegex(text, r"\d\.\d{3}")
        array = self.array()
        self.assertTrue(array["quality"].startswith("bad:"))
        self.assertEqual(set(array["fz_N"]), {None})

    def test_options_that_have_no_meaning_for_an_array_are_refused(self):
        for words in (["--follow"], ["--raw"]):
            self.assertEqual(self.read(*words)[0], 2)


class Top(ArrayCase):
    devices = [lambda: ArrayDevice("skin"), lambda: ArrayDevice("tip", values=3, places_m=CURVED_M), lambda: ArrayDevice("palm", 64, 64, rate_Hz=10),
               lambda: ArrayDevice("thumb", 4, 4)]

    def top(self, **env):
        """Returns the screen of a terminal of 80 x 24."""
        master, slave = pty.openpty()
        subprocess.run(["stty", "rows", "24", "columns", "80"], stdin=slave, check=True)
        with subprocess.Popen([BIN / "tactilectl", "top", "--count", "1", "--node", self.daemon.name], stdin=slave, stdout=slave, env={**os.environ, **env}) as process:
            os.close(slave)
            seen = b""
            try:
                while piece := os.read(master, 65536):
                    seen += piece
            except OSError:  # the terminal's end
                pass
            process.wait()
        os.close(master)
        return seen.decode()

    def test_maps_fit_into_80_columns_with_several_sensors(self):
        text = self.daemon.ctl("top", "--count", "1").stdout
        self.assertLessEqual(max(map(len, text.splitlines())), 80)
        self.assertRegex(text, r"(?m)^skin {22,}tip {22,}palm +$")
        self.assertEqual(len(re.findall(r"0 \.\. 0\.\d+ N, [12] out", text)), 4)
        self.assertEqual(len(re.findall(r"\(\) -?\d\.\d -?\d\.\d \+-\d\.\d\d mm", text)), 4)
        self.assertIn("@@", text)
        self.assertRegex(text, r"(?m)^\(\) centre of pressure  \? missing  ! saturated  x dead  ~ frozen$")

    def test_a_terminal_has_colours_and_no_more_lines_than_it_shows(self):
        screen = self.top(TERM="xterm-256color", LANG="C.UTF-8", LC_ALL="")
        self.assertIn("▀", screen)
        self.assertIn("\x1b[48;5;", screen)
        lines = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", screen).split("\n")
        self.assertLessEqual(len(lines), 24)
        self.assertLessEqual(max(len(line.rstrip("\r")) for line in lines), 80)
        plain = self.top(TERM="xterm-256color", LANG="C", LC_ALL="")
        self.assertNotIn("▀", plain)
        self.assertIn("@@", plain)

    def test_a_bad_array_has_no_map(self):
        for device in self.sent:
            device.is_paused = True
        wait_for(lambda: self.daemon.ctl("status").stdout.count("bad:") >= 4, "the end of the frames")
        text = self.daemon.ctl("top", "--count", "1").stdout
        self.assertEqual(text.count("no map: bad:"), 4)
        self.assertNotIn("@", text)


if __name__ == "__main__":
    unittest.main()
