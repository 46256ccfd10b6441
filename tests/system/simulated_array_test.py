"""An array of a scene through the release daemon: driver "sim", model "patch" and the readers, against the scene's truth."""
import csv
import json
import os
import sys
import unittest

from daemon import ROOT, Daemon, ctl, wait_for

sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

SCENE = ROOT / "config/scenes/array_grid_fingers.toml"
CONFIG = f"""
[[link]]
name = "scene"
driver = "sim"
scene = "{SCENE}"
at_end = "again"

[[sensor]]
name = "skin"
link = "scene"
model = "patch"
calibration = "{ROOT}/config/calibration/array_grid.toml"
stale_ms = 1000
"""


class SimulatedArray(unittest.TestCase):
    def test_the_array_of_a_scene_meets_its_truth(self):
        with Daemon(CONFIG).start() as daemon:
            file = daemon.folder / "truth.csv"
            self.assertEqual(ctl("simulate", "--scene", SCENE, "--truth", file).returncode, 0)
            with open(file) as rows:
                truth = {round(float(row["t_s"]) * 500): row for row in csv.DictReader(rows)}
            os.environ["TACTILED_RUNTIME_DIR"] = str(daemon.segment.parent)
            with tactiled.open(daemon.name) as node:
                seen = {}

                def enough():
                    array = node.array("skin")
                    seen[array.sample.device_sequence] = array
                    return sum(a.sample.force_S_N[2] < -2 for a in seen.values()) > 100
                wait_for(enough, "100 arrays under a press")
            printed = json.loads(daemon.ctl("read", "skin", "--array", "--json").stdout.splitlines()[0])
            self.assertIn("skin", json.dumps(printed))
        errors = []
        for sequence, array in seen.items():
            row = truth.get(sequence)
            if row is None or array.sample.force_S_N[2] > -2:
                continue
            for force, sd, name in zip(array.sample.force_S_N, array.sample.sd_force_N, ("fx_N", "fy_N", "fz_N")):
                errors.append(abs(force - float(row[name])) / sd)
            for axis, name in enumerate(("cop_x_m", "cop_y_m")):
                errors.append(abs(array.cop_S_m[axis] - float(row[name])) / array.cop_sd_m[axis])
        self.assertGreater(len(errors), 200)
        self.assertLess(sum(error > 5 for error in errors), 0.005 * len(errors))

    def test_files_of_channels_are_refused(self):
        done = ctl("simulate", "--scene", SCENE, "--out", "/tmp/never.csv")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn('--out: "skin" is an array of taxels: use --truth', done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
