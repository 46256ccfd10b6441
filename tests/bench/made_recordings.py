"""Made calibration recordings of tactile sensors that change over time.

    python3 made_recordings.py OUT_DIR [--seed N] [--count 100] [--jobs 1]

For each i the program writes three files:
    NNN_fit.csv    the part a maker calibrates on
    NNN_later.csv  the same sensor, same mounting, directly afterwards,
                   new loads; never used for the fit
    NNN.json       what was drawn for this recording, and how large each effect
                   came out, channel by channel (for explanation only)
A CSV has the columns t_s, c1, c2, ... and then the reference's loads.

The physics, in the order in which it is made
---------------------------------------------
Loads.  A robot or a hand presses the skin against a reference cell.  With a
"press" contact the skin can only be pushed, and shear cannot exceed friction:
no push, no shear.  Moments come from the place of the push.  With a "bonded"
contact a handle is glued on, so that every component is free of the others.
The way of loading (protocol) is drawn once; its single loads are always new.

Gain.  Each channel feels its own mix of the loads: gain row times (load / full
scale).  The rows form a matrix with a drawn condition number.  With fz alone a
matrix of one column always has condition 1; there the number is the ratio
between the most and the least sensitive channel.

Nonlinearity.  The mix bends: it saturates, stiffens, follows a power law, is
S-shaped, or has a soft dead zone.  The size is the largest distance from the
line through the two end points, as a share of the channel's span.  All the
curves rise everywhere.

Hysteresis.  The channel remembers its past.  Five laws are used, alone or in
pairs: Bouc-Wen (friction that slides smoothly), play (a few dry friction
elements), Preisach (turning points, remembered and wiped out), Maxwell creep
(springs and dampers, 0.5 to 300 s) and creep that goes back more slowly than
it came.  The size is the width of the loop under load: the distance between
the 1 % and 99 % points of what a smooth curve of the load (a cubic) leaves
over, in both parts together.  A third of the sensors are fresh when the
recording starts, so that their first loops differ from the later ones; the
others were pressed before, for a short or a long time (before_s).

Gain drift.  The response, not the zero, grows or shrinks: a straight ageing, a
warm-up, or it follows the temperature.

Zero drift.  Three causes, each partly common to all the channels: a random
walk (size = its standard deviation after one hour), a warm-up that dies away
as exp(-t / tau) (size = what is still to come when the recording starts), and
slow temperature cycles (size = amplitude).

Noise.  White and pink, with a level of its own for each channel.

Units.  At the end come the unit, an offset, and (for counts) whole numbers.

"Full scale" of a channel is its span over the recording, but at least 0.3 of
the largest span of all the channels: the electronics is set up for all of
them, and a hardly loaded channel does not get less noise or drift.  Hysteresis
and nonlinearity belong to the rubber and use the channel's own span.

A drawn size is the upper bound for the channels; each channel gets 0.5 to 1
times that.  About a quarter of the recordings have no drift of any kind.
"""

import argparse
import json
import math
import multiprocessing
import os
import random

PARTS = ("fit", "later")
COMPONENT_SETS = (
    ("fz_N",),
    ("fx_N", "fy_N", "fz_N"),
    ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm"),
)
PROTOCOLS = ("staircase", "presses", "slow_random", "sinusoids", "pose_grid", "robot_ramps")
CURVES = ("saturating", "stiffening", "power", "s_shape", "dead_zone")
HYSTERESIS_MIXES = (
    ("bouc_wen",), ("play",), ("preisach",), ("creep",), ("slow_return",),
    ("bouc_wen", "creep"), ("preisach", "creep"), ("play", "slow_return"),
)
# name, typical span of a channel, whole numbers?
UNITS = (
    ("dR/R", 1e-3, False), ("counts", 1e4, True), ("counts", 5e5, True), ("pF", 2.0, False),
    ("mV", 20.0, False), ("V", 1.0, False), ("uT", 300.0, False), ("kOhm", 30.0, False),
)
WEAK_CHANNEL_FLOOR = 0.3



def log_uniform(rng, low, high):
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def maybe(rng, chance, low, high):
    """A log-uniform size with this chance, otherwise 0."""
    size = log_uniform(rng, low, high)
    return size if rng.random() < chance else 0.0


def channel_sizes(rng, size, count):
    """Each channel gets 0.5 to 1 times the drawn size."""
    return [size * rng.uniform(0.5, 1.0) for _ in range(count)]


def smooth_step(part):
    return part * part * (3.0 - 2.0 * part)


def solve(matrix, right):
    """Gauss elimination with pivoting for a small system."""
    size = len(right)
    rows = [list(row) + [value] for row, value in zip(matrix, right)]
    for col in range(size):
        pivot = max(range(col, size), key=lambda r: abs(rows[r][col]))
        rows[col], rows[pivot] = rows[pivot], rows[col]
        for r in range(col + 1, size):
            factor = rows[r][col] / rows[col][col]
            for k in range(col, size + 1):
                rows[r][k] -= factor * rows[col][k]
    answer = [0.0] * size
    for r in range(size - 1, -1, -1):
        rest = sum(rows[r][k] * answer[k] for k in range(r + 1, size))
        answer[r] = (rows[r][size] - rest) / rows[r][r]
    return answer


def polynomial_fit(x, y, degree):
    """Least squares; the coefficient of x**k at place k. x lies in 0..1."""
    sums = [0.0] * (2 * degree + 1)
    right = [0.0] * (degree + 1)
    for a, b in zip(x, y):
        power = 1.0
        for k in range(2 * degree + 1):
            sums[k] += power
            if k <= degree:
                right[k] += power * b
            power *= a
    ridge = 1e-9 * len(x)
    matrix = [[sums[r + k] + (ridge if r == k else 0.0) for k in range(degree + 1)]
              for r in range(degree + 1)]
    return solve(matrix, right)


def loop_width(x, y, at_rest):
    """The 1 % to 99 % range of y after a cubic in x is taken off, without the
    samples at rest (they would hide the loops of short presses). About 2,000
    samples are enough."""
    each = max(1, len(x) // 2000)
    thinned = list(zip(x[::each], y[::each]))
    pairs = [pair for pair in thinned if abs(pair[0] - at_rest) > 0.03]
    if len(pairs) < 0.1 * len(thinned):
        pairs = thinned
    c0, c1, c2, c3 = polynomial_fit(*zip(*pairs), 3)
    left = sorted(b - (c0 + a * (c1 + a * (c2 + a * c3))) for a, b in pairs)
    count = len(left)
    return left[int(0.99 * (count - 1))] - left[int(0.01 * (count - 1))]


def orthonormal_columns(rng, rows, cols):
    """Random columns of length 1, at right angles to each other (Gram-Schmidt)."""
    columns = []
    while len(columns) < cols:
        column = [rng.gauss(0, 1) for _ in range(rows)]
        for _ in range(2):
            for other in columns:
                along = sum(a * b for a, b in zip(column, other))
                column = [a - along * b for a, b in zip(column, other)]
        length = math.sqrt(sum(a * a for a in column))
        if length > 1e-3:
            columns.append([a / length for a in column])
    return columns


def draw_classes(seed, index):
    """Components, drift or not, and protocol: balanced in blocks, so that any
    count gives thirds and quarters, and recording i never depends on count."""
    pairs = [(c, d) for c in COMPONENT_SETS for d in (False, True, True, True)]
    random.Random(f"pairs {seed} {index // 12}").shuffle(pairs)
    protocols = list(PROTOCOLS)
    random.Random(f"protocols {seed} {index // 6}").shuffle(protocols)
    components, drifts = pairs[index % 12]
    return components, drifts, protocols[index % 6]


def draw_timing(rng):
    """Length and rate that keep 1,000 to 6,000 rows in each part at 2 to 20 Hz.
    (6,000 rows at 2 Hz are 50 minutes, so no part is longer than that.)"""
    seconds = log_uniform(rng, 300.0, 2990.0)
    rate = log_uniform(rng, max(2.0, 1010.0 / seconds), min(20.0, 5990.0 / seconds))
    start = rng.choice((
        0.0, rng.uniform(0.1, 60.0), log_uniform(rng, 60.0, 1e5), 1.7e9 + rng.uniform(0, 8e7)))
    return {
        "part_s": seconds,
        "rate_hz": rate,
        "rows": int(seconds * rate),
        "t_start_s": round(start, 4),
        "interval_jitter": rng.choice((0.0, rng.uniform(0.002, 0.03))),
        "before_s": rng.choice((0.0, rng.uniform(20.0, 240.0), seconds * rng.uniform(0.2, 1.0))),
    }


def draw_contact(rng, components):
    """Full scale of each component, and how the loads hang together."""
    push = log_uniform(rng, 0.5, 200.0)
    shear = push * rng.uniform(0.2, 0.7)
    arm = log_uniform(rng, 0.003, 0.03)
    scales = {"fz_N": push, "fx_N": shear, "fy_N": shear * rng.uniform(0.7, 1.3),
              "mx_Nm": push * arm, "my_Nm": push * arm * rng.uniform(0.6, 1.5)}
    kind = "press"
    if len(components) > 1 and rng.random() < 0.3:
        kind = "bonded"
    return {
        "kind": kind,
        "pull_too": kind == "bonded" and rng.random() < 0.5,
        "push_sign": -1 if rng.random() < 0.2 else 1,
        "full_scale": {name: scales[name] for name in components},
        "label_noise_share": {name: rng.uniform(0.001, 0.005) for name in components},
    }


def draw_protocol(rng, name, timing, count):
    """The manner of loading; the same for both parts."""
    dt = 1.0 / timing["rate_hz"]
    longest = max(timing["part_s"] / (60.0 + 20.0 * count), 6.0 * dt)
    habit = rng.choice(("every_time", "sometimes", "never"))
    if name in ("slow_random", "sinusoids"):
        habit = rng.choice(("sometimes", "never"))
    hold = log_uniform(rng, min(max(0.8, 4.0 * dt), 0.6 * longest), min(longest, 40.0))
    return {
        "name": name,
        "rest_habit": habit,
        "hold_s": hold,
        "rest_s": hold * rng.uniform(0.5, 2.0),
        "ramp_s": max(dt, log_uniform(rng, 0.15, 1.2) * min(hold, 8.0)),
        "preload": rng.uniform(0.04, 0.25) if habit == "never" else 0.0,
        "depth_power": rng.choice((0.6, 1.0, 1.0, 1.7)),
        "steps": rng.randint(3, 8 if count == 1 else 5),
        "way_down_too": rng.random() < 0.7,
        "overshoot": rng.uniform(0.0, 0.08),
        "correlation_s": log_uniform(rng, max(2.0, 6.0 * dt), min(30.0, timing["part_s"] / 60.0)),
        "frequency_hz": log_uniform(rng, max(0.02, 20.0 / timing["part_s"]),
                                    min(0.7, timing["rate_hz"] / 10.0)),
        "grid": [rng.randint(2, 4), rng.randint(2, 4)],
        "ripple": log_uniform(rng, 0.0005, 0.008),
    }


def draw_sensor(rng, components):
    """Channels, gain, curve and hysteresis."""
    count = len(components)
    fewest = max(4, count + 1)
    channels = fewest if rng.random() < 0.2 else rng.randint(fewest, 16)
    unit, span, whole = rng.choice(UNITS)
    hysteresis = () if rng.random() < 0.12 else rng.choice(HYSTERESIS_MIXES)
    return {
        "channels": channels,
        "condition": log_uniform(rng, 3.0, 60.0),
        "unit": unit,
        "unit_span": span * log_uniform(rng, 0.3, 3.0),
        "whole_numbers": whole,
        "mixed_sizes": rng.random() < 0.15,
        "offset_in_spans": log_uniform(rng, 0.05, 30.0),
        "curve": rng.choice(CURVES),
        "nonlinearity": 0.0 if rng.random() < 0.1 else 0.2 * rng.random() ** 1.5,
        "hysteresis_laws": list(hysteresis),
        "hysteresis": log_uniform(rng, 0.003, 0.15) if hysteresis else 0.0,
        "noise_rms": log_uniform(rng, 0.0002, 0.01),
        "pink_share": rng.uniform(0.0, 0.85),
    }


def draw_drift(rng, drifts):
    """Sizes as shares of full scale. Without drift all sizes are 0."""
    sizes = {
        "walk_per_hour": maybe(rng, 0.7, 0.003, 0.30),
        "warm_up": maybe(rng, 0.6, 0.005, 0.30),
        "temperature": maybe(rng, 0.5, 0.002, 0.06),
        "gain": maybe(rng, 0.5, 0.003, 0.10),
    }
    if not any(sizes.values()):
        sizes["walk_per_hour"] = log_uniform(rng, 0.003, 0.30)
    if not drifts:
        sizes = dict.fromkeys(sizes, 0.0)
    sizes.update({
        "present": drifts,
        "warm_up_tau_s": log_uniform(rng, 180.0, 2400.0),
        "temperature_period_s": log_uniform(rng, 360.0, 3600.0),
        "temperature_phase": rng.uniform(0.0, 2.0 * math.pi),
        "gain_kind": rng.choice(("ageing", "warm_up", "temperature")),
        "common_share": rng.uniform(0.0, 0.95),
    })
    return sizes



def make_times(rng, timing):
    """Times from the start of the recording on; the hidden time before it is
    negative. Both parts follow each other without a gap."""
    dt = 1.0 / timing["rate_hz"]
    before = int(timing["before_s"] * timing["rate_hz"])
    jitter = timing["interval_jitter"] * dt
    times = [k * dt for k in range(-before, 2 * timing["rows"])]
    if jitter:
        times = [t + max(-0.3 * dt, min(0.3 * dt, rng.gauss(0.0, jitter))) for t in times]
        first = times[before]
        times = [t - first for t in times]
    return times, before


def draw_pose(rng, protocol, contact):
    """One target: depth, shear x, shear y, place x, place y; all within -1..1."""
    depth = 0.05 + 0.95 * rng.random() ** protocol["depth_power"]
    if contact["pull_too"] and rng.random() < 0.5:
        depth = -depth
    return [depth] + [rng.uniform(-1.0, 1.0) for _ in range(4)]


def part_of_pose(pose, level, contact):
    """The pose at a lower force. Under friction the shear follows the push by
    itself (see loads_from_pose); a glued handle has to lower all of it."""
    if contact["kind"] == "press":
        return [pose[0] * level] + pose[1:]
    return [value * level for value in pose]


def staircase_moves(rng, protocol, contact):
    pose = draw_pose(rng, protocol, contact)
    pose[0] = math.copysign(max(abs(pose[0]), 0.4), pose[0])
    steps = protocol["steps"] + rng.choice((-1, 0, 1))
    levels = [(k + rng.uniform(-0.2, 0.2)) / steps for k in range(1, steps)] + [1.0]
    if protocol["way_down_too"]:
        levels += [(k + rng.uniform(-0.2, 0.2)) / steps for k in range(steps - 1, 0, -1)]
    return [(part_of_pose(pose, level, contact), 0.5, 1.0) for level in levels]


def press_moves(rng, protocol, contact):
    pose = draw_pose(rng, protocol, contact)
    return [(pose, rng.uniform(0.5, 1.5), rng.uniform(0.3, 1.7))]


def grid_moves(rng, protocol, contact):
    """One walk over a grid of poses; each visit lands a little beside its place."""
    wide, high = protocol["grid"]
    places = [(2.0 * a / (wide - 1) - 1.0, 2.0 * b / (high - 1) - 1.0)
              for a in range(wide) for b in range(high)]
    if rng.random() < 0.5:
        rng.shuffle(places)
    shears = draw_pose(rng, protocol, contact)
    moves = []
    for x, y in places:
        pose = draw_pose(rng, protocol, contact)
        pose[0] = round(pose[0] * 4.0) / 4.0 or 0.25
        pose[1:3] = [0.6 * s + 0.4 * p for s, p in zip(shears[1:3], pose[1:3])]
        pose[3:5] = [x, y]
        pose = [max(-1.0, min(1.0, v * 0.95 + rng.gauss(0.0, 0.02))) for v in pose]
        moves.append((pose, 1.0, 1.0))
    return moves


def ramp_moves(rng, protocol, contact):
    """The force rises at a set speed, shoots over a little, settles, sometimes holds."""
    pose = draw_pose(rng, protocol, contact)
    over = part_of_pose(pose, 1.0 + protocol["overshoot"], contact)
    travel = 1.0 + 4.0 * abs(pose[0])
    return [(over, travel, 0.0), (pose, 0.3, rng.choice((0.0, 0.0, rng.uniform(0.3, 1.2))))]


MOVES = {"staircase": staircase_moves, "presses": press_moves,
         "pose_grid": grid_moves, "robot_ramps": ramp_moves}


def event_way_points(rng, protocol, contact, start, end):
    """The list of (time, pose) the robot passes; it stays for a hold at each."""
    make_moves = MOVES[protocol["name"]]
    rest = [protocol["preload"], 0.0, 0.0, 0.0, 0.0]
    chance = {"every_time": 1.0, "sometimes": 0.2, "never": 0.0}[protocol["rest_habit"]]
    now = start + protocol["rest_s"]
    points = [(start, rest), (now, rest)]
    each_move = protocol["name"] == "pose_grid"
    while now < end:
        moves = make_moves(rng, protocol, contact)
        for place, (pose, ramp, hold) in enumerate(moves):
            now += protocol["ramp_s"] * ramp
            points.append((now, pose))
            if hold:
                now += protocol["hold_s"] * hold
                points.append((now, pose))
            last = place == len(moves) - 1
            if (last or each_move) and rng.random() < chance:
                now += protocol["ramp_s"]
                away = [0.0] + pose[1:] if contact["kind"] == "press" else rest
                points.append((now, away))
                now += protocol["rest_s"] * rng.uniform(0.6, 1.4)
                points.append((now, away))
    return points


def follow_way_points(points, times, linear):
    """Poses at the times, between way points straight or smooth."""
    poses = []
    place = 0
    for t in times:
        while place < len(points) - 2 and points[place + 1][0] <= t:
            place += 1
        (t0, p0), (t1, p1) = points[place], points[place + 1]
        part = min(1.0, max(0.0, (t - t0) / (t1 - t0)))
        if not linear:
            part = smooth_step(part)
        poses.append([a + part * (b - a) for a, b in zip(p0, p1)])
    return poses


def rest_gate(rng, protocol, times):
    """1 while in contact, 0 at rest; for the continuous protocols."""
    if protocol["rest_habit"] == "never":
        return [1.0] * len(times)
    points = [(times[0], [1.0])]
    now = times[0]
    while now < times[-1]:
        now += rng.uniform(6.0, 20.0) * protocol["correlation_s"]
        points.append((now, [1.0]))
        now += 2.0
        points.append((now, [0.0]))
        now += rng.uniform(0.5, 2.0) * protocol["correlation_s"]
        points.append((now, [0.0]))
        now += 2.0
        points.append((now, [1.0]))
    return [value[0] for value in follow_way_points(points, times, False)]


def slow_random_poses(rng, protocol, contact, times):
    """White noise through two slow filters, squeezed into the range."""
    columns = []
    dt = (times[-1] - times[0]) / (len(times) - 1)
    for axis in range(5):
        keep = math.exp(-dt / (protocol["correlation_s"] * rng.uniform(0.7, 1.4)))
        first = second = 0.0
        raw = []
        for _ in times:
            first = keep * first + (1.0 - keep) * rng.gauss(0.0, 1.0)
            second = keep * second + (1.0 - keep) * first
            raw.append(second)
        rms = math.sqrt(sum(v * v for v in raw) / len(raw))
        column = [math.tanh(1.1 * v / rms) for v in raw]
        if axis == 0 and not contact["pull_too"]:
            low = protocol["preload"]
            column = [low + (1.0 - low) * (0.5 + 0.5 * v) for v in column]
        columns.append(column)
    return [list(pose) for pose in zip(*columns)]


def sinusoid_poses(rng, protocol, contact, times):
    """Sinusoids; middle, amplitude and frequency change every few cycles."""
    columns = []
    for axis in range(5):
        base = protocol["frequency_hz"] * rng.uniform(0.5, 1.0)
        points = [(times[0], [0.0, 0.0, base])]
        now = times[0]
        while now < times[-1]:
            now += rng.uniform(2.0, 6.0) / base
            amplitude = rng.uniform(0.1, 1.0)
            middle = rng.uniform(-1.0, 1.0) * (1.0 - amplitude)
            points.append((now, [middle, amplitude, base * rng.uniform(0.7, 1.0)]))
        phase = rng.uniform(0.0, 2.0 * math.pi)
        before = times[0]
        column = []
        for t, (middle, amplitude, freq) in zip(times, follow_way_points(points, times, True)):
            phase += 2.0 * math.pi * freq * (t - before)
            before = t
            column.append(middle + amplitude * math.sin(phase))
        if axis == 0 and not contact["pull_too"]:
            low = protocol["preload"]
            column = [low + (1.0 - low) * (0.5 + 0.5 * v) for v in column]
        columns.append(column)
    return [list(pose) for pose in zip(*columns)]


def make_poses(rng, protocol, contact, times):
    name = protocol["name"]
    if name in MOVES:
        points = event_way_points(rng, protocol, contact, times[0], times[-1] + 1.0)
        return follow_way_points(points, times, name == "robot_ramps")
    make = slow_random_poses if name == "slow_random" else sinusoid_poses
    poses = make(rng, protocol, contact, times)
    gates = rest_gate(rng, protocol, times)
    return [part_of_pose(pose, gate, contact) for pose, gate in zip(poses, gates)]


def loads_from_pose(pose, contact):
    """Loads as shares of full scale, by component name."""
    depth, shear_x, shear_y, place_x, place_y = pose
    sign = contact["push_sign"]
    if contact["kind"] == "bonded":
        return {"fx_N": shear_x, "fy_N": shear_y, "fz_N": sign * depth,
                "mx_Nm": place_y, "my_Nm": place_x}
    return {"fx_N": depth * shear_x, "fy_N": depth * shear_y, "fz_N": sign * depth,
            "mx_Nm": sign * depth * place_y, "my_Nm": -sign * depth * place_x}


def make_loads(rng, components, protocol, contact, times):
    """One list of shares of full scale for each component; a held force
    trembles a little, as that of any robot does."""
    poses = make_poses(rng, protocol, contact, times)
    tremble = [0.0] * 5
    columns = [[] for _ in components]
    for pose in poses:
        size = protocol["ripple"] * min(1.0, 5.0 * abs(pose[0]))
        tremble = [0.7 * v + 0.7 * rng.gauss(0.0, 1.0) for v in tremble]
        pose = [p + size * v for p, v in zip(pose, tremble)]
        if contact["kind"] == "press":
            pose[0] = max(0.0, pose[0])
        loads = loads_from_pose(pose, contact)
        for column, name in zip(columns, components):
            column.append(loads[name])
    return columns



def make_gain(rng, sensor, count):
    """Rows of gains. The singular values lie between 1 and 1 / condition."""
    channels, condition = sensor["channels"], sensor["condition"]
    if count == 1:
        powers = [0.0, 1.0] + [rng.random() for _ in range(channels - 2)]
        rng.shuffle(powers)
        return [[rng.choice((-1.0, 1.0, 1.0)) * condition ** -p] for p in powers]
    left = orthonormal_columns(rng, channels, count)
    right = orthonormal_columns(rng, count, count)
    powers = [0.0, 1.0] + [rng.random() for _ in range(count - 2)]
    values = [condition ** -p for p in powers]
    return [[sum(values[k] * left[k][row] * right[k][col] for k in range(count))
             for col in range(count)] for row in range(channels)]


def mix_loads(gain_row, columns):
    if len(columns) == 1:
        gain = gain_row[0]
        return [gain * v for v in columns[0]]
    return [sum(g * v for g, v in zip(gain_row, loads)) for loads in zip(*columns)]


def bent(kind, z):
    """A strongly bent curve from (0, 0) to (1, 1) that rises everywhere."""
    if kind == "saturating":
        return (1.0 - math.exp(-4.0 * z)) / (1.0 - math.exp(-4.0))
    if kind == "stiffening":
        return z / (1.0 + 5.0 * (1.0 - z))
    if kind == "power":
        low = 0.01 ** 0.4
        return ((z + 0.01) ** 0.4 - low) / (1.01 ** 0.4 - low)
    if kind == "s_shape":
        return 0.5 + 0.5 * math.tanh(8.0 * (z - 0.5)) / math.tanh(4.0)
    low, high = (math.log1p(math.exp((v - 0.3) / 0.05)) for v in (0.0, 1.0))
    return (math.log1p(math.exp((z - 0.3) / 0.05)) - low) / (high - low)


def bend(kind, size, z):
    """Blend of line and bent curve whose largest distance from the line is size."""
    if not size:
        return list(z)
    largest = max(abs(bent(kind, k / 400.0) - k / 400.0) for k in range(401))
    share = size / largest
    return [(1.0 - share) * v + share * bent(kind, v) for v in z]



def bouc_wen(rng, z, times):
    """dh = dz / yield * (1 - |h|^n * (beta + gamma * sign(dz * h)))."""
    slip = log_uniform(rng, 0.05, 0.4)
    power = rng.uniform(1.0, 2.0)
    beta = rng.uniform(0.5, 1.0)
    h, last, out = 0.0, z[0], []
    for value in z:
        change = (value - last) / slip
        last = value
        parts = 1 + int(abs(change) / 0.15)
        step = change / parts
        for _ in range(parts):
            turn = beta + (1.0 - beta if step * h > 0 else beta - 1.0)
            h += step * (1.0 - abs(h) ** power * turn)
        out.append(h)
    return out


def play(rng, z, times):
    """A sum of dry friction elements with different slips."""
    slips = [log_uniform(rng, 0.02, 0.3) for _ in range(5)]
    weights = [rng.uniform(0.3, 1.0) for _ in slips]
    states = [z[0]] * len(slips)
    out = []
    for value in z:
        total = 0.0
        for k, slip in enumerate(slips):
            state = states[k]
            if value - state > slip:
                state = value - slip
            elif state - value > slip:
                state = value + slip
            states[k] = state
            total += weights[k] * state
        out.append(total)
    return out


def preisach(rng, z, times):
    """Turning points are remembered in pairs; a loop that closes wipes out its
    pair. Branches follow d^p; the bent input makes the loops differ with load."""
    power = rng.uniform(1.3, 2.2)
    warp = log_uniform(rng, 0.6, 1.7)
    half = 2.0 * 0.5 ** power
    last = max(z[0], 0.0) ** warp
    origin, turns, way, y, out = last, [(last, 0.0)], 0, 0.0, []
    for value in z:
        x = max(value, 0.0) ** warp
        if x != last:
            new_way = 1 if x > last else -1
            if way and new_way != way:
                turns.append((last, y))
            way = new_way
            while len(turns) >= 3 and (x - turns[-2][0]) * way > 0:
                del turns[-2:]
            if len(turns) == 2 and (x - (2.0 * origin - turns[1][0])) * way > 0:
                del turns[1]
            start, level = turns[-1]
            scale = 1.0 if len(turns) == 1 else half
            side = way if len(turns) > 1 else (1 if x > origin else -1)
            y = level + side * scale * abs(x - start) ** power
            last = x
        out.append(y)
    return out


def creep_with(rng, z, times, slower_return):
    """Springs and dampers: each arm follows the load with its own time
    constant; on the way back it may need slower_return times as long."""
    arms = rng.randint(1, 4)
    taus = [log_uniform(rng, 0.5, 300.0 / slower_return) for _ in range(arms)]
    weights = [rng.uniform(0.3, 1.0) for _ in taus]
    out = [0.0] * len(z)
    for weight, tau in zip(weights, taus):
        there, back = -1.0 / tau, -1.0 / (tau * slower_return)
        state, last = z[0], times[0]
        for k, t in enumerate(times):
            gap = z[k] - state
            state -= gap * math.expm1((t - last) * (there if gap > 0 else back))
            last = t
            out[k] += weight * state
    return out


def creep(rng, z, times):
    return creep_with(rng, z, times, 1.0)


def slow_return(rng, z, times):
    return creep_with(rng, z, times, rng.uniform(1.5, 5.0))


LAWS = {"bouc_wen": bouc_wen, "play": play, "preisach": preisach,
        "creep": creep, "slow_return": slow_return}


def make_hysteresis(rng_seed, rng, laws, size, z, at_rest, times, first):
    """The memory part of a channel with the drawn width, and its widths in the
    two parts. The straight part is taken off, because it would only be more
    gain. All the channels of one sensor share the law and its numbers (same
    rubber): hence rng_seed."""
    total = [0.0] * len(z)
    shown = z[first:]
    for place, law in enumerate(laws):
        part = LAWS[law](random.Random(f"{rng_seed} {place}"), z, times)
        width = loop_width(shown, part[first:], at_rest)
        if width <= 1e-9:
            continue
        weight = rng.uniform(0.5, 1.0) / width
        total = [a + weight * b for a, b in zip(total, part)]
    c0, c1 = polynomial_fit(shown, total[first:], 1)
    total = [h - c0 - c1 * v for h, v in zip(total, z)]
    width = loop_width(shown, total[first:], at_rest)
    factor = size / width if width > 1e-9 else 0.0
    total = [factor * h for h in total]
    middle = (first + len(z)) // 2
    return total, (loop_width(z[first:middle], total[first:middle], at_rest),
                   loop_width(z[middle:], total[middle:], at_rest))



def random_walk(rng, times, per_hour):
    value, last, out = 0.0, times[0], []
    for t in times:
        value += per_hour * math.sqrt(max(0.0, t - last) / 3600.0) * rng.gauss(0.0, 1.0)
        last = t
        out.append(value)
    return out


def temperature_course(rng, drift, times):
    """About -1..1; cycles of a slowly changing length."""
    period, phase = drift["temperature_period_s"], drift["temperature_phase"]
    wobble_period = period * rng.uniform(2.0, 4.0)
    wobble_phase = rng.uniform(0.0, 2.0 * math.pi)
    return [math.sin(2.0 * math.pi * t / period + phase
                     + 0.7 * math.sin(2.0 * math.pi * t / wobble_period + wobble_phase))
            for t in times]


def make_courses(rng, drift, times, first):
    """Returns temperature, warm-up and a common walk, which all channels share.
    The gain's course runs over 0..1 during the two parts."""
    tau = drift["warm_up_tau_s"]
    temperature = temperature_course(rng, drift, times)
    warm_up = [math.exp(-t / tau) for t in times]
    kind = drift["gain_kind"]
    gain = {"ageing": times, "warm_up": warm_up, "temperature": temperature}[kind]
    low, high = min(gain[first:]), max(gain[first:])
    gain = [(v - low) / (high - low) for v in gain]
    return {"temperature": temperature, "warm_up": warm_up, "gain": gain,
            "walk": random_walk(rng, times, 1.0)}


def common_or_own(rng, share):
    """A factor within -1..1, alike for all the channels when share is near 1."""
    return share + (1.0 - share) * rng.uniform(-1.0, 1.0)


def make_zero_drift(rng, drift, courses, times):
    """Zero drift of one channel, in shares of its full scale, and its sizes."""
    share = drift["common_share"]
    walk_size = drift["walk_per_hour"] * rng.uniform(0.5, 1.0)
    warm_size = drift["warm_up"] * common_or_own(rng, share)
    heat_size = drift["temperature"] * common_or_own(rng, share)
    out = [warm_size * w + heat_size * h
           for w, h in zip(courses["warm_up"], courses["temperature"])]
    if walk_size:
        own = random_walk(rng, times, walk_size * math.sqrt(1.0 - share * share))
        together = walk_size * share
        out = [a + b + together * c for a, b, c in zip(out, own, courses["walk"])]
    return out, {"walk_per_hour": walk_size, "warm_up": warm_size, "temperature": heat_size}


def pink_noise(rng, count):
    """White noise through three filters (Kellet), set to rms 1."""
    a = b = c = 0.0
    out = []
    gauss = rng.gauss
    for _ in range(count):
        w = gauss(0.0, 1.0)
        a = 0.99765 * a + w * 0.0990460
        b = 0.96300 * b + w * 0.2965164
        c = 0.57000 * c + w * 1.0526913
        out.append(a + b + c + w * 0.1848)
    rms = math.sqrt(sum(v * v for v in out) / count)
    return [v / rms for v in out]


def make_noise(rng, rms, pink_share, count):
    """White and pink noise together; their powers add up to rms squared."""
    white = rms * math.sqrt(1.0 - pink_share)
    pink = rms * math.sqrt(pink_share)
    gauss = rng.gauss
    return [white * gauss(0.0, 1.0) + pink * v for v in pink_noise(rng, count)]



def clean_channels(rng, seed_text, sensor, gain, columns, times, first):
    """Bent and remembering answers before any drift; 0 at no load."""
    size = sensor["channels"]
    bends = channel_sizes(rng, sensor["nonlinearity"], size)
    widths = channel_sizes(rng, sensor["hysteresis"], size)
    answers, spans, part_widths = [], [], []
    for row, bend_size, width in zip(gain, bends, widths):
        mix = mix_loads(row, columns)
        low, high = min(min(mix), 0.0), max(max(mix), 0.0)
        span = high - low
        z = [(v - low) / span for v in mix]
        z_rest = -low / span
        at_rest = bend(sensor["curve"], bend_size, [z_rest])[0]
        answer = bend(sensor["curve"], bend_size, z)
        if width:
            memory, widths_of_parts = make_hysteresis(
                seed_text + " rubber", rng, sensor["hysteresis_laws"],
                width, z, z_rest, times, first)
            part_widths.append(widths_of_parts)
            answer = [a + b for a, b in zip(answer, memory)]
        answers.append([span * (v - at_rest) for v in answer])
        spans.append(span)
    largest = max(spans)
    answers = [[v / largest for v in answer] for answer in answers]
    spans = [span / largest for span in spans]
    sizes = {"span": spans, "nonlinearity": bends, "hysteresis": widths}
    for place, part in enumerate(PARTS):
        sizes[f"hysteresis_in_{part}"] = [pair[place] for pair in part_widths]
    return answers, spans, sizes


def add_time_and_unit(rng, sensor, drift, courses, answer, span, times, first):
    """One channel as its electronics would report it, and what it got."""
    full_scale = max(span, WEAK_CHANNEL_FLOOR)
    zero, sizes = make_zero_drift(rng, drift, courses, times)
    gain_size = drift["gain"] * common_or_own(rng, drift["common_share"])
    rms = sensor["noise_rms"] * log_uniform(rng, 0.5, 2.0)
    pink = min(1.0, sensor["pink_share"] * rng.uniform(0.5, 1.1))
    noise = make_noise(rng, rms, pink, len(times))
    unit = sensor["unit_span"] * log_uniform(rng, 0.7, 1.4)
    if sensor["mixed_sizes"]:
        unit *= log_uniform(rng, 0.01, 100.0)
    offset = unit * sensor["offset_in_spans"] * rng.uniform(0.7, 1.3)
    if not sensor["whole_numbers"] and rng.random() < 0.3:
        offset = -offset
    values = [offset + unit * (a * (1.0 + gain_size * g) + full_scale * (d + n))
              for a, g, d, n in zip(answer, courses["gain"], zero, noise)]
    if sensor["whole_numbers"]:
        values = [float(round(v)) for v in values]
    start, middle, end = zero[first], zero[(first + len(zero)) // 2], zero[-1]
    sizes.update({"gain": gain_size, "noise_rms": rms, "pink_share": pink,
                  "unit_per_largest_span": unit, "offset": offset, "full_scale": full_scale * unit,
                  "zero_change_in_fit": middle - start, "zero_change_in_later": end - middle})
    return values, sizes


def make_labels(rng, components, contact, columns):
    """The reference's readings, with its own small noise."""
    labels = []
    for name, column in zip(components, columns):
        scale = contact["full_scale"][name]
        noise = contact["label_noise_share"][name]
        labels.append([scale * (v + noise * rng.gauss(0.0, 1.0)) for v in column])
    return labels


def write_part(path, header, times, columns):
    with open(path, "w", encoding="ascii", newline="\n") as out:
        out.write(",".join(header) + "\n")
        form = ",".join(["%.4f"] + ["%.8g"] * len(columns)) + "\n"
        out.writelines(form % row for row in zip(times, *columns))


def rounded(value):
    if isinstance(value, float):
        return float(f"{value:.6g}") if abs(value) < 1e8 else round(value, 4)
    if isinstance(value, dict):
        return {key: rounded(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(v) for v in value]
    return value


def make_recording(job):
    """Draw, make and write recording `index`; returns the line to print."""
    out_dir, seed, index = job
    text = f"recording {seed} {index}"
    rng = random.Random(text)
    components, drifts, protocol_name = draw_classes(seed, index)
    timing = draw_timing(rng)
    contact = draw_contact(rng, components)
    protocol = draw_protocol(rng, protocol_name, timing, len(components))
    sensor = draw_sensor(rng, components)
    drift = draw_drift(rng, drifts)

    times, first = make_times(rng, timing)
    rows = timing["rows"]
    fit = slice(first, first + rows)
    later = slice(first + rows, first + 2 * rows)
    columns = make_loads(rng, components, protocol, contact, times)
    gain = make_gain(rng, sensor, len(components))
    answers, spans, per_channel = clean_channels(rng, text, sensor, gain, columns, times, first)
    courses = make_courses(rng, drift, times, first)
    channels = []
    for answer, span in zip(answers, spans):
        values, sizes = add_time_and_unit(
            rng, sensor, drift, courses, answer, span, times, first)
        channels.append(values)
        for key, value in sizes.items():
            per_channel.setdefault(key, []).append(value)

    outputs = channels + make_labels(rng, components, contact, columns)
    clock = [timing["t_start_s"] + t for t in times]
    header = ["t_s"] + [f"c{k + 1}" for k in range(len(channels))] + list(components)
    name = os.path.join(out_dir, f"{index:03d}")
    for part, rows_of_part in zip(PARTS, (fit, later)):
        write_part(f"{name}_{part}.csv", header, clock[rows_of_part],
                   [column[rows_of_part] for column in outputs])
    story = {"index": index, "seed": seed, "components": list(components), "timing": timing,
             "contact": contact, "protocol": protocol, "sensor": sensor, "drift": drift,
             "gain_rows": gain, "per_channel": per_channel}
    with open(f"{name}.json", "w", encoding="ascii") as out:
        json.dump(rounded(story), out, indent=1)
    return describe(story)


def describe(story):
    sensor, drift, timing = story["sensor"], story["drift"], story["timing"]
    shares = " ".join(f"{label} {100.0 * value:.1f}%" for label, value in (
        ("bend", sensor["nonlinearity"]), ("hyst", sensor["hysteresis"]),
        ("noise", sensor["noise_rms"]), ("walk/h", drift["walk_per_hour"]),
        ("warm-up", drift["warm_up"]), ("temp", drift["temperature"]), ("gain", drift["gain"])))
    return (f"{story['index']:03d} {len(story['components'])} of {sensor['channels']:2d} ch "
            f"cond {sensor['condition']:4.1f} {timing['part_s'] / 60.0:4.1f} min "
            f"{timing['rate_hz']:4.1f} Hz {timing['rows']} rows "
            f"{story['protocol']['name']} rest={story['protocol']['rest_habit']} "
            f"{story['contact']['kind']} {sensor['curve']} "
            f"{'+'.join(sensor['hysteresis_laws']) or 'no_hyst'} {sensor['unit']} | {shares}"
            f"{'' if drift['present'] else ' | NO DRIFT'}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out_dir")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=1, help="processes at the same time")
    options = parser.parse_args()
    os.makedirs(options.out_dir, exist_ok=True)
    jobs = [(options.out_dir, options.seed, index) for index in range(options.count)]
    if options.jobs > 1:
        with multiprocessing.Pool(options.jobs) as pool:
            for line in pool.imap(make_recording, jobs):
                print(line, flush=True)
        return
    for job in jobs:
        print(make_recording(job), flush=True)


if __name__ == "__main__":
    main()
