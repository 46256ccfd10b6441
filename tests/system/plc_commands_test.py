#!/usr/bin/env python3
"""Commands of PLCs: one that writes its block in every cycle across restarts, two that compete, each path's tare
limit, faults."""
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN  # noqa: E402
from held_force import FULL_SCALE_N, Held, wait_for  # noqa: E402
from plc_view import program  # noqa: E402

TARE, UNTARE, CLEAR = 1, 2, 3
DONE, REJECTED = 2, 3
OK, UNDER_LOAD, ADOPTED, REPEATED = 0, 9, 11, 12
FAULT = 8
DIRECT = slice(1, 4)  # DIRECT_CMD, DIRECT_STATE and DIRECT_RESULT of the registers from 50 on


class Cyclic(threading.Thread):
    """An I/O scanner: writes the command block and reads the global block in every cycle, through every reconnection."""

    def __init__(self, plc):
        super().__init__(daemon=True)
        self.plc, self.block, self.node, self.ended = plc, [0, 0, 0, 0, 0], [0] * 32, threading.Event()
        self.cycles = 0
        self.start()

    def run(self):
        while not self.ended.wait(0.01):
            self.plc.write(5000, *self.block)
            self.node = self.plc.read(0, 32)
            self.cycles += 1

    def wait_for_cycle(self):
        """Returns after a whole cycle that began after the call: what is in node was answered now."""
        until = self.cycles + 2
        wait_for(lambda: self.cycles >= until, "a whole cycle")

    def stop(self):
        self.ended.set()
        self.join()


class CyclicPlc(unittest.TestCase):
    def test_its_last_tare_does_not_run_again_when_the_daemon_restarts_under_a_load(self):
        for more in ("", 'zero_after = "forget"\n'):
            with Held(more + "tare_limit_N = 0\n") as held:
                plc = Cyclic(held.plc())
                self.addCleanup(plc.stop)
                wait_for(lambda: plc.node[27] == ADOPTED, "the first number")
                plc.block = [TARE, 1, 0, 0, 5]
                wait_for(lambda: plc.node[25] == 5 and plc.node[26] == DONE, "the tare")
                held.press(-20.0)
                for end in (signal.SIGTERM, signal.SIGKILL):
                    held.restart(end)
                    plc.wait_for_cycle()
                    wait_for(lambda: plc.node[25] == 5 and plc.node[27] == ADOPTED, "the old number to be adopted")
                    for _ in range(20):
                        quality, force_N = held.read_force()
                        self.assertLess(force_N, -19.9)
                        self.assertEqual(quality.split(":")[0], "uncertain" if more else "good")
                plc.block = [UNTARE, 1, 0, 0, 6]
                wait_for(lambda: plc.node[25] == 6 and plc.node[26] == DONE, "the next number")
                plc.stop()

    def test_it_reads_the_result_before_its_number_counts_as_repeated(self):
        with Held() as held:
            plc = held.plc()
            plc.write(5000, TARE, 1, 0, 0, 1)
            seen = []

            def is_repeated():
                plc.write(5000, TARE, 1, 0, 0, 2)
                outcome = plc.outcome()
                if outcome != (2, 1, OK) and outcome not in seen[-1:]:  # it runs
                    seen.append(outcome)
                return outcome[2] == REPEATED
            wait_for(is_repeated, "its number to count as repeated")
            self.assertEqual(seen, [(2, DONE, OK), (2, DONE, REPEATED)])
            before = plc.read(50, 1)[0]
            for _ in range(100):
                plc.write(5000, TARE, 1, 0, 0, 2)
            self.assertGreaterEqual(plc.read(50, 1)[0], before + 100)


class StoppedDaemon(unittest.TestCase):
    def test_commands_that_waited_for_it_and_whose_senders_gave_up_do_not_run(self):
        with Held() as held:
            plc = held.plc()
            plc.command(1, TARE, 1)
            held.press(-10.0)
            self.assertEqual(plc.command(2, TARE, 1), (2, DONE, OK))
            held.daemon.process.send_signal(signal.SIGSTOP)
            time.sleep(0.1)
            user = subprocess.Popen([BIN / "tactilectl", "tare", "--remove", "left", "--node", held.daemon.name],
                                    env=held.daemon.reader_env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            for at, values in ((5000, (UNTARE, 1, 0, 0, 3)), (5011, (1,))):
                with socket.create_connection(("127.0.0.1", held.daemon.port)) as other:
                    data = struct.pack(f">HHB{len(values)}H", at, len(values), 2 * len(values), *values)
                    other.sendall(struct.pack(">HHHBB", 1, 0, 2 + len(data), 1, 16) + data)
            time.sleep(1.2)
            user.kill()
            user.wait()
            held.daemon.process.send_signal(signal.SIGCONT)
            time.sleep(1)
            self.assertAlmostEqual(held.read_force()[1], 0.0, delta=0.1, msg="the tare is in force")
            self.assertEqual(plc.command(3, UNTARE, 1), (3, DONE, OK), "the PLC writes it again")
            self.assertAlmostEqual(held.read_force()[1], -10.0, delta=0.1)


class TwoPlcs(unittest.TestCase):
    def test_each_is_told_of_its_own_commands_alone(self):
        with Held() as held:
            one, other = held.plc("127.0.0.1"), held.plc("127.0.0.2")
            self.assertEqual(one.command(5, TARE, 1), (5, REJECTED, ADOPTED))
            self.assertEqual(other.command(5, TARE, 1), (5, REJECTED, ADOPTED))
            self.assertEqual(one.command(6, TARE, 1), (6, DONE, OK))
            self.assertEqual(other.outcome(), (5, REJECTED, ADOPTED), "the other's number 6 has not been written yet")
            self.assertEqual(other.command(6, CLEAR, 2), (6, REJECTED, 2))
            self.assertEqual(one.outcome(), (6, DONE, OK))
            self.assertEqual(one.block(), [TARE, 1, 0, 0, 6])
            self.assertEqual(other.block(), [CLEAR, 2, 0, 0, 6])

    def test_two_at_one_address_share_one_block(self):
        with Held() as held:
            one, other = held.plc(), held.plc()  # two PLCs behind one router
            one.command(1, TARE, 1)
            self.assertEqual(one.command(2, TARE, 1), (2, DONE, OK))
            self.assertEqual(other.outcome(), (2, DONE, OK), "the result of the first one")
            self.assertEqual(other.command(2, UNTARE, 1), (2, REJECTED, REPEATED), "its number is used")

    def test_a_reconnected_one_goes_on_and_a_repeated_number_runs_nothing(self):
        with Held() as held:
            plc = held.plc()
            plc.command(1, TARE, 1)
            self.assertEqual(plc.command(2, TARE, 1), (2, DONE, OK))
            plc.close()
            again = held.plc()
            self.assertEqual(again.outcome(), (2, DONE, OK))
            count = again.read(120, 1)
            self.assertEqual(again.command(2, TARE, 1), (2, DONE, REPEATED))
            self.assertEqual(again.command(2, UNTARE, 1), (2, REJECTED, REPEATED))
            self.assertEqual(again.read(120, 1), count)
            self.assertEqual(again.command(3, TARE, 1), (3, DONE, OK))
            self.assertEqual(again.read(120, 1)[0], count[0] + 1)

    def test_both_command_all_the_time_and_each_gets_its_own_answers(self):
        with Held(modbus="max_requests_per_s = 0\n") as held:
            failures = []

            def command(plc, own):
                mask = 1 if own else 2  # the mask of the other PLC contains no existing sensor
                plc.command(1, 8, mask)
                for number in range(2, 100):
                    while (outcome := plc.command(number, 8, mask)) == 6:  # busy with the other PLC's command
                        pass
                    if outcome != ((number, DONE, OK) if own else (number, REJECTED, 2)):
                        failures.append((own, number, outcome))

            threads = [threading.Thread(target=command, args=(held.plc(f"127.0.0.{1 + i}"), i == 0)) for i in range(2)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            self.assertEqual(failures, [])


class TareLimit(unittest.TestCase):
    def test_a_held_force_beyond_a_fifth_of_full_scale_is_refused_on_every_path(self):
        with Held() as held:
            plc = held.plc()
            plc.command(1, TARE, 1)
            number = 1
            for force_N, result in ((-0.22 * FULL_SCALE_N, UNDER_LOAD), (-0.18 * FULL_SCALE_N, OK)):
                held.press(force_N)
                state = REJECTED if result else DONE
                ended = lambda: plc.read(50, 8)[2] != 1  # noqa: E731
                self.assertEqual(held.daemon.ctl("tare", "left").returncode, 1 if result else 0)
                number += 1
                self.assertEqual(plc.command(number, TARE, 1), (number, state, result))
                self.assertEqual(plc.write_one(5010, 1), 0)
                wait_for(ended, "the tare by a register")
                self.assertEqual(plc.read(50, 8)[DIRECT], [TARE, state, result])
                self.assertEqual(plc.write_coil(0), 0)
                wait_for(ended, "the tare by a coil")
                self.assertEqual(plc.read(50, 8)[DIRECT], [TARE, state, result])
                self.assertEqual(plc.read(54, 1)[0], 2 if result else 4)
                quality, seen_N = held.read_force()
                self.assertAlmostEqual(seen_N, force_N if result else 0, delta=0.02)


class Faults(unittest.TestCase):
    def test_tactilectl_clear_clears_what_is_latched(self):
        with Held(commands=False) as held:
            plc = held.plc()
            held.device.is_silent = True
            wait_for(lambda: plc.read(FAULT, 1)[0] & 1, "sensor lost")
            held.device.is_silent = False
            held.settle()
            self.assertTrue(plc.read(FAULT, 1)[0] & 1, "it is latched")
            cleared = held.daemon.ctl("clear")
            self.assertEqual((cleared.returncode, cleared.stdout), (0, "clear: done; a fault whose cause lasts comes back\n"))
            wait_for(lambda: plc.read(FAULT, 1)[0] == 0, "the fault to be cleared")

    def test_fault_clear_s_clears_them_for_a_plc_that_may_not_write(self):
        with Held(commands=False, node="fault_clear_s = 1\n") as held:
            plc = held.plc()
            held.device.is_silent = True
            wait_for(lambda: plc.read(FAULT, 1)[0] & 1, "sensor lost")
            time.sleep(1.5)
            self.assertTrue(plc.read(FAULT, 1)[0] & 1, "the cause lasts")
            began = time.monotonic()
            held.device.is_silent = False
            wait_for(lambda: plc.read(FAULT, 1)[0] == 0, "the fault to clear itself")
            self.assertGreater(time.monotonic() - began, 0.9)


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
                                        ({"HAS_GRAVITY": True, "GRAVITY_X": 40.0}, [0, 0, 0], True), ({"HAS_GRAVITY": False}, [0, 0, 0], False)):
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

    def test_an_acceleration_keeps_its_words_until_a_slower_fieldbus_has_written_them(self):
        with Held() as held:
            plc = held.plc()
            stated = lambda: plc.client.read_holding_registers(5311, count=4).registers  # noqa: E731
            self.scan(plc)
            self.assertEqual(stated(), [0x8000, 0x8000, 0x8000, 0], "nothing was measured")
            self.scan(plc, HAS_ACCEL=True, ACCEL_X=1.5, ACCEL_Z=-0.25, writes=False)
            self.scan(plc, HAS_ACCEL=False, writes=False)
            self.scan(plc, HAS_ACCEL=False)
            self.assertEqual(stated(), [1500, 0, -250 & 0xFFFF, 1])
            self.scan(plc, HAS_ACCEL=True, ACCEL_X=40.0)
            self.assertEqual(stated(), [1500, 0, -250 & 0xFFFF, 1], "a value out of range is not confirmed")
            self.command = self.program.instance("FB_TACTILED_WRITE")  # the PLC restarts, and its count is another one
            self.scan(plc)
            self.assertEqual(self.command.value("WRITE_REGS")[11:], [0x8000, 0x8000, 0x8000, 0])
            self.assertEqual(stated()[:3], [0x8000] * 3)


if __name__ == "__main__":
    unittest.main(verbosity=2)
