#!/usr/bin/env python3
"""An allocation fails in the release daemon, each one in turn: it starts or reports the reason, reloads or keeps its
configuration, and never crashes.

    memory_test.py             a part of them: a minute
    EVERY=1 memory_test.py     each of start and reload
"""
import mmap
import os
import pathlib
import signal
import struct
import sys
import unittest

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusException

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "system"))
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402
from unit_daemon import CALIBRATION, CONFIG  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

LIBRARY = os.environ.get("NO_MEMORY_LIBRARY", str(BIN.parent / "tests/faults/libno_memory.so"))
EVERY = int(os.environ.get("EVERY", 0))
PARTS = 40  # without EVERY: this number of each kind
GRASP = """
[grasp]
gravity_G_m_s2 = [0, 0, 9.81]
friction = 0.7
objects = "objects.toml"

[[grasp.jaw]]
sensor = "left"
x_S_in_G = [0, 0, -1]
z_S_in_G = [1, 0, 0]
"""
OBJECTS = 'format = 1\n[[object]]\nid = 1\nname = "egg"\nmass_kg = 0.05\nsd_kg = 0.001\n'
FROM, HOW_MANY, FIRST_THREAD, COUNTED, REFUSED = range(5)
FOR_EVER = 2**60
CAL_ID = 28  # register


class Page:
    """The memory that libno_memory.so shares with this test."""

    def __init__(self, path):
        path.write_bytes(bytes(40))
        with open(path, "r+b") as file:
            self.memory = mmap.mmap(file.fileno(), 40)

    def __getitem__(self, at):
        return struct.unpack_from("<Q", self.memory, 8 * at)[0]

    def __setitem__(self, at, value):
        struct.pack_into("<Q", self.memory, 8 * at, value)

    def refuse(self, number, how_many, first_thread=False):
        for at, value in ((FROM, 0), (COUNTED, 0), (REFUSED, 0), (HOW_MANY, how_many), (FIRST_THREAD, first_thread), (FROM, number)):
            self[at] = value


class NoMemory(unittest.TestCase):
    def setUp(self):
        d = self.d = self.enterContext(Daemon(CONFIG + GRASP))
        for name, text in (("unit.toml", CALIBRATION), ("objects.toml", OBJECTS), ("rows.csv", "t_s,c1,c2,c3\n0,1,2,-3\n0.01,1,2,-3\n")):
            (d.folder / name).write_text(text)
        d.play("--in", d.folder / "rows.csv", "--pty", d.folder / "dev", "--format", "lines", "--sequence", "--rate", 200, "--loop")
        self.page = Page(d.folder / "no_memory")
        d.env.update(LD_PRELOAD=LIBRARY, NO_MEMORY=str(d.folder / "no_memory"), STATE_DIRECTORY=str(d.folder))
        self.identity = None  # of configuration and calibration, from the register
        self.segment = d.segment

    def is_good(self):
        try:
            with tactiled.open(self.d.name) as node:
                sample = node.latest("left")
        except tactiled.Error:
            return False
        return sample.quality == tactiled.GOOD and sample.force_S_N == (1.0, 2.0, -3.0)

    def calibration_id(self):
        client = ModbusTcpClient("127.0.0.1", port=self.d.port, timeout=1)
        try:
            return client.read_input_registers(CAL_ID, count=1, slave=1).registers[0] if client.connect() else None
        finally:
            client.close()

    def answers(self):
        client = ModbusTcpClient("127.0.0.1", port=self.d.port, timeout=1)
        try:
            return client.connect() and not client.read_input_registers(0, count=10, slave=1).isError()
        except (OSError, ModbusException):  # it ended after it had accepted
            return False
        finally:
            client.close()

    def numbers(self, count):
        """Returns the numbers of the allocations that are refused, out of `count`."""
        return range(1, count + 1, EVERY or max(1, count // PARTS))

    def start(self, number, how_many):
        """Returns its exit status, None if it runs."""
        (self.d.folder / "tactiled.log").unlink(missing_ok=True)
        self.page.refuse(number, how_many)
        try:
            self.d.start()
            return None
        except AssertionError:
            return self.d.process.returncode

    def check_start(self, number, how_many):
        status = self.start(number, how_many)
        if status is None:
            self.page[FROM] = 0  # memory is available again
            wait_for(lambda: self.d.process.poll() is not None or self.is_good() and self.answers(), f"good samples and registers; {self.d.log()}")
            status = self.d.process.poll()  # it was about to end
        if status is None:
            self.identity = self.identity or self.calibration_id()
            self.assertEqual(self.calibration_id(), self.identity)
            status = self.d.stop()[0]
            self.assertEqual(status, 0, self.d.log())
        else:
            self.assertIn(status, (69, 71), self.d.log())
            self.assertRegex(self.d.log(), "memory|Resource temporarily unavailable")
        self.assertFalse(self.segment.exists())
        return status

    def test_a_start_ends_with_a_reason_or_works(self):
        self.assertEqual(self.check_start(0, 0), 0)
        count = self.page[COUNTED]
        for how_many, kind in ((1, "one"), (FOR_EVER, "all from it on, until it is up")):
            statuses = []
            for number in self.numbers(count):
                with self.subTest(refused=kind, number=number):
                    statuses.append(self.check_start(number, how_many))
            print(f"start, {kind}: {len(statuses)} of {count} allocations, exit statuses "
                  f"{ {s: statuses.count(s) for s in sorted(set(statuses))} }", flush=True)
            self.assertEqual(len(statuses), len(self.numbers(count)))
            self.assertGreater(sum(s != 0 for s in statuses), 0, "nothing was refused")

    def reload(self):
        before = len(self.d.log())
        self.d.process.send_signal(signal.SIGHUP)
        wait_for(lambda: "SIGHUP: " in self.d.log()[before:] or self.d.process.poll() is not None, "an answer to SIGHUP")
        wait_for(lambda: self.d.log().endswith("\n"), "the end of the line")
        return self.d.log()[before:]

    def test_a_reload_changes_all_or_nothing(self):
        self.d.start()
        wait_for(self.is_good, "good samples")
        text = self.d.config.read_text().replace('name = "left"', 'name = "left"\ncontact_on_N = 0.2\nrate_Hz = 200')
        both = [text, text.replace("contact_on_N = 0.2", "contact_on_N = 0.3").replace("rate_Hz = 200", "rate_Hz = 201").replace("friction = 0.7", "friction = 0.6")]
        turn = 1
        self.d.config.write_text(both[turn])
        self.page.refuse(0, 0, first_thread=True)
        self.assertIn("SIGHUP: changed", self.reload())
        count = self.page[COUNTED]
        for how_many, kind in ((1, "one"), (10, "ten"), (FOR_EVER, "all from it on")):
            said = {"changed": 0, "refused": 0}
            for number in self.numbers(count):
                with self.subTest(refused=kind, number=number):
                    self.d.config.write_text(both[1 - turn])
                    self.page.refuse(number, how_many, first_thread=True)
                    answer = self.reload()
                    self.assertIsNone(self.d.process.poll(), self.d.log())
                    self.assertRegex(answer, "SIGHUP: (changed|refused)")
                    changed = "SIGHUP: changed" in answer
                    turn = 1 - turn if changed else turn
                    said["changed" if changed else "refused"] += 1
                    self.assertTrue(self.is_good())
            print(f"reload, {kind}: {sum(said.values())} of {count} allocations: {said}", flush=True)
            self.assertGreater(said["refused"], 0)
        self.page[FROM] = 0
        self.d.config.write_text(both[1 - turn])
        self.assertIn("SIGHUP: changed", self.reload(), "with memory it works again")
        self.assertEqual(self.d.stop()[0], 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
