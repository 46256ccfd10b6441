"""One recording in the shapes in which spreadsheets, loggers, robots and laboratories write it. Standard library only."""
import datetime
import gzip
import json
import math
import random
import struct
import zipfile

CHANNELS = [f"ch{i}" for i in range(1, 7)]
PLAIN = ["t_s", *CHANNELS, "fx_N", "fy_N", "fz_N", "session"]
SESSIONS, ROWS, RATE_HZ, GAP_S, EPOCH_S = 5, 120, 20, 60, 1718000000
GAIN = [[310, 20, -150], [-290, 35, -170], [15, 330, -140], [-25, -305, -160], [120, 140, -260], [-90, 60, -210]]  # counts/N
ZERO = [20500, 19800, 21200, 20100, 22300, 18700]
G = 9.80665
KEYS = ("ask", "refuse", "channels", "scale", "sessions", "interval", "loose", "labels")


def load(session, k):
    """Force in N at row k, a real number, of a session: twice a rest and a press that moves, mirrored the second time."""
    u = (k % 60 - 10) / 50
    if not 0 <= k < ROWS or u <= 0:
        return (0.0, 0.0, 0.0)
    size, phase = math.sin(math.pi * u) ** 0.7, 0.7 * session
    shear = 4 * size if k < 60 else -4 * size
    return (shear * math.sin(6 * math.pi * u + 1.3 * phase), shear * math.cos(5 * math.pi * u + 2.1 * phase),
            -size * (9 + 5.5 * math.sin(4 * math.pi * u + phase)))


class Row:
    def __init__(self, random_, i):
        session, self.k = divmod(i, ROWS)
        self.i, self.session = i, session + 1
        self.ms = round(session * (ROWS / RATE_HZ + GAP_S) * 1000 + self.k * 1000 / RATE_HZ)
        force = load(session, self.k)
        self.force_N = [round(f + random_.gauss(0, 0.004), 4) + 0.0 for f in force]
        self.channel = [round(z + sum(g * f for g, f in zip(gain, force)) + random_.gauss(0, 3), 2)
                        for z, gain in zip(ZERO, GAIN)]

    @property
    def size_N(self):
        return math.hypot(*self.force_N)


RECORDING = [Row(r, i) for r in [random.Random(20240610)] for i in range(SESSIONS * ROWS)]


def seconds(r):
    return f"{r.ms / 1000:.3f}"


def channels(r):
    return [f"{x:.2f}" for x in r.channel]


def forces(r, per_N=1.0, digits=4):
    return [f"{f * per_N:.{digits}f}" for f in r.force_N]


def session(r):
    return str(r.session)


def date(r, mark="T", zone=""):
    t = datetime.datetime(1970, 1, 1) + datetime.timedelta(milliseconds=EPOCH_S * 1000 + r.ms)
    return t.strftime(f"%Y-%m-%d{mark}%H:%M:%S.") + f"{t.microsecond // 1000:03}" + zone


def rows(*columns):
    """Columns are functions of a row that return a text or a list of texts."""
    result = []
    for r in RECORDING:
        cells = [column(r) for column in columns]
        result.append([text for cell in cells for text in (cell if isinstance(cell, list) else [cell])])
    return result


def plain():
    return rows(seconds, channels, forces, session)


def table(head, lines, mark=",", end="\n"):
    return end.join(mark.join(line) for line in [head, *lines]) + end


def commas(lines):
    return [[cell.replace(".", ",") for cell in line] for line in lines]


def separators():
    yield "plain.csv", table(PLAIN, plain()), {}
    yield "semicolons.csv", table(PLAIN, commas(plain()), ";", "\r\n"), {}
    yield "tabs.tsv", table(PLAIN, plain(), "\t").rstrip("\n"), {}
    yield "aligned.txt", "".join("".join(cell.rjust(11) for cell in line) + "\n" for line in [PLAIN, *plain()]), {}
    yield "savetxt.txt", f"# {' '.join(PLAIN)}\n" + "".join(
        " ".join(f"{float(cell):.18e}" for cell in line) + "\n" for line in plain()), {}
    yield "returns.csv", table(PLAIN, plain(), ",", "\r"), {}
    yield "twice.csv", table(PLAIN, plain()[:300]) + table(PLAIN, plain()[300:]), {}


def names():
    yield "comments.csv", "# skin 0042\n# operator: Anna, Ben\n#\n# columns,see,below\n\n" + table(PLAIN, plain()), {}
    yield "units.csv", table(["Time", *CHANNELS, "Fx", "Fy", "Fz", "session"], [
        ["s", *["counts"] * 6, *["mN"] * 3, "-"], *rows(seconds, channels, lambda r: forces(r, 1000, 1), session)]), {"channels": [f"{c} [counts]" for c in CHANNELS]}
    yield "quoted.csv", table(['""', *[f'"{name}"' for name in PLAIN]], rows(
        lambda r: f'"{r.i + 1}"', seconds, channels, forces, lambda r: f'"{r.session}"')), {}
    digits = [f"S{i} [digit]" for i in range(1, 7)]
    yield "brackets.csv", table(["Time [s]", *digits, "Fx [N]", "Fy [N]", "Fz [N]", "Session"], plain()), {"channels": digits}
    yield "grams.csv", table(["t(s)", *CHANNELS, "fx(g)", "fy(g)", "fz(g)", "session"], rows(
        seconds, channels, lambda r: forces(r, 1000 / G, 3), session)), {}
    german = [f"Kanal {i} [\u00b5V]" for i in range(1, 7)]
    yield "german.csv", table(["Zeit [s]", *german, "Kraft Fx [N]", "Kraft Fy [N]", "Kraft Fz [N]", "Sitzung"], commas(
        plain()), ";", "\r\n").encode("latin-1"), {"channels": german}
    french = [f"Capteur n\u00b0{i}" for i in range(1, 7)]
    yield "french.csv", table(["Temps (s)", *french, "Fx (N)", "Fy (N)", "Fz (N)", "S\u00e9ance"], commas(
        plain()), ";", "\r\n").encode("utf-8-sig"), {"channels": french}
    chinese = [f"\u901a\u9053{i}" for i in range(1, 7)]
    yield "chinese.csv", table(["\u65f6\u95f4(s)", *chinese, "Fx(N)", "Fy(N)", "Fz(N)", "\u6279\u6b21"], plain()), {
        "channels": chinese}
    yield "unicode.txt", b"\xff\xfe" + table(["Time [s]", *CHANNELS, "Fx [kg]", "Fy [kg]", "Fz [kg]", "Session"], rows(
        seconds, channels, lambda r: forces(r, 1 / G, 6), session), "\t", "\r\n").encode("utf-16-le"), {}
    taxels = [f"taxel[{i}]" for i in range(6)]
    yield "hash.csv", table(["#", "t_s", *taxels, *PLAIN[7:]], rows(
        lambda r: str(r.i + 1), seconds, channels, forces, session)), {"channels": taxels}
    yield "no_unit.csv", table(["t_s", *CHANNELS, "fx", "fy", "fz", "session"], rows(
        seconds, channels, lambda r: forces(r, 1000 / G, 2), session)), {"refuse": ["no unit: fx fy fz"]}


def numbers():
    def gaps(cells, r, offset):
        marks = ["NaN", "nan", "N/A", "", "NULL", "NA", "-", "#N/A"]
        n = r.i // 29
        return [marks[n % 8] if r.i % 29 == offset and k == n % len(cells) else cell for k, cell in enumerate(cells)]

    def infinite(r):
        return ["inf" if k == 2 and r.i in (150, 151, 390) else cell for k, cell in enumerate(channels(r))]

    low = random.Random(11)
    yield "exponents.csv", table(PLAIN, rows(seconds, lambda r: [f"{x:+.6E}" for x in r.channel], lambda r: [
        cell.replace("0.", ".", 1) if cell.startswith(("0.", "-0.")) else cell for cell in forces(r)], session)), {}
    yield "thousands.csv", table(PLAIN, rows(seconds, lambda r: [f'"{x:,.2f}"' for x in r.channel], forces, session)), {
        "refuse": ["column ch1: \"20,502.50\"", "thousands"]}
    yield "marks.csv", table(PLAIN, rows(seconds, lambda r: gaps(channels(r), r, 7), lambda r: gaps(forces(r), r, 10), session)), {
        "loose": True}
    yield "infinite.csv", table(PLAIN, rows(seconds, infinite, forces, session)), {"refuse": ["column ch3: \"inf\"", "2 rows"]}
    yield "huge.csv", table(PLAIN, rows(seconds, lambda r: [
        str((round(100 * x) << 40) + low.getrandbits(38)) for x in r.channel], forces, session)), {"scale": 100 * 2.0**40}
    yield "three_rows.csv", table(PLAIN, [plain()[i] for i in (20, 30, 40)]), {"refuse": ["3 rows", "at least"]}


def times():
    rest = [*CHANNELS, *PLAIN[7:]]
    yield "ns.csv", table(["timestamp", *rest], rows(
        lambda r: str((EPOCH_S * 1000 + r.ms) * 10**6), channels, forces, session)), {}
    yield "zone.csv", table(["Timestamp", *rest[:-1]], rows(lambda r: date(r, "T", "+02:00"), channels, forces)), {"sessions": 0}
    yield "pandas.csv", table(["", *rest], rows(lambda r: date(r, " "), channels, forces, session)), {}
    stamp = ["header.stamp.sec", "header.stamp.nanosec", "header.frame_id"]
    yield "ros.csv", table([*stamp, *rest], rows(lambda r: [
        str(EPOCH_S + r.ms // 1000), str(r.ms % 1000 * 10**6), "skin_link"], channels, forces, session)), {}
    yield "no_time.csv", table(rest, rows(channels, forces, session)), {"interval": 0}
    yield "millis.csv", table(["millis", *rest], rows(lambda r: str(r.ms), channels, forces, session)), {}
    yield "us.csv.gz", gzip.compress(table(["timestamp_us", *rest], rows(
        lambda r: str((EPOCH_S * 1000 + r.ms) * 1000), channels, forces, session)).encode()), {}


def others():
    """Columns that are no channels, and fit the labels better than channels do."""
    def robot(r):
        depth, angle = -0.08 * r.force_N[2], 0.01 * r.force_N[0]
        return [f"{x:.5f}" for x in (0.4 + 1e-4 * r.force_N[0], 0.1 + 1e-4 * r.force_N[1], 0.25 - depth / 1e3,
                                     math.sin(angle), 0.01 * r.force_N[1], 0.001, math.cos(angle), 0.2 - depth / 1e3, depth)]

    def logger(r):
        return [str(r.i), str(48211 + 3 * r.i), str(EPOCH_S * 1000 + r.ms), str(r.session * 2 + r.k // 60),
                "press" if r.size_N > 0.3 else "rest", '"M\u00fcller, A."' if r.session % 2 else "Li",
                "1" if r.size_N > 0.3 else "0", f"{4.1 - 2e-4 * r.i + 1e-3 * math.sin(r.i):.3f}"]

    def slow(r):
        return [f"{31 + 0.002 * r.i:.2f}", f"{round(-2 * r.force_N[2]) / 2:.1f}", "64", f"{math.exp(-r.i / 150):.5f}"]

    def mean(r):
        near = [q.force_N[2] for q in RECORDING[max(0, r.i - 4):r.i + 1] if q.session == r.session]
        return sum(near) / len(near)

    pose = ["x", "y", "z", "qx", "qy", "qz", "qw", "tcp_z", "commanded_depth_mm"]
    yield "robot.csv", table(["t_s", *pose, *PLAIN[1:]], rows(seconds, robot, channels, forces, session)), {}
    log = ["row", "frame_number", "stamp", "trial", "phase", "operator", "contact", "battery_V"]
    yield "logger.csv", table([*log, *PLAIN[1:]], rows(logger, channels, forces, session)), {
        "ask": ["trial", "contact", "battery_V"]}
    yield "chip.csv", table(["t_s", "T_chip [degC]", "setpoint", "adc_gain", "loss", *PLAIN[1:]], rows(
        seconds, slow, channels, forces, session)), {"ask": ["setpoint", "loss"]}
    yield "load_cell.csv", table(["t_s", "loadcell_raw", *PLAIN[1:]], rows(
        seconds, lambda r: str(round(8388608 - 21000 * r.force_N[2])), channels, forces, session)), {"ask": ["loadcell_raw"]}
    yield "made.csv", table([*PLAIN, "|F|", "fz_ma5"], rows(
        seconds, channels, forces, session, lambda r: [f"{r.size_N:.4f}", f"{mean(r):.4f}"])), {"ask": ["|F|", "fz_ma5"]}
    yield "commands.csv", table([*PLAIN, "ch7_set"], rows(seconds, channels, forces, session, lambda r: robot(r)[2])), {
        "ask": ["ch7_set"]}
    yield "joints.csv", table(["t_s", *[f"q{i}" for i in range(1, 8)], *PLAIN[1:]], rows(
        seconds, lambda r: robot(r)[:7], channels, forces, session)), {"ask": ["ch1 ch2", "q1 q2"]}


def npy(descr, shape, body):
    head = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}"
    head += " " * (-(len(head) + 11) % 64) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + body


def containers(folder):
    flat = [float(cell) for line in plain() for cell in line]
    yield "matrix.npy", npy("'<f8'", "(600, 11)", struct.pack(f"<{len(flat)}d", *flat)), {"refuse": ["--columns"]}
    descr = [("t_s", "<f8"), *[(c, "<f4") for c in CHANNELS], *[(c, "<f8") for c in PLAIN[7:10]], ("session", "<i4")]
    yield "structured.npy", npy(repr(descr), "(600,)", b"".join(struct.pack(
        "<d6f3di", r.ms / 1000, *r.channel, *r.force_N, r.session) for r in RECORDING)), {}
    with zipfile.ZipFile(folder / "excel.xlsx", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
    yield "excel.xlsx", (folder / "excel.xlsx").read_bytes(), {"refuse": ["xlsx", "libreoffice"]}
    yield "lines.jsonl", "".join(json.dumps(dict(zip(PLAIN, line))) + "\n" for line in plain()), {"refuse": ["JSON", "pandas"]}
    yield "matlab.mat", b"MATLAB 5.0 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\1IM", {"refuse": ["MATLAB", "scipy"]}
    yield "h5.h5", b"\x89HDF\r\n\x1a\n" + bytes(80), {"refuse": ["HDF5", "pandas"]}
    yield "pandas.parquet", b"PAR1" + bytes(80) + b"PAR1", {"refuse": ["parquet", "pandas"]}
    topics = b"".join(struct.pack("<BQHHI", 4, 8 + len(topic), i, i, len(topic)) + topic
                         for i, topic in enumerate((b"/skin", b"/ati/wrench")))
    yield "bag.mcap", b"\x89MCAP0\r\n" + topics + struct.pack("<BQQQI", 2, 20, 0, 0, 0) + b"\x89MCAP0\r\n", {
        "refuse": ["MCAP with the topics /skin /ati/wrench", "ros2 topic"]}
    yield "cut.csv.gz", gzip.compress(table(PLAIN, plain()).encode())[:-2000], {"refuse": ["cut off"]}


def two_clocks():
    """The reference has a clock of its own, 0.37 s ahead, and another rate."""
    noise, lines = random.Random(5), []
    for i in range(int((RECORDING[-1].ms / 1000 + 5) * 125)):
        t_s = i / 125 - 2
        s = min(SESSIONS - 1, max(0, int(t_s // (ROWS / RATE_HZ + GAP_S))))
        force = load(s, (t_s - s * (ROWS / RATE_HZ + GAP_S)) * RATE_HZ)
        lines.append([f"{t_s + 0.37:.4f}", *[f"{f + noise.gauss(0, 0.004):.4f}" for f in force]])
    head = ["Time (s)", "Fx (N)", "Fy (N)", "Fz (N)"]
    skin = table(["t_s", *CHANNELS, "session"], rows(seconds, channels, session))
    yield "two_clocks.csv", skin, {"labels": table(head, lines), "loose": True}
    circle = [[f"{math.cos(i * math.pi / 20):.4f}", f"{math.sin(i * math.pi / 20):.4f}"] for i in range(40)]
    yield "circling.csv", table(["t_s", "ch1", "ch2", "ch3"], [
        [f"{i / 20:.3f}", *circle[i % 40], f"{noise.gauss(0, 1):.3f}"] for i in range(1200)]), {
        "labels": table(["t_s", "fx_N", "fy_N"], [[f"{i / 20 + 0.4:.3f}", *circle[i % 40]] for i in range(1200)]),
        "refuse": ["cannot be aligned", "offsets"]}
    other = [[line[0], *[f"{noise.gauss(0, 3):.4f}" for _ in range(3)]] for line in lines]
    yield "no_relation.csv", skin, {"labels": table(head, other), "refuse": ["cannot be aligned"]}


def repeating(late_s, scatter=0.1, period_s=5, presses=20):
    """Similar presses, of which the channels and the labels miss the ends; both have one clock."""
    random_ = random.Random(1)
    size = [10 * (1 + random_.gauss(0, scatter)) for _ in range(2 * presses)]

    def press(t_s):
        return -size[int(t_s // period_s)] * max(0, math.sin(2 * math.pi * (t_s % period_s) / period_s))

    skin, labels = [], []
    for i in range(presses * period_s * 20):
        t_s = late_s + i / 20
        skin.append([f"{t_s:.3f}", *[f"{20000 + g * press(t_s) + random_.gauss(0, 3):.2f}" for g in (310, -290, 150, -250)]])
    for i in range(presses * period_s * 100):
        labels.append([f"{i / 100:.3f}", f"{press(i / 100) + random_.gauss(0, 0.004):.4f}"])
    return table(["t_s", "R1", "R2", "R3", "R4"], skin), table(["t_s", "fz_N"], labels)


def unloaded_axes():
    """Presses without shear; the reference has six axes, of which five show noise."""
    noise, lines, skin = random.Random(5), [], []
    for r in RECORDING:
        raw = [f"{z + g[2] * r.force_N[2] + noise.gauss(0, 3):.2f}" for z, g in zip(ZERO, GAIN)]
        skin.append([seconds(r), *raw, session(r)])
        other = [f"{noise.gauss(0, sd):.5f}" for sd in (0.004, 0.004, 1e-4, 1e-4, 1e-4)]
        lines.append([seconds(r), *other[:2], f"{r.force_N[2]:.4f}", *other[2:]])
    head = ["t_s", "fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm"]
    return table(["t_s", *CHANNELS, "session"], skin), table(head, lines)


def write(folder):
    """Writes all files and returns {name: what must come of it}."""
    expected = {}
    for part in (separators(), names(), numbers(), times(), others(), containers(folder), two_clocks()):
        for name, data, what in part:
            assert set(what) <= set(KEYS), what
            (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())
            expected[name] = what
    return expected
