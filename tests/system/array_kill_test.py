#!/usr/bin/env python3
"""The daemon is killed at random moments while it publishes arrays, and started again. No reader shows a mixture of two arrays,
an array beyond stale_ms, or a value in a BAD array; each is BAD watchdog_ms after the daemon's end, and has values after the next
start. KILLS=500 in the environment: a longer run, which prints its counts."""
import json
import os
import random
import shutil
import sys
import threading
import time
import unittest

from array_device import array_daemon
from array_ramp import HALF_COUNT_N, Ramp, Witnesses
from daemon import ROOT, wait_for
from web_server import PROGRAM, Web

sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

KILLS = int(os.environ.get("KILLS", 4))
WATCHDOG_MS = 250  # the default; a reader may show the values of a killed daemon for this time
T_S_MS = 0.1  # resolution of t_s

NO_DAEMON = {"quality": "bad"}


def is_bad(array):
    return array["quality"].startswith("bad")


def judged_ns(array, before_ns):
    """When the array was judged: tactiled-web gives all requests of one of its cycles one answer, which states its time."""
    return array["t_s"] * 1e9 if "t_s" in array else before_ns


def faults_of(array, before_ns, stale_ms):
    """The faults of an array as JSON that was asked for at this time."""
    forces = [force for axis in "xyz" for force in array[f"f{axis}_N"]]
    if is_bad(array):
        return ["a value in a BAD array"] if set(forces) != {None} or array["peak_N"] is not None else []
    found = [] if judged_ns(array, before_ns) - array["t_ns"] <= 1e6 * (stale_ms + T_S_MS) else ["old"]
    sizes = [abs(force) for force in forces if force is not None]
    return found if len(sizes) == len(forces) and max(sizes) - min(sizes) < HALF_COUNT_N else [*found, "a mixture"]


class Asker:
    """Asks the web server and tactilectl for the array, again and again. A context manager."""

    def __init__(self, daemon, web, stale_ms):
        self.stale_ms = stale_ms
        self.ways = {"tactilectl": lambda: json.loads(daemon.ctl("read", "skin", "--array", "--json").stdout or "null")}
        if web is not None:
            self.ways["tactiled-web"] = lambda: self.answer(*web.ask("/api/array?sensor=skin")[::2])
        self.faults, self.values, self.ended = [], dict.fromkeys(self.ways, 0), threading.Event()
        self.threads = [threading.Thread(target=self.run, args=(name,)) for name in self.ways]

    @staticmethod
    def answer(code, body):
        return json.loads(body) if code == 200 else None

    def run(self, name):
        while not self.ended.is_set():
            before_ns = time.monotonic_ns()
            array = self.ways[name]()
            if array is not None:  # there was a daemon
                self.faults += [(name, fault, array) for fault in faults_of(array, before_ns, self.stale_ms)]
                self.values[name] += not is_bad(array)

    def __enter__(self):
        for thread in self.threads:
            thread.start()
        return self

    def __exit__(self, *_):
        self.ended.set()
        for thread in self.threads:
            thread.join()


class Kills(unittest.TestCase):
    stale_ms = WATCHDOG_MS

    def restart(self):
        """Starts the daemon, unless it runs, and waits until every reader has its values."""
        if self.daemon.process.poll() is not None:
            self.daemon.start()
        for name, way in self.asker.ways.items():
            wait_for(lambda: not is_bad(way() or NO_DAEMON), f"a value of {name}")
        with tactiled.open(self.daemon.name, str(self.daemon.segment.parent)) as node:
            wait_for(lambda: node.array("skin").sample.quality != tactiled.BAD, "an array")
            self.assertEqual(node.header.pid, self.daemon.process.pid)

    def kill(self):
        """Returns when no reader shows values any more."""
        self.daemon.process.kill()
        self.daemon.process.wait()
        ended_ns = time.monotonic_ns()
        for name, way in self.asker.ways.items():
            wait_for(lambda: self.has_ended(way, ended_ns), f"the end of the values of {name}")

    def has_ended(self, way, ended_ns):
        before_ns = time.monotonic_ns()
        array = way()
        if array is None or is_bad(array):
            return True
        self.assertLessEqual(judged_ns(array, before_ns) - ended_ns, 1e6 * (WATCHDOG_MS + T_S_MS))
        return False

    def test_a_killed_daemon_has_no_values_and_the_next_one_has_its_own(self):
        dice = random.Random(KILLS)
        device = self.enterContext(Ramp(rows=32, columns=32, values=3, rate_Hz=1000))
        self.daemon = array_daemon(device, stale_ms=self.stale_ms)
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        web = self.enterContext(Web(self.daemon.name)) if PROGRAM.exists() else None
        if web is not None:
            self.addCleanup(shutil.rmtree, web.folder)
        with Witnesses(self.daemon.name, "skin", self.stale_ms, self.daemon.reader_env) as witnesses, Asker(self.daemon, web, self.stale_ms) as self.asker:
            for n in range(KILLS):
                time.sleep(dice.uniform(0, 0.03))
                self.kill()
                if n % 2 == 0:
                    self.restart()
                else:  # the next one is killed before it has published much
                    self.daemon.start()
            self.restart()
        if "KILLS" in os.environ:
            print(witnesses, self.asker.values, sep="\n")
        self.assertEqual(witnesses.faults(), {})
        self.assertEqual(self.asker.faults, [])
        self.assertTrue(all(self.asker.values.values()), self.asker.values)


class KillsOfASlowSensor(Kills):
    """Its values end with the daemon, before they are stale."""
    stale_ms = 5 * WATCHDOG_MS


if __name__ == "__main__":
    unittest.main()
