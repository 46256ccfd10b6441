"""Sensors that the tests simulate: their response to a load, by the documents' own formulas and sign tables.

No code is shared with the project. A load is a dict of components of the wrench, frame S, N and Nm: a press has fz <
0. To add a model: a class derived from Sensor with its channels, its wire format and its methods; a line in SENSORS.
"""
import csv
import math
import pathlib
import random
import struct
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
NONE = float("nan")


def cobs_frame(plain):
    """Returns the bytes of a binary frame (drivers/wire/cobs_frame.md): `plain` with its CRC-16, stuffed, and a zero."""
    crc = 0xFFFF
    for byte in plain:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    plain += struct.pack("<H", crc)
    return b"".join(bytes([len(part) + 1]) + part for part in plain.split(b"\0")) + b"\0"


class Sensor:
    """One kind of sensor. `methods`: each in turn is used in calibrate, daemon and PLC."""
    model = ""
    channels = ()
    channel_unit = "unknown"
    noise = 0.0           # sd of each channel
    components = ("fx", "fy", "fz")
    methods = ()
    fitted_as = {}        # methods that calibrate does not fit: the method whose calibration they use
    full_scale = 1.0      # N
    wire = "lines"        # or "cobs": 32 bits
    counts_per_unit = 1.0
    rows = 600            # rows of the calibration
    cop_methods = ()      # methods that compute the centre of pressure
    least_within = 0.5    # minimum share of errors within one sd: 68 %, but model errors are equal in all reads of
                          # one load
    heavy_tails = {}      # methods with non-normal errors: excess over the sd that an error may reach, relative to
                          # full scale

    def __init__(self):
        self.random = random.Random(f"{self.model} 7")  # individual sensor and its loads
        self.noise_random = random.Random(f"{self.model} 8")

    def begin(self, method):
        """Selects the sensor of this method, without load."""
        self.method = method

    def load_of(self, share):
        """Returns a load inside of the calibrated domain; share = 0.8 stays away from its edge."""
        full, r = self.full_scale * share, self.random
        return {"fx": r.uniform(-full, full) / 2, "fy": r.uniform(-full, full) / 2, "fz": -r.uniform(0.1 * full, full)}

    def exact(self, load):
        """Returns the channels under this load, without noise, in channel_unit. May keep a state; called once per
        frame."""
        raise NotImplementedError

    def calibration_loads(self):
        return [self.load_of(1.0) for _ in range(self.rows)]

    def live_loads(self):
        return [self.load_of(0.75) for _ in range(30)]

    def calibrate_words(self):
        return []

    # ---- the same for all

    def rest(self):
        return dict.fromkeys(self.components, 0.0)

    def read(self, load):
        return [value + self.noise_random.gauss(0, self.noise) for value in self.exact(load)]

    def write_labelled(self, path):
        """Writes rows of three sessions, each from rest."""
        loads = self.calibration_loads()
        columns = [c + ("_N" if c[0] == "f" else "_Nm") for c in self.components]
        with open(path, "w") as file:
            writer = csv.writer(file)
            writer.writerow(["t_s", *self.channels, *columns, "session"])
            for i, load in enumerate(loads):
                session = 3 * i // len(loads)
                if i == 0 or session != 3 * (i - 1) // len(loads):
                    self.begin(self.method)
                    for _ in range(30):
                        writer.writerow([0.01 * i, *map(repr, self.read(self.rest())), *[0.0] * len(columns), f"s{session}"])
                writer.writerow([0.01 * i, *map(repr, self.read(load)), *[repr(load[c]) for c in self.components], f"s{session}"])

    def frame(self, sequence, channels, time_us=None):
        """Returns the bytes of a frame: drivers/wire/*.md. A channel that is NaN is missing. time_us: only for "cobs"."""
        if self.wire == "lines":
            text = ",".join([str(sequence), *("" if math.isnan(v) else repr(v) for v in channels)])
            checksum = 0
            for byte in text.encode():
                checksum ^= byte
            return f"{text}*{checksum:02X}\n".encode()
        missing = sum(1 << k for k, value in enumerate(channels) if math.isnan(value))
        flags = (1 if missing else 0) | (0 if time_us is None else 2)
        plain = struct.pack("<BBBBHI", 2, 0, len(channels), flags, sequence & 0xFFFF, (time_us or 0) & 0xFFFFFFFF)
        plain += struct.pack("<I", missing) if missing else b""
        for value in channels:
            plain += struct.pack("<i", 0 if math.isnan(value) else round(value * self.counts_per_unit))
        return cobs_frame(plain)

    def toml(self, name, method):
        more = {"lines": f'format = "lines"\nchannels = {len(self.channels)}\nsequence = true\nchecksum = true\n',
                "cobs": 'format = "cobs"\n'}[self.wire]
        known = "temperature_sd_K = 1e-4\n" if self.model in ("table", "hair", "capacitive") else ""  # models that follow temperature
        units = f"counts_per_unit = {self.counts_per_unit}\n" if self.wire == "cobs" else ""
        return (f'[[link]]\nname = "usb-{name}"\ndriver = "uart"\ndevice = "{{folder}}/{name}"\nbaud = 921600\npath = "direct"\nsimulated = true\n{more}\n'
                f'[[sensor]]\nname = "{name}"\nlink = "usb-{name}"\nmodel = "{self.model}"\ntemperature_range_C = [23, 23]\n{known}calibration = "{{folder}}/{name}-{method}.toml"\n'
                f'method = "{method}"\nstale_ms = 2000\n{units}\n')


class Play:
    """Play operator (backlash): the output is constant until the input has moved by the width."""

    def __init__(self, width):
        self.width, self.output = width, 0.0

    def next(self, value):
        self.output = min(max(self.output, value - self.width), value + self.width)
        return self.output


class Table(Sensor):
    """Lee, Kim, Shikida and Sato: their sign table and printed sensitivities; `matrix` and `map` with finite elements."""
    model = "table"
    channels = ("R1", "R2", "R3", "R4", "R5", "R6", "R7", "R8")
    channel_unit = "dR/R0"
    noise = 20e-6
    methods = ("linear", "signs", "matrix", "nonlinear", "map")
    fitted_as = {"signs": "linear"}
    cop_methods = ("map",)
    ALONG_X = (-1, +1, 0, 0, +1, -1, 0, 0)
    ALONG_Y = (0, 0, -1, +1, 0, 0, +1, -1)
    OUTER_TANGENTIAL, INNER_TANGENTIAL, INNER_NORMAL = 8582e-6, 10847e-6, 19366e-6  # dR/R0 at 1 N

    def __init__(self):
        super().__init__()
        fem = ROOT / "tests/data/fem"
        with open(fem / "table_compliance.csv") as file:  # Fx Fy +Fz per N, Mx My per N mm
            rows = list(csv.reader(file))[1:]
        self.compliance = [[2e-6 * float(word) * (1 if i < 3 else 1e3) for i, word in enumerate(row[1:])] for row in rows]
        with open(fem / "table_influence.csv") as file:
            rows = [list(map(float, row)) for row in list(csv.reader(file))[1:]]
        self.nodes = [(1e-3 * row[0], 1e-3 * row[1], [row[2 + 3 * k:5 + 3 * k] for k in range(8)]) for row in rows
                      if math.hypot(row[0], row[1]) < 0.6]
        self.own_gain = [self.random.uniform(0.9, 1.1) for _ in range(8)]

    def begin(self, method):
        super().begin(method)
        self.plays = [[Play(0.05), Play(0.2)] for _ in range(3)]
        self.components = ("fx", "fy", "fz", "mx", "my") if method in ("matrix", "map") else ("fx", "fy", "fz")
        self.noise = 2e-6 if method in ("matrix", "map") else 20e-6

    def load_of(self, share):
        load = super().load_of(share)
        if self.method == "linear" and self.random.random() < 0.3:
            load["fz"] = 0.0  # a shear alone is inside of the domain, too
        if self.method == "matrix":
            load.update(mx=self.random.uniform(-3e-4, 3e-4) * share, my=self.random.uniform(-3e-4, 3e-4) * share)
        if self.method == "map":
            near = [node for node in self.nodes if math.hypot(node[0], node[1]) < 0.6e-3 * share ** 2]
            x, y, load["node"] = self.random.choice(near)
            if share < 1:
                load["fz"] = -self.random.uniform(0.5, share)  # below a smaller press the noise dominates
                                                               # (decoupling/table/README.md)
            load.update(mx=y * load["fz"], my=-x * load["fz"])
        return load

    def exact(self, load):
        fx, fy, fz = load["fx"], load["fy"], load["fz"]
        if self.method == "matrix":
            return [gain * sum(a * load[c] for a, c in zip(row, self.components))
                    for gain, row in zip(self.own_gain, self.compliance)]
        if self.method == "map":
            return [2e-6 * gain * (row[0] * fx + row[1] * fy + row[2] * fz)
                    for gain, row in zip(self.own_gain, load.get("node") or self.nodes[0][2])]
        press = -fz
        if self.method == "nonlinear":
            bent = (fx, fy, press - 0.06 * press * press)
            fx, fy, press = [0.95 * value + 0.03 * near.next(value) + 0.02 * far.next(value)
                             for value, (near, far) in zip(bent, self.plays)]
        return [(self.INNER_TANGENTIAL if k % 2 == 0 else self.OUTER_TANGENTIAL) * (self.ALONG_X[k] * fx + self.ALONG_Y[k] * fy) +
                (self.INNER_NORMAL * press if k % 2 == 0 else 0.0) for k in range(8)]

    def calibration_loads(self):
        if self.method != "nonlinear":
            return super().calibration_loads()
        path = [self.rest()]  # hysteresis: in small steps, as on a loading machine
        while len(path) < self.rows:
            begin, end = path[-1], self.load_of(1.0)
            path += [{c: begin[c] + (end[c] - begin[c]) * i / 12 for c in begin} for i in range(1, 13)]
        return path

    def live_loads(self):
        if self.method != "signs":
            return super().live_loads()
        return [dict(zip(self.components, force)) for force in
                ((0, 0, -0.73), (0.42, 0, 0), (0, -0.34, 0), (0.47, 0, -0.12), (-0.36, 0.43, -0.1))]

    def calibrate_words(self):
        return ["--influence", ROOT / "config/calibration/table_influence.toml"] if self.method == "map" else []


class Hair(Sensor):
    """Cao et al., eq. 14 and their sensitivities; hairs differ by 3 % and, except for `physics`, are nonlinear under
    shear."""
    model = "hair"
    channels = ("H1", "H2", "H3", "H4")
    channel_unit = "dR/R0"
    noise = 5.14e-6
    methods = ("sum_diff", "matrix", "physics")
    wire = "cobs"
    counts_per_unit = 1e9
    AREA_m2 = 2.827e-5
    full_scale = 2000 * AREA_m2
    D_SIGMA, D_TAU = 3.74e-7, 7.91e-7  # 1/Pa

    def __init__(self):
        super().__init__()
        self.own_gain = [(self.random.gauss(1, 0.03), self.random.gauss(1, 0.03)) for _ in range(4)]

    def exact(self, load):
        sigma = -load["fz"] / self.AREA_m2
        tau, alpha = math.hypot(load["fx"], load["fy"]) / self.AREA_m2, math.atan2(load["fy"], load["fx"])
        bend = 0 if self.method == "physics" else 0.04 * self.D_SIGMA * 2000 * (tau / 2000) ** 2
        return [normal * self.D_SIGMA * sigma - shear * self.D_TAU * tau * math.cos(alpha - math.pi / 2 * i) + bend
                for i, (normal, shear) in enumerate(self.own_gain)]


class Skin(Sensor):
    """Six readings, each a mixture of the forces; nonlinear except for `matrix`, saturating for rbf, mlp and auto."""
    model = "generic"
    channels = ("B1", "B2", "B3", "B4", "B5", "B6")
    channel_unit = "uT"
    noise = 0.05
    methods = ("matrix", "quadratic", "rbf", "mlp", "auto")
    heavy_tails = {"mlp": 0.02}  # errors are largest at the corners of the domain, and the sd is that of 68 % of rows
                                 # everywhere
    full_scale = 10.0
    wire = "cobs"
    counts_per_unit = 1e4
    rows = 900

    def exact(self, load):
        values = []
        for k in range(6):
            angle = math.pi / 3 * k
            u = 1.6 * load["fx"] * math.cos(angle) + 1.6 * load["fy"] * math.sin(angle) - (1 + 0.2 * (-1) ** k) * load["fz"]
            if self.method == "matrix":
                value = 9 * u
            elif self.method == "quadratic":
                value = 9 * u + 0.12 * u * u
            else:
                value = 200 * math.tanh(u / 22)
            values.append(value - 40 + 11 * k)
        return values


class Capacitive(Sensor):
    """The piezo-capacitive thesis: its curves for `quadratic`; for the others a soft pad over electrodes with strays.

    The pad: N = K/3 (u^2 - 1/u), shift = shear / k, C = stray + active u (overlap / overlap at rest). `ratio` has the overlap
    to first order, `overlap` that of a disc with sectors, by quadrature.
    """
    model = "capacitive"
    channels = ("C1", "C2", "C3", "C4", "Cn")
    channel_unit = "pF"
    noise = 0.3e-3
    methods = ("quadratic", "ratio", "overlap")
    full_scale = 10.0
    rows = 300
    SHEAR_N = 1.2
    TOWARDS = (0, math.pi, math.pi / 2, -math.pi / 2)  # the sectors C1 .. C4 are on +x -x +y -y
    STRAY, ACTIVE, K_N, SHIFT_N = (0.90, 0.91, 0.89, 0.90, 0.40), (0.33, 0.32, 0.34, 0.33, 0.90), 31.0, 5.0
    DISC, INNER, OUTER, OPENING, CENTRE, GAP = 4e-3, 2.5e-3, 6e-3, 1.4, 2e-3, 3e-3  # m, rad

    def begin(self, method):
        super().begin(method)
        self.known = (None, None)  # load and channels of the last frame: often used again

    def load_of(self, share):
        r, shear = self.random, self.SHEAR_N * share
        return {"fx": r.uniform(-shear, shear), "fy": r.uniform(-shear, shear), "fz": -r.uniform(0.05, self.full_scale) * share}

    def exact(self, load):
        key = (load["fx"], load["fy"], load["fz"])
        if self.known[0] != key:
            self.known = (key, self.curves(*key) if self.method == "quadratic" else self.pad(*key))
        return self.known[1]

    def curves(self, fx, fy, fz):
        side = [0.0071 * f * f + 0.038 * f + 1.2285 for f in (fx, -fx, fy, -fy)]  # eq. XXXIV
        return side + [0.0008 * fz * fz - 0.0405 * fz + 1.3039]                   # eq. XXXIII

    def pad(self, fx, fy, fz):
        low, high = 0.3, 4.0
        for _ in range(50):
            u = (low + high) / 2
            low, high = (u, high) if self.K_N / 3 * (u * u - 1 / u) < -fz else (low, u)
        shift, towards = math.hypot(fx, fy) / self.SHIFT_N, math.atan2(fy, fx)  # in units of DISC, or of the shift
                                                                                # that doubles a sector
        if self.method == "ratio":
            share = [1 + shift * math.cos(towards - angle) for angle in self.TOWARDS] + [1]
        else:
            share = [self.area(shift, towards - angle) / self.area(0, 0) for angle in self.TOWARDS] + [1]
        return [stray + active * u * part for stray, active, part in zip(self.STRAY, self.ACTIVE, share)]

    def area(self, shift, towards):
        """Returns the common area of the disc, shifted by this share of its radius, and a sector whose middle is at
        angle 0; in DISC^2."""
        inner, outer, n, total = self.INNER / self.DISC, self.OUTER / self.DISC, 100, 0.0
        for i in range(n):
            angle = self.OPENING * ((i + 0.5) / n - 0.5) - towards
            edge = shift * math.cos(angle) + math.sqrt(1 - (shift * math.sin(angle)) ** 2)
            total += (min(max(edge, inner), outer) ** 2 - inner ** 2) / 2 * self.OPENING / n
        return total

    def calibrate_words(self):
        if self.method != "overlap":
            return []
        known = {"disc_radius_m": self.DISC, "inner_radius_m": self.INNER, "outer_radius_m": self.OUTER, "opening_rad": self.OPENING,
                 "centre_radius_m": self.CENTRE, "gap_m": self.GAP}
        return [word for name, value in known.items() for word in ("--set", f"{name}={value}")]


class Piezo(Sensor):
    """The thesis' film and centre electrode (eq. XXXV, XXXIII): the film leaks, and the converter computes means and
    runs freely."""
    model = "piezo"
    channels = ("Vp", "Cn")
    channel_unit = "V, pF"
    components = ("fz",)
    methods = ("fused",)
    heavy_tails = {"fused": 0.02}  # a frame that the machine delays by 10 ms during a jump of the press changes the
                                   # mean of the converter's window
    least_within = 0      # errors within one time constant of the leak are equal: a few seconds have a handful. See
                          # PiezoFit.ReadsWhat...
    full_scale = 10.0
    TAU_S, WINDOW_S = 1.0, 0.1003

    def begin(self, method):
        super().begin(method)
        self.clock = time.monotonic
        self.last_s = None

    def load_of(self, share):
        return {"fz": -self.random.uniform(0.05, 1) * self.full_scale * share}

    def read(self, load):
        """Called once per frame: time has passed."""
        N, now_s = -load["fz"], self.clock()
        drive, centre = 0.0092 * N * N + 0.2917 * N, 0.0008 * N * N + 0.0405 * N
        if self.last_s is None:
            self.V, self.held, self.sum, self.begun_s = 0.0, centre, 0.0, now_s
            self.drive, self.centre, self.last_s = drive, centre, now_s
        # The press jumped between the last frame and this one: in the middle.
        T = now_s - self.last_s
        self.V = self.V * math.exp(-T / self.TAU_S) + (drive - self.drive) * math.exp(-T / 2 / self.TAU_S)
        while now_s >= self.begun_s + self.WINDOW_S:  # a conversion has ended since
            self.begun_s += self.WINDOW_S
            self.sum += self.centre * (self.begun_s - self.last_s)
            self.held = self.sum / self.WINDOW_S + self.noise_random.gauss(0, 0.3e-3)
            self.sum, self.last_s = 0.0, self.begun_s
        self.sum += (self.centre + centre) / 2 * (now_s - self.last_s)
        self.drive, self.centre, self.last_s = drive, centre, now_s
        return [self.V + 0.0768 + self.noise_random.gauss(0, 1.4e-3), self.held + 1.3039]

    def write_labelled(self, path):
        """Writes steps to any press, most as short as the live ones, one in 40 held for longer; one row per frame."""
        with open(path, "w") as file:
            writer = csv.writer(file)
            writer.writerow(["t_s", *self.channels, "fz_N"])
            self.begin(self.method)
            self.clock = lambda: t_s
            t_s, change_s, load = 0.0, 1.0, self.rest()
            for i in range(30 * 200):
                t_s = 0.005 * i
                if t_s >= change_s:
                    hold_s = self.random.uniform(0.5, 2) if self.random.random() < 1 / 40 else self.random.uniform(0.02, 0.08)
                    load, change_s = self.load_of(1.0), t_s + hold_s
                writer.writerow([t_s, *map(repr, self.read(load)), load["fz"]])


SENSORS = {"table": Table, "hair": Hair, "capacitive": Capacitive, "piezo": Piezo, "skin": Skin}
