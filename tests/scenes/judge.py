"""Compares forces with the truth: the limits of a scene's [[expect]], and defects that it must detect.

A Series has one list per axis; times are those of the truth's rows. config/scenes/README.md has the keys.
"""
import bisect
import dataclasses
import math
import operator

AXES = (0, 1, 2)
NOT_JUDGED = 1e4      # limit that judges nothing
EXCITED = 0.05        # rms over the largest force; below, an axis determines no gain, leak or delay
REGRESSION = 0.01     # share of a column's square that those before it do not explain; below, it is not determined
HALF_WIDTH_S = 0.01   # half width of the differences that stand for a rate; delays up to that are measured


@dataclasses.dataclass
class Series:
    t_s: list
    force: list    # [fx, fy, fz], each a list, N; NaN = no value
    sd: list       # the same, stated standard uncertainty; NaN = not known
    quality: list  # "good", "uncertain", "bad"

    def part(self, begin_s, end_s):
        """The samples with begin_s <= t <= end_s."""
        a, b = bisect.bisect_left(self.t_s, begin_s - 1e-9), bisect.bisect_right(self.t_s, end_s + 1e-9)
        return Series(self.t_s[a:b], [f[a:b] for f in self.force], [s[a:b] for s in self.sd], self.quality[a:b])


def delayed(series, by_s):
    """Each force as it was `by_s` before, straight between samples."""
    force = [[] for _ in AXES]
    for t in series.t_s:
        at = t - by_s
        i = min(max(bisect.bisect_right(series.t_s, at), 1), len(series.t_s) - 1)
        a, b = series.t_s[i - 1], series.t_s[i]
        u = min(max((at - a) / (b - a), 0.0), 1.0)
        for axis in AXES:
            f = series.force[axis]
            force[axis].append(f[i - 1] + u * (f[i] - f[i - 1]))
    return dataclasses.replace(series, force=force)


def scaled(series, factors):
    return dataclasses.replace(series, force=[[k * x for x in f] for k, f in zip(factors, series.force)])


def leaking(series, share):
    x, y, z = series.force
    return dataclasses.replace(series, force=[[a + share * c for a, c in zip(x, z)], y, z])


def swapped(series):
    x, y, z = series.force
    return dataclasses.replace(series, force=[y, x, z])


# Defects that are planted in the decoupled force.
DEFECTS = {
    "shear +2 %": lambda s: scaled(s, (1.02, 1.02, 1)),
    "shear +5 %": lambda s: scaled(s, (1.05, 1.05, 1)),
    "press +2 %": lambda s: scaled(s, (1, 1, 1.02)),
    "press +5 %": lambda s: scaled(s, (1, 1, 1.05)),
    "3 % of fz in fx": lambda s: leaking(s, 0.03),
    "sign of fx": lambda s: scaled(s, (-1, 1, 1)),
    "fx and fy swapped": swapped,
    "2 ms late": lambda s: delayed(s, 0.002),
    "5 ms late": lambda s: delayed(s, 0.005),
    "20 ms late": lambda s: delayed(s, 0.020),
    "always good": lambda s: dataclasses.replace(s, quality=["good"] * len(s.t_s)),
    "sd of a third": lambda s: dataclasses.replace(s, sd=[[x / 3 for x in column] for column in s.sd]),
}


def dot(a, b):
    return sum(map(operator.mul, a, b))


def coefficients(columns, y):
    """Least squares of y on the columns; None for a column that those before it explain."""
    kept = []
    for i, column in enumerate(columns):
        rest = list(column)
        for _, basis, square in kept:
            k = dot(rest, basis) / square
            rest = [r - k * b for r, b in zip(rest, basis)]
        square = dot(rest, rest)
        if square > REGRESSION * dot(column, column) and square > 0:
            kept.append((i, rest, square))
    # y on the orthogonal columns, then back to the given ones.
    n = len(kept)
    of_basis = [dot(y, basis) / square for _, basis, square in kept]
    upper = [[dot(columns[kept[b][0]], kept[a][1]) / kept[a][2] if b > a else float(a == b) for b in range(n)]
             for a in range(n)]
    solved = [0.0] * n
    for a in reversed(range(n)):
        solved[a] = of_basis[a] - sum(upper[a][b] * solved[b] for b in range(a + 1, n))
    result = [None] * len(columns)
    for (i, _, _), value in zip(kept, solved):
        result[i] = value
    return result


def centred(column):
    mean = sum(column) / len(column)
    return [x - mean for x in column]


def rates(t_s, force):
    """Differences over HALF_WIDTH_S on each side, at least one sample."""
    step_s = (t_s[-1] - t_s[0]) / max(1, len(t_s) - 1)
    k = max(1, round(HALF_WIDTH_S / step_s))
    last = len(force) - 1
    return [(force[min(i + k, last)] - force[max(i - k, 0)]) / (2 * k * step_s) for i in range(len(force))]


def errors_of(series, truth, share=0.99):
    """{axis: {"worst", "most", "gain", "leak", "late_s", "spread"}}: largest error, and that of `share` of the samples, N; error of
    the gain; the largest share of another axis in it; delay; rms of error over stated sd. None where the series does not
    determine it."""
    result = {axis: dict.fromkeys(("worst", "most", "gain", "leak", "late_s", "spread")) for axis in AXES}
    largest = max((abs(x) for axis in AXES for x in truth[axis]), default=0)
    moved = [centred(truth[axis]) for axis in AXES]
    excited = [math.sqrt(dot(m, m) / len(m)) > EXCITED * largest if m and largest > 0 else False for m in moved]
    for axis in AXES:
        error = [f - F for f, F in zip(series.force[axis], truth[axis])]
        if not error or any(map(math.isnan, error)):
            continue
        one = result[axis]
        sizes = sorted(map(abs, error))
        one["worst"] = sizes[-1]
        one["most"] = sizes[min(len(sizes) - 1, math.ceil(share * len(sizes)))]
        pairs = [(e / s) ** 2 for e, s in zip(error, series.sd[axis]) if s > 0]
        if len(pairs) > 0.5 * len(error):
            one["spread"] = math.sqrt(sum(pairs) / len(pairs))
        columns, names = [], []
        if excited[axis]:
            columns += [moved[axis], [-r for r in centred(rates(series.t_s, truth[axis]))]]
            names += ["gain", "late_s"]
        for other in AXES:
            if other != axis and excited[other]:
                columns.append(moved[other])
                names.append("leak")
        for name, value in zip(names, coefficients(columns, centred(error))):
            if value is not None and (one[name] is None or abs(value) > abs(one[name])):
                one[name] = value
    return result


# key of an [[expect]] -> what it limits
LIMITS = {"gain_within": "gain", "leak_within": "leak", "late_within_s": "late_s", "spread_within": "spread"}


def judge(expect, series, truth, due):
    """Returns the failures of a series as texts; empty = as expected. `truth`: [fx, fy, fz] at its times; `due`:
    expected number of samples."""
    failures = []
    axes = (2,) if expect.get("press_only", False) else AXES
    if "reads_N" in expect:
        truth = [[expect["reads_N"][axis]] * len(series.t_s) for axis in AXES]
    wanted, within = expect.get("quality", "any"), 0
    limits = expect["within_N"]
    for i, quality in enumerate(series.quality):
        right = quality != "bad" and wanted in ("any", quality)
        within += right and all(abs(series.force[a][i] - truth[a][i]) <= limits[a] for a in axes)  # NaN is not within
    share = within / due if due else 0.0
    if share < expect.get("share", 0.99):
        failures.append(f"{100 * share:.2f} % within")
    errors = errors_of(series, truth, expect.get("share", 0.99))
    for key, name in LIMITS.items():
        for axis in axes:
            limit = expect.get(key, [NOT_JUDGED] * 3)[axis]
            if limit >= NOT_JUDGED:
                continue
            value = errors[axis][name]
            if value is None or abs(value) > limit:
                failures.append(f"{name} of f{'xyz'[axis]} {'unknown' if value is None else format(value, '.3g')}")
    return share, errors, failures
