"""A scene without the daemon: simulate and decouple; and the zero of a scene, the mean of a time at rest."""
import csv
import math

from judge import Series

TARE_S = (0.5, 0.58)  # all scenes rest for a second


def signals_of(run_ctl, scene, effects, seed, folder):
    """{sensor: path of its signals.csv}"""
    together = folder / "signals.csv"
    run_ctl("simulate", "--scene", scene.path, "--effects", effects, "--seed", seed, "--out", together)
    if len(scene.sensors) == 1:
        return {next(iter(scene.sensors)): together}
    paths = {}
    with open(together) as file:
        rows = [row for row in csv.reader(file)]
    for name, (_, table) in scene.sensors.items():
        columns = [i for i, field in enumerate(rows[0]) if field.startswith(f"{name}.")]
        paths[name] = folder / f"{name}.csv"
        with open(paths[name], "w") as file:
            writer = csv.writer(file)
            writer.writerow(["t_s", *(rows[0][i].partition(".")[2] for i in columns)])
            writer.writerows([row[0], *(row[i] for i in columns)] for row in rows[1:] if any(row[i] for i in columns))
    return paths


def read_forces(path):
    """A Series from a file of `tactilectl decouple`."""
    columns = {}
    with open(path) as file:
        rows = csv.reader(file)
        fields = next(rows)
        rows = list(rows)
    for i, field in enumerate(fields):
        if field == "quality":
            columns[field] = [row[i].partition(":")[0] for row in rows]
        elif field == "t_s" or field.startswith(("fx", "fy", "fz", "sd_f")):
            columns[field] = [float(row[i]) if row[i] else math.nan for row in rows]
    return Series(columns["t_s"], [columns[f"f{a}_N"] for a in "xyz"], [columns[f"sd_f{a}_N"] for a in "xyz"],
                  columns["quality"])


def tared(series):
    zero = series.part(*TARE_S)
    for axis in range(3):
        known = [f for f in zero.force[axis] if not math.isnan(f)]
        if known:
            mean = sum(known) / len(known)
            series.force[axis] = [f - mean for f in series.force[axis]]
        else:
            series.force[axis] = [math.nan] * len(series.t_s)
    return series
