#!/usr/bin/env python3
"""Standard deviation from several ways of holding out, judged on the other session of the skin. Needs python3-numpy.

    held_out_ways.py

For the straight line and the quadratic in all channels, fitted to one session: its rows are left out in 5, 10, 25 or 100
stretches of time, or one in ten at random. The sd is max(q68, q95 / 1.96, q99 / 2.58) of the errors on them, in % of
full scale, as `tactilectl calibrate` computes it without the terms for load and hysteresis. It is judged on the other
session by the share of errors within 1 sd (aim: at least 60 %) and beyond 5 sd (at most 3 %), and by sd over error (at
most 1.5). The last line of each pair has the least sd that gives 60 %, and the greatest that gives 1.5.
"""
import numpy
from calibration_holds import number
from real_data import DATA, rows_of

RIDGE = 1e-5


def features(channels, quadratic):
    n = channels.shape[1]
    columns = [numpy.ones(len(channels)), *channels.T]
    if quadratic:
        columns += [channels[:, k] * channels[:, j] for k in range(n) for j in range(k, n)]
    return numpy.column_stack(columns)


def fit(x, y, ridge):
    return numpy.linalg.solve(x.T @ x + ridge * len(x) * numpy.eye(x.shape[1]), x.T @ y)


def main():
    rows = [r for r in rows_of(DATA / "eflesh/normal_labelled.csv") if r["fz_N"]]
    names = [c for c in rows[0] if c[0] == "B"]
    data = {s: (numpy.array([[number(r[c]) for c in names] for r in rows if r["session"] == s]),
                numpy.array([number(r["fz_N"]) for r in rows if r["session"] == s])) for s in "12"}
    for quadratic in (False, True):
        for here, there in ("12", "21"):
            channels, force = data[here]
            mean, width, full_scale = channels.mean(0), channels.std(0), numpy.abs(force).max()
            x, other = features((channels - mean) / width, quadratic), features((data[there][0] - mean) / width, quadratic)
            ridge = RIDGE if quadratic else 1e-9
            error = numpy.abs(other @ fit(x, force, ridge) - data[there][1]) / full_scale * 100
            rms = numpy.sqrt(numpy.mean(error ** 2))
            print(f"{'quadratic' if quadratic else 'line'}, session {here} to {there}: error {rms:.2f} %")
            for parts in (5, 10, 25, 100, 0):
                n = len(force)
                group = numpy.arange(n) * parts // n if parts else numpy.random.default_rng(1).integers(0, 10, n)
                left = numpy.zeros(n)
                for g in set(group):
                    left[group == g] = x[group == g] @ fit(x[group != g], force[group != g], ridge) - force[group == g]
                left = numpy.abs(left) / full_scale * 100
                sd = max(numpy.quantile(left, q) / z for q, z in ((0.6827, 1), (0.95, 1.96), (0.99, 2.576)))
                print(f"  {f'{parts} stretches' if parts else 'rows at random'}: sd {sd:.2f} %; within 1 sd {100 * numpy.mean(error <= sd):.0f} %, "
                      f"beyond 5 sd {100 * numpy.mean(error > 5 * sd):.1f} %, sd over error {sd / rms:.2f}")
            print(f"  needed: at least {numpy.quantile(error, 0.6):.2f} %, at most {1.5 * rms:.2f} %")


if __name__ == "__main__":
    main()
