#!/usr/bin/env python3
"""A killed daemon is dead for every reader, and a stopped one hangs."""
import json
import os
import pathlib
import signal
import subprocess
import time
import unittest

from daemon import BIN, ctl, wait_for
from unit_daemon import quality_is, unit_daemon


class DeadDaemon(unittest.TestCase):
    def setUp(self):
        self.daemon = unit_daemon()
        self.addCleanup(self.daemon.__exit__)
        self.daemon.start()
        wait_for(quality_is(self.daemon, "good"), "a good sample")
        self.recorder = subprocess.Popen([BIN / "tactilectl", "record", self.daemon.folder / "a.mcap", "--node", self.daemon.name],
                                         stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(self.recorder.communicate)  # after kill(): cleanups run from the last to the first
        self.addCleanup(self.recorder.kill)
        wait_for((self.daemon.folder / "a.mcap").exists, "the recording")
        self.daemon.process.send_signal(signal.SIGKILL)
        self.daemon.process.wait()
        time.sleep(0.5)

    def test_every_reader_says_that_it_is_dead(self):
        pid = str(self.daemon.process.pid)
        for words in (("status",), ("read", "left"), ("top", "--count", "1")):
            done = self.daemon.ctl(*words)
            self.assertEqual(done.returncode, 3, (words, done))
            self.assertIn("is dead", done.stdout + done.stderr)
            self.assertIn(f"there is no process {pid}", done.stdout + done.stderr)
        self.assertNotIn(", open)", self.daemon.ctl("status").stdout)
        self.assertEqual(json.loads(self.daemon.ctl("status", "--json").stdout)["daemon"], "dead")
        self.assertFalse(json.loads(self.daemon.ctl("status", "--json").stdout)["links"][0]["open"])
        self.recorder.wait(timeout=60)  # the recorder was running when the daemon died
        error = self.recorder.stderr.read()
        self.assertEqual(self.recorder.returncode, 3)
        self.assertIn("is dead", error)
        done = ctl("record", self.daemon.folder / "b.mcap", "--node", self.daemon.name, "--seconds", "1")
        self.assertEqual(done.returncode, 3)
        self.assertFalse((self.daemon.folder / "b.mcap").exists())

    def test_a_killed_daemon_whose_parent_has_not_waited_for_it_is_dead(self):
        """A supervisor or a shell may leave the ended process as a zombie, which has a number and a name in /proc."""
        with unit_daemon() as d:
            d.start()
            wait_for(quality_is(d, "good"), "a good sample")
            os.kill(d.process.pid, signal.SIGKILL)  # Popen.send_signal() would wait for an ended process
            stat = pathlib.Path(f"/proc/{d.process.pid}/stat")
            wait_for(lambda: "(tactiled) Z" in stat.read_text(), "the zombie")
            time.sleep(0.5)
            for words in (("status",), ("read", "left"), ("top", "--count", "1")):
                done = d.ctl(*words)
                self.assertEqual(done.returncode, 3, (words, done))
                self.assertIn("is dead", done.stdout + done.stderr)
                self.assertNotIn("it hangs or was stopped", done.stdout + done.stderr)
            self.assertEqual(json.loads(d.ctl("status", "--json").stdout)["daemon"], "dead")
            findings = json.loads(ctl("doctor", "--json", "--config", d.config).stdout)["findings"]
            said = [(f["verdict"], f["says"]) for f in findings if f["check"] == "daemon"]
            self.assertEqual([verdict for verdict, _ in said], ["wrong"])
            self.assertIn("is dead", said[0][1])
            self.assertIn("(tactiled) Z", stat.read_text())  # it was a zombie until the end

    def test_a_stopped_daemon_hangs_and_is_not_dead(self):
        with unit_daemon() as d:
            d.start()
            wait_for(quality_is(d, "good"), "a good sample")
            d.process.send_signal(signal.SIGSTOP)
            time.sleep(0.5)
            done = d.ctl("status")
            d.process.send_signal(signal.SIGCONT)
            self.assertEqual(done.returncode, 1)
            self.assertIn("it hangs or was stopped", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
