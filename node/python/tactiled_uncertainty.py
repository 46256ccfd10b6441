"""Rules for the uncertainty of what is computed from samples: means, differences, sums, magnitude, direction, slip ratio.
The same as uncertainty.h for C and C++; node/guide/uncertainty.md derives them. Only the standard library.

    import tactiled, tactiled_uncertainty as rules
    with tactiled.open("gripper") as node:
        s = node.latest("left")
        print(rules.magnitude(s), rules.sd_of_mean(s, rules.FZ, 100))

A sample is any object with quality, force_S_N, sd_force_N, sd_torque_Nm, state, epoch, tare_count and budget, a Budget: a
tactiled.Sample, or one made from a row of `tactilectl decouple --budget`. Components: FX .. MZ, frame S. A result is NaN
if a standard deviation that it needs is not known.
"""
import collections
import math

FX, FY, FZ, MX, MY, MZ = range(6)
NOISE, CALIBRATION, REFERENCE, ZERO, TEMPERATURE, MOTION = range(6)  # the parts of a standard deviation
PARTS = ("noise", "calibration", "reference", "zero", "temperature", "motion")
SURE = 3.0  # a magnitude above this many sd is an estimate; below, it is a bound
WITHIN = 1.96  # normal errors: 95 %
DIVISOR = 10.0  # a ratio over a press above this many sd has an interval wider by at most 1 / 100 than its sd says
LOW_PASS, METHOD = 4, 15 << 16  # bits of Sample.state

# sd_part: by part and component, N or Nm. correlation: of two components, the 15 pairs above the diagonal. load: in full
# scales. The others: struct tactiled_budget of layout.h.
Budget = collections.namedtuple("Budget", "sd_part correlation load alike alike_within model")
# A computed value; where is_bound, 95 % of the true values are below `value`, and sd is NaN.
Value = collections.namedtuple("Value", "value sd is_bound")


def budget_of(numbers):
    """The Budget of the numbers of struct tactiled_budget, in its order."""
    numbers = tuple(numbers)
    parts = tuple(numbers[6 * p:6 * p + 6] for p in range(len(PARTS)))
    return Budget(parts, numbers[36:51], numbers[51:57], numbers[57], numbers[58], int(numbers[59]))


def _root(variance):
    return math.nan if math.isnan(variance) else math.sqrt(max(variance, 0.0))


def sd(sample, c):
    """The standard deviation of component c."""
    return sample.sd_force_N[c] if c < 3 else sample.sd_torque_Nm[c - 3]


def correlation(budget, c, d):
    """The correlation of the errors of components c and d of one sample; 0 if it is not known."""
    if c == d:
        return 1.0
    low, high = min(c, d), max(c, d)
    r = budget.correlation[low * (9 - low) // 2 + high - 1]
    return r if -1 <= r <= 1 else 0.0


def alike(a, b):
    """The correlation of the calibration errors of one sensor under the loads of two budgets; 0 if it is not known."""
    within = a.alike_within * b.alike_within
    squared = sum((x - y) ** 2 for x, y in zip(a.load, b.load)) / within if within > 0 else math.nan
    return math.sqrt(a.alike * b.alike) / (1 + squared) if squared >= 0 and a.alike >= 0 and b.alike >= 0 else 0.0


def _covariance(budget, c, d):
    products = sum(budget.sd_part[p][c] * budget.sd_part[p][d] for p in range(len(PARTS)) if p != REFERENCE)
    return correlation(budget, c, d) * products + budget.sd_part[REFERENCE][c] * budget.sd_part[REFERENCE][d]


def covariance(sample, c, d):
    """The covariance of components c and d of one sample, N and Nm: every part but the reference correlates alike."""
    if c == d:
        return sd(sample, c) ** 2
    both = _covariance(sample.budget, c, d)
    return 0.0 if math.isnan(both) else both


def sd_of_mean(sample, c, n):
    """The sd of the mean of component c over n samples that follow each other under one load, of which this is any."""
    noise = sample.budget.sd_part[NOISE][c]
    if math.isnan(noise) or n < 2 or sample.state & LOW_PASS:
        return sd(sample, c)
    return _root(sd(sample, c) ** 2 - noise ** 2 * (1 - 1 / n))


def sd_of_difference(now, earlier, c):
    """The sd of component c of `now` minus `earlier`, two samples of one sensor."""
    a, b = now.budget.sd_part, earlier.budget.sd_part
    variance = sd(now, c) ** 2 + sd(earlier, c) ** 2
    if math.isnan(a[NOISE][c] + b[NOISE][c]):
        return _root(variance)
    variance -= 2 * a[REFERENCE][c] * b[REFERENCE][c]
    if (now.state ^ earlier.state) & METHOD == 0:
        variance -= 2 * alike(now.budget, earlier.budget) * a[CALIBRATION][c] * b[CALIBRATION][c]
    if (now.epoch, now.tare_count) == (earlier.epoch, earlier.tare_count):
        variance -= 2 * min(a[ZERO][c], b[ZERO][c]) ** 2
    return _root(variance)


def _product(budget, weight_a, sd_a, weight_b, sd_b):
    return sum(weight_a[c] * weight_b[d] * sd_a[c] * sd_b[d] * correlation(budget, c, d)
               for c in range(6) if weight_a[c] != 0 for d in range(6) if weight_b[d] != 0)


def sd_of_sum(samples, weights):
    """The sd of the sum over sensors of weights[i][c] times component c of samples[i]. (0, 0, 1, 0, 0, 0) for each: sum of
    fz. Errors that sensors share add up; where they would cancel, they count as independent."""
    if any(sample.quality not in (1, 2) for sample in samples):  # GOOD, UNCERTAIN
        return math.nan
    variance = reference = references = 0.0
    budgets = [sample.budget for sample in samples]
    for i, (budget, weight) in enumerate(zip(budgets, weights)):
        variance += sum(_product(budget, weight, part, weight, part) for p, part in enumerate(budget.sd_part) if p != REFERENCE)
        of_reference = sum(weight[c] * budget.sd_part[REFERENCE][c] for c in range(6) if weight[c] != 0)
        reference += of_reference
        references += of_reference ** 2
        for other, others_weight in zip(budgets[:i], weights):
            if budget.model != 0 and budget.model == other.model:
                for p in (CALIBRATION, TEMPERATURE, MOTION):
                    variance += 2 * max(0.0, _product(budget, weight, budget.sd_part[p], others_weight, other.sd_part[p]))
    return _root(max(variance, 0.0) + max(reference ** 2, references)) if variance == variance else math.nan


class _Length:
    """A vector of the first n components of the force: its length, unit vector and covariance C."""

    def __init__(self, sample, n):
        force = sample.force_S_N[:n]
        measured = [c for c in range(n) if not math.isnan(force[c])]
        C = {(c, d): covariance(sample, c, d) for c in measured for d in measured}
        self.length = math.hypot(*(force[c] for c in measured)) if measured else math.nan
        self.unit = [force[c] / self.length if c in measured and self.length > 0 else 0.0 for c in range(n)]
        product = [sum(C[c, d] * self.unit[d] for d in measured) for c in measured]
        self.along = sum(product[i] * self.unit[c] for i, c in enumerate(measured))
        self.across = sum(C[c, c] for c in measured) - self.along
        both = sum(x * x for x in product)
        self.shared = both - self.along ** 2
        self.of_across = sum(x * x for x in C.values()) - 2 * both + self.along ** 2

    def value(self):
        trace = self.across + self.along
        if not self.length > SURE * _root(trace):
            return Value(self.length + WITHIN * _root(trace), math.nan, True)
        more = self.of_across / 2 - self.across * self.along - 2 * self.shared
        return Value(self.length, _root(self.along + more / self.length ** 2), False)


def magnitude(sample):
    """The magnitude of the measured components of the force, N."""
    return _Length(sample, 3).value()


def direction(sample):
    """The direction of the force: a unit vector in S, and the root mean square of the angle between it and the true one,
    rad. NaN where the magnitude is a bound."""
    v = _Length(sample, 3)
    if v.value().is_bound:
        return (math.nan,) * 3, math.nan
    more = 3 * (v.across * v.along + 2 * v.shared) - (v.across ** 2 + 2 * v.of_across) * 2 / 3
    return tuple(v.unit), _root((v.across + more / v.length ** 2) / v.length ** 2)


def slip_ratio(sample):
    """The tangential force over the press, |(fx, fy)| / -fz. NaN without a press above 10 sd or without fx and fy; a bound
    where the tangential force is one."""
    v = _Length(sample, 2)
    shear, press, of_press = v.value(), -sample.force_S_N[2], sample.sd_force_N[2]
    if not press > DIVISOR * of_press or math.isnan(sample.force_S_N[0] + sample.force_S_N[1]):
        return Value(math.nan, math.nan, True)
    if shear.is_bound:
        return Value(shear.value / (press - WITHIN * of_press), math.nan, True)
    ratio = shear.value / press
    slope = [v.unit[0] / press, v.unit[1] / press, ratio / press]
    variance = (shear.sd ** 2 - v.along) / press ** 2  # the second order of the shear
    variance += sum(slope[c] * slope[d] * covariance(sample, c, d) for c in range(3) for d in range(3))
    return Value(ratio, _root(variance), False)


def largest_part(sample):
    """The part with the largest share in the variance of the force: a word of PARTS, None if none is known."""
    known = [c for c in range(3) if not math.isnan(sample.sd_force_N[c])]
    squares = [sum(sample.budget.sd_part[part][c] ** 2 for c in known) for part in range(len(PARTS))]
    return PARTS[squares.index(max(squares))] if max(squares) > 0 else None
