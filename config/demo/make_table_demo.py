#!/usr/bin/env python3
"""Writes table_demo.csv: the readings of a table-shaped sensor of eight strain gauges in a loop of 20 s.

    python3 make_table_demo.py > table_demo.csv

At rest, pressed down to 1 N, then pulled around a circle of 0.3 N while pressed, released. Columns R1 .. R8 in dR/R0
at 100 Hz, with white noise of 20 ppm (one standard deviation). The gains are those of the sample in Lee et al., "A
Table-Shaped Tactile Sensor for Detecting Triaxial Force on the Basis of Strain Distribution"; outer gauges as in
config/calibration/table_documents.toml. The model is written out here on purpose, from the mechanics: a demo that
used the product's own inverse would prove nothing.
"""
import math
import random
import sys

RATE_HZ = 100
DURATION_S = 20
PRESS_N = 1.0
CIRCLE_N = 0.3
NOISE = 20e-6
SEED = 20260301

NORMAL_INNER = 19366e-6  # dR/R0 at 1 N of uniform press
TANGENTIAL_INNER = 10847e-6  # dR/R0 at 1 N along the gauge's axis
TANGENTIAL_OUTER = 8582e-6

# Four columns are at +x, +y, -x, -y of the plate. A force along +x bends each column forward: its backward side is
# stretched, its forward side compressed. An inner gauge is on the side of its column that faces the plate's centre.
# name: (position of the column along x, along y, inner)
GAUGES = {
    "R1": (-1, 0, True),
    "R2": (-1, 0, False),
    "R3": (0, -1, True),
    "R4": (0, -1, False),
    "R5": (+1, 0, True),
    "R6": (+1, 0, False),
    "R7": (0, +1, True),
    "R8": (0, +1, False),
}


def ease(t, start, end):
    """Returns 0 before start, 1 after end, and a smooth transition in between."""
    u = min(max((t - start) / (end - start), 0.0), 1.0)
    return u * u * (3 - 2 * u)


def force_on_sensor(t):
    """Returns Fx, Fy and the press, N, at t seconds of the loop."""
    press = PRESS_N * (min(max((t - 2) / 3, 0.0), 1.0) - min(max((t - 16) / 2, 0.0), 1.0))
    radius = CIRCLE_N * (ease(t, 5, 6.5) - ease(t, 14, 15.5))
    angle = 2 * math.pi * (t - 6.5) / 3.75  # two revolutions from 6.5 to 14 s
    return radius * math.cos(angle), radius * math.sin(angle), press


def reading(gauge, fx, fy, press):
    x, y, inner = GAUGES[gauge]
    along = fx * x + fy * y  # component of the force from the centre towards this column
    if inner:  # the centre's side is the backward side if the force points outwards
        return TANGENTIAL_INNER * along + NORMAL_INNER * press
    return -TANGENTIAL_OUTER * along


def main():
    noise = random.Random(SEED)
    print("t_s," + ",".join(GAUGES))
    for i in range(RATE_HZ * DURATION_S):
        t = i / RATE_HZ
        force = force_on_sensor(t)
        cells = [f"{reading(gauge, *force) + noise.gauss(0, NOISE):.9f}" for gauge in GAUGES]
        print(f"{t:.2f}," + ",".join(cells))


if __name__ == "__main__":
    sys.exit(main())
