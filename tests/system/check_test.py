#!/usr/bin/env python3
"""tactilectl check names what is wrong or unsafe in a configuration, with the line to write; doctor says the same."""
import json
import pathlib
import re
import shutil
import tempfile
import unittest

from daemon import ROOT, ctl
from unit_daemon import CALIBRATION, CONFIG


class Check(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-test-"))
        self.addCleanup(shutil.rmtree, self.folder)
        (self.folder / "unit.toml").write_text(CALIBRATION)

    def check(self, config, calibration=CALIBRATION):
        (self.folder / "unit.toml").write_text(calibration)
        (self.folder / "my.toml").write_text(config.replace("{folder}", str(self.folder)))
        return ctl("check", "my.toml", cwd=self.folder)

    def test_a_configuration_with_a_grasp_needs_no_folder_in_its_name(self):
        grasp = CONFIG + '\n[grasp]\n[[grasp.jaw]]\nsensor = "left"\nx_S_in_G = [1, 0, 0]\nz_S_in_G = [0, 1, 0]\n'
        done = self.check(grasp)
        self.assertEqual(done.returncode, 0, done.stderr)
        shutil.copytree(ROOT / "config", self.folder / "config")
        self.assertNotIn("filesystem error", ctl("check", "tactiled.toml", cwd=self.folder / "config").stderr)

    def test_four_channels_do_not_fit_a_calibration_of_three(self):
        done = self.check(CONFIG.replace("channels = 3", "channels = 4"))
        self.assertEqual(done.returncode, 1)
        self.assertIn("has 4 channels, the calibration has 3", done.stderr)
        named = CONFIG.replace("channels = 3", "channels = 4").replace("stale_ms", 'channels = ["c1", "-", "c2", "c3"]\nstale_ms')
        self.assertEqual(self.check(named).returncode, 0)

    def test_what_is_unsafe_is_named_with_the_line_to_write(self):
        done = self.check(CONFIG.replace("sequence = true\n", "").replace("stale_ms", "tare_limit_N = 0\nstale_ms"),
                          CALIBRATION.replace("100.0, 100.0, 100.0", "0.1, 0.1, 0.3"))
        self.assertEqual(done.returncode, 0, done.stderr)
        for said in ("no sequence", "no checksum", "rate_Hz = ", "frozen_after = ", "tare under any load", "contact_on_N = 0.5 is beyond",
                     "contact_on_N = 0.033"):
            self.assertIn(said, done.stdout)
        safe = CONFIG.replace("channels = 3\n", 'channels = 3\nchecksum = "crc16"\ntime_us = true\n')
        safe = safe.replace("stale_ms", "rate_Hz = 100\nstale_ms").replace("frozen_after = 0", "frozen_after = 100")
        self.assertIn("no monitor", self.check(safe).stdout)
        joint = "joint_domain.mean = [0.0, 0.0, 0.0]\njoint_domain.whitening = [[1.0], [0.0, 1.0], [0.0, 0.0, 1.0]]\njoint_domain.limit = 9.0\n"
        self.assertIn("the joint domain of an older version", self.check(safe, CALIBRATION + joint).stdout)
        monitor = "monitor.mean = [0.0, 0.0, 0.0]\nmonitor.scores = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\nmonitor.limit = 9.0\n"
        self.assertNotIn("warning", self.check(safe, CALIBRATION + monitor).stdout)

    def test_the_undetected_damage_of_a_calibration_is_stated_and_limited(self):
        self.assertIn("undetected damage of a channel is unknown: calibrate again", self.check(CONFIG).stdout)
        damage = "".join(f"undetected_damage.{kind} = [0.0, 0.0, {share}]\n"
                         for kind, share in (("stuck", 0.03), ("half_gain", 0.6), ("drifting", 0.3), ("exchanged", 0.0), ("zero", 0.0)))
        states = 'sensor "left": a channel at half gain is GOOD and wrong in 20.0 % of readings (mean over the channels; c3: 60.0 %)'
        self.assertIn(states + "\n", self.check(CONFIG, CALIBRATION + damage).stdout)
        limited = CONFIG.replace("stale_ms", "undetected_damage_limit = 0.1\nstale_ms")
        self.assertIn(states + "; above undetected_damage_limit = 0.1, so it is UNCERTAIN (not-redundant)",
                      self.check(limited, CALIBRATION + damage).stdout)
        self.assertNotIn("not-redundant", self.check(limited.replace("= 0.1", "= 0.21"), CALIBRATION + damage).stdout)
        self.assertIn("is unknown: calibrate again; it cannot be compared with undetected_damage_limit = 1, so it is UNCERTAIN",
                      self.check(limited.replace("= 0.1", "= 1"), CALIBRATION).stdout)
        # The mean 0.3 / 3 is not above 0.1 in double, and above it in float.
        equal = damage.replace("0.6]", "0.3]")
        self.assertNotIn("not-redundant", self.check(limited, CALIBRATION + equal).stdout)

    def test_loads_that_the_channels_cannot_show_are_named(self):
        self.assertIn("a press beside the places of the calibration (3 channels, 5 unknowns)", self.check(CONFIG).stdout)
        self.assertNotIn("change of the load", self.check(CONFIG).stdout)
        slow = self.check(CONFIG.replace("stale_ms = 2000", "delay_ms = 250\nstale_ms = 100")).stdout
        self.assertIn("a change of the load within the 500 ms over which the channels are measured, longer than stale_ms = ", slow)

    def test_a_misspelt_key_is_one_error(self):
        for key, wrong in (("model", "modle"), ("device", "devcie"), ("[[sensor]]", "[[sensr]]"), ("driver", "drivr"), ("channels", "chanels")):
            done = self.check(CONFIG.replace(key, wrong, 1))
            self.assertEqual(done.returncode, 1)
            lines = done.stderr.strip().splitlines()
            self.assertEqual(len(lines), 1, done.stderr)
            self.assertIn("did you mean", lines[0])

    def test_an_unknown_table_names_every_known_one(self):
        self.assertIn("known: node, realtime, link, sensor, modbus, shm, grasp, tool, gpio", self.check(CONFIG + "\n[xyzzy]\na = 1\n").stderr)

    def test_a_configuration_with_tabs_and_one_from_another_folder(self):
        tabs = re.sub(r" *= *", "\t=\t", CONFIG.replace("{folder}/unit.toml", "unit.toml")).replace("\nname", "\n\tname").replace("\n", "\r\n")
        self.assertEqual(self.check(tabs).returncode, 0, self.check(tabs).stderr)
        self.assertEqual(ctl("check", self.folder / "my.toml", cwd="/").returncode, 0)

    def test_a_small_sensor_is_told_the_count_of_its_registers(self):
        small = self.check(CONFIG, CALIBRATION.replace("100.0, 100.0, 100.0", "0.2, 0.2, 0.2"))
        self.assertIn("its full scale of 0.346 N is 35 counts of 0.01 N in the registers", small.stdout)
        self.assertIn("-> register_N = 0.0001", small.stdout)
        cured = self.check(CONFIG.replace("stale_ms", "register_N = 0.0001\nstale_ms"), CALIBRATION.replace("100.0, 100.0, 100.0", "0.2, 0.2, 0.2"))
        self.assertNotIn("registers", cured.stdout)
        large = self.check(CONFIG, CALIBRATION.replace("100.0, 100.0, 100.0", "900.0, 900.0, 900.0"))
        self.assertIn("beyond the registers, which end at 327.67 N", large.stdout)
        self.assertIn("register_N = 0.002 is no power of ten", self.check(CONFIG.replace("stale_ms", "register_N = 0.002\nstale_ms")).stderr)

    def test_a_hair_without_a_temperature_range_and_a_coarse_sensor_are_told_the_line(self):
        shutil.copy(ROOT / "config/calibration/hair_documents.toml", self.folder / "hair.toml")
        hair = CONFIG.replace("channels = 3", "channels = 4").replace('model = "generic"', 'model = "hair"').replace("unit.toml", "hair.toml")
        hair = hair.replace("frozen_after = 0\n", "")
        done = self.check(hair)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("every value is UNCERTAIN:temperature\n    -> temperature_range_C = [20, 24]", done.stdout)
        self.assertIn("counts as dead: a coarse sensor at rest does so, too\n    -> frozen_after = 0", done.stdout)
        cured = self.check(hair.replace("stale_ms", "temperature_range_C = [22, 22]\ntemperature_sd_K = 0.01\nfrozen_after = 0\nstale_ms"))
        self.assertNotIn("UNCERTAIN", cured.stdout)
        self.assertNotIn("counts as dead", cured.stdout)
        found = json.loads(ctl("doctor", "--json", "--config", self.folder / "my.toml").stdout)["findings"]
        self.assertNotIn("temperature", {f["check"] for f in found})
        self.assertIn("the standard deviation contains 0.5 K, which is so much that every value is UNCERTAIN:temperature",
                      self.check(hair.replace("stale_ms", "temperature_range_C = [22, 22]\nstale_ms")).stdout)
        self.check(hair)
        found = json.loads(ctl("doctor", "--json", "--config", self.folder / "my.toml").stdout)["findings"]
        self.assertTrue(any(f["check"] == "temperature" and f["remedy"].startswith("temperature_range_C = ") for f in found))

    def test_a_slow_sensor_is_told_its_stale_ms(self):
        rows = [f"{i / 10},{84000 - 2100 * load + i * 37 % 11},{load}" for i, load in enumerate(load for load in (0, -1, -2, -3, -5, -7, -10) for _ in range(20))]
        (self.folder / "cell.csv").write_text("t_s,c1,fz_N\n" + "\n".join(rows) + "\n")
        done = ctl("calibrate", "--model", "generic", "--in", "cell.csv", "--out", "cell.toml", cwd=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("stale_ms = 300  #", done.stdout)
        sensor = done.stdout[done.stdout.index("[[sensor]]"):]
        link = CONFIG[:CONFIG.index("[[sensor]]")].replace("channels = 3", "channels = 1")
        self.assertNotIn("an outage", self.check(link + sensor).stdout)
        quick = self.check(CONFIG.replace("stale_ms = 2000", "rate_Hz = 10\nstale_ms = 100")).stdout
        self.assertIn("its frames are 100 ms apart, and without one for stale_ms = 100 there is no value", quick)
        self.assertIn("-> stale_ms = 300", quick)

    def test_the_expected_standard_deviation_of_a_weight_is_printed(self):
        two = CONFIG + CONFIG.replace('"usb0"', '"usb1"').replace("/dev\"", "/dev1\"").replace('"left"', '"right"')
        jaw = '[[grasp.jaw]]\nsensor = "{}"\nx_S_in_G = [0, 0, -1]\nz_S_in_G = [{}, 0, 0]\n'
        grasp = two + "\n[grasp]\ngravity_G_m_s2 = [0, 0, 9.81]\n" + jaw.format("left", 1) + jaw.format("right", -1)
        done = self.check(grasp)
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = re.findall(r"weight: (\S+) kg, held with (\S+) N a jaw: expected sd (\S+) kg \(\S+ %\); after `weigh known (\S+)` (\S+) kg", done.stdout)
        self.assertEqual([row[0] for row in lines], ["3", "0.6"])  # half of 2 x 100 N x 0.5 / 1.5 / g = 6.8 kg, rounded down
        for mass_kg, _, sd_kg, _, known_kg in lines:
            self.assertLess(float(sd_kg), 0.05 * float(mass_kg))
            self.assertLessEqual(float(known_kg), 1.1 * float(sd_kg))
        worse = self.check(grasp, CALIBRATION.replace("sd = [0.01, 0.01, 0.01]", "sd = [30.0, 30.0, 30.0]"))
        self.assertIn("expected sd no stable weight", worse.stdout)

    def test_doctor_says_the_same(self):
        self.check(CONFIG)
        found = json.loads(ctl("doctor", "--json", "--config", self.folder / "my.toml").stdout)["findings"]
        kinds = {f["check"] for f in found if f["verdict"] == "advice"}
        self.assertLessEqual({"rate", "frozen", "line"}, kinds)
        self.assertTrue(all(f["remedy"] for f in found if f["check"] in ("rate", "frozen")))


if __name__ == "__main__":
    unittest.main(verbosity=2)
