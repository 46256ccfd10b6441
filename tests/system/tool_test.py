#!/usr/bin/env python3
"""The wrench on the gripper, end to end: a wrist sensor that carries a hand of 0.8 kg, whose weight a guided verb measures while
a robot reports gravity through Modbus; then 20 other poses. Shared memory, registers and a recording must agree.
"""
import json
import math
import pathlib
import random
import re
import struct
import subprocess
import sys
import threading
import time
import unittest

from pymodbus.client import ModbusTcpClient

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, ROOT, wait_for  # noqa: E402
from guided_hand import begin, guide  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

G_m_s2, MASS_kg, CENTRE_m, POSITION_m = 9.80665, 0.8, (0.004, 0.012, -0.03), (0.0, 0.0, -0.12)
ZERO = (3.1, -2.2, 1.4, 0.05, 0.02, -0.08)
TOOL, TOOL_FLOATS, PLC_WATCHDOG, GRAVITY_X, WARN_HINTS = 60, 2030, 5021, 5040, 1 << 9
CONFIG = """[tool]

[[tool.sensor]]
sensor = "wrist"
x_S_in_G = [0, 1, 0]
z_S_in_G = [0, 0, 1]
position_G_mm = [0, 0, -120]
"""


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def to_S(v):  # x of S is y of G, z is z
    return (v[1], -v[0], v[2])


def gravity(tilt, towards):
    return (G_m_s2 * math.sin(tilt) * math.cos(towards), G_m_s2 * math.sin(tilt) * math.sin(towards), G_m_s2 * math.cos(tilt))


class Plc:
    """Writes gravity, once it has been told, five times a second until it stops; and reads registers. A stall of the machine
    that is shorter than the watchdog matters to no test but that of the watchdog."""

    def __init__(self, port):
        self.client, self.lock = ModbusTcpClient("127.0.0.1", port=port), threading.Lock()
        wait_for(self.client.connect, "the registers")
        self.gravity, self.stopped = None, threading.Event()
        self.watch(60_000)
        self.thread = threading.Thread(target=self.repeat, daemon=True)
        self.thread.start()

    def repeat(self):
        while not self.stopped.wait(0.2):
            if self.gravity is not None:
                self.write(self.gravity)

    def watch(self, ms):
        wait_for(lambda: self.write_once(PLC_WATCHDOG, [ms]), "the write to be taken")

    def write(self, gravity):
        self.gravity = gravity
        wait_for(lambda: self.write_once(GRAVITY_X, gravity), "the write to be taken")

    def write_once(self, at, values):
        """Returns False for "busy", the answer of a daemon that stood still for a second."""
        with self.lock:
            self.wrote_s = time.monotonic()
            answer = self.client.write_registers(at, values, slave=1)
        assert not answer.isError() or answer.exception_code == 6, answer
        return not answer.isError()

    def read(self, at, count):
        with self.lock:
            return self.client.read_input_registers(at, count=count, slave=1).registers

    def stop(self):
        self.stopped.set()
        self.thread.join()

    def close(self):
        self.stop()
        self.client.close()


class Tool(unittest.TestCase):
    def setUp(self):
        self.daemon, self.devices = begin(self, CONFIG, {"wrist": 6, "finger": 3}, commands=True)
        self.plc = Plc(self.daemon.port)
        self.addCleanup(lambda: self.plc.close())
        self.node = tactiled.open(self.daemon.name)
        self.random = random.Random(3)

    def turn(self, tilt, towards, force=(0, 0, 0), told=True):
        """The hand in another pose; the robot reports it, to 0.1 degrees."""
        g = gravity(tilt, towards)
        weight = tuple(MASS_kg * x for x in g)
        arm = tuple(c - p for c, p in zip(CENTRE_m, POSITION_m))
        torque = tuple(a + b for a, b in zip(cross(arm, weight), cross(tuple(-p for p in POSITION_m), force)))
        self.devices["wrist"].reading = [z + f for z, f in zip(ZERO, (*to_S(tuple(w + f for w, f in zip(weight, force))), *to_S(torque)))]
        if told:
            off = gravity(tilt + self.random.uniform(-0.0017, 0.0017), towards + self.random.uniform(-0.0017, 0.0017))
            self.tell(off)

    def tell(self, g):
        self.plc.write([round(x * 1000) & 0xFFFF for x in g])
        time.sleep(0.3)

    def fit(self, poses):
        steps = [lambda i=i: self.turn(0.2 + 2.4 * i / poses, 2.4 * i) for i in range(poses)]
        status, printed = guide(self.daemon, ["tool-fit", "--poses", poses, "--seconds", 0.5], steps)
        self.assertEqual(status, 0, printed)
        lines = printed[printed.index("[[tool.sensor]]"):]
        text = self.daemon.config.read_text()
        self.daemon.config.write_text(text[:text.index("[[tool.sensor]]")] + lines)
        self.daemon.process.send_signal(1)
        wait_for(lambda: "changed the grasp or the tool" in self.daemon.log(), "the reload")
        return lines

    def test_the_weight_of_a_hand_is_measured_and_compensated(self):
        lines = self.fit(6)
        self.assertAlmostEqual(float(re.search(r"mass_kg = (\S+)", lines)[1]), MASS_kg, delta=0.004)
        worst_N, worst_Nm, worst_sds = 0, 0, 0
        for _ in range(20):
            self.turn(math.acos(self.random.uniform(-1, 1)), self.random.uniform(0, 2 * math.pi))
            time.sleep(1.3)
            seen = [self.node.tool for _ in range(20) if time.sleep(0.01) is None]
            self.assertEqual({tool.quality for tool in seen}, {tactiled.GOOD}, seen[0])
            mean = [sum(tool.force_G_N[k] for tool in seen) / len(seen) for k in range(3)]
            worst_N = max(worst_N, math.hypot(*mean))
            worst_Nm = max(worst_Nm, math.hypot(*seen[-1].torque_G_Nm))
            worst_sds = max(worst_sds, *(abs(f) / sd for tool in seen for f, sd in zip(tool.force_G_N, tool.sd_force_N)))
        print(f"20 poses of a hand of {MASS_kg} kg: at most {worst_N:.4f} N remain, {100 * worst_N / MASS_kg / G_m_s2:.2f} % of its weight, "
              f"and {worst_Nm:.4f} Nm; {worst_sds:.1f} sd", file=sys.stderr)
        self.assertLess(worst_N, 0.01 * MASS_kg * G_m_s2)
        self.assertLess(worst_sds, 4)

        # A force of the world, in registers and in a recording as in shared memory.
        force = (2.0, -1.0, 5.0)
        self.turn(0.7, 1.0, force)
        time.sleep(1.3)
        tool = self.node.tool
        for seen, right in zip(tool.force_G_N, force):
            self.assertAlmostEqual(seen, right, delta=0.1)
        registers = self.plc.read(TOOL, 20)
        self.assertEqual(registers[0], registers[19])
        self.assertTrue(registers[1] >> 8 & 1, registers)
        for seen, right in zip(struct.unpack(">3h", struct.pack(">3H", *registers[2:5])), tool.force_G_N):
            self.assertAlmostEqual(seen * 0.01, right, delta=0.03)
        self.assertEqual(registers[14:16] + registers[17:18], [1, 0, 800])
        floats = self.plc.read(TOOL_FLOATS, 28)
        by_sensor = self.plc.read(2500, 28)
        none = self.plc.read(2528, 28)
        self.assertEqual(none[1], 1 << 15)
        for block in (floats, by_sensor):
            for seen, right in zip(struct.unpack(">3f", struct.pack(">6H", *block[2:8])), tool.force_G_N):
                self.assertAlmostEqual(seen, right, delta=0.03)
        recorded = self.daemon.folder / "tool.mcap"
        done = subprocess.run([BIN / "tactilectl", "record", recorded, "--seconds", "1", "--node", self.daemon.name], capture_output=True,
                              text=True, env=self.daemon.reader_env)
        self.assertEqual(done.returncode, 0, done)
        data = recorded.read_bytes()
        self.assertIn(f"/{self.daemon.name}/tool/wrench".encode(), data)
        self.assertIn(b"tactiled_msgs/msg/Tool", data)
        replayed = subprocess.run([BIN / "tactilectl", "replay", recorded], capture_output=True, text=True)
        self.assertEqual(replayed.returncode, 0, replayed)

        # A sensor that is silent, and a robot that falls silent.
        self.devices["wrist"].is_silent = True
        wait_for(lambda: self.node.tool.quality == tactiled.BAD, "the sum to have no value")
        self.assertTrue(math.isnan(self.node.tool.force_G_N[0]))
        registers = self.plc.read(TOOL, 20)
        self.assertEqual((registers[1] >> 15, registers[2:8], registers[15]), (1, [0x8000] * 6, 1))
        self.devices["wrist"].is_silent = False
        wait_for(lambda: self.node.tool.quality == tactiled.GOOD, "the sum to be back")
        self.plc.write([0x8000] * 3)
        wait_for(lambda: self.node.tool.quality == tactiled.BAD, "no sum without gravity")
        self.assertIn("gravity", tool_json(self.daemon)["why"])

    def test_gravity_of_a_plc_that_stopped_expires(self):
        self.fit(6)
        self.turn(0.5, 0.3)
        wait_for(lambda: self.node.tool.quality == tactiled.GOOD, "the sum")
        self.plc.watch(2000)
        self.plc.stop()
        wait_for(lambda: self.node.tool.quality == tactiled.BAD, "no sum with the gravity of a dead PLC")
        self.assertGreaterEqual(time.monotonic() - self.plc.wrote_s, 2)
        wait_for(lambda: self.plc.read(9, 1)[0] & WARN_HINTS, "the warning")
        self.assertEqual(self.plc.read(7, 1)[0] & 0x5000, 0x5000, "STATUS: the PLC is silent, a warning")
        self.assertIn("gravity", tool_json(self.daemon)["why"])
        self.assertEqual(self.plc.client.read_holding_registers(GRAVITY_X, count=3, slave=1).registers, [0x8000] * 3)

        def is_back():
            self.plc.write(self.plc.gravity)
            return self.node.tool.quality == tactiled.GOOD and not self.plc.read(9, 1)[0] & WARN_HINTS
        wait_for(is_back, "the sum of a PLC that is back, and the end of the warning")

    def test_a_tare_in_one_pose_holds_in_another(self):
        self.fit(6)
        self.turn(0.5, 0.3)
        done = self.daemon.ctl("tare", "wrist")
        self.assertEqual(done.returncode, 0, done)
        self.turn(2.0, 3.0)
        time.sleep(1.3)
        tool = self.node.tool
        self.assertEqual(tool.quality, tactiled.GOOD, tool)
        self.assertLess(math.hypot(*tool.force_G_N), 0.02 * MASS_kg * G_m_s2)
        self.plc.close()
        self.daemon.stop()  # the next run has the tare, and not the pose of it
        self.daemon.start()
        node = tactiled.open(self.daemon.name)
        self.plc = Plc(self.daemon.port)
        self.turn(1.0, 1.0)
        time.sleep(0.5)
        self.assertEqual(node.tool.quality, tactiled.BAD)
        self.assertIn("tare", tool_json(self.daemon)["why"])
        done = self.daemon.ctl("tare", "wrist")
        self.assertEqual(done.returncode, 0, done)
        wait_for(lambda: node.tool.quality == tactiled.GOOD, "the sum after another tare")


def tool_json(daemon):
    return json.loads(daemon.ctl("status", "--json").stdout)["tool"]


if __name__ == "__main__":
    unittest.main()
