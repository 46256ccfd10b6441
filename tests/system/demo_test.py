#!/usr/bin/env python3
"""The demo of node/run.sh in a terminal of 80 x 24, as the user of a machine that nobody prepared: keys inject faults and the live
view shows the quality, `tactilectl top` shows the same, and a second demo and a taken port are refused with the remedy."""
import fcntl
import os
import pathlib
import pty
import re
import select
import shutil
import signal
import socket
import struct
import subprocess
import tempfile
import termios
import time
import unittest

from daemon import BIN, ROOT, free_port

USER = 65534  # user "nobody"
COLUMNS, LINES = 80, 24
ESCAPE = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")


class Screen:
    """A program in a terminal. Each of its pictures begins with "home"."""

    def __init__(self, words, folder, env, before=()):
        self.master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", LINES, COLUMNS, 0, 0))
        self.process = subprocess.Popen([*before, *words], cwd=folder, env=env, stdin=slave, stdout=slave, stderr=slave, start_new_session=True)
        os.close(slave)
        self.text = ""

    def read(self, seconds):
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            if not select.select([self.master], [], [], left)[0]:
                return
            try:
                self.text += os.read(self.master, 65536).decode()
            except OSError:  # the program has ended
                return

    def lines(self):
        """Returns the lines of the last whole picture."""
        pictures = self.text.split("\x1b[H")
        whole = [p for p in pictures[1:] if p.endswith("\x1b[J")]
        return [ESCAPE.sub("", line).rstrip("\r") for line in whole[-1].split("\n")] if whole else []

    def wait(self, what, condition, seconds=60):
        """Waits until condition(lines) is true; returns the lines."""
        until = time.monotonic() + seconds
        while True:
            self.read(0.1)
            if self.lines() and condition(self.lines()):
                return self.lines()
            if time.monotonic() > until or self.process.poll() is not None:
                raise AssertionError(f"no {what}; the screen: " + "\n".join(self.lines() or [self.text[-1000:]]))

    def key(self, key):
        os.write(self.master, key.encode())

    def end(self):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGTERM)
        os.close(self.master)  # else the program may wait until somebody reads its pictures
        self.process.wait(timeout=60)


def line_of(lines, name):
    return next((line for line in lines if line.startswith(name)), "")


class Demo(unittest.TestCase):
    def setUp(self):
        """A clone in a folder with a space in its name, that belongs to a user without a session (no XDG_RUNTIME_DIR)."""
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled demo-", dir="/run" if os.geteuid() == 0 else None))
        self.addCleanup(shutil.rmtree, self.folder, True)
        for entry in ROOT.iterdir():
            if entry.name not in ("build", ".git"):
                (self.folder / entry.name).symlink_to(entry)
        (self.folder / "build").mkdir()
        (self.folder / "build/release").symlink_to(BIN.parent)
        # The folder name of a real clone: scripts find their paths from where they are.
        (self.folder / "node").unlink()
        shutil.copytree(ROOT / "node", self.folder / "node", ignore=shutil.ignore_patterns("__pycache__"))
        self.port = free_port()
        self.env = {"PATH": os.environ["PATH"], "HOME": str(self.folder), "LANG": "de_DE.UTF-8", "TERM": "xterm", "TACTILED_BUILT": "1",
                    "PORT": str(self.port), "PYTHONDONTWRITEBYTECODE": "1"}
        self.before = ()
        if os.geteuid() == 0 and all(path.stat().st_mode & 1 for path in (BIN, *BIN.parents)):
            for path in (self.folder, *self.folder.rglob("*")):
                os.chown(path, USER, USER, follow_symlinks=False)
            self.before = ("setpriv", f"--reuid={USER}", f"--regid={USER}", "--clear-groups")
        else:
            self.env["TACTILED_RUNTIME_DIR"] = str(self.folder / "run")
            (self.folder / "run").mkdir()

    def run_sh(self, **env):
        return subprocess.run([*self.before, "node/run.sh"], cwd=self.folder, env={**self.env, **env}, capture_output=True, text=True, timeout=60)

    def start(self):
        screen = Screen(["node/run.sh"], self.folder, self.env, self.before)
        self.addCleanup(screen.end)
        screen.wait("value of all sensors", lambda lines: all("GOOD" in line_of(lines, name) for name in ("left", "right", "skin")))
        return screen

    def test_keys_inject_faults_and_the_view_shows_them(self):
        screen = self.start()
        seen = screen.wait("weight", lambda lines: "stable" in line_of(lines, "grip"))
        kg, true_kg = re.search(r"weight (0\.\d+) \+- .* true (0\.\d+) kg", line_of(seen, "grip")).groups()
        self.assertLess(abs(float(kg) - float(true_kg)), 0.05 * float(true_kg))

        # top, in another terminal, shows the same sensors and the same fault.
        env = {**self.env, "TACTILED_RUNTIME_DIR": self.env.get("TACTILED_RUNTIME_DIR", str(self.folder / "build/demo/run"))}
        top = Screen([BIN / "tactilectl", "top", "--interval", "0.2"], self.folder, env, self.before)
        self.addCleanup(top.end)
        top.wait("good sensors", lambda lines: all("good" in line_of(lines, name) for name in ("left", "right", "skin")))
        screen.key("p")
        screen.wait("pause", lambda lines: any(line.startswith("paused with open jaws") for line in lines))
        time.sleep(0.3)
        for _ in range(3):
            tare = subprocess.run([*self.before, BIN / "tactilectl", "tare", "left"], cwd=self.folder, env=env, capture_output=True, text=True)
            self.assertEqual(tare.returncode, 0, tare.stderr)
        screen.key("p")
        self.assertTrue(any(line.startswith("key ") and line.endswith("q quit") for line in screen.lines()))
        screen.key("h")
        held = screen.wait("held object", lambda lines: any(line.startswith("held, so that") for line in lines))
        kg = re.search(r"weigh known (0\.\d+)", "\n".join(held)).group(1)
        known = subprocess.run([*self.before, BIN / "tactilectl", "weigh", "known", kg], cwd=self.folder, env=env, capture_output=True, text=True)
        self.assertEqual(known.returncode, 0, known.stderr)
        screen.key("h")
        screen.wait("next pick", lambda lines: "open" not in line_of(lines, "grip"))
        screen.key("u")
        screen.wait("unplugged jaw", lambda lines: "BAD" in line_of(lines, "left") and line_of(lines, "fault: the left jaw's cable"))
        top.wait("unplugged jaw", lambda lines: "bad" in line_of(lines, "left") and "good" in line_of(lines, "right"))
        screen.wait("pick that waits for the jaw", lambda lines: "no open gripper: grip unknown" in "\n".join(lines))
        screen.key("r")
        screen.wait("repaired jaw", lambda lines: "GOOD" in line_of(lines, "left") and line_of(lines, "fault: none"))
        top.wait("repaired jaw", lambda lines: "good" in line_of(lines, "left"))
        for lines in (top.lines(), screen.lines()):
            self.assertLessEqual(len(lines), LINES)
            self.assertLessEqual(max(len(line) for line in lines if "export" not in line), COLUMNS, "\n".join(lines))
        self.assertIn("export TACTILED_RUNTIME_DIR='", "\n".join(screen.lines()))  # quoted: the path has a space

        screen.key("f")
        screen.wait("frozen channel", lambda lines: "GOOD" not in line_of(lines, "left") and "frozen" in line_of(lines, "left"))
        screen.key("r")
        screen.wait("repaired jaw", lambda lines: "GOOD" in line_of(lines, "left"))
        screen.key("d")
        screen.wait("late bytes", lambda lines: "GOOD" not in line_of(lines, "left") and "contact" not in line_of(lines, "left"))
        screen.key("r")
        screen.wait("repaired jaw", lambda lines: "GOOD" in line_of(lines, "left"))
        screen.key("j")
        dead = screen.wait("pick without a weight", lambda lines: any("given up" in line and line.startswith("pick") for line in lines))
        self.assertNotIn("wrong, 0 given up", "\n".join(dead))
        self.assertRegex("\n".join(dead), r"pick \d+ given up: no [a-z ]+: grip [a-z]+, weight [a-z]+")
        self.assertIn(" 0 wrong", "\n".join(dead))
        screen.key("q")
        self.assertEqual(screen.process.wait(timeout=60), 0)
        screen.read(1)
        self.assertRegex(screen.text, r"\d+ objects were sorted into the right bin, 0 into a wrong one")
        self.assertFalse((self.folder / "build/demo/left").is_symlink())
        top.wait("ended daemon", lambda lines: "left" not in "\n".join(lines) or "dead" in "\n".join(lines))
        top.key("q")
        top.process.wait(timeout=60)

    def test_a_second_demo_leaves_the_first_alone(self):
        screen = self.start()
        second = self.run_sh(PORT=str(free_port()), PICKS="1")
        self.assertEqual((second.returncode, second.stdout.count("pick")), (1, 0))
        self.assertIn("a demo runs in this folder already", second.stderr)
        (self.folder / "build/demo/lock").unlink()  # another clone has its own lock
        third = self.run_sh(PORT=str(free_port()), PICKS="1")
        self.assertEqual((third.returncode, third.stdout.count("pick")), (1, 0))
        self.assertIn('a daemon named "gripper" runs already', third.stderr)
        self.assertNotIn("Traceback", third.stderr)
        time.sleep(0.5)
        screen.read(0.5)
        self.assertIn("GOOD", line_of(screen.wait("picture", bool), "left"))

    def test_a_taken_port_is_named_with_the_remedy(self):
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", self.port))
            taken.listen()
            done = self.run_sh(PICKS="1")
        self.assertEqual(done.returncode, 1)
        self.assertIn(f"another program serves port {self.port}", done.stderr)
        self.assertRegex(done.stderr, r"PORT=\d+ ./node/run.sh")
        self.assertNotIn("Traceback", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
