#!/usr/bin/env python3
"""The code that saves every file, with a failure at every system call: the old file or the new one is there, never
neither."""
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN  # noqa: E402

CALLS = "openat,write,fsync,close,rename,renameat,renameat2,unlink,unlinkat"
ERRORS = ("ENOSPC", "EIO", "EROFS", "EACCES", "EMFILE")


class Save(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.labelled = cls.folder / "labelled.csv"
        rows = [(k % 7 - 3, k % 5 - 2, -(k % 11)) for k in range(60)]
        cls.labelled.write_text("t_s,c1,c2,c3,fx_N,fy_N,fz_N,session\n" + "".join(
            f"{k},{2 * x + 0.01 * (k % 3)},{2 * y + 0.01 * (k % 4)},{3 * z + 0.01 * (k % 5)},{x},{y},{z},{'ab'[k % 2]}\n" for k, (x, y, z) in enumerate(rows)))
        cls.new = cls.save()[1]
        cls.old = cls.new.replace(b"generic", b"generic ", 1) + b"# the old one\n"
        # Returns the calls from the first that names the temporary file to the last before the program reports
        # success: for each its name and its index among calls of that name in the whole run.
        cls.out.write_bytes(cls.old)
        log = cls.folder / "log"
        cls.save("strace", "-f", "-qq", "-e", f"trace={CALLS}", "-o", log)
        lines = [re.sub(r"^\d+ +", "", line) for line in log.read_text().splitlines()]
        first = next(i for i, line in enumerate(lines) if ".C.toml." in line)
        told = next(i for i, line in enumerate(lines) if i > first and re.match(r"write\([12],", line))
        cls.lines = lines[first:told]
        counts, cls.calls = {}, []
        for i, line in enumerate(lines[:told]):
            name = line.split("(")[0]
            counts[name] = counts.get(name, 0) + 1
            if i >= first:
                cls.calls.append((name, counts[name]))

    @classmethod
    def save(cls, *before):
        """Calibrates into C.toml; returns (exit status, its bytes, its output)."""
        cls.out = cls.folder / "C.toml"
        done = subprocess.run([*before, BIN / "tactilectl", "calibrate", "--model", "generic", "--method", "matrix", "--force", "--in",
                               cls.labelled, "--out", cls.out], capture_output=True, text=True, timeout=60)
        return done.returncode, cls.out.read_bytes() if cls.out.exists() else None, done.stderr

    def broken_at(self, name, number, how):
        self.out.write_bytes(self.old)
        result = self.save("strace", "-f", "-qq", "-o", "/dev/null", "-e", f"trace={name}", "-e", f"inject={name}:{how}:when={number}")
        left = [path for path in self.folder.iterdir() if path.name.endswith(".tmp")]
        for path in left:
            path.unlink()
        return *result, left

    def test_it_is_written_synced_renamed_and_its_folder_synced_before_it_is_called_saved(self):
        order = [line.split("(")[0] for line in self.lines]
        text = "\n".join(self.lines)
        self.assertRegex(text, r'openat\(.*"\S*\.C\.toml\.\d+\.tmp", O_WRONLY\|O_CREAT\|O_EXCL\|O_NOFOLLOW')
        at = [order.index("write"), order.index("fsync"), next(i for i, n in enumerate(order) if n.startswith("rename")),
              len(order) - 1 - order[::-1].index("fsync")]
        self.assertEqual(at, sorted(set(at)), text)
        self.assertRegex("\n".join(self.lines[at[2]:at[3]]), "O_DIRECTORY", "the second fsync is the folder's")

    def test_killed_at_any_call_it_leaves_the_old_file_or_the_new_one(self):
        seen = set()
        for name, number in self.calls:
            status, found, said, _ = self.broken_at(name, number, "signal=SIGKILL")
            self.assertNotEqual(status, 0, (name, number))
            self.assertIn(found, (self.old, self.new), (name, number))
            seen.add(found)
        self.assertEqual(seen, {self.old, self.new}, "killed before the rename and after it")
        self.assertGreaterEqual(len(self.calls), 6)

    def test_an_error_of_any_call_is_reported_and_leaves_no_half_of_a_file(self):
        told = 0
        for name, number in self.calls:
            for error in ERRORS:
                with self.subTest(call=(name, number), error=error):
                    status, found, said, left = self.broken_at(name, number, f"error={error}")
                    self.assertIn(found, (self.old, self.new))
                    self.assertIn(status, (0, 1))
                    if status == 0:
                        self.assertEqual(found, self.new, "said to be saved")
                    else:
                        told += 1
                        self.assertRegex(said, r"C\.toml: not saved: .*: \w")
                    if not name.startswith("unlink"):
                        self.assertEqual(left, [])
        self.assertGreaterEqual(told, 4 * len(ERRORS), "open, write, fsync and rename must each tell")

    def test_a_write_that_a_signal_interrupts_is_tried_again(self):
        for name, number in self.calls:
            if name == "write":
                self.assertEqual(self.broken_at(name, number, "error=EINTR")[:2], (0, self.new))

    def test_a_file_system_that_cannot_sync_a_folder_is_good_enough(self):
        last = [call for call in self.calls if call[0] == "fsync"][-1]
        self.assertEqual(self.broken_at(*last, "error=EINVAL")[:2], (0, self.new))


class Load(unittest.TestCase):
    """The code that reads every file, with a failure at each of its calls."""

    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        self.config = self.folder / "C.toml"
        self.config.write_text('[node]\nname = "' + 70_000 * "x" + '"\n')  # two pieces; the name is the error
        log = self.folder / "log"
        self.right = self.check("strace", "-f", "-qq", "-e", "trace=openat,read,fstat,newfstatat", "-o", log)
        self.assertIn("C.toml:2: [node]: name = ", self.right)
        counts, self.calls, reading = {}, [], False
        for line in log.read_text().splitlines():
            name = re.sub(r"^\d+ +", "", line).split("(")[0]
            counts[name] = counts.get(name, 0) + 1
            if "/C.toml" in line:
                reading = True
            elif reading:
                self.calls.append((name, counts[name]))
                if name == "read" and line.endswith("= 0"):
                    break
        self.assertEqual([name.replace("newfstatat", "fstat") for name, _ in self.calls], ["fstat", "read", "read", "read"])

    def check(self, *before):
        done = subprocess.run([*before, BIN / "tactilectl", "check", self.config], capture_output=True, text=True, timeout=60)
        self.assertNotEqual(done.returncode, 0)
        return done.stdout + done.stderr

    def broken_at(self, name, number, error):
        return self.check("strace", "-f", "-qq", "-o", "/dev/null", "-e", f"trace={name}", "-e", f"inject={name}:error={error}:when={number}")

    def test_a_disk_that_fails_is_reported_and_nothing_is_taken_from_half_a_file(self):
        for name, number in self.calls:
            said = self.broken_at(name, number, "EIO")
            self.assertRegex(said, r"C\.toml: cannot be (read|examined): Input/output error")
            self.assertNotIn("[node]", said)

    def test_a_read_that_a_signal_interrupts_is_tried_again(self):
        for name, number in self.calls[1:]:
            self.assertEqual(self.broken_at(name, number, "EINTR"), self.right)


if __name__ == "__main__":
    unittest.main(verbosity=2)
