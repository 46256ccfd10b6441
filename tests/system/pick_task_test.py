#!/usr/bin/env python3
"""A pick task end to end: a PLC that runs the printed function blocks alone teaches, picks, weighs, sorts and releases objects.

    pick_task_test.py              20 picks, a jaw damaged in 4 of them (1 minute)
    PICKS=100 pick_task_test.py    as many as the promise has: 0 wrong, and each of 20 damages reported

The robot and the objects are those of pick_bench.py; the PLC knows only the registers and its own commands. Each
object is taught by the register TEACH. One in five objects was never taught and must be reported as unknown.
"""
import math
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

from pymodbus.client import ModbusTcpClient

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, PATIENCE_S, Daemon  # noqa: E402
from pick_bench import GRASP, Robot, calibrate_skin  # noqa: E402
from plc_view import program  # noqa: E402
from simulated_sensors import SENSORS  # noqa: E402

PICKS = int(os.environ.get("PICKS", "20"))
SEED = int(os.environ.get("SEED", "7"))
KNOWN_kg = {1: 0.12, 2: 0.21, 3: 0.34, 4: 0.55}  # object's id: its true weight
STRANGE_kg = 0.45
TEACHINGS = 3
GRIP_N = 8.0
WITHIN = 0.03  # share of the weight: the estimator's target is 3 %

MOVES = 1 << 5                                             # WEIGHT_WHY: no damage
DAMAGES = {"shear dead": {"fx": 0, "fy": 0, "fz": 1}, "half gain": {"fx": 0.5, "fy": 0.5, "fz": 0.5},
           "axis reversed": {"fx": -1, "fy": -1, "fz": 1}}
VIEW, CYCLE = 600, 5300                                   # the PLC reads the view and writes the cycle
CLEAR_LATCHES, TEACH = 3, 10                               # CMD
GRASPED = 1 << 2                                           # STATUS
CLOSING, LIFTING, MOVING, OPENING = 1, 3, 4, 5             # GRIPPER_STATE
OPEN, LOST, STABLE, UNKNOWN = 0, 6, 2, 0xFFFF              # GRIP_STATE, WEIGHT_STATE, no value


class Plc:
    """A controller with a cycle of 20 ms that runs the printed function blocks alone: one read and one write in each cycle."""

    def __init__(self, port):
        self.client = ModbusTcpClient("127.0.0.1", port=port)
        assert self.client.connect()
        self.program = program()
        self.map, self.node, self.weight, self.command = (self.program.instance(f"FB_TACTILED{end}") for end in ("", "_NODE", "_WEIGHT", "_WRITE"))
        self.began, self.hint = time.monotonic(), {"HAS_GRAVITY": True, "GRAVITY_Z": 9.81}

    def scan(self, **inputs):
        answer = self.client.read_input_registers(VIEW, count=125, slave=1)
        self.program.now_ms = int((time.monotonic() - self.began) * 1000)
        self.map.call(VIEW_REGS=answer.registers, READ_DONE=True)
        node, weight = self.node.values, self.weight.values
        self.node.call(NODE=self.map.values["NODE"])
        self.weight.call(**{name: self.map.values[name] for name in ("NODE", "GRASP", "DOUBTS")})
        self.command.call(NODE=self.map.values["NODE"], **self.hint, **inputs)
        written = self.client.write_registers(CYCLE, self.command.values["WRITE_REGS"], slave=1)
        assert not written.isError(), written
        return {"status": node["STATUS"], "grip": weight["GRIP_STATE"], "state": weight["WEIGHT_STATE"], "slips": weight["SLIP_COUNT"],
                "latch": node["SLIP_LATCH"], "kg": weight["WEIGHT_KG"] if weight["HAS_WEIGHT"] else None, "sd_kg": weight["WEIGHT_SD_KG"],
                "object": weight["OBJECT_ID"], "probability": weight["OBJECT_PROB"], "grasps": weight["GRASPS"], "why": weight["WEIGHT_WHY"],
                "jaws": weight["WEIGHT_JAWS"], "ok": weight["OK"]}

    def say(self, gripper_state):
        self.hint["GRIPPER_STATE"] = gripper_state
        self.scan()

    def run(self, command, mask, parameter=0):
        self.scan(EXECUTE=False)
        self.scan(EXECUTE=True, CMD=command, MASK=mask, PARAM_L=parameter)
        self.wait(f"command {command}", lambda _: not self.command.values["BUSY"])
        assert self.command.values["DONE"], self.command.values["RESULT"]

    def wait(self, what, condition, seconds=PATIENCE_S):
        until = time.monotonic() + seconds
        while True:
            seen = self.scan()
            if condition(seen):
                return seen
            if time.monotonic() > until:
                raise AssertionError(f"waited {seconds} s for {what}; last seen {seen}")
            time.sleep(0.02)


class PickTask(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-pick-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        calibrate_skin(cls.folder / "skin.toml")

    def setUp(self):
        links = "".join(SENSORS["skin"]().toml(name, "quadratic") for name in ("left", "right"))
        self.daemon = Daemon(links + GRASP)
        text = self.daemon.config.read_text().replace("[modbus]\n", f'[modbus]\ncommands = true\nsettings = "{self.daemon.folder}/s.toml"\n')
        self.daemon.config.write_text(text)
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        for name in ("left", "right"):
            shutil.copy(self.folder / "skin.toml", self.daemon.folder / f"{name}-quadratic.toml")
        self.robot = Robot(self.daemon.folder, SEED)
        self.robot.start()
        self.addCleanup(self.robot.finish)
        self.daemon.start()
        self.plc = Plc(self.daemon.port)
        self.addCleanup(self.plc.client.close)
        self.plc.wait("a value of both jaws", lambda seen: seen["grip"] == OPEN)

    def pick(self, mass_kg, do=lambda seen: None):
        """Closes, waits for grasped, lifts, waits for a stable weight, calls `do`, and releases. Returns the state
        while the weight was stable, and its delay after the lift."""
        self.robot.offer(mass_kg)
        self.robot.live(0.25)  # the arm moves to the next object: the skins are free
        self.plc.say(CLOSING)
        self.robot.close(GRIP_N)
        grasped = self.plc.wait("grasped", lambda seen: seen["status"] & GRASPED)
        self.plc.say(LIFTING)
        self.robot.lift()
        lifted_s = time.monotonic()
        if self.robot.damaged:
            limit_s = self.robot.world_s + 1.5  # the PLC's limit for a weight
            stable = self.plc.wait("the end of the time for a weight", lambda _: self.robot.world_s > limit_s)
        else:
            stable = self.plc.wait("a stable weight", lambda seen: seen["ok"])
        stable["slid"] = stable["slips"] - grasped["slips"] & 0xFFFF
        stable["after_s"] = time.monotonic() - lifted_s
        self.plc.say(MOVING)
        do(stable)
        self.plc.say(OPENING)
        self.robot.open()
        self.plc.wait("open", lambda seen: seen["grip"] == OPEN and self.robot.is_open())
        return stable

    def teach(self, object_id):
        def one_more(_):
            self.plc.run(TEACH, 0, object_id)
        return one_more

    def test_every_object_goes_where_it_belongs(self):
        rng = random.Random(SEED)
        for object_id, mass_kg in KNOWN_kg.items():
            for _ in range(TEACHINGS):
                self.pick(mass_kg, self.teach(object_id))
        before = self.plc.scan()
        wrong, rows, slid, missed = [], [], 0, []
        for n in range(PICKS):
            object_id = rng.choice([0, *KNOWN_kg])
            mass_kg = KNOWN_kg.get(object_id, STRANGE_kg)
            if n % 5 == 4:
                damage, jaw = rng.choice(list(DAMAGES)), rng.choice(["left", "right"])
                self.robot.damaged = {jaw: DAMAGES[damage]}
                seen = self.pick(mass_kg)
                self.robot.damaged = {}
                if seen["state"] == STABLE or seen["object"] != 0 or not seen["why"] & ~MOVES or not seen["jaws"] >> (jaw == "right") & 1:
                    missed.append((n, damage, jaw, mass_kg, seen))
                continue
            seen = self.pick(mass_kg)
            slid += seen["slid"] > 0
            rows.append((abs(seen["kg"] - mass_kg) / mass_kg, abs(seen["kg"] - mass_kg) / seen["sd_kg"], seen["after_s"]))
            if seen["object"] != object_id or rows[-1][0] > WITHIN:
                wrong.append((n, object_id, mass_kg, seen))
        after = self.plc.scan()
        error, sds, after_s = zip(*rows)
        print(f"{PICKS} picks, {PICKS // 5} with a damaged jaw, {len(missed)} of these not reported; {len(wrong)} wrong; weight: worst error {100 * max(error):.2f} %, rms {100 * math.hypot(*error) / math.sqrt(len(rows)):.2f} %, "
              f"worst {max(sds):.1f} sd; {slid} with a slip told though nothing slid; stable {min(after_s):.2f} .. {max(after_s):.2f} s after the command to lift", file=sys.stderr)
        self.assertEqual(wrong, [])
        self.assertEqual(missed, [])
        self.assertLessEqual(slid, PICKS // 20)  # frames that a busy machine delays come in bursts: a force seems to
                                                 # jump
        self.assertEqual(after["grasps"] - before["grasps"], PICKS)

    def test_a_slip_between_two_scans_is_counted_and_stays_latched(self):
        before = self.plc.scan()
        self.robot.offer(KNOWN_kg[4])
        self.robot.live(0.25)
        self.robot.close(3.0)  # N: friction holds 0.8 * 3 * 2, less than 5.4
        self.plc.wait("grasped", lambda seen: seen["status"] & GRASPED)
        self.robot.lift()
        self.robot.live(1.5)  # the PLC does not read
        self.robot.open()
        self.robot.live(0.3)
        seen = self.plc.wait("open or lost", lambda seen: seen["grip"] in (OPEN, LOST))
        self.assertGreater(seen["slips"] - before["slips"] & 0xFFFF, 0)
        self.assertNotEqual(seen["latch"], 0)
        self.plc.run(CLEAR_LATCHES, 3)
        self.plc.wait("the latch to be clear", lambda seen: seen["latch"] == 0)

    def test_a_contact_threshold_beyond_the_calibration_is_refused(self):
        wrong = self.daemon.folder / "wrong.toml"
        wrong.write_text(self.daemon.config.read_text().replace('link = "usb-left"\n', 'link = "usb-left"\ncontact_on_N = 290\n', 1))
        checked = subprocess.run([BIN / "tactilectl", "check", wrong], capture_output=True, text=True)
        self.assertEqual(checked.returncode, 1, checked)
        self.assertRegex(checked.stderr, "wrong.toml:[0-9]+: .*contact_on_N = 290 is not below the full scale")
        good = subprocess.run([BIN / "tactilectl", "check", self.daemon.config], capture_output=True, text=True)
        self.assertEqual((good.returncode, "faces no other" in good.stdout), (0, False), good)

    def test_one_silent_jaw_is_no_weight(self):
        self.lose({"right"})

    def test_two_silent_jaws_are_no_weight(self):
        self.lose({"left", "right"})

    def lose(self, names):
        self.pick(KNOWN_kg[3], lambda _: None)
        self.robot.offer(KNOWN_kg[3])
        self.robot.live(0.25)
        self.robot.close(GRIP_N)
        self.plc.wait("grasped", lambda seen: seen["status"] & GRASPED)
        self.robot.lift()
        self.plc.wait("a stable weight", lambda seen: seen["state"] == STABLE)
        self.robot.silent = names
        gone = self.plc.wait("no value", lambda seen: seen["grip"] == UNKNOWN)
        for _ in range(25):  # and stays so, whatever the other skin delivers
            self.assertIsNone(gone["kg"])
            self.assertEqual((gone["object"], gone["grip"]), (0, UNKNOWN))
            time.sleep(0.02)
            gone = self.plc.scan()


if __name__ == "__main__":
    unittest.main(verbosity=2)
