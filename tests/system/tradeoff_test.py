"""tactilectl tradeoff: its output is complete and marks unknown values; other parsers read its files."""
import csv
import json
import math
import pathlib
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree as xml

from daemon import BIN, ROOT

SCENES = ROOT / "config/scenes"
METHODS = {"hair": {"sum_diff", "matrix", "physics"}}
LABELLED = ROOT / "tests/data/eflesh/normal_labelled.csv"


def tradeoff(*words):
    return subprocess.run([BIN / "tactilectl", "tradeoff", *map(str, words)], capture_output=True, text=True)


class Tradeoff(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def hair(self, *words):
        done = tradeoff("--scene", SCENES / "tradeoff_hair_combined.toml", "--samples", 200, *words)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def skin(self):
        """Returns a calibration of a real skin with two methods."""
        calibration = self.folder / "skin.toml"
        for method in ("quadratic",):
            subprocess.run([BIN / "tactilectl", "calibrate", "--model", "generic", "--method", method, "--in", LABELLED, "--session", "1",
                            "--out", calibration], check=True, capture_output=True)
        return calibration

    def test_the_csv_has_a_row_a_method_and_scene_and_one_over_all(self):
        self.hair("--csv", self.folder / "t.csv")
        with open(self.folder / "t.csv") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual({r["method"] for r in rows}, METHODS["hair"])
        self.assertEqual([r["scene"] for r in rows if r["method"] == "physics"], ["tradeoff_hair_combined", "all"])
        for row in rows:
            self.assertGreater(float(row["rms_percent"]), 0)
            self.assertLess(float(row["rms_percent"]), 10)
            self.assertLessEqual(float(row["fz_rms_percent"]), float(row["fz_99_percent"]))
            self.assertLessEqual(float(row["p50_ns"]), float(row["p99_9_ns"]))
            self.assertAlmostEqual(sum(float(row[k]) for k in ("good_percent", "uncertain_percent", "bad_percent")), 100, delta=0.1)
            self.assertEqual(row["mx_rms_percent"], "")  # hairs do not measure moments: empty, not 0
        self.assertTrue(any(row["front"] == "1" for row in rows))

    def test_the_json_has_a_schema_and_null_where_nothing_is_known(self):
        page = json.loads(self.hair("--json"))
        self.assertEqual(page["schema"], 1)
        (model,) = page["models"]
        self.assertEqual(model["model"], "hair")
        self.assertTrue(model["sentence"].startswith("hair: "))
        for method in model["methods"]:
            for scene in method["scenes"]:
                self.assertIsNone(scene["mx_rms_percent"])
                if scene["instructions"] is None:
                    self.assertTrue(any("perf_event_open" in note for note in page["notes"]))
                else:
                    self.assertGreater(scene["instructions"], 50)

    def test_the_figure_is_xml_and_names_every_method(self):
        self.hair("--svg", self.folder / "t.svg")
        texts = {"".join(t.itertext()) for t in xml.parse(self.folder / "t.svg").iter("{http://www.w3.org/2000/svg}text")}
        self.assertLessEqual(METHODS["hair"] | {"hair"}, texts)

    def test_the_table_says_where_instructions_are_not_counted(self):
        text = self.hair()
        self.assertIn("hair: ", text)
        self.assertTrue("perf_event_open" in text or "instr." in text)

    def test_your_own_calibration_over_your_own_readings(self):
        done = tradeoff("--calibration", self.skin(), "--in", LABELLED, "--samples", 200, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        (method,) = json.loads(done.stdout)["models"][0]["methods"]
        (here, _) = method["scenes"]
        self.assertEqual((method["method"], here["scene"], here["samples"]), ("quadratic", "normal_labelled", 7200))
        self.assertLess(here["fz_rms_percent"], 3)
        self.assertTrue(math.isfinite(here["good_but_off_5sd_percent"]))

    def test_a_lost_electrode_is_bad_and_not_an_error(self):
        done = tradeoff("--scene", SCENES / "tradeoff_capacitive_damaged.toml", "--samples", 50, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        methods = {m["method"]: m["scenes"][0] for m in json.loads(done.stdout)["models"][0]["methods"]}
        self.assertGreater(methods["ratio"]["bad_percent"], 50)  # it needs all five
        self.assertLess(methods["ratio"]["rms_percent"], 10)
        self.assertEqual(methods["overlap"]["bad_percent"], 0)   # it works with four, and reports it
        self.assertGreater(methods["overlap"]["uncertain_percent"], 50)

    def test_what_is_asked_wrongly_is_said(self):
        skin = self.skin()
        for words, said in ((("--calibration", skin), "--scene"), (("--in", LABELLED), "--calibration"),
                            (("--calibration", skin, "--scene", SCENES / "tap.toml"), "has no channel"),
                            (("--scenes", self.folder), "tradeoff_table_calibrate"),
                            (("--svg", self.folder / "nowhere/t.svg"), "no file can be written")):
            done = tradeoff(*words, "--samples", 10)
            self.assertEqual(done.returncode, 2, (words, done.stdout, done.stderr))
            self.assertIn(said, done.stderr + done.stdout)


if __name__ == "__main__":
    unittest.main()
