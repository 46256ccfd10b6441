#!/usr/bin/env python3
"""Readers that are compiled with the headers of older layouts read the wrench of an array and of an ordinary sensor from
today's segment: each sample has the numbers that today's reader gives.

tests/data/readers/VERSION.tar.gz has the headers of the last commit with that version:
git archive COMMIT node/include/tactiled | gzip -9n; `zcat ... | git get-tar-commit-id` prints the commit."""
import os
import pathlib
import shutil
import struct
import subprocess
import tarfile
import tempfile
import unittest

from array_device import ArrayDevice
from daemon import ROOT, Daemon, wait_for
from unit_daemon import CALIBRATION, CONFIG, play, quality_is

SOURCE = pathlib.Path(__file__).parent / "print_reader.c"
COUNT = 60
FZ = 9  # index of the word in a line
HEADERS = pathlib.Path("node/include/tactiled")


def compiled(root, program):
    """The program, compiled with the headers of the tree below `root`."""
    subprocess.run(["cc", "-std=gnu11", "-O2", "-I", root / HEADERS, SOURCE, "-o", program], check=True)
    return program


def force_N(line):
    return struct.unpack("<d", struct.pack("<Q", int(line[FZ], 16)))[0]


class OlderReaders(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-readers-"))
        cls.addClassCleanup(shutil.rmtree, folder)
        cls.programs = {"today": compiled(ROOT, folder / "today")}
        for path in (ROOT / "tests/data/readers").glob("*.tar.gz"):
            layout = path.name.removesuffix(".tar.gz")
            with tarfile.open(path) as archive:
                archive.extractall(folder / f"headers-{layout}")
            cls.programs[layout] = compiled(folder / f"headers-{layout}", folder / layout)

    def start(self, *command, env=None):
        """A daemon with the array "skin" and the sensor "left"."""
        skin = self.enterContext(ArrayDevice("skin"))
        self.daemon = Daemon(skin.config() + CONFIG, env=env)
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        (self.daemon.folder / "skin.toml").write_text(skin.calibration())
        (self.daemon.folder / "unit.toml").write_text(CALIBRATION)
        (self.daemon.folder / "rows.csv").write_text("t_s,c1,c2,c3\n0,1,2,-3\n0.01,1.01,2.01,-3.01\n")
        play(self.daemon)
        self.daemon.start(*command)
        wait_for(lambda: "bad" not in self.daemon.ctl("status").stdout, "values of both sensors")

    def begin(self, layout, *words):
        return subprocess.Popen([self.programs[layout], self.daemon.name, *map(str, words)], stdout=subprocess.PIPE, text=True, env=self.daemon.reader_env)

    def samples(self, reader):
        """{sequence: the words of its line}"""
        lines = [line.split() for line in reader.communicate(timeout=60)[0].splitlines()]
        self.assertEqual((reader.returncode, len(lines)), (0, COUNT))
        return {int(line[0]): line for line in lines}

    def compare(self, layout):
        for sensor, fz_N in (("skin", -2), ("left", -3)):
            with self.subTest(layout=layout, sensor=sensor):
                old, new = map(self.samples, [self.begin(name, sensor, COUNT) for name in (layout, "today")])
                both = old.keys() & new.keys()
                self.assertGreater(len(both), COUNT // 2)
                for sequence in both:
                    self.assertEqual(old[sequence], new[sequence])
                    self.assertAlmostEqual(force_N(old[sequence]), fz_N, delta=0.3)

    def expect_the_end(self, layout):
        """The readers have no value of a daemon that was killed."""
        for sensor in ("skin", "left"):
            self.assertEqual(self.begin(layout, sensor).communicate()[0][0], "1")
        self.daemon.process.kill()
        self.daemon.process.wait()
        for sensor in ("skin", "left"):
            wait_for(lambda: self.begin(layout, sensor).communicate()[0][0] == "3", "no value")

    def test_layout_1_7_in_the_daemons_folder(self):
        self.start()
        self.compare("1.7")
        self.expect_the_end("1.7")

    def test_layout_1_4_in_dev_shm(self):
        folder = "/dev/shm"
        self.start("sh", "-c", f'exec "$@" --runtime-dir {folder}', "sh", env={**os.environ, "TACTILED_RUNTIME_DIR": folder})
        self.compare("1.4")
        self.expect_the_end("1.4")


if __name__ == "__main__":
    unittest.main()
