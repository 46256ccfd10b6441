#!/usr/bin/env python3
"""The grasp scenes with driver "sim", through the daemon: the weight in shared memory and in registers.

Each scene of config/scenes/grasp_*.toml has three jaws, each with its skin mounted in another orientation; they are
calibrated with the simulator's own scene, as their [[expect]] states. The test runs in real time, because limits in
ms must take ms.
"""
import concurrent.futures
import math
import pathlib
import shutil
import statistics
import struct
import sys
import tempfile
import time
import tomllib
import unittest

from pymodbus.client import ModbusTcpClient

sys.path.insert(0, str(pathlib.Path(__file__).parent))
sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "scenes"))
from daemon import ROOT, Daemon  # noqa: E402
from run import calibrate, constant_temperature  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

SCENES = ("grasp_ball", "grasp_egg_light", "grasp_egg", "grasp_egg_heavy")
WITHIN = 0.03  # share of the weight: the estimator's target is 3 %
INWARD = ([-1, 0, 0], [0.5, -0.8660254, 0], [0.5, 0.8660254, 0])  # z_S of the jaws, 120 degrees apart
NONE_I32 = -2 ** 31


def mounting(turn_deg, inward):
    """Returns x_S in G. The palm looks down, and a scene's weight pulls along -y of a skin without rotation."""
    turn = math.radians(turn_deg)
    across = [inward[1], -inward[0], 0]  # cross product of inward and z_G
    return [math.cos(turn) * across[0], math.cos(turn) * across[1], -math.sin(turn)]


def config_of(path, calibration, keys=None):
    """keys: of each sensor, beside the default ones."""
    scene = tomllib.loads(path.read_text())
    text = f'[[link]]\nname = "scene"\ndriver = "sim"\nscene = "{path}"\n\n'
    # The scenes' arm accelerates and brakes for 0.8 s after the weight has come onto the jaws.
    grasp = '[grasp]\ngravity_G_m_s2 = [0, 0, 9.81]\nlift_accelerates_ms = 900\nobjects = "objects.toml"\n'
    for i, sensor in enumerate(scene["sensor"]):
        text += (f'[[sensor]]\nname = "{sensor["name"]}"\nlink = "scene"\ndevice = {i}\nmodel = "hair"\n{constant_temperature(calibration) if keys is None else keys}calibration = "{calibration}"\n'
                 f'contact_on_N = 0.02\ncontact_off_N = 0.01\n\n')
        grasp += (f'\n[[grasp.jaw]]\nsensor = "{sensor["name"]}"\nx_S_in_G = {mounting(sensor["turn_deg"], INWARD[i])}\n'
                  f'z_S_in_G = {INWARD[i]}\n')
    end_s = sum(motion.get("for_s", motion.get("in_s", 0.5)) for motion in scene["motion"])
    return text + grasp, scene["body"]["mass_kg"], end_s


def grasp_of(node, sequence):
    """Returns the grasp of a node record; None: it is overwritten."""
    record = node._segment.node.read(sequence)
    return None if record is None else tactiled.Grasp._make(tactiled._GRASP.texts(tactiled._NODE.values(record)[-2], 0))


def watch(path, calibration, keys=None):
    """Returns the values of shared memory and Modbus over a whole scene: grasps, the mass, the number of frames in
    both, and differences."""
    text, mass_kg, end_s = config_of(path, calibration, keys)
    seen, same, differ = [], 0, []
    with Daemon(text) as daemon:
        daemon.start()
        client = ModbusTcpClient("127.0.0.1", port=daemon.port)
        client.connect()
        with tactiled.open(daemon.name) as node:
            until = time.monotonic() + end_s + 0.5
            while time.monotonic() < until:
                r = client.read_input_registers(0, count=32, slave=1).registers
                record, _ = node.snapshot()
                seen.append(record.grasp)
                g = grasp_of(node, record.sequence - (record.sequence - r[4] & 0xFFFF))  # the same frame
                if g is not None:
                    same += 1
                    weight = struct.unpack(">i", struct.pack(">HH", *r[20:22]))[0]
                    expected = NONE_I32 if math.isnan(g.weight_kg) else round(g.weight_kg * 1e4)
                    if (r[17], r[19]) != (g.state, g.weight_state) or abs(weight - expected) > 1:
                        differ.append((g, r))
                time.sleep(0.005)
        client.close()
        log = daemon.log()
    shutil.rmtree(daemon.folder)
    return seen, mass_kg, same, differ, log


class Scenes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-grasp-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.calibration = {}
        for name in SCENES:
            scene = tomllib.loads((ROOT / f"config/scenes/{name}.toml").read_text())
            of = scene["expect"][0]["calibration"].split(":")[1]
            cls.calibration[name] = cls.folder / f"{pathlib.Path(of).stem}.toml"
            if not cls.calibration[name].exists():
                calibrate(ROOT / "config/scenes" / of, "matrix", cls.calibration[name])

    def test_each_scene_is_grasped_weighed_and_let_go(self):
        with concurrent.futures.ThreadPoolExecutor(2) as pool:
            jobs = {name: pool.submit(watch, ROOT / f"config/scenes/{name}.toml", self.calibration[name]) for name in SCENES}
        for name, job in jobs.items():
            with self.subTest(name):
                seen, mass_kg, same, differ, log = job.result()
                self.assertEqual(differ, [], "shared memory and Modbus told different things of the same frame")
                self.assertGreater(same, 50)
                states = [g.state for g in seen]
                order = [state for i, state in enumerate(states) if i == 0 or state != states[i - 1]]
                stable = [g for g in seen if g.weight_state == tactiled.WEIGHT_STABLE]
                errors = [(g.weight_kg - mass_kg) / mass_kg for g in stable] or [math.nan]
                words = ["open", "contact", "grasped", "lifting", "holding", "slipping", "lost"]
                print(f"{name}: {1000 * mass_kg:.2f} g, {len(stable)} of {len(seen)} looks stable, error first {100 * errors[0]:.2f} %, "
                      f"median {100 * statistics.median(errors):.2f} %, {100 * min(errors):.2f} .. {100 * max(errors):.2f} %; "
                      f"sd {100 * max((g.weight_sd_kg for g in stable), default=math.nan) / mass_kg:.2f} %; "
                      + " ".join(words[s] if s < 7 else "unknown" for s in order), file=sys.stderr)
                self.assertGreater(len(stable), 20, log)
                self.assertLess(abs(errors[0]), WITHIN)  # the value of a PLC
                self.assertLess(abs(statistics.median(errors)), WITHIN)
                self.assertIn(tactiled.GRIP_HOLDING, states)
                self.assertEqual(seen[-1].grasps, 1)
                self.assertTrue(all(math.isnan(g.weight_kg) for g in seen if g.state in (tactiled.GRIP_OPEN, tactiled.GRIP_UNKNOWN)))

    def test_without_a_way_to_know_the_temperature_the_state_of_the_weight_says_so(self):
        bare = self.folder / "bare.toml"
        calibrate(ROOT / "config/scenes/calibrate_hair_wide.toml", "matrix", bare)
        seen, *_ = watch(ROOT / "config/scenes/grasp_egg.toml", bare, 'channels = ["H1", "H2", "H3", "H4", "-"]\n')
        states = {g.weight_state for g in seen}
        self.assertIn(tactiled.WEIGHT_TEMPERATURE, states)
        self.assertEqual(states & {tactiled.WEIGHT_OVERLOAD, tactiled.WEIGHT_STABLE}, set())


if __name__ == "__main__":
    unittest.main(verbosity=2)
