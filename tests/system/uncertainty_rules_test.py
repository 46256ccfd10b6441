#!/usr/bin/env python3
"""The rules of uncertainty.h and tactiled_uncertainty.py against a Monte Carlo of the equations of node/guide/uncertainty.md,
which shares no code with them: random errors are drawn as the page says that they are shared, and the scatter of what is
computed from them is compared with the stated sd. Both languages must agree with each other to 1e-6, and with the scatter
within 3 %.

    uncertainty_rules_test.py    about 20 s
"""
import ctypes
import math
import pathlib
import subprocess
import sys
import tempfile
import types
import unittest

import numpy

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402
import tactiled_uncertainty as rules  # noqa: E402

DRAWS = 40_000  # the scatter is known within 0.4 %
WITHIN = 0.03
SOURCE = """
#include "tactiled/uncertainty.h"
#define F(name) __attribute__((visibility("default"))) name
double F(mean)(const struct tactiled_placed* p, unsigned c, unsigned n) { return tactiled_sd_of_mean(p, c, n); }
double F(difference)(const struct tactiled_placed* a, const struct tactiled_placed* b, unsigned c) {
    return tactiled_sd_of_difference(a, b, c); }
double F(sum)(const struct tactiled_placed* const* p, const double (*w)[6], unsigned n) { return tactiled_sd_of_sum(p, w, n); }
void F(magnitude)(const struct tactiled_placed* p, double* out) {
    struct tactiled_value v = tactiled_magnitude(p); out[0] = v.value; out[1] = v.sd; out[2] = v.is_bound; }
void F(slip)(const struct tactiled_placed* p, double* out) {
    struct tactiled_value v = tactiled_slip_ratio(p); out[0] = v.value; out[1] = v.sd; out[2] = v.is_bound; }
double F(direction)(const struct tactiled_placed* p, double* u) { return tactiled_direction(p, u); }
unsigned F(largest)(const struct tactiled_placed* p) { return tactiled_largest_part(p); }
"""


class Sensor:
    """A sample with errors of every part, and how to draw them."""

    def __init__(self, random, load, scale=1.0, model=5):
        self.load = numpy.asarray(load, float)
        self.truth = self.load * [10, 10, 20, 0.2, 0.2, 0.1]
        size = scale * numpy.array([0.1, 0.12, 0.2, 2e-3, 2e-3, 1e-3])
        self.part = {name: size * random.uniform(0.3, 1, 6) for name in ("noise", "calibration", "zero", "temperature", "motion")}
        self.gain = 0.01 * scale
        root = random.normal(size=(6, 12))
        self.R = root @ root.T
        d = numpy.sqrt(numpy.diag(self.R))
        self.R /= numpy.outer(d, d)
        self.alike, self.within, self.model = 0.8, 0.7, model

    def sample(self):
        reference = self.gain * self.truth
        rows = [self.part["noise"], self.part["calibration"], reference, self.part["zero"], self.part["temperature"], self.part["motion"]]
        sd = numpy.sqrt(sum(numpy.square(row) for row in rows))
        upper = [self.R[c, d] for c in range(6) for d in range(c + 1, 6)]
        budget = rules.budget_of([*numpy.concatenate(rows), *upper, *self.load, self.alike, self.within, self.model])
        return types.SimpleNamespace(quality=1, force_S_N=tuple(self.truth[:3]), sd_force_N=tuple(sd[:3]), sd_torque_Nm=tuple(sd[3:]),
                                     state=0, epoch=1, tare_count=1, budget=budget)

    def draw(self, random, name, z=None):
        """Errors of a part, draws x 6, with the correlation R; z: normal numbers that another sample shares."""
        z = random.normal(size=(DRAWS, 6)) if z is None else z
        return z @ numpy.linalg.cholesky(self.R + 1e-12 * numpy.eye(6)).T * self.part[name]


def record(sample):
    """The bytes of struct tactiled_placed."""
    values = {"quality": sample.quality, "force_S_N": sample.force_S_N, "sd_force_N": sample.sd_force_N, "sd_torque_Nm": sample.sd_torque_Nm,
              "epoch": sample.epoch, "tare_count": sample.tare_count, "state": sample.state}
    flat = []
    for name, code in tactiled._SAMPLE.fields:
        value = values.get(name, 0)
        n = 1 if len(code) == 1 else int(code[:-1])
        flat += list(value) if isinstance(value, tuple) else [value] * n
    head = tactiled._SAMPLE.struct.pack(*flat)
    b = sample.budget
    return tactiled._PLACED.struct.pack(head, 0, 0, *[x for part in b.sd_part for x in part], *b.correlation, *b.load, b.alike,
                                        b.alike_within, b.model)


class Rules(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        source, library = pathlib.Path(cls.folder.name, "rules.c"), pathlib.Path(cls.folder.name, "rules.so")
        source.write_text(SOURCE)
        subprocess.run(["cc", "-std=c11", "-O1", "-Wall", "-Wextra", "-Werror", f"-I{ROOT}/node/include", "-shared", "-fPIC", source,
                        "-o", library, "-lm"], check=True)
        cls.c = ctypes.CDLL(str(library))
        for name in ("mean", "difference", "sum", "direction"):
            getattr(cls.c, name).restype = ctypes.c_double

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def setUp(self):
        self.random = numpy.random.default_rng(20261130)

    def agree(self, stated, by_c, scatter=None):
        self.assertAlmostEqual(by_c / stated, 1, delta=1e-6)
        if scatter is not None:
            self.assertAlmostEqual(stated / scatter, 1, delta=WITHIN)

    def of_c(self, name, sample):
        out = (ctypes.c_double * 3)()
        getattr(self.c, name)(record(sample), out)
        return out[0], out[1], bool(out[2])

    def test_mean_of_samples(self):
        s = Sensor(self.random, [0.1, 0.2, -0.5, 0, 0.1, 0])
        rest = sum(s.draw(self.random, name) for name in ("calibration", "zero", "temperature", "motion"))
        rest += s.gain * s.truth * self.random.normal(size=(DRAWS, 1))
        for n in (1, 10, 100):
            noise = sum(s.draw(self.random, "noise") for _ in range(n)) / n
            for c in range(6):
                stated = rules.sd_of_mean(s.sample(), c, n)
                self.agree(stated, self.c.mean(record(s.sample()), c, n), (noise + rest)[:, c].std())
        filtered = s.sample()
        filtered.state = rules.LOW_PASS
        self.assertEqual(rules.sd_of_mean(filtered, 2, 100), rules.sd(filtered, 2))
        self.assertEqual(self.c.mean(record(filtered), 2, 100), rules.sd(filtered, 2))

    def test_difference_from_an_earlier_sample(self):
        for load in ([0.1, 0.2, -0.5, 0, 0.1, 0], [0.1, 0.2, -0.5, 0, 0.1, 0.1], [-0.6, 0.5, 0.3, 0, 0.1, 0]):
            now = Sensor(self.random, load)
            then = Sensor(self.random, [0.1, 0.2, -0.5, 0, 0.1, 0])
            then.R = now.R
            then.part["zero"] = 0.6 * now.part["zero"]
            for one_zero in (True, False):
                a, b = now.sample(), then.sample()
                b.tare_count = 1 if one_zero else 2
                r = now.alike / (1 + numpy.sum((now.load - then.load) ** 2) / now.within ** 2)
                z = self.random.normal(size=(DRAWS, 6))
                z_then = r * z + math.sqrt(1 - r * r) * self.random.normal(size=(DRAWS, 6))
                error = now.draw(self.random, "calibration", z) - then.draw(self.random, "calibration", z_then)
                error += (now.gain * now.truth - then.gain * then.truth) * self.random.normal(size=(DRAWS, 1))
                z = self.random.normal(size=(DRAWS, 6))
                moved = now.draw(self.random, "zero") * 0.8  # 0.6^2 + 0.8^2 = 1: the motion of the zero since
                error += now.draw(self.random, "zero", z) * 0.6 + moved
                error -= then.draw(self.random, "zero", z if one_zero else None)
                for name in ("noise", "temperature", "motion"):
                    error += now.draw(self.random, name) - then.draw(self.random, name)
                for c in range(6):
                    stated = rules.sd_of_difference(a, b, c)
                    self.agree(stated, self.c.difference(record(a), record(b), c), error[:, c].std())

    def sum_of_c(self, samples, weights):
        n = len(samples)
        pointers = (ctypes.c_char_p * n)(*[record(s) for s in samples])
        rows = (ctypes.c_double * 6 * n)(*[(ctypes.c_double * 6)(*w) for w in weights])
        return rules.sd_of_sum(samples, weights), self.c.sum(pointers, rows, n)

    def sum_of(self, sensors, weights):
        """Stated sd, that of C, and the scatter of the equations."""
        samples = [s.sample() for s in sensors]
        by_c = self.sum_of_c(samples, weights)[1]
        total, reference = numpy.zeros(DRAWS), 0.0
        shared = {name: self.random.normal(size=(DRAWS, 6)) for name in ("calibration", "temperature", "motion")}
        for s, w in zip(sensors, weights):
            total += sum(s.draw(self.random, name, shared.get(name)) for name in s.part) @ w
            reference += s.gain * s.truth @ w
        return rules.sd_of_sum(samples, weights), by_c, math.hypot(total.std(), reference)

    def test_sum_over_sensors(self):
        for n in (1, 2, 3, 16):
            for weight in ((0.0, 0.0, 1.0, 0.0, 0.0, 0.0), (0.6, 0.0, 0.8, 0.0, 0.0, 0.0), (0.0, 0.05, 0.1, 1.0, 0.0, 0.0)):
                load = numpy.array([0.3, 0.4, 0.5, 0.2, 0.1, 0.2])
                sensors = [Sensor(self.random, load + self.random.uniform(-0.2, 0.2, 6)) for _ in range(n)]
                for s in sensors:
                    s.R = 0.7 * numpy.eye(6) + 0.3  # positive, so that no shared errors cancel
                self.agree(*self.sum_of(sensors, [weight] * n))

    def test_sensors_of_other_models_share_no_calibration(self):
        sensors = [Sensor(self.random, [0, 0, -0.5, 0, 0, 0], model=m) for m in (1, 2)]
        weights = [(0, 0, 1, 0, 0, 0)] * 2
        own = [s.sample() for s in sensors]
        like = [Sensor(numpy.random.default_rng(20261130), [0, 0, -0.5, 0, 0, 0]).sample() for _ in sensors]
        self.assertLess(rules.sd_of_sum(own, weights), rules.sd_of_sum(like, weights))

    def test_errors_that_would_cancel_are_no_gain(self):
        s = Sensor(self.random, [0, 0, -0.5, 0, 0, 0])
        for others in (5, 6):  # its model, and another one with another reference
            both = [s.sample(), s.sample()]
            both[1].budget = both[1].budget._replace(model=others)
            opposed, by_c = self.sum_of_c(both, [(0, 0, 1, 0, 0, 0), (0, 0, -1, 0, 0, 0)])
            self.agree(opposed, by_c)
            independent = math.sqrt(2 * sum(row[2] ** 2 for row in both[0].budget.sd_part))
            self.assertAlmostEqual(opposed / independent, 1, delta=1e-6)

    def test_of_another_method_no_calibration_cancels(self):
        s = Sensor(self.random, [0, 0, -0.5, 0, 0, 0])
        now, then = s.sample(), s.sample()
        same = rules.sd_of_difference(now, then, 2)
        then.state = 2 << 16
        other = rules.sd_of_difference(now, then, 2)
        self.agree(other, self.c.difference(record(now), record(then), 2))
        self.assertAlmostEqual(other ** 2 - same ** 2, 2 * s.alike * now.budget.sd_part[rules.CALIBRATION][2] ** 2, delta=1e-9)

    def force_errors(self, s):
        error = sum(s.draw(self.random, name) for name in s.part) + s.gain * s.truth * self.random.normal(size=(DRAWS, 1))
        return error[:, :3]

    def test_magnitude_direction_and_slip_ratio(self):
        ratios = 0
        for load, scale in (([0.1, 0.2, -0.5, 0, 0, 0], 1), ([0.3, 0, -0.25, 0, 0, 0], 1), ([0.05, 0.06, -0.1, 0, 0, 0], 0.5)):
            s = Sensor(self.random, load, scale)
            # all parts of one sample correlate by the covariance that the rules use
            error = self.force_errors(s)
            force = s.truth[:3] + error
            sample = s.sample()
            value, sd, is_bound = rules.magnitude(sample)
            by_c = self.of_c("magnitude", sample)
            self.assertFalse(is_bound or by_c[2])
            self.agree(sd, by_c[1], numpy.linalg.norm(force, axis=1).std())
            unit, angle = rules.direction(sample)
            out = (ctypes.c_double * 3)()
            self.agree(angle, self.c.direction(record(sample), out))
            self.assertTrue(numpy.allclose(list(out), unit))
            cosine = force @ numpy.array(unit) / numpy.linalg.norm(force, axis=1)
            self.assertAlmostEqual(angle / math.sqrt(numpy.mean(numpy.arccos(numpy.clip(cosine, -1, 1)) ** 2)), 1, delta=WITHIN)
            ratio = rules.slip_ratio(sample)
            by_c = self.of_c("slip", sample)
            if ratio.is_bound:
                self.assertTrue(by_c[2])
                continue
            self.agree(ratio.sd, by_c[1], (numpy.hypot(force[:, 0], force[:, 1]) / -force[:, 2]).std())
            ratios += 1
        self.assertEqual(ratios, 3)

    def test_a_small_force_has_a_bound_and_no_direction(self):
        s = Sensor(self.random, [0.005, 0, -0.01, 0, 0, 0])
        error = self.force_errors(s)
        below = []
        for e in error[:2000]:
            sample = s.sample()
            sample.force_S_N = tuple(s.truth[:3] + e)
            value, sd, is_bound = rules.magnitude(sample)
            if not is_bound:
                continue
            below.append(numpy.linalg.norm(s.truth[:3]) <= value)
            self.assertTrue(math.isnan(sd) and math.isnan(rules.direction(sample)[1]))
            self.assertTrue(math.isnan(rules.slip_ratio(sample).sd))
        self.assertGreater(len(below), 1500)
        self.assertGreater(numpy.mean(below), 0.95)

    def test_nothing_is_claimed_where_nothing_is_known(self):
        s = Sensor(self.random, [0.1, 0.2, -0.5, 0, 0.1, 0]).sample()
        nan = math.nan
        s.budget = rules.budget_of([nan] * 59 + [0])  # a daemon before 1.10
        self.assertEqual(rules.sd_of_mean(s, 2, 100), rules.sd(s, 2))
        self.agree(rules.sd_of_difference(s, s, 2), self.c.difference(record(s), record(s), 2), math.sqrt(2) * rules.sd(s, 2))
        self.assertTrue(math.isnan(rules.sd_of_sum([s], [(0, 0, 1, 0, 0, 0)])))
        bad = Sensor(self.random, [0.1, 0.2, -0.5, 0, 0.1, 0]).sample()
        bad.quality = 3
        self.assertTrue(all(map(math.isnan, self.sum_of_c([bad], [(0, 0, 1, 0, 0, 0)]))))
        self.assertIsNone(rules.largest_part(s))
        s.sd_force_N = (nan,) * 3
        for value in (rules.sd_of_mean(s, 2, 100), self.c.mean(record(s), 2, 100), rules.magnitude(s).sd, self.of_c("magnitude", s)[1],
                      rules.sd_of_difference(s, s, 2), self.c.difference(record(s), record(s), 2)):
            self.assertTrue(math.isnan(value))


if __name__ == "__main__":
    unittest.main()
