#!/usr/bin/env python3
"""Every model and method from labelled rows to a PLC: five sensors of different kinds on five ptys, one daemon.

The sensors are simulated by their documents' formulas (simulated_sensors.py), calibrated with `tactilectl calibrate`,
and fed at 200 Hz. A PLC (pymodbus) must read the applied forces within the registers' resolution and the stated sd;
shared memory (tactiled.py) must agree. A new model needs a class in simulated_sensors.py, no line here.
"""
import concurrent.futures
import math
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import BIN, ROOT, wait_for  # noqa: E402
from sensor_bench import NONE_I16, RATE_HZ, Bench, Witness, f32, i16_of  # noqa: E402
from simulated_sensors import NONE, SENSORS  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")
OK, STALE, UNCERTAIN, FAULT = 1 << 0, 1 << 6, 1 << 12, 1 << 15  # STATUS of a sensor block
# FAULT of a sensor block
DISCONNECTED, MISSING, DISAGREEMENT, SD_UNKNOWN = 2, 7, 10, 12
WORST_SD = 5  # of all the values read, about 7000: a normal error is beyond 5 sd once in 1.7 million


def wrench_of(sample):
    return (*sample.force_S_N, *sample.torque_S_Nm)


def sd_of(sample):
    return (*sample.sd_force_N, *sample.sd_torque_Nm)


class ThreeSensors(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.calibrations = pathlib.Path(cls.temporary.name)
        wanted = [(name, method) for name, kind in SENSORS.items() for method in kind.methods if method not in kind.fitted_as]
        wanted.reverse()  # the slowest ones are last in the list
        with concurrent.futures.ThreadPoolExecutor(2) as two_at_once:
            for what, done in zip(wanted, two_at_once.map(cls.calibrate, *zip(*wanted))):
                assert done.returncode == 0, f"{what}: {done.stdout}{done.stderr}"

    @classmethod
    def calibrate(cls, name, method):
        sensor = SENSORS[name]()
        sensor.begin(method)
        stem = cls.calibrations / f"{name}-{method}"
        sensor.write_labelled(f"{stem}.csv")
        return subprocess.run([BIN / "tactilectl", "calibrate", "--model", sensor.model, "--method", method, "--channel-unit",
                               sensor.channel_unit, "--in", f"{stem}.csv", "--out", f"{stem}.toml", *sensor.calibrate_words()],
                              capture_output=True, text=True)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def bench(self, **methods):
        return self.enterContext(Bench(methods, self.calibrations))

    def check_same(self, block, floats, sample):
        """The PLC's registers are those of the sample in shared memory."""
        for i, value in enumerate(wrench_of(sample)):
            self.assertEqual(block["i16"][i], i16_of(value, 0.01 if i < 3 else 0.001))
            if math.isnan(value):
                self.assertTrue(math.isnan(floats["wrench"][i]))
            else:
                self.assertEqual(floats["wrench"][i], f32(value))
        status = {tactiled.GOOD: OK, tactiled.UNCERTAIN: UNCERTAIN, tactiled.BAD: FAULT}[sample.quality]
        self.assertEqual(block["status"] & (OK | UNCERTAIN | FAULT), status)
        self.assertEqual(floats["status"], block["status"])
        self.assertEqual(block["raw"], sample.missing | sample.saturated)

    def errors(self, bench, name, load):
        """Reads a sensor once; returns [|error| / sd] of each component after checking it against the load."""
        sensor = bench.sensors[name]
        what = f"{name} {sensor.method} {load}"
        block, floats, sample = bench.together(name)
        self.check_same(block, floats, sample)
        ratios = []
        for i, component in enumerate(COMPONENTS):
            value, sd = floats["wrench"][i], sd_of(sample)[i]
            if component not in sensor.components:
                self.assertEqual((block["i16"][i], math.isnan(value)), (NONE_I16, True), f"{what}: {component} is not seen")
                continue
            applied, resolution = load[component], 0.01 if i < 3 else 0.001
            allowed = WORST_SD * sd + sensor.heavy_tails.get(sensor.method, 0) * sensor.full_scale  # NaN, an unknown
                                                                                                    # sd, fails
            self.assertLessEqual(abs(value - applied), allowed, f"{what}: {component} = {value}, sd {sd}")
            register = (block["i16"][i] ^ 0x8000) - 0x8000
            self.assertLessEqual(abs(register * resolution - applied), resolution / 2 + allowed, f"{what}: {component}")
            ratios.append(abs(value - applied) / sd)
        if sensor.method in sensor.cop_methods:
            for i, applied_m in enumerate((-load["my"] / load["fz"], load["mx"] / load["fz"])):
                sd_m = math.hypot(sd_of(sample)[4 - i], applied_m * sd_of(sample)[2]) / abs(load["fz"])
                self.assertLessEqual(abs(floats["cop_mm"][i] / 1e3 - applied_m), WORST_SD * sd_m, f"{what}: COP {floats['cop_mm']}")
        return ratios, sample

    def run_methods(self, **methods):
        """Loads all sensors at once; the PLC reads all."""
        bench = self.bench(**methods)
        ratios = {name: [] for name in methods}
        flagged, reads = dict.fromkeys(methods, 0), 0
        bench.wait_all_good()
        loads = {name: bench.sensors[name].live_loads() for name in methods}
        for i in range(max(map(len, loads.values()))):
            now = {name: {**bench.sensors[name].rest(), **loads[name][i % len(loads[name])]} for name in methods}
            bench.apply(now)
            for _ in range(4):
                for name, load in now.items():
                    found, sample = self.errors(bench, name, load)
                    ratios[name] += found
                    # The feeder is a program of this machine, which may stand still: its age has tests of its own.
                    flagged[name] += sample.reasons & ~(tactiled.UNPROVED_AGE | tactiled.WRONG_RATE) != 0
                reads += 1
                time.sleep(1 / RATE_HZ)
        for name, method in methods.items():
            within = sum(r <= 1 for r in ratios[name]) / len(ratios[name])
            print(f"\n  {name} {method}: {reads} reads, {100 * within:.0f} % within one sd, worst {max(ratios[name]):.1f} sd, {flagged[name]} not GOOD",
                  end="")
            self.assertGreaterEqual(within, bench.sensors[name].least_within, f"{name} {method}")
            self.assertEqual(flagged[name], 0, f"{name} {method}")
        for name in methods:
            self.assertEqual(bench.block(name)["lost"], 0, name)
        self.assertEqual(bench.daemon.stop()[0], 0)

    def test_each_method_from_labelled_rows_to_the_plc(self):
        longest = max(len(kind.methods) for kind in SENSORS.values())
        for turn in range(longest):
            methods = {name: kind.methods[turn % len(kind.methods)] for name, kind in SENSORS.items()}
            with self.subTest(**methods):
                self.run_methods(**methods)

    def first_methods(self):
        return {name: kind.methods[0] for name, kind in SENSORS.items()}

    def test_unplugged_sensor_goes_to_the_sentinel_and_the_others_do_not_notice(self):
        bench = self.bench(**self.first_methods())
        everyone = (1 << len(SENSORS)) - 1
        for name, n in bench.number.items():
            with self.subTest(name):
                bench.wait_all_good()
                witness = Witness(bench, [other for other in SENSORS if other != name])
                time.sleep(0.1)
                began = time.monotonic()
                bench.feeder.unplug(name)
                wait_for(lambda: bench.block(name)["fault"] == DISCONNECTED, "the fault")  # on a busy machine it is stale before
                took = time.monotonic() - began
                for _ in range(60):
                    block, floats, sample = bench.together(name)
                    self.check_same(block, floats, sample)
                    self.assertEqual(block["i16"] + block["cop"], [NONE_I16] * 8)
                    self.assertTrue(all(map(math.isnan, floats["wrench"] + floats["cop_mm"])))
                    self.assertEqual(block["fault"], DISCONNECTED)
                    self.assertIn("disconnected", sample.reasons_text)  # and stale, if it is
                    self.assertEqual(bench.plc.ok_mask(), everyone & ~(1 << n))
                    time.sleep(0.01)
                witness.check(self)
                bench.feeder.plug(name)
                wait_for(lambda: bench.plc.ok_mask() == everyone, "the sensor to come back")
                print(f"\n  {name}: sentinel after {1000 * took:.0f} ms", end="")

    def dead(self, name, method, channel, value, fault, load, not_good=UNCERTAIN):
        """Tests a channel that is NONE (missing) or constant. Returns (sd before, sd after); the forces stay right."""
        bench = self.bench(**{**self.first_methods(), name: method})
        bench.wait_all_good()
        sensor = bench.sensors[name]
        load = {**sensor.rest(), **load}
        bench.apply({name: load})
        before = self.errors(bench, name, load)[1]
        self.assertEqual(before.quality, tactiled.GOOD)
        witness = Witness(bench, [other for other in SENSORS if other != name])
        k = sensor.channels.index(channel)
        bench.feeder.spoil[name] = lambda channels: [*channels[:k], value, *channels[k + 1:]]
        wait_for(lambda: bench.block(name)["status"] & not_good, f"{channel} to be noticed")
        time.sleep(0.05)
        for _ in range(100):
            block, floats, sample = bench.together(name)
            self.check_same(block, floats, sample)
            self.assertEqual(block["status"] & (OK | UNCERTAIN | FAULT), not_good)
            self.assertIn(block["fault"], fault if isinstance(fault, tuple) else (fault,))
            self.assertEqual(block["raw"], 1 << k if math.isnan(value) else 0)
            if not_good == UNCERTAIN and not math.isnan(sample.sd_force_N[0]):
                self.errors(bench, name, load)
            time.sleep(0.005)
        witness.check(self)
        bench.feeder.spoil.clear()
        wait_for(lambda: bench.block(name)["status"] & OK, "the channel to be believed again")
        return before.sd_force_N, sample.sd_force_N

    def assert_grew(self, before, after, factors):
        for was, now, factor in zip(before, after, factors):
            self.assertAlmostEqual(now / was, factor, delta=0.15)  # hairs differ, and the sd grows with the load

    # Sums of squares of the gauges: fx loses one of two inner gauges and keeps both outer ones; fz keeps 3 of 4, with
    # a common loss with fx.
    def test_missing_gauge(self):
        before, after = self.dead("table", "linear", "R5", NONE, MISSING, {"fx": 0.2, "fy": -0.15, "fz": -0.6})
        self.assertGreater(after[0] / before[0], 1.15)
        self.assertGreater(after[2] / before[2], 1.1)

    def test_stuck_gauge(self):
        # Parity names the gauge and replaces it by its prediction, or the method's own search treats it as missing.
        before, after = self.dead("table", "linear", "R5", 0.0, (DISAGREEMENT, MISSING), {"fx": 0.2, "fy": -0.15, "fz": -0.6})
        self.assertGreater(after[0] / before[0], 1.15)
        self.assertGreater(after[2] / before[2], 1.1)

    def test_missing_hair(self):
        load = {"fx": 0.006, "fy": -0.004, "fz": -0.03}
        self.assert_grew(*self.dead("hair", "sum_diff", "H2", NONE, MISSING, load), (1, 3 ** 0.5, 2 ** 0.5))

    def test_stuck_hair(self):
        _, after = self.dead("hair", "sum_diff", "H2", 0.0, DISAGREEMENT, {"fx": 0.006, "fy": -0.004, "fz": -0.03})
        self.assertTrue(all(map(math.isnan, after)), "which hair is wrong cannot be told: no sd")

    def test_missing_channel_of_a_skin(self):
        self.dead("skin", "matrix", "B3", NONE, MISSING, {"fx": 1.0, "fy": -2.0, "fz": -5.0}, not_good=FAULT)

    def test_missing_electrode(self):
        # Noise of one electrode over its slope 0.038 + 2 * 0.0071 * 0.5, relative to noise of two over the pair's
        # 0.076 pF/N.
        before, after = self.dead("capacitive", "quadratic", "C2", NONE, MISSING, {"fx": 0.5, "fy": -0.3, "fz": -4.0})
        self.assertAlmostEqual(after[0] / before[0], 0.076 / 0.0451 / 2 ** 0.5, delta=0.15)
        self.assertAlmostEqual(after[1] / before[1], 1, delta=0.15)

    def test_missing_film(self):
        _, after = self.dead("piezo", "fused", "Vp", NONE, MISSING, {"fz": -4.0})
        self.assertTrue(math.isnan(after[2]), "Cn alone lags by what the press does: no sd")

    def test_missing_centre_of_a_film(self):
        self.dead("piezo", "fused", "Cn", NONE, MISSING, {"fz": -4.0}, not_good=FAULT)

    def test_the_documents_sensors_without_an_sd(self):
        methods = {"table": "linear", "hair": "sum_diff", "capacitive": "quadratic", "piezo": "fused"}
        bench = Bench(methods, self.calibrations)
        for name, method in methods.items():
            shutil.copy(ROOT / f"config/calibration/{name}_documents.toml", bench.daemon.folder / f"{name}-{method}.toml")
        bench.sensors["hair"].own_gain = [(1, 1)] * 4
        bench.sensors["hair"].method = "physics"  # linear hairs
        bench.sensors["piezo"].TAU_S, bench.sensors["piezo"].WINDOW_S = 0.1, 0.1
        # 13.7 Pa is a hair's noise under a press; 0.3 fF of 0.0405 pF/N at rest; 2 % of 10 N: press jumps between conversions
        noise_N = {"table": 6 * 0.002, "hair": 6 * 13.7 * 2.827e-5, "capacitive": 6 * 0.0074, "piezo": 0.2}
        with bench:
            loads = {name: sensor.load_of(0.75) for name, sensor in bench.sensors.items()}
            bench.apply(loads)
            for _ in range(50):
                for name, load in loads.items():
                    block, floats, sample = bench.together(name)
                    self.check_same(block, floats, sample)
                    self.assertEqual(block["fault"], SD_UNKNOWN)
                    self.assertTrue(all(map(math.isnan, sample.sd_force_N)))
                    for i, component in enumerate(COMPONENTS[:3]):
                        if component not in load:
                            continue
                        self.assertAlmostEqual(floats["wrench"][i], load[component], delta=noise_N[name])


if __name__ == "__main__":
    unittest.main(verbosity=2)
