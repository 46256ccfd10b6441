#!/usr/bin/env python3
"""Time from the last byte of an RTU request to the first byte of its answer, over a pty: prints quantiles.

    rtu_turnaround.py [REQUESTS]      115,200 baud, silence_us by default and 100; TACTILED_BIN=FOLDER measures another build
"""
import os
import pathlib
import select
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "system"))
from daemon import Daemon, wait_for  # noqa: E402
from modbus_slaves import Pty, crc  # noqa: E402

CONFIG = """
[modbus.rtu]
device = "{folder}/line"
baud = 115200
SILENCE

[[link]]
name = "scene"
driver = "sim"
scene = "{root}/config/scenes/drop.toml"

[[sensor]]
name = "drop"
link = "scene"
model = "generic"
calibration = "{folder}/unit.toml"
"""


def turnaround_us(fd):
    request = bytes([1, 3, 0, 0, 0, 10])
    request += crc(request)
    os.write(fd, request)
    asked = time.monotonic()
    if not select.select([fd], [], [], 0.2)[0]:
        return None
    us = (time.monotonic() - asked) * 1e6
    answer = b""
    while len(answer) < 25:
        answer += os.read(fd, 256)
    assert answer[:3] == bytes([1, 3, 20]), answer
    time.sleep(0.004)
    return us


def main():
    from unit_daemon import CALIBRATION
    requests = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    root = pathlib.Path(__file__).resolve().parents[2]
    for silence in ("", "silence_us = 100"):
        with Daemon(CONFIG.replace("SILENCE", silence).replace("{root}", str(root))) as d:
            (d.folder / "unit.toml").write_text(CALIBRATION)
            line = Pty(d.folder / "line")
            d.start()
            wait_for(lambda: "Modbus RTU: " in d.log(), "the line to be opened")
            taken = sorted(us for us in (turnaround_us(line.master) for _ in range(requests)) if us is not None)
            d.stop()
            at = {q: taken[min(len(taken) - 1, int(q * len(taken)))] for q in (0.5, 0.99)}
            print(f"{silence or 'default':20} p50 {at[0.5]:7.0f} us  p99 {at[0.99]:7.0f} us  answers {len(taken)} of {requests}")


if __name__ == "__main__":
    main()
