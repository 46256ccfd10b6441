#!/usr/bin/env python3
"""The folder of the segment: readers in C, C++ and Python refuse one in which others can write, /dev/shm has to be named, and a file
that is truncated during a read ends no reader."""
import itertools
import os
import pathlib
import struct
import subprocess
import sys
import time
import unittest
import warnings

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, run_folder, wait_for  # noqa: E402
from python_reader import tactiled  # noqa: E402
from unit_daemon import quality_is, unit_daemon  # noqa: E402

STRANGER = 65534
IS_ROOT = os.geteuid() == 0


def ctl(*words, **env):
    return subprocess.run([BIN / "tactilectl", *map(str, words)], capture_output=True, text=True, timeout=60,
                          env={**os.environ, **{key: str(value) for key, value in env.items()}})


class AFolder(unittest.TestCase):
    def test_that_others_can_write_to_is_refused_by_every_reader(self):
        with unit_daemon() as d:
            folder = run_folder() / f"test-{os.getpid()}"
            folder.mkdir()
            self.addCleanup(folder.rmdir)
            d.env["TACTILED_RUNTIME_DIR"] = str(folder)
            d.start()
            wait_for(quality_is(d, "good"), "a good sample")
            for mode in (0o777, 0o1777, 0o775):
                folder.chmod(mode)
                for words in (("status",), ("read", "left"), ("tare", "left")):
                    done = d.ctl(*words)
                    self.assertEqual(done.returncode, 3, words)
                    self.assertIn("not a trusted folder", done.stderr)
                with self.assertRaisesRegex(tactiled.Error, "not a trusted folder"):
                    tactiled.open(d.name, str(folder))
            folder.chmod(0o755)
            self.assertEqual(d.ctl("status").returncode, 0)
            d.stop()

    def test_is_checked_by_python_as_by_c(self):
        with unit_daemon() as d:
            d.start()
            inner = run_folder() / f"test-{os.getpid()}" / "a"
            inner.mkdir(parents=True)
            self.addCleanup(lambda: (inner.rmdir(), inner.parent.rmdir()))
            copy = inner / f"tactiled.{d.name}"
            self.addCleanup(lambda: copy.unlink(missing_ok=True))
            link = inner.parent / "link"
            link.symlink_to(inner)
            self.addCleanup(link.unlink)

            def both(folder):
                try:
                    tactiled.open(d.name, str(folder)).close()
                    python = True
                except tactiled.Error as e:
                    python = False
                    self.assertNotIn("Errno", str(e))
                c = ctl("status", "--node", d.name, "--runtime-dir", folder).returncode != 3
                self.assertEqual(python, c, folder)
                return c
            copy.write_bytes(d.segment.read_bytes())
            copy.chmod(0o640)
            self.assertTrue(both(inner))
            self.assertFalse(both(link))
            self.assertFalse(both(f"{inner}/../a"))
            self.assertFalse(both("/tmp"))
            self.assertFalse(both("nowhere"))
            for path, mode in ((inner, 0o777), (inner.parent, 0o777), (copy, 0o660)):
                before = path.stat().st_mode
                path.chmod(mode)
                self.assertFalse(both(inner), path)
                path.chmod(before)
            if IS_ROOT:
                inner.parent.chmod(0o1777)
                self.assertTrue(both(inner))
                os.chown(inner, STRANGER, STRANGER)
                self.assertFalse(both(inner))
                os.chown(inner, 0, 0)
                inner.parent.chmod(0o755)
                for path in (copy, inner.parent):
                    os.chown(path, STRANGER, STRANGER)
                    self.assertFalse(both(inner), path)
                    os.chown(path, 0, 0)
                for path in (inner.parent, inner, copy):  # all of one user
                    os.chown(path, STRANGER, STRANGER)
                self.assertTrue(both(inner))
                for path in (inner.parent, inner, copy):
                    os.chown(path, 0, 0)
            self.assertTrue(both(inner))

    def test_dev_shm_is_used_only_where_it_is_named_and_with_a_warning(self):
        with unit_daemon() as d:
            d.env["TACTILED_RUNTIME_DIR"] = "/dev/shm"
            d.start()
            self.assertTrue(pathlib.Path(f"/dev/shm/tactiled.{d.name}").exists())
            wait_for(lambda: "any local user can create a segment" in d.log(), "the warning")
            wait_for(quality_is(d, "good"), "a good sample")
            done = d.ctl("status")
            self.assertEqual(done.returncode, 0)
            self.assertIn("warning: any local user", done.stderr)
            self.assertEqual(ctl("status", "--node", d.name).returncode, 3)
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                with tactiled.open(d.name, "/dev/shm") as node:
                    self.assertEqual(node.latest("left").force_S_N, (1.0, 2.0, -3.0))
            self.assertEqual([w.category for w in said], [RuntimeWarning])

    def test_a_program_of_layout_1_4_meets_the_daemon_in_dev_shm(self):
        """Uses the offsets of that version as numbers."""
        with unit_daemon() as d:
            d.env["TACTILED_RUNTIME_DIR"] = "/dev/shm"
            d.start()
            wait_for(quality_is(d, "good"), "a good sample")
            data = pathlib.Path(f"/dev/shm/tactiled.{d.name}").read_bytes()
        self.assertEqual(data[:8], b"TACTILED")
        byte_order, major, minor, header_size = struct.unpack_from("=IHHI", data, 8)
        self.assertEqual((byte_order, major), (0x01020304, 1))
        self.assertGreaterEqual((minor, header_size), (4, 512))
        n_sensors, sensor_offset, sensor_size = struct.unpack_from("=3I", data, 248)
        self.assertEqual(n_sensors, 1)
        self.assertEqual(data[sensor_offset:sensor_offset + 5], b"left\0")
        offset, slot_size, slots, record_size, head_offset = struct.unpack_from("=5I", data, sensor_offset + 160)
        number = struct.unpack_from("=I", data, head_offset)[0] - 1
        at = offset + number % slots * slot_size
        self.assertEqual(struct.unpack_from("=I", data, at)[0], 2 * number + 2)
        self.assertEqual(struct.unpack_from("=Q", data, at + 8)[0], number)
        self.assertEqual(struct.unpack_from("=3d", data, at + 8 + 56), (1.0, 2.0, -3.0))


class ATruncatedFile(unittest.TestCase):
    def test_ends_no_reader_and_the_next_daemon_is_followed(self):
        for length in (0, 4096, 100_000):
            with self.subTest(length), unit_daemon() as d:
                d.start()
                wait_for(quality_is(d, "good"), "a good sample")
                with open(d.folder / "out.csv", "w+") as out, tactiled.open(d.name) as node, node.follow("left", 0.5) as left:
                    reader = subprocess.Popen([BIN / "tactilectl", "read", "left", "--follow", "--csv", "--timeout", "0", "--node", d.name],
                                              stdout=out)
                    cxx = subprocess.Popen([BIN / "reader_cxx17", d.name, "left", "4"], stdout=subprocess.PIPE, text=True)
                    next(left)
                    wait_for(lambda: os.stat(out.name).st_size > 200, "rows")
                    os.truncate(d.segment, length)
                    wait_for(lambda: node.latest("left").quality == tactiled.BAD, "BAD")
                    rest = list(itertools.islice(left, 1000))
                    self.assertEqual(len([s for s in rest if s.reasons & tactiled.DAEMON_STOPPED]), 1)
                    self.assertTrue(rest[-1].reasons & tactiled.DAEMON_STOPPED)
                    self.assertNotEqual(d.process.wait(timeout=60), 0)  # its own mapping was truncated
                    self.assertIsNone(reader.poll())
                    d.start()
                    wait_for(lambda: node.latest("left").quality == tactiled.GOOD, "a value")
                    time.sleep(0.2)
                    reader.terminate()
                    self.assertIn(reader.wait(timeout=60), (0, 1))
                    self.assertEqual(cxx.wait(timeout=60), 0)
                    cxx.stdout.close()
                    out.seek(0)
                    rows = [row.split(",") for row in out.read().splitlines()[1:-1]]
                self.assertEqual({row[1:4][2] for row in rows}, {"-3", ""})
                self.assertEqual(rows[-1][3], "-3")


class Words(unittest.TestCase):
    def test_a_node_name_that_is_a_path_is_a_wrong_word(self):
        for verb in (("status",), ("read", "left"), ("tare", "all"), ("top", "--count", "1")):
            done = ctl(*verb, "--node", "../../x")
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("a name has the characters", done.stderr)

    def test_a_failed_write_is_exit_1(self):
        with unit_daemon() as d, open("/dev/full", "w") as full:
            d.start()
            wait_for(quality_is(d, "good"), "a good sample")
            for words in (("status",), ("status", "--json"), ("read", "left"), ("read", "left", "--follow", "--count", "300", "--csv")):
                done = subprocess.run([BIN / "tactilectl", *words, "--node", d.name], stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
                self.assertEqual(done.returncode, 1, words)
                self.assertIn("standard output", done.stderr)
            for words in (("check", "--help"), ("--version",), ("--help",), ("check", "--keys"), ("map",), ("check", d.config), ("simulate", "--help")):
                done = subprocess.run([BIN / "tactilectl", *words], stdout=full, stderr=subprocess.PIPE, text=True)
                self.assertEqual(done.returncode, 1, words)
            self.assertEqual(subprocess.run([BIN / "tactiled", "--help"], stdout=full, stderr=subprocess.PIPE).returncode, 74)
            piped = subprocess.run(f"{BIN}/tactilectl read left --follow --node {d.name} | head -n 3", shell=True, capture_output=True, text=True)
            self.assertEqual((piped.returncode, piped.stderr), (0, ""))


if __name__ == "__main__":
    unittest.main(verbosity=2)
