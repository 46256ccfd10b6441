"""tactilectl calibrate on the files of others: the right values or the right sentence, and never a channel that is none."""
import gzip
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import tomllib
import unittest

import labelled_shapes
from daemon import BIN

WARNING_LINES = 10


class Shapes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = pathlib.Path(temporary.name)
        cls.expected = labelled_shapes.write(cls.folder)
        cls.plain = cls.calibrate("plain.csv")[1]

    @classmethod
    def calibrate(cls, name, *words):
        """Returns the process and the calibration, None if there is none."""
        out = cls.folder / "out.toml"
        out.unlink(missing_ok=True)
        if labels := cls.expected.get(name, {}).get("labels"):
            (cls.folder / "labels.csv").write_text(labels)
            words += ("--labels", cls.folder / "labels.csv")
        done = subprocess.run([BIN / "tactilectl", "calibrate", "--model", "generic", "--in", cls.folder / name, "--out", out,
                               *words], capture_output=True, text=True)
        return done, tomllib.loads(out.read_text()) if out.exists() else None

    def check(self, name, done, got):
        """A calibration from this file is that of the plain file."""
        what, plain = self.expected[name], self.plain
        self.assertEqual(done.returncode, 0, done.stderr)
        warnings = [line for line in done.stderr.splitlines() if line.startswith("warning")]
        self.assertLessEqual(len(warnings), WARNING_LINES)
        names = [channel.replace(" ", "_") for channel in what.get("channels", labelled_shapes.CHANNELS)]
        self.assertEqual(got["channels"], names)
        self.assertEqual(got["components"], plain["components"])
        loose, scale = what.get("loose", False), what.get("scale", 1)
        for mine, other in zip(got["full_scale"], plain["full_scale"]):
            self.assertLess(abs(mine / other - 1), 0.03 if loose else 0.01)
        for i, (mine, other) in enumerate(zip(got["matrix"], plain["matrix"])):
            for a, b in zip(mine, other):
                self.assertLess(0 if loose else abs(scale * a - b), 0.01 * max(map(abs, other)))
            squares = [(sum(m * (scale * x - z) for m, x, z in zip(mine, row.channel, got["zero"])) - row.force_N[i])**2
                       for row in labelled_shapes.RECORDING]
            self.assertLess((sum(squares) / len(squares))**0.5, 0.01 * plain["full_scale"][i])
        self.assertLess(max(got["held_out_rms"]), 0.1)  # N; the labels' noise is 0.004 N
        step_s = got.get("repeats", {}).get("interval_s", 0)
        if step_s == 0 and (said := re.search(r"the rows are ([\d.]+) ms", done.stdout)):
            step_s = float(said[1]) / 1e3
        self.assertAlmostEqual(step_s, what.get("interval", 0.05), delta=1e-3)
        sessions = what.get("sessions", 5)
        self.assertEqual("(5 sessions)" in done.stdout, sessions == 5, done.stdout)  # among the ways to hold rows out

    def test_each_shape_has_the_right_values_or_the_right_sentence(self):
        for name, what in self.expected.items():
            with self.subTest(name):
                done, got = self.calibrate(name)
                if "ask" not in what and "refuse" not in what:
                    self.check(name, done, got)
                    continue
                self.assertIsNone(got, done.stdout)
                self.assertIn(done.returncode, (1, 2), done.stderr)
                for words in what.get("refuse", what.get("ask")):
                    self.assertIn(words, done.stderr)
                if "ask" in what:
                    self.assertIn("--channels", done.stderr)
                    self.check(name, *self.calibrate(name, "--channels", ",".join(labelled_shapes.CHANNELS)))

    def test_the_offset_of_two_clocks_is_said_with_its_uncertainty(self):
        done, _ = self.calibrate("two_clocks.csv")
        offset, sd = re.search(r"channels \+ ([\d.]+) s \(sd ([\de.-]+) s\)", done.stderr).groups()
        self.assertAlmostEqual(float(offset), 0.37, delta=0.005)
        self.assertLess(float(sd), 0.005)

    def offset_s(self, skin, labels):
        """Returns the offset that is said for two texts, and its standard deviation."""
        (self.folder / "offset_skin.csv").write_text(skin)
        (self.folder / "offset_labels.csv").write_text(labels)
        done, _ = self.calibrate("offset_skin.csv", "--labels", self.folder / "offset_labels.csv")
        said = re.search(r"channels ([+-]) ([\d.]+) s \(sd ([\de.-]+) s\)", done.stderr)
        self.assertIsNotNone(said, done.stderr)
        return float(said[1] + said[2]), float(said[3])

    def test_a_similar_press_with_full_overlap_does_not_beat_the_true_one(self):
        for late_s in (0, 5, 10):
            offset, sd = self.offset_s(*labelled_shapes.repeating(late_s))
            self.assertAlmostEqual(offset, 0, delta=0.005, msg=late_s)
            self.assertLess(sd, 0.005)

    def test_axes_without_a_load_do_not_count_as_unexplained(self):
        offset, sd = self.offset_s(*labelled_shapes.unloaded_axes())
        self.assertAlmostEqual(offset, 0, delta=0.005)
        self.assertLess(sd, 0.005)

    def test_an_array_is_read_as_far_as_its_header_says(self):
        values = struct.pack("<8d", *range(8))
        behind_MiB = 128
        data = labelled_shapes.npy("'<f8'", "(2, 4)", values) + bytes(behind_MiB * 2**20)
        (self.folder / "long.npy.gz").write_bytes(gzip.compress(data, 1))
        (self.folder / "short.npy").write_bytes(labelled_shapes.npy("'<f8'", "(3, 4)", values))
        (self.folder / "endless.npy").write_bytes(labelled_shapes.npy("'<f8'", f"({2**62}, 4)", values))
        peak_MiB = []
        for name in ("short.npy", "endless.npy", "long.npy.gz"):
            code = ("import resource, subprocess, sys; r = subprocess.run(sys.argv[1:], capture_output=True, text=True); "
                    "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, r.stderr)")
            done = subprocess.run([sys.executable, "-c", code, BIN / "tactilectl", "calibrate", "--model", "generic", "--in",
                                   self.folder / name, "--out", self.folder / "none.toml"], capture_output=True, text=True)
            self.assertEqual("cut off" in done.stdout, name != "long.npy.gz", done.stdout)
            peak_MiB.append(int(done.stdout.split()[0]) / 1024)
        self.assertLess(peak_MiB[-1], peak_MiB[0] + behind_MiB / 2, "it held what follows the array")

    def test_a_matrix_without_names_is_read_with_names(self):
        done, got = self.calibrate("matrix.npy", "--columns", ",".join(labelled_shapes.PLAIN))
        self.check("matrix.npy", done, got)

    def test_a_calibration_reads_the_file_from_which_it_was_made(self):
        _, got = self.calibrate("german.csv")
        self.assertIsNotNone(got)
        done = subprocess.run([BIN / "tactilectl", "decouple", "--calibration", self.folder / "out.toml", "--in",
                               self.folder / "german.csv"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = done.stdout.splitlines()
        self.assertEqual(len(lines), 1 + len(labelled_shapes.RECORDING))
        force_N = [float(cell) for cell in lines[31].split(",")[1:4]]
        for mine, other in zip(force_N, labelled_shapes.RECORDING[30].force_N):
            self.assertAlmostEqual(mine, other, delta=0.1)

    def test_the_classes_are_shown_before_the_fit(self):
        done, _ = self.calibrate("robot.csv")
        for line in ("  label        fx_N fy_N fz_N", "  channel      ch1 ch2 ch3 ch4 ch5 ch6", "  place        not used: x y z"):
            self.assertIn(line, done.stderr)


if __name__ == "__main__":
    unittest.main()
