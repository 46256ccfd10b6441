#!/usr/bin/env python3
"""Instructions a sample of each effect of the simulator, counted by callgrind: a scene of a sensor model with the
effect alone less the same with none, both over two lengths. Reports the entries of drivers/sim/effects that are off
by more than a fifth.

    sim_instructions.py [--effects a,b] [path of sim_bench]          about 4 minutes
"""
import argparse
import json
import pathlib
import subprocess
import tempfile

import counted

arguments = argparse.ArgumentParser()
arguments.add_argument("bench", nargs="?", default="build/release/bin/sim_bench")
arguments.add_argument("--effects")
wish = arguments.parse_args()
BENCH = pathlib.Path(wish.bench).resolve()
SHORT, LONG = 6400, 19200
SCENE = """format = 1
title = "everything moves"
rate_Hz = 1000
[body]
shape = "{shape}"
radius_m = 0.0003
temperature_C = 33
[[sensor]]
name = "s"
model = "{model}"
{more}
[[motion]]
do = "press"
to_N = {full}
in_s = 1
[[motion]]
do = "shear"
to_N = {half}
direction_deg = 20
in_s = 1
[[motion]]
do = "slide"
speed_m_s = 0.05
in_s = 1
[[motion]]
do = "warm"
ambient_by_K = 2
in_s = 1
[[motion]]
do = "shake"
amplitude_N = {half}
from_Hz = 10
for_s = 1000
"""
root = pathlib.Path(__file__).resolve().parents[2]
ROUND = ("hertz_contact", "contact_patch")  # effects of a round body only; the others meet a textured one
SENSORS = {"table": ('influence = "%s"' % (root / "config/calibration/table_influence.toml"), 0.8), "hair": ("", 0.04), "capacitive": ("", 6.0)}


def a_sample(effects, scene):
    return counted.a_step(lambda samples: [BENCH, "--run", effects, samples, scene], SHORT, LONG)


listed = json.loads(subprocess.run([BENCH.parent / "tactilectl", "simulate", "--list", "--json"], capture_output=True, text=True, check=True).stdout)
with tempfile.TemporaryDirectory() as folder:
    scenes, base = {}, {}
    kinds = [(model, model, more, full, "textured") for model, (more, full) in SENSORS.items()]
    kinds += [("round", "table", *SENSORS["table"], "sphere"), ("array", "table", "array = [2, 2]", SENSORS["table"][1], "textured")]
    for kind, model, more, full, shape in kinds:
        scenes[kind] = pathlib.Path(folder) / f"{kind}.toml"
        scenes[kind].write_text(SCENE.format(model=model, more=more, full=full, half=full / 3, shape=shape))
        base[kind] = a_sample("none", scenes[kind])
        print(f"{'none':24} {kind:11} {base[kind]:8.0f}", flush=True)
    for effect in listed["effects"]:
        if wish.effects and effect["name"] not in wish.effects.split(","):
            continue
        kinds = ["round"] if effect["name"] in ROUND else ["array"] if effect["name"] == "array_spread" else effect["models"]
        measured = {m: a_sample(effect["name"], scenes[m]) - base[m] for m in kinds}
        most = max(measured.values()) / (4 if "array" in measured else 1)  # for one sensor
        off = "" if abs(most - effect["instructions"]) <= 0.2 * most + 3 else f"   entry says {effect['instructions']:.0f}"
        print(f"{effect['name']:24} {' '.join(f'{m} {v:.0f}' for m, v in measured.items()):40} {most:8.0f}{off}", flush=True)
