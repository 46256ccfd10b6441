#!/usr/bin/env python3
"""Labelled recordings of simulated tactile sensors, from first principles, as a maker would have them.

    made_skins.py [--out DIR] [--seed N] [--only NAME ...]

Writes NAME_fit.csv (sessions 1, 2), NAME_one.csv (session 1), NAME_unseen.csv (session 3); for six-axis cells
also NAME_single.csv (sessions 4, 5, one axis at a time) and NAME_combined.csv (session 6, combinations).
Columns: t_s, channels, fx_N .. mz_Nm, session. Frame: z out of the skin, a press has fz < 0.

All have in common, on top of each sensor's physics: channel = rest + gain (raw - rest) + zero + drift +
noise; gain: sd 1 % per session and channel; zero: sd 1 % of the channel's range per session; drift: slow, 0.5 % of
the range over a session; noise: sd of the sensor, 0.1 to 0.5 % of the range. Labels: reference cell with
0.05 % of full scale noise.
"""
import argparse
import csv
import math
import os
import random
import zlib

RATE = 20.0
ROWS = 700
LABELS = {"fx": "fx_N", "fy": "fy_N", "fz": "fz_N", "mx": "mx_Nm", "my": "my_Nm", "mz": "mz_Nm"}


# ---------------------------------------------------------------- loads
def smooth(a, b, n):
    """n points of a minimum-jerk move from a to b (b included)."""
    out = []
    for i in range(1, n + 1):
        s = i / n
        out.append(a + (b - a) * s * s * s * (10 + s * (6 * s - 15)))
    return out


def ou(rng, n, tau_rows):
    """A filtered random walk of about unit size, beginning at 0."""
    a = math.exp(-1.0 / tau_rows)
    q = math.sqrt(1 - a * a)
    v = y = 0.0
    out = []
    for _ in range(n):
        v = a * v + q * rng.gauss(0, 1)
        y += 0.25 * (v - y)          # a robot is not white noise
        out.append(y)
    return out


def skin_loads(rng, n, full_n, mu, place, amplitude=1.0):
    """Rows (fx, fy, fz, x, y): contact loads. place: half width in m in which the contact lies; 0: a plate."""
    rows = [(0.0, 0.0, 0.0, 0.0, 0.0)] * 30
    kinds = []
    while len(rows) < n:
        if not kinds:
            kinds = ["press", "press", "walk", "hold", "sweep_x", "sweep_y", "sweep_z", "press", "walk"]
            rng.shuffle(kinds)
        kind = kinds.pop()
        x, y = (rng.uniform(-place, place), rng.uniform(-place, place)) if place else (0.0, 0.0)
        top = full_n * amplitude * (0.25 + 0.75 * rng.random())
        seg = []
        if kind in ("press", "hold"):
            angle, m = rng.uniform(0, 2 * math.pi), mu * math.sqrt(rng.random())
            up, still, down = rng.randint(8, 18), rng.randint(10, 20) * (4 if kind == "hold" else 1), rng.randint(6, 14)
            norm = smooth(0, top, up) + [top] * still + smooth(top, 0, down)
            lag = rng.randint(0, up // 2)
            frac = [0.0] * lag + smooth(0, m, up + still // 2 - lag)
            frac += [m] * (len(norm) - len(frac))
            for nn, f in zip(norm, frac):
                seg.append((nn * f * math.cos(angle), nn * f * math.sin(angle), -nn, x, y))
        elif kind == "walk":
            k = rng.randint(90, 140)
            a, b, c, d, e = (ou(rng, k, t) for t in (25, 18, 18, 40, 40))
            for i in range(k):
                edge = min(1.0, i / 12, (k - 1 - i) / 12)
                edge = edge * edge * (3 - 2 * edge)
                nn = edge * full_n * amplitude * min(1.0, abs(0.5 + 0.45 * a[i]))
                sx, sy = mu * math.tanh(0.9 * b[i]), mu * math.tanh(0.9 * c[i])
                r = max(1.0, math.hypot(sx, sy) / (mu or 1.0))
                px = max(-place, min(place, x + place * 0.6 * d[i]))
                py = max(-place, min(place, y + place * 0.6 * e[i]))
                seg.append((nn * sx / r, nn * sy / r, -nn, px, py))
        elif kind == "sweep_z":
            k = rng.randint(40, 60)
            for i in range(k):
                seg.append((0.0, 0.0, -top * (1 - abs(2 * i / (k - 1) - 1)), x, y))
        else:
            k = rng.randint(50, 70)
            norm = smooth(0, top, 10) + [top] * k + smooth(top, 0, 10)
            for i, nn in enumerate(norm):
                s = 0.0
                if 10 <= i < 10 + k:
                    s = 0.95 * mu * nn * math.sin(2 * math.pi * (i - 10) / k)
                seg.append((s, 0.0, -nn, x, y) if kind == "sweep_x" else (0.0, s, -nn, x, y))
        rows += seg
        rows += [(0.0, 0.0, 0.0, x, y)] * rng.randint(12, 22)
    return rows[:n]


def cell_loads(rng, n, full, kind, amplitude=1.0):
    """Rows of six components. kind: mixed, single, combined."""
    rows = [(0.0,) * 6] * 30
    kinds, axes = [], []
    while len(rows) < n:
        if not kinds:
            kinds = {"mixed": ["axis"] * 6 + ["press", "press", "walk", "hold"], "single": ["axis"] * 6,
                     "combined": ["press", "press", "walk", "hold"]}[kind]
            kinds = list(kinds)
            rng.shuffle(kinds)
        k = kinds.pop()
        seg = []
        if k == "axis":
            if not axes:
                axes = list(range(6))
                rng.shuffle(axes)
            axis = axes.pop()
            top = full[axis] * amplitude * (0.7 + 0.3 * rng.random())
            m = rng.randint(30, 44)
            for i in range(m):
                v = [0.0] * 6
                v[axis] = top * math.sin(2 * math.pi * i / (m - 1))
                seg.append(tuple(v))
        elif k in ("press", "hold"):
            top = [f * amplitude * rng.uniform(-1, 1) for f in full]
            still = 40 if k == "hold" else 14
            prof = smooth(0, 1, 12) + [1.0] * still + smooth(1, 0, 10)
            seg = [tuple(p * t for t in top) for p in prof]
        else:
            m = rng.randint(90, 130)
            w = [ou(rng, m, 20) for _ in full]
            for i in range(m):
                edge = min(1.0, i / 10, (m - 1 - i) / 10)
                seg.append(tuple(edge * f * amplitude * math.tanh(0.8 * w[j][i]) for j, f in enumerate(full)))
        rows += seg + [(0.0,) * 6] * rng.randint(10, 16)
    return rows[:n]


# ---------------------------------------------------------------- materials
class Play:
    """Prandtl-Ishlinskii: part of the load passes through plays (dry friction in the foam)."""

    def __init__(self, full, part):
        self.r = [0.02 * full, 0.06 * full, 0.15 * full]
        self.w = [part * 0.4, part * 0.35, part * 0.25]
        self.s = [0.0] * 3

    def __call__(self, f):
        y = (1 - sum(self.w)) * f
        for i, r in enumerate(self.r):
            self.s[i] = max(f - r, min(f + r, self.s[i]))
            y += self.w[i] * self.s[i]
        return y


class Creep:
    """Kelvin-Voigt element in series: a part of the answer comes later."""

    def __init__(self, part, tau_s):
        self.part, self.a, self.s = part, 1 - math.exp(-1 / (RATE * tau_s)), 0.0

    def __call__(self, f):
        self.s += self.a * (f - self.s)
        return f * (1 - self.part) + self.part * self.s


class Foam:
    def __init__(self, full, play, creep, tau_s):
        self.p, self.c = Play(full, play), Creep(creep, tau_s)

    def __call__(self, f):
        return self.c(self.p(f))


def stiffening(load, k, h):
    """Compression u of a foam of thickness h with N = k u / (1 - u / h)^1: u = N / (k + N / h)."""
    return load / (k + load / h) if load >= 0 else load / k


def dipole(m, r):
    """uT of a dipole m (A m^2) at r (m)."""
    x, y, z = r
    r2 = x * x + y * y + z * z
    r1 = math.sqrt(r2)
    c = 0.1 / (r2 * r1)              # mu0 / 4 pi = 1e-7; in uT: 0.1
    d = 3 * (m[0] * x + m[1] * y + m[2] * z) / r2
    return c * (d * x - m[0]), c * (d * y - m[1]), c * (d * z - m[2])


# ---------------------------------------------------------------- sensors
class Sensor:
    noise = 0.002
    session_gain = 0.01
    mu, place = 0.5, 0.0
    components = ("fx", "fy", "fz")

    def __init__(self, rng):
        self.build(rng)

    def loads(self, rng, kind, amplitude):
        return skin_loads(rng, ROWS, self.full, self.mu, self.place, amplitude)

    def wrench(self, load):
        fx, fy, fz, x, y = load
        return {"fx": fx, "fy": fy, "fz": fz, "mx": y * fz, "my": -x * fz}

    def start(self, rng):
        pass


class Mag2x2(Sensor):
    """A plate with four magnets on foam above four two-axis Hall chips; every magnet reaches every chip."""
    names = ["B1x", "B1z", "B2y", "B2z", "B3y", "B3z", "B4x", "B4z"]
    full, mu, noise = 10.0, 0.5, 0.002

    def build(self, rng):
        self.at = [(sx * 5e-3, sy * 5e-3) for sx, sy in ((-1, -1), (1, -1), (-1, 1), (1, 1))]
        self.m = [tuple(0.02 * c * (1 + 0.04 * rng.gauss(0, 1)) for c in (0.02 * rng.gauss(0, 1), 0.02 * rng.gauss(0, 1), s))
                  for s in (1, -1, -1, 1)]
        self.off = [tuple(2e-4 * rng.gauss(0, 1) for _ in range(3)) for _ in range(4)]
        self.h = 5.0e-3

    def start(self, rng):
        self.fx, self.fy = Foam(5, 0.10, 0.05, 3), Foam(5, 0.10, 0.05, 3)
        self.fz = Foam(10, 0.10, 0.06, 3)

    def raw(self, load):
        fx, fy, n = self.fx(load[0]), self.fy(load[1]), self.fz(-load[2])
        u = stiffening(n, 3000, self.h * 0.55)
        k = 3500 * (1 + 0.05 * n)    # compressed foam is stiffer in shear
        dx, dy = fx / k, fy / k
        tx, ty = fx * 2e-3 / 0.6, fy * 2e-3 / 0.6   # shear acts above the foam: tilt
        out = []
        for chip, (cx, cy) in enumerate(self.at):
            b = [0.0, 0.0, 0.0]
            for (px, py), m, o in zip(self.at, self.m, self.off):
                z = self.h - u - tx * px - ty * py + o[2]
                f = dipole(m, (cx - px - dx - o[0], cy - py - dy - o[1], -z))
                b = [p + q for p, q in zip(b, f)]
            out += [b[0] if chip in (0, 3) else b[1], b[2]]
        return out


class Opt12(Sensor):
    """A dome with 12 photodiodes in two rings: light through the gap decays exponentially with the dent."""
    names = ["P%d" % (i + 1) for i in range(12)]
    full, mu, noise, place = 8.0, 0.6, 0.002, 1.5e-3

    def build(self, rng):
        self.d = [(2.2e-3 * math.cos(a), 2.2e-3 * math.sin(a)) for a in (math.pi / 4 + i * math.pi / 2 for i in range(4))]
        self.d += [(4.8e-3 * math.cos(a), 4.8e-3 * math.sin(a)) for a in (i * math.pi / 4 for i in range(8))]
        self.i0 = [2.2 * (1 + 0.1 * rng.gauss(0, 1)) for _ in self.d]
        self.dark = [0.05 + 0.01 * rng.random() for _ in self.d]
        self.lam = [0.45e-3 * (1 + 0.05 * rng.gauss(0, 1)) for _ in self.d]

    def start(self, rng):
        self.f = [Foam(f, 0.03, 0.02, 2) for f in (4.8, 4.8, 8)]

    def raw(self, load):
        fx, fy, n = self.f[0](load[0]), self.f[1](load[1]), self.f[2](-load[2])
        u = 1.1e-3 * (max(n, 0.0) / 8) ** (2 / 3)    # Hertz
        w = 2.8e-3 + 0.8e-3 * math.sqrt(max(n, 0) / 8)
        x, y = load[3] + 0.9e-4 * fx, load[4] + 0.9e-4 * fy
        out = []
        for (px, py), i0, dark, lam in zip(self.d, self.i0, self.dark, self.lam):
            rx, ry = px - x, py - y
            g = math.exp(-(rx * rx + ry * ry) / (2 * w * w))
            dent = u * g + 0.9e-4 * (fx * rx + fy * ry) / w * math.exp(-(rx * rx + ry * ry) / (4 * w * w))   # bulge ahead of the shear
            out.append(dark + i0 * math.exp(-dent / lam * 0.6))
        return out


class Cell8(Sensor):
    """Four spokes with a gauge for bending up and down and one for bending sideways, cross talk 4 %."""
    components = ("fx", "fy", "fz", "mx", "my", "mz")
    full = (60.0, 60.0, 120.0, 3.0, 3.0, 3.0)
    spokes, noise = 4, 0.001

    def build(self, rng):
        self.names = ["G%d%s" % (k + 1, c) for k in range(self.spokes) for c in "vt"]
        self.g = []
        r = 0.025
        for k in range(self.spokes):
            a = 2 * math.pi * k / self.spokes + 0.1
            s, c = math.sin(a), math.cos(a)
            for row in ((0, 0, 1, s / r, -c / r, 0), (-s, c, 0, 0, 0, 1 / r)):
                row = [v / self.spokes * 8 * (1 + 0.03 * rng.gauss(0, 1)) for v in row]   # 1e-6 strain
                scale = max(abs(v) * f for v, f in zip(row, self.full))
                self.g.append([v + 0.04 * rng.gauss(0, 1) * scale / f for v, f in zip(row, self.full)])

    def loads(self, rng, kind, amplitude):
        return cell_loads(rng, ROWS, self.full, kind, amplitude)

    def wrench(self, load):
        return dict(zip(self.components, load))

    def raw(self, load):
        return [sum(a * b for a, b in zip(row, load)) for row in self.g]


class Cell6(Cell8):
    """Three spokes: six gauges for six components, nothing to spare."""
    spokes = 3


class Mag15(Sensor):
    """A magnetic elastomer (magnetised particles) over five three-axis chips; a ball presses at a wandering place."""
    names = ["B%d%s" % (k + 1, a) for k in range(5) for a in "xyz"]
    full, mu, noise, place = 5.0, 0.5, 0.003, 4.0e-3

    def build(self, rng):
        self.chips = [(0, 0), (-7e-3, -7e-3), (7e-3, -7e-3), (7e-3, 7e-3), (-7e-3, 7e-3)]
        self.grid = [(-10e-3 + 4e-3 * i, -10e-3 + 4e-3 * j, 2e-3 * (1 + 0.03 * rng.gauss(0, 1))) for i in range(6) for j in range(6)]
        self.m = [(0.0003 * rng.gauss(0, 0.3), 0.0003 * rng.gauss(0, 0.3), 0.0015 * (1 + 0.1 * rng.gauss(0, 1))) for _ in self.grid]

    def start(self, rng):
        self.f = [Foam(f, 0.06, 0.04, 2) for f in (2.5, 2.5, 5)]

    def raw(self, load):
        fx, fy, n = self.f[0](load[0]), self.f[1](load[1]), self.f[2](-load[2])
        u = stiffening(n, 5000, 1.4e-3)
        w2 = 2 * (3.5e-3) ** 2
        k = 2500 * (1 + 0.08 * n)
        b = [[0.0, 0.0, 0.0] for _ in self.chips]
        for (px, py, z), m in zip(self.grid, self.m):
            rx, ry = px - load[3], py - load[4]
            g = math.exp(-(rx * rx + ry * ry) / w2)
            qx = px + fx / k * g + 0.35 * u * g * rx / 3.5e-3      # squeezed out sideways
            qy = py + fy / k * g + 0.35 * u * g * ry / 3.5e-3
            slope = u * g * 2 / w2                                # the surface turns, and the magnets with it
            t = (m[0] - m[2] * slope * rx, m[1] - m[2] * slope * ry, m[2])
            for i, (cx, cy) in enumerate(self.chips):
                f = dipole(t, (cx - qx, cy - qy, -(z + 1.2e-3 - u * g)))
                b[i][0] += f[0]
                b[i][1] += f[1]
                b[i][2] += f[2]
        return [v for c in b for v in c]


class Fsr4(Sensor):
    """Four force-sensing resistors under the corners of a preloaded plate, each in a divider with 10 kOhm."""
    names = ["V1", "V2", "V3", "V4"]
    components = ("fz", "mx", "my")
    full, mu, noise, place = 20.0, 0.0, 0.003, 9e-3

    def build(self, rng):
        self.at = [(sx * 20e-3, sy * 20e-3) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        self.k = [(18e3 * (1 + 0.08 * rng.gauss(0, 1)), 0.85 * (1 + 0.03 * rng.gauss(0, 1))) for _ in self.at]
        self.pre = [0.4 * (1 + 0.1 * rng.gauss(0, 1)) for _ in self.at]
        self.share = [0.25 + 0.01 * s for s in (1, -1, 1, -1)]     # plates are never flat

    def start(self, rng):
        self.f = [Foam(8, 0.05, 0.03, 4) for _ in self.at]

    def raw(self, load):
        fz, x, y = load[2:]
        out = []
        for i, (px, py) in enumerate(self.at):
            f = -fz * (self.share[i] + 0.25 * (x / px + y / py))
            f = max(0.02, self.pre[i] + self.f[i](f))
            r = self.k[i][0] / f ** self.k[i][1]
            out.append(3.3 * 10e3 / (10e3 + r))
        return out


class Hair4(Sensor):
    """Four hair cantilevers in the middle of a pad: linear, noisy, small cross talk."""
    names = ["H1", "H2", "H3", "H4"]
    full, mu, noise = 4.0, 0.6, 0.005

    def build(self, rng):
        self.g = []
        for sx, sy in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            self.g.append([v * 1e-3 * (1 + 0.05 * rng.gauss(0, 1)) for v in
                           (1.6 * sx + 0.08 * rng.gauss(0, 1), 1.6 * sy + 0.08 * rng.gauss(0, 1), -0.9)])

    def raw(self, load):
        return [sum(a * b for a, b in zip(row, load)) for row in self.g]


class Cap5(Sensor):
    """Four sectors and a centre electrode under a soft pad: the gap closes with fz, shear moves the overlap."""
    names = ["C1", "C2", "C3", "C4", "Cn"]
    full, mu, noise = 12.0, 0.5, 0.002

    def build(self, rng):
        self.a = [(3.5e-3, 6e-3, 1 + 0.03 * rng.gauss(0, 1)) for _ in range(4)]
        self.stray = [0.4 + 0.05 * rng.gauss(0, 1) for _ in range(5)]
        self.d0 = [0.30e-3 * (1 + 0.02 * rng.gauss(0, 1)) for _ in range(5)]

    def start(self, rng):
        self.f = [Foam(f, 0.05, 0.04, 3) for f in (6, 6, 12)]

    def raw(self, load):
        fx, fy, n = self.f[0](load[0]), self.f[1](load[1]), self.f[2](-load[2])
        u = stiffening(n, 9e4, 0.22e-3)
        dx, dy = fx / 9000, fy / 9000
        eps = 8.854 * 2.8            # pF / m
        out = []
        for (sx, sy), (w, length, t), stray, d0 in zip(((1, 0), (0, 1), (-1, 0), (0, -1)), self.a, self.stray, self.d0):
            s = dx * sx + dy * sy
            side = abs(dx * sy) + abs(dy * sx)
            gap = d0 - u * (1 + 0.04 * (fx * sx + fy * sy) / 6)     # shear also tilts
            out.append(stray + eps * t * (w + s) * (length - side) / gap)
        out.append(self.stray[4] + eps * 2.0e-5 / (self.d0[4] - u))
        return out


class Baro8(Sensor):
    """Eight barometers cast in rubber (ring of seven and one in the middle), ball at a wandering place; fz mx my."""
    names = ["p%d" % (i + 1) for i in range(8)]
    components = ("fz", "mx", "my")
    full, mu, noise, place = 10.0, 0.3, 0.001, 5e-3

    def build(self, rng):
        self.at = [(0.0, 0.0)] + [(6e-3 * math.cos(2 * math.pi * i / 7), 6e-3 * math.sin(2 * math.pi * i / 7)) for i in range(7)]
        self.g = [900 * (1 + 0.12 * rng.gauss(0, 1)) for _ in self.at]

    def start(self, rng):
        self.f = Foam(10, 0.03, 0.06, 5)

    def raw(self, load):
        n = self.f(-load[2])
        z = 4.0e-3
        out = []
        for (px, py), g in zip(self.at, self.g):
            rx, ry = px - load[3], py - load[4]
            r2 = rx * rx + ry * ry + z * z
            p = g * z ** 3 / r2 ** 2.5 * z * z * (n + (load[0] * rx + load[1] * ry) / z)   # Boussinesq and Cerruti
            out.append(101325.0 / 100 + p / (1 + abs(p) / 30000) / 100)
        return out


class Textile9(Sensor):
    """A 3 x 3 piezoresistive fabric under a padded plate of finite stiffness; fz mx my; conductance saturates."""
    names = ["T%d%d" % (i, j) for i in range(3) for j in range(3)]
    components = ("fz", "mx", "my")
    full, mu, noise, place = 15.0, 0.0, 0.004, 8e-3

    def build(self, rng):
        self.at = [(-10e-3 + 10e-3 * i, -10e-3 + 10e-3 * j) for i in range(3) for j in range(3)]
        self.g = [(100 * (1 + 0.1 * rng.gauss(0, 1)), 3.0 * (1 + 0.1 * rng.gauss(0, 1))) for _ in self.at]

    def start(self, rng):
        self.f = [Foam(4, 0.08, 0.05, 4) for _ in self.at]

    def raw(self, load):
        n = -load[2]
        w = [math.exp(-((px - load[3]) ** 2 + (py - load[4]) ** 2) / (2 * (9e-3) ** 2)) for px, py in self.at]
        s = sum(w)
        out = []
        for wi, foam, (g, half) in zip(w, self.f, self.g):
            f = max(0.0, foam(n * wi / s))
            out.append(5 + g * f / (half + f))
        return out


SENSORS = {"mag2x2": Mag2x2, "opt12": Opt12, "cell8": Cell8, "cell6": Cell6, "mag15": Mag15, "fsr4": Fsr4,
           "hair4": Hair4, "cap5": Cap5, "baro8": Baro8, "textile9": Textile9}


# ---------------------------------------------------------------- recordings
def record(sensor, name, seed, sessions):
    """{session: [row]} with the maker's disturbances; the range is that of all sessions."""
    clean, loads = {}, {}
    for s, kind in sessions.items():
        rng = random.Random("%d/%s/load/%d" % (seed, name, s))
        sensor.start(rng)
        loads[s] = sensor.loads(rng, kind, 0.95 if s in (3, 6) else 1.0)
        clean[s] = [sensor.raw(row) for row in loads[s]]
    count = len(sensor.names)
    every = [r for rows in clean.values() for r in rows]
    rest = clean[min(clean)][0]
    width = [max(r[k] for r in every) - min(r[k] for r in every) for k in range(count)]
    full = {c: max(abs(sensor.wrench(l)[c]) for rows in loads.values() for l in rows) for c in sensor.components}
    out = {}
    for s in sessions:
        rng = random.Random("%d/%s/chain/%d" % (seed, name, s))
        gain = [1 + sensor.session_gain * rng.gauss(0, 1) for _ in range(count)]
        zero = [0.01 * rng.gauss(0, 1) * w for w in width]
        wave = [(rng.choice((-1, 1)) * 0.005 * w * rng.uniform(0.7, 1.3), rng.uniform(0.6, 1.6)) for w in width]
        rows = []
        for i, (raw, load) in enumerate(zip(clean[s], loads[s])):
            t = i / (ROWS - 1)
            chan = [rest[k] + gain[k] * (raw[k] - rest[k]) + zero[k] + wave[k][0] * t ** wave[k][1]
                    + sensor.noise * width[k] * rng.gauss(0, 1) for k in range(count)]
            wrench = sensor.wrench(load)
            label = [wrench[c] + 0.0005 * full[c] * rng.gauss(0, 1) for c in sensor.components]
            rows.append([600.0 * (s - 1) + i / RATE] + chan + label + [s])
        out[s] = rows
    return out


def write(path, sensor, rows):
    with open(path, "w", newline="") as f:
        w = csv.writer(f, lineterminator="\n")
        w.writerow(["t_s"] + sensor.names + [LABELS[c] for c in sensor.components] + ["session"])
        for r in rows:
            w.writerow(["%.3f" % r[0]] + ["%.7g" % v for v in r[1:-1]] + [r[-1]])


def main():
    p = argparse.ArgumentParser()
    p.add_argument("--out", default=os.path.dirname(os.path.abspath(__file__)))
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--only", nargs="*")
    a = p.parse_args()
    os.makedirs(a.out, exist_ok=True)
    for name, kind in SENSORS.items():
        if a.only and name not in a.only:
            continue
        sensor = kind(random.Random("%d/%s" % (a.seed, name)))
        sessions = {1: "mixed", 2: "mixed", 3: "mixed"}
        cell = isinstance(sensor, Cell8)
        if cell:
            sessions.update({4: "single", 5: "single", 6: "combined"})
        rows = record(sensor, name, a.seed, sessions)
        at = os.path.join(a.out, name)
        write(at + "_fit.csv", sensor, rows[1] + rows[2])
        write(at + "_one.csv", sensor, rows[1])
        write(at + "_unseen.csv", sensor, rows[3])
        if cell:
            write(at + "_single.csv", sensor, rows[4] + rows[5])
            write(at + "_combined.csv", sensor, rows[6])
        body = repr(sorted(rows.items())).encode()
        print("%-9s %2d channels  %-18s crc %08x" % (name, len(sensor.names), " ".join(sensor.components), zlib.crc32(body)))


if __name__ == "__main__":
    main()
