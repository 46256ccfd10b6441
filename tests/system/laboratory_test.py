#!/usr/bin/env python3
"""The verbs of the laboratory are in a separate program and package, and users type tactilectl for all of them."""
import os
import pathlib
import re
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

from daemon import BIN, ROOT

FIT = re.compile(r"lib(ceres|lapack|blas|f77blas|cblas|atlas|cholmod|spqr|suitesparse|glog|gflags|gfortran)", re.I)
LABORATORY = ["calibrate", "capture", "decouple", "identify", "play", "simulate", "tradeoff"]


def libraries(program):
    return subprocess.run(["ldd", BIN / program], capture_output=True, text=True, check=True).stdout


def verbs_of_help(program):
    """Returns {group: [verb]} of --help."""
    text = subprocess.run([program, "--help"], capture_output=True, text=True, check=True).stdout
    return {group: re.findall(r"^  ([a-z-]+) ", lines, re.M) for group, lines in re.findall(r"^(\S[^\n]*):\n((?:  .*\n?|\n)+)", text, re.M)}


class Libraries(unittest.TestCase):
    def test_the_programs_that_operate_load_none_of_the_fit(self):
        for program in ("tactiled", "tactilectl"):
            self.assertIsNone(FIT.search(libraries(program)), program)
        self.assertIsNotNone(FIT.search(libraries("tactilectl-lab")))


class Verbs(unittest.TestCase):
    def test_help_lists_both_groups_and_each_verb_has_its_own(self):
        groups = verbs_of_help(BIN / "tactilectl")
        self.assertEqual([verbs for group, verbs in groups.items() if "tactiled-lab" in group], [LABORATORY])
        self.assertEqual(groups["Subcommands"],
                         ["status", "top", "read", "record", "replay", "tare", "clear", "weigh", "teach", "tool-fit", "grasp-check", "map", "check", "completion", "doctor"])
        for verb in groups["Subcommands"] + LABORATORY:
            for words in ((verb, "--help"), ("--help", verb)):
                done = subprocess.run([BIN / "tactilectl", *words], capture_output=True, text=True)
                self.assertEqual((done.returncode, done.stderr), (0, ""), words)
                self.assertIn(f"Usage: tactilectl {verb} [OPTIONS]", done.stdout)

    def test_errors_are_those_of_tactilectl(self):
        done = subprocess.run([BIN / "tactilectl", "decouple", "--calibration", "/nowhere.toml"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertTrue(done.stderr.startswith("tactilectl: /nowhere.toml: "), done.stderr)


class Alone(unittest.TestCase):
    """tactilectl in a folder with another tactilectl-lab, or without one."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        shutil.copy(BIN / "tactilectl", self.folder)

    def run_it(self, *words, **kinds):
        return subprocess.run([self.folder / "tactilectl", *words], capture_output=True, text=True, timeout=60, **kinds)

    def laboratory(self, script):
        program = self.folder / "tactilectl-lab"
        program.write_text("#!/bin/bash\n" + script)
        program.chmod(0o755)

    def test_without_the_package_the_error_names_it(self):
        for verb in LABORATORY:
            done = self.run_it(verb, "--help")
            self.assertEqual((done.returncode, done.stdout), (2, ""))
            self.assertIn(f"tactilectl: {verb} is in the package tactiled-lab, which is not installed", done.stderr)

    def test_without_the_package_all_else_works(self):
        self.assertEqual(self.run_it("--version").returncode, 0)
        self.assertEqual(self.run_it("map").returncode, 0)
        self.assertEqual(self.run_it("check", ROOT / "config/demo.toml").returncode, 0)
        self.assertEqual(self.run_it("status", "--node", "nobody").returncode, 3)
        self.assertEqual(self.run_it("read", "play", "--node", "nobody").returncode, 3)  # the name of a sensor is not
                                                                                         # a verb
        self.assertEqual(self.run_it("calibrated").returncode, 2)
        self.assertIn("calibrate", self.run_it("--help").stdout)

    def test_a_program_that_cannot_be_started_is_another_error(self):
        (self.folder / "tactilectl-lab").write_text("")
        done = self.run_it("play")
        self.assertEqual(done.returncode, 1)
        self.assertIn("tactilectl-lab: Permission denied", done.stderr)

    def test_words_environment_input_and_exit_status_pass_through(self):
        self.laboratory('printf "%s|" "$@"; echo "$WORD"; cat; echo said >&2; exit 42')
        done = self.run_it("simulate", "--list", "a b", "", input="in\n", env={**os.environ, "WORD": "w"})
        self.assertEqual((done.returncode, done.stdout, done.stderr), (42, "simulate|--list|a b||w\nin\n", "said\n"))
        self.laboratory("kill -TERM $$")
        self.assertEqual(self.run_it("play").returncode, -signal.SIGTERM)

    def test_it_is_found_behind_a_symbolic_link_and_by_path(self):
        self.laboratory("exit 7")
        (self.folder / "bin").mkdir()
        (self.folder / "bin/tactilectl").symlink_to(self.folder / "tactilectl")
        self.assertEqual(subprocess.run([self.folder / "bin/tactilectl", "play"]).returncode, 7)
        self.assertEqual(subprocess.run(["tactilectl", "play"], env={"PATH": f"{self.folder}:/usr/bin:/bin"}).returncode, 7)


class Signals(unittest.TestCase):
    def test_an_interrupt_ends_the_verb_as_it_ends_any(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            with self.subTest(signal=number), tempfile.TemporaryDirectory() as folder:
                pty = pathlib.Path(folder) / "pty"
                player = subprocess.Popen([BIN / "tactilectl", "play", "--in", ROOT / "config/demo/table_demo.csv", "--pty", pty, "--format",
                                           "cobs", "--bits", "32", "--loop"], stderr=subprocess.DEVNULL)
                until = time.monotonic() + 20
                while not pty.is_symlink() and time.monotonic() < until:
                    time.sleep(0.01)
                self.assertEqual(os.readlink(f"/proc/{player.pid}/exe"), str(BIN / "tactilectl-lab"))
                player.send_signal(number)
                self.assertEqual(player.wait(timeout=60), 0)
                self.assertFalse(pty.is_symlink())


if __name__ == "__main__":
    unittest.main(verbosity=2)
