"""Texts of two builds: the register map, the help of each verb, and the errors of `check` about broken configurations."""
import re

from same.numbers import ROOT, ctl
from same.outcome import differing_lines, first_difference

MAPS = ("csv", "md", "st")
# (name, what is replaced in config/demo.toml, by what)
BROKEN = (
    ("unknown key", "required = false", "required = false\nnonsense = 1"),
    ("unknown table", "[realtime]", "[nonsense]\na = 1\n[realtime]"),
    ("unknown driver", 'driver = "uart"', 'driver = "urat"'),
    ("unknown format", 'format = "cobs"', 'format = "cosb"'),
    ("unknown model", 'model = "table"', 'model = "tabel"'),
    ("unknown method", 'model = "table"', 'model = "table"\nmethod = "liner"'),
    ("another model's method", 'model = "table"', 'model = "table"\nmethod = "physics"'),
    ("method without a fit", 'model = "generic"', 'model = "generic"\nmethod = "mlp"'),
    ("no device", 'device = "build/demo/skin"', ""),
    ("a number out of range", "stale_ms = 100", "stale_ms = 0"),
    ("a text for a number", "stale_ms = 100", 'stale_ms = "soon"'),
    ("a number for a text", 'name = "gripper"', "name = 5"),
    ("an unknown link", 'link = "usb1"', 'link = "usb7"'),
    ("a link twice", 'name = "usb1"', 'name = "usb0"'),
    ("a sensor twice", 'name = "table"', 'name = "skin"'),
    ("a sensor named all", 'name = "skin"', 'name = "all"'),
    ("no calibration", "calibration/table_documents.toml", "calibration/none.toml"),
    ("another model's calibration", "calibration/table_documents.toml", "calibration/hair_documents.toml"),
    ("a broken address", "127.0.0.1:1502", "127.0.0.1.9:1502"),
    ("no TOML", "[modbus]", "[modbus"),
    ("a zero divisor", "counts_per_unit = 1e9", "counts_per_unit = 0"),
    ("channels that are not there", 'model = "table"', 'model = "table"\nchannels = ["R1", "R2"]'),
    ("too many channels", "channels = 15", "channels = 99"),
    ("a filter out of range", "stale_ms = 100", "stale_ms = 100\nfilter_hz = -1"),
    ("a grasp without jaws", "[modbus]", "[grasp]\ngravity_G_m_s2 = [0, 0, 9.81]\n[modbus]"),
    ("a grasp of an unknown sensor", "[modbus]", '[[grasp.jaw]]\nsensor = "none"\nx_S_in_G = [1, 0, 0]\nz_S_in_G = [0, 0, 1]\n[modbus]'),
    ("sim without a scene", 'driver = "uart"\ndevice = "build/demo/table"', 'driver = "sim"'),
    ("replay of no file", 'driver = "uart"\ndevice = "build/demo/table"', 'driver = "replay"\nfile = "none.mcap"'),
)


def add(outcome, name, a, b):
    lines, differ = differing_lines(a, b)
    outcome.add(max(lines, 1), differ, float("inf") if differ else 0, f"{name}: {first_difference(a, b)}" if a != b else "")
    if a != b:
        print(f"differs: {name}: {first_difference(a, b)}")


def compare(base, new, folder, outcome):
    texts = outcome("register map csv, md, st: lines", judged=False)
    for form in MAPS:
        add(texts, f"map --format {form}", *(ctl(build, "map", "--format", form).stdout for build in (base, new)))

    helps = outcome("--help, lines", judged=False)
    first = ctl(base, "--help").stdout
    add(helps, "--help", first, ctl(new, "--help").stdout)
    for verb in re.findall(r"^  ([a-z]+) {3,}", first.split("Subcommands:")[1], re.MULTILINE):
        add(helps, f"{verb} --help", *(ctl(build, verb, "--help").stdout for build in (base, new)))

    checks = outcome("errors of check, lines", judged=False)
    statuses = outcome("exit status of check")
    demo = (ROOT / "config/demo.toml").read_text().replace('"calibration/', f'"{ROOT}/config/calibration/')
    for name, old, by in (("the demo", "", ""), ("tactiled.toml", None, None), *BROKEN):
        path = folder / "check.toml"
        if old is None:
            path = ROOT / "config/tactiled.toml"
        else:
            assert old in demo, old
            path.write_text(demo.replace(old, by, 1))
        a, b = (ctl(build, "check", path) for build in (base, new))
        statuses.equal(a.returncode, b.returncode, name)
        add(checks, f"check of {name}", a.stdout + a.stderr, b.stdout + b.stderr)
