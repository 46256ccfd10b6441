#!/usr/bin/env python3
"""Writes table_influence.toml beside this file from tests/data/fem/table_influence.csv: microstrain to strain, mm to m."""
import csv
import pathlib

here = pathlib.Path(__file__).resolve().parent
rows = list(csv.reader(open(here.parent.parent / "tests/data/fem/table_influence.csv")))[1:]
with open(here / "table_influence.toml", "w") as out:
    out.write('''# Model "table", method "map": the strain of the eight gauges per 1 N of Fx, Fy and Fz at 961 points of the plate, from
# second-order finite elements of the drawing of Lee, Kim, Shikida and Sato. Made by make_table_influence.py.
# To try things with, and what a fit of method "map" starts from (a scale and a zero for each gauge). No sd: no sample of
# the sensor was measured against it, so every sample says so (uncertain). Written without a crc line; add none.
format = 1
model = "table"
method = "map"
contact_model = "point"
serial = "finite elements"
channels = ["R1", "R2", "R3", "R4", "R5", "R6", "R7", "R8"]
channel_unit = "dR/R0"
zero = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
components = ["fx", "fy", "fz", "mx", "my"]

parameters.gauge_factor = 2.0  # Ni-Cr foil; the documents' numbers would need 18 to 46, see decoupling/table/README.md
parameters.noise = 2e-6        # dR/R0
parameters.contact = 1         # a point

# x y in m; then for R1 .. R8 the strain per N of Fx, Fy, +Fz
tables.influence = [
''')
    for row in rows:
        scale = [1e-3] * 2 + [1e-6] * 24
        out.write("    [" + ", ".join(repr(float("%.8g" % (float(v) * s))) for v, s in zip(row, scale)) + "],\n")
    out.write("]\n")
