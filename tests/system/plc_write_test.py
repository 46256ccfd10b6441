#!/usr/bin/env python3
"""The generated FB_TACTILED and FB_TACTILED_WRITE beside the daemon: commands, hints, and a network that is slower than the task."""
import pathlib
import signal
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from held_force import Held, wait_for  # noqa: E402
from interop.pymodbus_client import write_and_read  # noqa: E402
from plc_view import program  # noqa: E402

TARE, UNTARE, CLEAR = 1, 2, 3
DONE = 2
OK, UNDER_LOAD, ADOPTED = 0, 9, 11


class FunctionBlock(unittest.TestCase):
    """The generated FB_TACTILED and FB_TACTILED_WRITE, run against the daemon like a PLC's task: one read and one write a cycle."""

    def setUp(self):
        self.program = program()
        self.map, self.left, self.command = (self.program.instance(f"FB_TACTILED{end}") for end in ("", "_SENSOR", "_WRITE"))
        self.inputs = {name: 0 for name in ("CMD", "MASK", "PARAM_H", "PARAM_L")} | {"EXECUTE": False}

    def scan(self, plc, writes=True, **inputs):
        time.sleep(0.02)
        self.program.now_ms += 20
        self.map.call(VIEW_REGS=plc.read(600, 125), READ_DONE=True)
        self.left.call(SENSOR=self.map.values["SENSOR"][0])
        self.command.call(NODE=self.map.values["NODE"], **inputs)
        if writes:
            self.exception = plc.write(5300, *self.command.values["WRITE_REGS"])

    def until_valid(self, plc):
        def is_valid():
            self.scan(plc)
            return self.left.values["FRESH"] and self.command.values["WRITES_ARRIVE"] and plc.read(10, 1)[0] & 1
        wait_for(is_valid, "a fresh read")

    def run_once(self, plc, seconds=30, **inputs):
        self.scan(plc, EXECUTE=False)
        until = time.monotonic() + seconds
        self.scan(plc, EXECUTE=True, **inputs)
        while self.command.values["BUSY"] and time.monotonic() < until:
            self.scan(plc)
        return [self.command.value(name) for name in ("DONE", "ERROR", "RESULT")]

    def test_it_tares_across_restarts_and_repeats_nothing(self):
        with Held() as held:
            plc = held.plc()
            self.until_valid(plc)
            for count in (1, 2):
                self.assertEqual(self.run_once(plc, CMD=TARE, MASK=1), [True, False, OK])
                self.assertEqual(plc.read(120, 1), [count])
            for _ in range(50):
                self.scan(plc)
            self.assertEqual(plc.read(120, 1), [2], "a cyclic write runs nothing again")
            held.press(-25.0)
            self.assertEqual(self.run_once(plc, CMD=TARE, MASK=1), [False, True, UNDER_LOAD])
            held.restart(signal.SIGKILL)
            self.until_valid(plc)
            self.assertAlmostEqual(self.left.values["FZ_N"], -25, delta=0.05)
            wait_for(lambda: self.scan(plc) or plc.outcome()[2] == ADOPTED, "the old number to be adopted")
            self.assertEqual(self.run_once(plc, CMD=UNTARE, MASK=1), [True, False, OK])
            self.assertEqual(plc.read(120, 1), [0])

    def test_a_command_that_times_out_is_withdrawn(self):
        with Held() as held:
            plc = held.plc()
            for _ in range(10):
                self.scan(plc)
            self.scan(plc, EXECUTE=True, CMD=TARE, MASK=1, TIMEOUT=1000, writes=False)
            for _ in range(60):
                self.scan(plc, writes=False)
            self.assertEqual([self.command.value(n) for n in ("BUSY", "ERROR", "RESULT")], [False, True, 7])
            self.assertEqual(self.command.value("WRITE_REGS")[:2], [0, 0])
            self.scan(plc)
            self.assertEqual(plc.read(120, 1), [0])
            self.assertEqual(self.run_once(plc, CMD=TARE, MASK=1, TIMEOUT=20000), [True, False, OK])

    def test_hints_are_written_and_nothing_said_leaves_them_as_configured(self):
        with Held() as held:
            plc = held.plc()
            self.scan(plc)
            gravity = {"GRAVITY_X": 0.0, "GRAVITY_Y": 6.937, "GRAVITY_Z": -6.937}
            for hint, words, is_bad in (({"HAS_GRAVITY": False}, [0, 0, 0], False), ({"HAS_GRAVITY": True, **gravity}, [0, 6937, -6937 & 0xFFFF], False),
                                        ({"HAS_GRAVITY": True, "GRAVITY_X": 40.0}, [0x8000] * 3, True), ({"HAS_GRAVITY": False}, [0, 0, 0], False)):
                self.scan(plc, **hint)
                self.assertEqual((self.command.value("WRITE_REGS")[8:11], self.command.value("BAD_GRAVITY")), (words, is_bad))

    def test_a_bad_hint_or_a_command_that_must_wait_takes_nothing_else_along(self):
        with Held("tare_ms = 2000\n") as held:
            plc, other = held.plc(), held.plc("127.0.0.2")
            self.until_valid(plc)
            for size, is_bad in ((9.69, True), (9.71, False), (9.89, False), (9.91, True), (0.0, True), (0.981, True)):
                self.scan(plc, HAS_GRAVITY=True, GRAVITY_X=0.0, GRAVITY_Y=0.6 * size, GRAVITY_Z=-0.8 * size, GRIPPER_STATE=7)
                self.assertEqual((self.exception, self.command.value("BAD_GRAVITY")), (0, is_bad))
                self.assertEqual(self.command.value("WRITE_REGS")[6:8], [0xFFFF, 0xFFFF], "no such state of the gripper, no stated force")
                self.assertEqual(plc.read(29, 1), [self.command.value("BEAT")], "the heartbeat is taken")
            other.command(1, TARE, 1)
            self.assertEqual(other.write(5000, TARE, 1, 0, 0, 2), 0)
            wait_for(lambda: plc.read(7, 1)[0] >> 8 & 1, "the other PLC's tare")
            self.scan(plc, EXECUTE=False)
            self.scan(plc, EXECUTE=True, CMD=CLEAR, MASK=1, GRIPPER_STATE=3)
            while plc.read(7, 1)[0] >> 8 & 1:
                self.scan(plc)
                self.assertEqual((self.exception, plc.read(29, 1)), (0, [self.command.value("BEAT")]))
            while self.command.values["BUSY"]:
                self.scan(plc)
            self.assertEqual([self.command.value(name) for name in ("DONE", "RESULT")], [True, OK])
            self.assertEqual(other.outcome(), (2, DONE, OK))

    def in_force(self, plc):
        """Writes what the block has and reads the acceleration in force, by one request: no time passes between."""
        answer = write_and_read(plc.client, 5300, [*self.command.values["WRITE_REGS"]], 5311, 4, slave=1)
        return answer.registers

    def test_an_acceleration_keeps_its_words_until_a_slower_fieldbus_has_written_them(self):
        with Held() as held:
            plc = held.plc()
            self.scan(plc)
            self.assertEqual(self.in_force(plc), [0x8000, 0x8000, 0x8000, 0], "nothing was measured")
            self.scan(plc, HAS_ACCEL=True, ACCEL_X=1.5, ACCEL_Z=-0.25, writes=False)
            self.scan(plc, HAS_ACCEL=False, writes=False)
            self.scan(plc, HAS_ACCEL=False, writes=False)
            self.assertEqual(self.in_force(plc), [1500, 0, -250 & 0xFFFF, 1])
            self.scan(plc, HAS_ACCEL=True, ACCEL_X=40.0, writes=False)
            self.assertEqual(self.command.value("WRITE_REGS")[11:], [1500, 0, -250 & 0xFFFF, 1], "a value out of range is not confirmed")
            self.command = self.program.instance("FB_TACTILED_WRITE")  # the PLC restarts, and its count is another one
            self.scan(plc, writes=False)
            self.assertEqual(self.command.value("WRITE_REGS")[11:], [0x8000, 0x8000, 0x8000, 0])
            self.assertEqual(self.in_force(plc)[:3], [0x8000] * 3)

    def test_an_acceleration_from_before_an_outage_is_not_a_new_one(self):
        with Held() as held:
            plc = held.plc()
            self.scan(plc)
            for count, (outage_ms, words) in enumerate(((60, [1500, 0, 0]), (100, [0x8000] * 3), (1900, [0x8000] * 3)), 1):
                self.scan(plc, HAS_ACCEL=True, ACCEL_X=1.5, writes=False)
                self.program.now_ms += outage_ms - 20  # a scan takes 20 ms
                self.scan(plc, HAS_ACCEL=False, writes=False)
                self.assertEqual(self.in_force(plc), [*words, count], f"{outage_ms} ms after its measurement")
            self.scan(plc, HAS_ACCEL=True, ACCEL_X=2.0, writes=False)
            self.assertEqual(self.in_force(plc)[:3], [2000, 0, 0])


if __name__ == "__main__":
    unittest.main(verbosity=2)
