"""A played daemon, layout.h in an independent parser, and a segment whose bytes can be patched: for the tests of
node/python/tactiled.py."""
import math
import os
import pathlib
import re
import struct
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import ROOT, Daemon, run_folder, wait_for  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

RATE_HZ = 250
STALE_MS = 1000  # a busy machine delays the player and the daemon for longer than 100 ms
WATCHDOG_MS = 1000
LINK = """
[[link]]
name = "usb-{}"
driver = "uart"
device = "{{folder}}/{}"
path = "direct"
baud = 921600
format = "cobs"
simulated = true

[[sensor]]
name = "{}"
link = "usb-{}"
counts_per_unit = 1e9
model = "table"
calibration = "ROOT/config/calibration/table_documents.toml"
stale_ms = STALE_MS
"""


def played_daemon(*sensors, rate=RATE_HZ, name=None):
    config = "".join(LINK.format(s, s, s, s) for s in sensors)
    daemon = Daemon(config.replace("ROOT", str(ROOT)).replace("STALE_MS", str(STALE_MS)), name=name, node=f"watchdog_ms = {WATCHDOG_MS}")
    for sensor in sensors:
        daemon.play("--in", ROOT / "config/demo/table_demo.csv", "--pty", daemon.folder / sensor, "--format", "cobs",
                    "--bits", 32, "--counts-per-unit", "1e9", "--rate", rate, "--loop")
    return daemon


def good(daemon, sensor="left"):
    with tactiled.open(daemon.name) as node:
        wait_for(lambda: node.latest(sensor).quality in (tactiled.GOOD, tactiled.UNCERTAIN), "a value")


def forces_are_nan(sample):
    fields = ("force_S_N", "torque_S_Nm", "sd_force_N", "sd_torque_Nm", "raw_force_S_N", "raw_torque_S_Nm", "cop_S_m")
    return all(math.isnan(x) for name in fields for x in getattr(sample, name)) and math.isnan(sample.residual)


def same_bits(a, b):
    """Returns whether two decoded values are equal, with NaN equal to NaN."""
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same_bits, a, b))
    return a == b or (isinstance(a, float) and struct.pack("d", a) == struct.pack("d", b))


class Layout:
    """layout.h in a parser that is independent of the module."""

    SCALARS = {"char": ("s", 1), "uint8_t": ("B", 1), "uint16_t": ("H", 2), "uint32_t": ("I", 4), "uint64_t": ("Q", 8), "float": ("f", 4),
               "double": ("d", 8)}

    def __init__(self):
        text = re.sub(r"/\*.*?\*/", "", (ROOT / "node/include/tactiled/layout.h").read_text(), flags=re.S)
        self.numbers = {name: int(value.rstrip("u"), 0)
                        for name, value in re.findall(r"#define TACTILED_(\w+) (0x\w+|\d+u?)\s", text)}
        self.enums = {}
        for name, body in re.findall(r"enum tactiled_(\w+) \{(.*?)\}", text, flags=re.S):
            self.enums[name] = {}
            for constant, one, shift in re.findall(r"TACTILED_(\w+) = (0x\w+|\d+)(?: << (\d+))?", body):
                self.enums[name][constant] = int(one, 0) << int(shift or 0)
            self.numbers.update(self.enums[name])
        self.structs = {}  # name -> [(member, offset, format)]
        self.sizes = {}
        for name, body in re.findall(r"struct tactiled_(\w+) \{(.*?)\};", text, flags=re.S):
            self._lay_out(name, body)

    def _lay_out(self, name, body):
        members, at, largest = [], 0, 4
        for member in filter(None, (m.strip() for m in body.split(";"))):
            align, kind, names = re.fullmatch(r"(?:TACTILED_ALIGN\((\d+)\) )?((?:struct )?\w+) (.*)", member).groups()
            for field, dims in re.findall(r"(\w+)((?:\[\w+\])*)", names):
                count = math.prod(int(dim) if dim.isdigit() else self.numbers[dim.replace("TACTILED_", "")]
                                  for dim in re.findall(r"\w+", dims))
                if kind in ("struct tactiled_grasp", "struct tactiled_tool", "struct tactiled_sample", "struct tactiled_budget"):  # tables of their own
                    letter, size, count, align = "s", 1, self.sizes[kind.split("_", 1)[1]], 8
                elif kind.startswith("struct"):
                    inner = self.structs[kind.split("_", 1)[1]]
                    assert all(code == "I" for _, _, code in inner)
                    letter, size, count = "I", 4, count * len(inner)
                else:
                    letter, size = self.SCALARS[kind]
                alignment = int(align or size)
                largest = max(largest, alignment)
                at += -at % alignment
                members.append((field, at, letter if count == 1 else f"{count}{letter}"))
                at += size * count
        self.structs[name], self.sizes[name] = members, at + -at % largest

    def offset(self, name, member):
        return next(offset for field, offset, _ in self.structs[name] if field == member)

    def decode(self, name, data):
        values = {}
        for field, offset, code in self.structs[name]:
            found = struct.unpack_from("=" + code, data, offset)
            values[field] = found if code[:-1] else found[0]
        return values


LAYOUT = Layout()


def segment_bytes(name):
    return bytearray((run_folder() / f"tactiled.{name}").read_bytes())


def sensor_ring(data, index):
    header = LAYOUT.decode("header", data)
    at = header["sensor_offset"] + index * header["sensor_size"]
    numbers = LAYOUT.decode("sensor", data[at:at + LAYOUT.sizes["sensor"]])["ring"]
    return dict(zip((field for field, _, _ in LAYOUT.structs["ring"]), numbers)), data


class a_copy:
    """A copy of a segment under another name, to be patched. A context manager."""

    def __init__(self, data):
        self.data = bytearray(data)
        self.name = f"copy-{os.getpid()}-{time.monotonic_ns()}"
        self.path = run_folder() / f"tactiled.{self.name}"

    def put(self, struct_name, member, *values, at=0):
        code = next(code for field, _, code in LAYOUT.structs[struct_name] if field == member)
        struct.pack_into("=" + code, self.data, at + LAYOUT.offset(struct_name, member), *values)

    def make_fresh(self):
        """Makes all samples fresh and the daemon alive for the next ten seconds."""
        now_ns = time.monotonic_ns()
        self.date_samples(now_ns)
        ring, _ = sensor_ring(self.data, 0)
        for slot in range(ring["slots"]):
            self.put("sample", "t_published_ns", now_ns, at=ring["offset"] + slot * ring["slot_size"] + 8)
        self.put("header", "watchdog_ms", 10_000)
        self.put("sensor", "stale_ms", 10_000, at=self.sensor_at())

    def date_samples(self, t_ns):
        ring, _ = sensor_ring(self.data, 0)
        for slot in range(ring["slots"]):
            self.put("sample", "t_ns", t_ns, at=ring["offset"] + slot * ring["slot_size"] + 8)

    def empty_rings(self, records=0):
        """Publishes nothing, or so many samples that the ring has wrapped."""
        header, ring = LAYOUT.decode("header", self.data), sensor_ring(self.data, 0)[0]
        for offset, slot_size, slots, _, head_offset in (header["node"], ring.values()):
            struct.pack_into("=I", self.data, head_offset, 0)
            for slot in range(slots):
                struct.pack_into("=I", self.data, offset + slot * slot_size, 1)
        for number in range(records):
            slot = ring["offset"] + number % ring["slots"] * ring["slot_size"]
            struct.pack_into("=I", self.data, slot, 2 * number + 2)
            struct.pack_into("=I", self.data, ring["head_offset"], number + 1)

    def sensor_at(self):
        return LAYOUT.decode("header", self.data)["sensor_offset"]

    def set_record_size(self, size):
        ring, _ = sensor_ring(self.data, 0)
        ring["record_size"] = size
        self.put("sensor", "ring", *ring.values(), at=self.sensor_at())

    def write(self, mode=0o640):
        self.path.write_bytes(self.data)
        self.path.chmod(mode)
        return self.name

    def write_in_place(self):
        with open(self.path, "r+b") as file:
            file.write(self.data)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.path.exists():
            self.path.unlink()
