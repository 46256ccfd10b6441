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


class ConfiguredGravity(unittest.TestCase):
    TOOL = """
[tool]
gravity_G_m_s2 = [0, 0, 9.81]

[[tool.sensor]]
sensor = "left"
x_S_in_G = [1, 0, 0]
z_S_in_G = [0, 0, 1]
mass_kg = 0.5
"""

    def test_it_is_in_force_after_a_restart_and_not_after_a_stated_one_has_ended(self):
        def is_known():
            return not plc.read(61, 1)[0] & 1

        def warns():
            return bool(plc.read(9, 1)[0] >> 9 & 1)

        def is_stated():
            plc.write(5040, 0, 0, 9800)
            return plc.client.read_holding_registers(5042, count=1).registers == [9800]

        with Held(self.TOOL, modbus="hints_expire_ms = 300\n") as held:
            plc = held.plc()
            for end in (signal.SIGTERM, signal.SIGKILL):
                wait_for(is_known, "the configured gravity")
                self.assertEqual(plc.client.read_holding_registers(5040, count=3).registers, [0x8000] * 3, "none was stated")
                wait_for(is_stated, "a stated gravity")
                wait_for(warns, "its end")
                self.assertFalse(is_known())
                self.assertEqual(plc.write(5040, *[0x8000] * 3), 0)
                wait_for(lambda: not warns(), "the end of the warning after it was withdrawn")
                self.assertFalse(is_known())
                held.restart(end)


if __name__ == "__main__":
    unittest.main(verbosity=2)
