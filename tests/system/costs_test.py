#!/usr/bin/env python3
"""accuracy_costs: each cost with few samples. The physics is judged, never a time."""
import csv
import io
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, ROOT  # noqa: E402

NAMES = ["filter", "hairs", "converter", "fidelity", "map", "solver", "precision", "batch", "register"]


def accuracy_costs(*words, cwd=ROOT):
    return subprocess.run([BIN / "accuracy_costs", *map(str, words)], cwd=cwd, capture_output=True, text=True)


def cost(name, samples):
    """Returns {row: {column: number}}; rows of one name are a list."""
    done = accuracy_costs(name, "--samples", samples, "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["schema"] == 1 and answer["advice"].endswith("."), answer
    return answer["rows"]


class Physics(unittest.TestCase):
    def test_a_lower_cutoff_leaves_less_noise_and_comes_later_as_theory_says(self):
        rows = sorted(cost("filter", 50000), key=lambda row: row["cutoff_Hz"])
        for lower, higher in zip(rows, rows[1:]):
            self.assertLess(lower["noise_left"], higher["noise_left"])
            self.assertGreater(lower["delay_ms"], higher["delay_ms"])
        for row in rows:
            self.assertAlmostEqual(row["noise_left"] / row["noise_left_theory"], 1, delta=0.08)  # 50 s at 1 Hz: 3 sd
            self.assertAlmostEqual(row["delay_ms"], row["delay_theory_ms"], delta=1e-3)
        slow = rows[0]
        self.assertAlmostEqual(slow["delay_ms"], 205 / slow["cutoff_Hz"], delta=2)  # formula in node/low_pass.hpp

    def test_four_hairs_tell_half_of_what_one_tells_and_come_near_the_print(self):
        one, two, four = cost("hairs", 10000)
        self.assertAlmostEqual(one["normal_Pa"] / four["normal_Pa"], 2, delta=0.06)
        self.assertAlmostEqual(one["normal_Pa"] / two["normal_Pa"], 2**0.5, delta=0.05)
        self.assertAlmostEqual(one["shear_Pa"] / four["shear_Pa"], 2**0.5, delta=0.05)
        for row in (one, two, four):
            self.assertAlmostEqual(row["normal_Pa"] / row["normal_ideal_Pa"], 1, delta=0.04)
            self.assertAlmostEqual(row["shear_Pa"] / row["shear_printed_Pa"], 1, delta=0.13)
        self.assertIsNone(two["normal_printed_Pa"])

    def test_a_slower_conversion_is_quieter_and_half_of_it_late(self):
        rows = sorted(cost("converter", 5000), key=lambda row: row["rate_Hz"])
        for slower, faster in zip(rows, rows[1:]):
            self.assertLess(slower["fz_sd_mN"], faster["fz_sd_mN"])
            self.assertLess(slower["fx_sd_mN"], faster["fx_sd_mN"])
        for row in rows:
            self.assertAlmostEqual(row["delay_ms"], float(row["conversion"].split()[0]) / 2, delta=0.01)
            # 40.5 fF/N + 1.6 fF/N^2 at 2 N
            self.assertAlmostEqual(row["fz_sd_mN"], row["noise_aF"] / 43.7, delta=0.05 * row["fz_sd_mN"])

    def test_auto_keeps_within_the_wanted_accuracy_and_none_does_not(self):
        rows = cost("fidelity", 3000)
        for row in rows:
            self.assertLessEqual(row["auto_error_mN"], row["wanted_mN"], row["scene"])
            self.assertGreaterEqual(row["none_error_mN"], row["auto_error_mN"], row["scene"])
        self.assertTrue(any(row["none_error_mN"] > 2 * row["wanted_mN"] for row in rows))

    def test_a_denser_map_is_nearer(self):
        rows = cost("map", 300)
        self.assertIsNone(rows[0]["force_error_median"])  # all points are in it, so none is left to test
        errors = [row["force_error_median"] for row in rows[1:]]
        self.assertLess(errors[0], 0.005)
        self.assertLess(errors[1], 0.03)
        self.assertGreater(errors[-1], 10 * errors[1])

    def test_the_last_sample_leads_where_the_middle_does_not_and_overlap_needs_neither(self):
        by = {(row["solver"], row["most_steps"]): row for row in cost("solver", 320)}
        self.assertLess(by["map, from the last sample", 6]["force_error_90"], 1e-3)
        self.assertGreater(by["map, from the middle", 6]["force_error_90"], 0.1)
        self.assertLess(by["map, whole search", 0]["force_error_90"], 1e-4)
        for start in ("overlap, from first order", "overlap, from the last sample"):
            self.assertLess(by[start, 2]["force_error_90"], by[start, 1]["force_error_90"] / 100)
            self.assertLess(by[start, 8]["force_error_90"], 1e-12)

    def test_float_rounds_at_its_24_bits_and_double_at_its_53(self):
        for row in cost("precision", 320):
            bits = 24 if row["bytes_a_number"] == 4 else 53
            self.assertLess(row["error_of_full_scale"], 100 * 2.0**-bits, row["kernel"])
            self.assertGreater(row["error_of_full_scale"], 0.01 * 2.0**-bits, row["kernel"])

    def test_an_array_is_measured_up_to_four_by_four(self):
        rows = cost("batch", 64)
        self.assertEqual([row["taxels"] for row in rows], ["1", "2", "4", "8", "16"])
        for row in rows:
            self.assertTrue(all(row[column] > 0 for column in row if column.endswith("_ns")))

    def test_int16_is_off_by_half_a_step_inside_its_range_and_saturates_beyond(self):
        inside = 0
        for row in cost("register", 2000):
            if row["register"] == "float32":
                self.assertLessEqual(row["worst_error_N"], row["force_N"] * 2.0**-24)
                self.assertEqual(row["words"], 2)
            elif row["force_N"] <= 327.67:
                inside += 1
                self.assertLessEqual(row["worst_error_N"], 0.005 + 1e-12)
                self.assertEqual(row["saturated_share"], 0)
            else:
                self.assertGreater(row["saturated_share"], 0)
                self.assertGreater(row["worst_error_N"], 1)
        self.assertGreater(inside, 8)


class Files(unittest.TestCase):
    def test_csv_and_figure_say_what_the_table_says(self):
        with tempfile.TemporaryDirectory() as folder:
            table, figure = pathlib.Path(folder) / "a.csv", pathlib.Path(folder) / "a.svg"
            done = accuracy_costs("register", "--samples", 100, "--csv", table, "--svg", figure)
            self.assertEqual(done.returncode, 0, done.stderr)
            rows = list(csv.DictReader(io.StringIO(table.read_text())))
            self.assertEqual(len(rows), len(cost("register", 100)))
            drawn = "".join(xml.etree.ElementTree.parse(figure).getroot().itertext())
            self.assertIn("float32, two registers", drawn)
            self.assertIn("force, N", drawn)

    def test_a_cost_is_printed_as_json(self):
        done = accuracy_costs("filter", "--samples", 50, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        page = json.loads(done.stdout)
        self.assertEqual((page["schema"], page["cost"]), (1, "filter"))
        self.assertTrue(all(isinstance(row, dict) for row in page["rows"]))

    def test_every_figure_that_the_list_names_lies_there_and_a_page_shows_it(self):
        listed = accuracy_costs("list").stdout.splitlines()
        self.assertEqual([line.split()[0] for line in listed], NAMES)
        pages = "".join(page.read_text() for page in ROOT.glob("*/**/*.md"))
        for line in listed:
            path = ROOT / line[line.rindex("(") + 1 : -1]
            self.assertTrue(path.exists(), path)
            self.assertRegex(pages, rf"\]\((\.\./)?{re.escape(path.name)}\)")

    def test_what_is_wrong_is_said_with_what_to_do(self):
        for words, said in ((("fliter",), "did you mean filter?"),
                            (("all", "--svg", "a.svg"), "for one cost"), (("all", "--json"), "for one cost"),
                            (("list", "--svg", "l.svg"), "for one cost"), ((), "name is required"),
                            (("all", "--folder", "nowhere"), "no file can be written"),
                            (("filter", "--csv", "nowhere/t.csv"), "no file can be written"),
                            (("filter", "--samples", 0), "--samples")):
            done = accuracy_costs(*words)
            self.assertEqual(done.returncode, 2, words)
            self.assertIn(said, done.stderr + done.stdout)
        with tempfile.TemporaryDirectory() as elsewhere:
            for name, said in (("hairs", "--folder"), ("map", "--influence")):
                done = accuracy_costs(name, cwd=elsewhere)
                self.assertEqual(done.returncode, 2, name)
                self.assertIn(said, done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
