#!/usr/bin/env python3
"""Runs tests of the present tree against the release programs of an older commit, which knew neither CRC-16 nor the keys that
these tests use: the mechanisms that a test shows to be fixed must make it fail there.

    before.py BIN TEST.py [names of unittest]     BIN: build/release/bin of the older commit

Each test is copied to a temporary folder, with exclusive or for CRC-16 and without the unknown keys. The last line has the
number of failures; the text of each is its size."""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
UNKNOWN = "path|zeros|accept_unproved_age|tare_after_restart|zero_after|fault_clear_s"
XOR = '\n\ndef crc16(data):\n    total = 0\n    for byte in data:\n        total ^= byte\n    return total\n\n\n'


def rewrite(text, name):
    text = text.replace('*%04X', '*%02X').replace('checksum = "crc16"', "checksum = true")
    text = re.sub(r"\n\ndef crc16\(data\):\n(?:    .*\n)+\n*", lambda _: XOR, text)
    if name == "daemon.py":
        text = text.replace("import socket\n", "import re\nimport socket\n", 1)
        text = text.replace('        head = f', f'        config = re.sub(r"(?m)^({UNKNOWN}) = .*$", "", config)\n        head = f')
        text = re.sub(r'zeros = "\{self\.folder\}/zeros\.toml"\\n', "", text)
    return text


def main(binaries, test, *names):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        (root / "tests/system").mkdir(parents=True)
        for other in ("node", "config", "tests/st", "tests/faults", "tests/data"):
            (root / other).symlink_to(ROOT / other)
        for source in (ROOT / "tests/system").glob("*.py"):
            (root / "tests/system" / source.name).write_text(rewrite(source.read_text(), source.name))
        env = {**os.environ, "TACTILED_BIN": binaries, "TACTILED_RUNTIME_DIR": "/dev/shm", "PYTHONWARNINGS": "ignore"}
        return subprocess.run([sys.executable, root / "tests/system" / test, *names], env=env).returncode


if __name__ == "__main__":
    sys.exit(main(str(pathlib.Path(sys.argv[1]).resolve()), *sys.argv[2:]))
