#!/usr/bin/env python3
"""tactilectl calibrate --certificate: each number is computed again by other code, and the XML has the schema's order."""
import math
import pathlib
import random
import re
import subprocess
import tempfile
import tomllib
import unittest
import xml.etree.ElementTree as ET

import certificate_check
from certificate_schema import faults, name_of
from daemon import BIN, ROOT

EFLESH = ROOT / "tests/data/eflesh/normal_labelled.csv"
REFERENCE = ("--reference", "cell & amplifier <7>", "--reference-uncertainty", "0.1%,0.01N")
FULL_N, CREEP, HYSTERESIS, LOST_ZERO = 10, 0.02, 0.01, 0.015  # the last three: parts of full scale
SATURATED = 30000  # more than a channel of these recordings has
LIMITS = ("--saturates-above", str(SATURATED))


class Sensor:
    """Four channels over fx and fz, a little curved, with hysteresis, creep, a zero that is lost, and noise. `memory`: part of the
    force by which a larger one before, since the last rest, exceeded it."""
    GAIN = [(900, -400), (-850, -420), (120, -600), (60, 700)]

    def __init__(self, random_, gain_sd=0.003, memory=0.0):
        self.random, self.gain_sd, self.memory = random_, gain_sd, memory
        self.t_s, self.play, self.creep, self.peak, self.rows = 0.0, 0.0, 0.0, 0.0, []

    def mount(self, name):
        self.name, self.gain, self.lost = name, 1 + self.random.gauss(0, self.gain_sd), 0.0
        self.zero = [20000 + self.random.gauss(0, 20) for _ in self.GAIN]
        self.play = self.creep = 0.0
        self.t_s += 60

    def step(self, fx, fz, dt_s, labelled=True, saturated=False):
        self.t_s += dt_s
        width = HYSTERESIS * FULL_N / 2
        self.play = min(max(self.play, fz - width), fz + width)
        self.creep += (CREEP * fz - self.creep) * (1 - math.exp(-dt_s / 100))
        self.peak = max(self.peak, -fz) if fz else 0.0
        felt = self.gain * fz + 0.0004 * fz * fz - (fz - self.play) + self.creep + self.lost * FULL_N - self.memory * (self.peak + fz)
        channel = [z + gx * fx + gz * felt + self.random.gauss(0, 2) for z, (gx, gz) in zip(self.zero, self.GAIN)]
        if saturated:
            channel[3] = SATURATED
        label = [f"{f + self.random.gauss(0, 0.002):.5f}" for f in (fx, fz)] if labelled else ["", ""]
        self.rows.append([f"{self.t_s:.3f}", *(f"{c:.3f}" for c in channel), *label, f"{22 + 0.2 * math.sin(self.t_s / 500):.3f}", self.name])

    def hold(self, fx=0.0, fz=0.0, rows=5, dt_s=1.0):
        """Returns the creep in N between 30 s and 300 s, if it lasts so long."""
        self.step(fx, fz, 2, labelled=False)
        creep = {}
        for k in range(rows):
            self.step(fx, fz, dt_s, saturated=k == 5)
            creep[k * dt_s] = self.creep
        return creep.get(300, 0) - creep.get(30, 0)


def made(path, **of_sensor):
    """Three mountings: fz up and down, up again and held for 310 s, a rest as long; fx in both directions; both together.
    Returns the creep in N in the long holds."""
    sensor, creep = Sensor(random.Random(376), **of_sensor), []
    for name in ('1 <"a">', "2 & b", "3"):
        sensor.mount(name)
        sensor.hold()
        for level in [*range(1, 11), *range(9, 0, -1), 0]:
            sensor.hold(fz=-level)
        for level in range(1, 10):
            if name == "3" and level == 4:
                sensor.step(0, -5, 1)  # this load is reached neither by rising nor by falling
            sensor.hold(fz=-level)
        creep.append(sensor.hold(fz=-FULL_N, rows=32, dt_s=10))
        sensor.lost = -LOST_ZERO
        creep.append(sensor.hold(rows=32, dt_s=10))
        for sign in (1, -1):
            for level in (1, 2, 3, 4, 3, 2, 1, 0):
                sensor.hold(fx=sign * level, rows=32 if level == 2 and name == "3" else 5, dt_s=10 if name == "3" else 1)
        for fx, fz in ((2, -4), (2, -8), (-2, -8), (-2, -4), (0, 0)):
            sensor.hold(fx, fz)
    header = ["t_s", "R1", "R2", "R3", "R4", "fx_N", "fz_N", "temperature_C", "session"]
    quoted = [[*row[:-1], '"' + row[-1].replace('"', '""') + '"'] for row in sensor.rows]
    path.write_text("\n".join(",".join(row) for row in [header, *quoted]) + "\n")
    return creep


class Certificates(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def run_it(self, *words):
        return subprocess.run([BIN / "tactilectl", *words], capture_output=True, text=True)

    def calibrate(self, rows, *words):
        return self.run_it("calibrate", "--model", "generic", "--force", "--in", rows, "--out", self.folder / "skin.toml", *LIMITS, *words)

    def certify(self, rows, *words):
        """Calibrates, checks that the schema's order is kept, and returns the differences and {figure: [(load, part)]}."""
        done = self.calibrate(rows, "--certificate", self.folder / "skin.xml", *words)
        self.assertEqual(done.returncode, 0, done.stderr)
        done = self.run_it("decouple", "--each-row-alone", "--calibration", self.folder / "skin.toml", "--in", rows, "--out", self.folder / "forces.csv", *LIMITS)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(list(faults(ET.parse(self.folder / "skin.xml").getroot())), [])
        figures = {}
        return self.differences(rows, figures.__setitem__), figures

    def differences(self, rows, tell=lambda *_: None):
        return list(certificate_check.differences(rows, self.folder / "forces.csv", self.folder / "skin.toml", self.folder / "skin.xml", tell))

    def made(self):
        self.creep = made(self.folder / "rows.csv")
        return self.folder / "rows.csv"

    def test_each_number_is_that_of_the_rows(self):
        found, figures = self.certify(self.made(), *REFERENCE)
        self.assertEqual(found, [])
        counts = {name: len(numbers) for name, numbers in figures.items()}
        for name, least in (("interpolation", 10), ("reproducibility", 10), ("repeatability", 9), ("reversibility", 9), ("zero", 9), ("creep", 6)):
            self.assertGreaterEqual(counts[f"fz.{name}"], least, name)
        self.assertEqual(counts["fx.creep"], 0)
        self.assertIn("held for 300 s", certificate_check.Certificate(self.folder / "skin.xml").result("fx.creep")[2])

    def test_the_uncertainty_has_each_part_of_the_sd(self):
        made(self.folder / "rows.csv", gain_sd=0.03, memory=0.2)
        self.assertEqual(self.certify(self.folder / "rows.csv", *REFERENCE)[0], [])
        calibration = tomllib.loads((self.folder / "skin.toml").read_text())
        for key in ("sd", "sd_slope", "sd_unloading"):
            self.assertGreater(max(calibration[key]), 0, key)
        small = certificate_check.Certificate(self.folder / "skin.xml").result("fz.full_scale")[0]["expanded"][0]
        self.certify(self.folder / "rows.csv", "--reference", "x", "--reference-uncertainty", "30%")
        large = certificate_check.Certificate(self.folder / "skin.xml").result("fz.full_scale")[0]["expanded"][0]
        of_reference = 0.3 * calibration["full_scale"][1]
        self.assertGreater(large, of_reference)
        self.assertAlmostEqual(large, math.hypot(small, of_reference), delta=0.01 * large)

    def test_the_figures_are_those_of_the_sensor(self):
        _, figures = self.certify(self.made(), *REFERENCE, "--one-zero")  # zeros of its own make the channels nearly alike
        for (load, value), creep in zip(figures["fz.creep"], self.creep, strict=True):
            self.assertAlmostEqual(value, abs(creep) / FULL_N, delta=0.001, msg=f"creep at {load} N")
        middle = [value * abs(load) / FULL_N for load, value in figures["fz.reversibility"] if 3 < -load < 7]
        self.assertGreater(min(middle), 0.5 * HYSTERESIS)
        self.assertLess(max(middle), 2 * (HYSTERESIS + CREEP))
        largest = max(abs(value) for _, value in figures["fz.zero"])
        self.assertGreater(largest, 0.5 * LOST_ZERO)
        self.assertLess(largest, LOST_ZERO + CREEP + HYSTERESIS)

    def test_a_real_recording(self):
        found, figures = self.certify(EFLESH, *REFERENCE)
        self.assertEqual(found, [])
        self.assertEqual([name for name, numbers in figures.items() if not numbers], ["fz.creep"])

    def test_a_changed_number_is_found(self):
        rows = self.made()
        self.assertEqual(self.certify(rows, *REFERENCE)[0], [])
        whole = (self.folder / "skin.xml").read_text()
        numbers = list(re.finditer(r"<si:(value|valueXMLList|valueExpandedMU|valueExpandedMUXMLList)>([^<]*)<", whole))
        self.assertGreater(len(numbers), 30)
        for number in numbers:
            changed = re.sub(r"(\S+)$", lambda last: repr(float(last[0]) * 1.001 + 1e-6), number[2])
            (self.folder / "skin.xml").write_text(whole[:number.start(2)] + changed + whole[number.end(2):])
            self.assertNotEqual(self.differences(rows), [], whole[number.start() - 300:number.end()])

    def test_an_order_that_the_schema_does_not_have_is_found(self):
        self.certify(EFLESH, *REFERENCE)
        root = ET.parse(self.folder / "skin.xml").getroot()
        seen = set()
        for element in root.iter():
            for i in range(len(element) - 1):
                if name_of(element[i]) == name_of(element[i + 1]):
                    continue
                element[i], element[i + 1] = element[i + 1], element[i]
                self.assertNotEqual(list(faults(root)), [], name_of(element))
                element[i], element[i + 1] = element[i + 1], element[i]
                seen.add(name_of(element))
        self.assertGreater(len(seen), 15)
        self.assertEqual(list(faults(root)), [])

    def test_one_press_without_a_rest_has_no_figures_but_reasons(self):
        rows = self.folder / "rows.csv"
        sensor = Sensor(random.Random(7))
        sensor.mount("only")
        for k in range(400):
            sensor.step(3 * math.sin(0.37 * k), -6 - 4 * math.sin(0.23 * k), 0.1)
        rows.write_text("t_s,R1,R2,R3,R4,fx_N,fz_N\n" + "".join(",".join(row[:7]) + "\n" for row in sensor.rows))
        found, figures = self.certify(rows, *REFERENCE)
        self.assertEqual((found, [numbers for numbers in figures.values() if numbers]), ([], []))
        for name in figures:
            self.assertTrue(certificate_check.Certificate(self.folder / "skin.xml").result(name)[2].startswith("absent: "), name)

    def test_texts_and_statements(self):
        stated = {"number": "K 12", "laboratory": 'A & B "C" <d>', "person": "Ü", "customer": "E\uffff\x01F", "country": "DE", "performed": "2026-11-20"}
        self.certify(self.made(), *REFERENCE, "--serial", "<7>", *(w for k, v in stated.items() for w in ("--stated", f"{k}={v}")))
        texts = [element.text for element in ET.parse(self.folder / "skin.xml").iter() if element.text]
        stated["customer"] = "E" + "\ufffd" * 4 + "F"  # each byte that XML cannot have
        for text in (*stated.values(), "<7>", REFERENCE[1], '1 <"a">, 2 & b, 3'):
            self.assertIn(text, texts)
        self.assertTrue(any("not an accredited calibration certificate" in text for text in texts))

    def test_the_report_has_the_same_figures(self):
        _, figures = self.certify(self.made(), *REFERENCE, "--report", self.folder / "skin.html")
        page = (self.folder / "skin.html").read_text()
        part = page[page.index("Figures as in ISO 376"):page.index("Coverage of the loads")]
        values = [float(value) for value in re.findall(r'<data value="([^"]*)">', part)]
        for name, numbers in figures.items():
            if numbers:
                largest = 100 * max((value for _, value in numbers), key=abs)
                self.assertTrue(any(abs(value - largest) <= 1e-9 * abs(largest) for value in values), name)
        self.assertIn("absent: neither full scale", part)
        self.assertIn("cell &amp; amplifier &lt;7&gt;", part)
        done = self.calibrate(self.made(), "--report", self.folder / "skin.html")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("expanded uncertainty is unknown", (self.folder / "skin.html").read_text())

    def test_without_a_reference_it_is_refused_before_the_fit(self):
        xml, unit, of = self.folder / "skin.xml", "--reference-uncertainty", ("--reference", "cell")
        for words, message in (
                ((), 'needs --reference "what measured the labels"'),
                ((*of,), "needs --reference-uncertainty"),
                ((unit, "0.1%"), "needs --reference "),
                (("--reference", " ", unit, "0.1%"), "needs --reference "),
                ((*of, unit, "0%"), "a number above 0 with its unit"),
                ((*of, unit, "0.1"), "a number above 0 with its unit"),
                ((*of, unit, "nan%"), "a number above 0 with its unit"),
                ((*of, unit, "0.1%,0.2%"), "there is another one in %"),
                ((*of, unit, "0.001Nm"), "fz needs one too, in % or N"),
                ((*REFERENCE, "--stated", "country=Germany"), "two capital letters"),
                ((*REFERENCE, "--stated", "performed=2026-02-30"), "the date of the measurement"),
                ((*REFERENCE, "--stated", "lab=x"), "with one of the keys number, laboratory"),
                ((*REFERENCE, "--report", xml), "would replace this file")):
            done = self.calibrate(EFLESH, "--certificate", xml, *words)
            self.assertEqual(done.returncode, 2, words)
            self.assertIn(message, done.stderr)
        done = self.calibrate(EFLESH, "--stated", "country=DE")
        self.assertEqual(done.returncode, 2)
        self.assertFalse(xml.exists() or (self.folder / "skin.toml").exists())


if __name__ == "__main__":
    unittest.main()
