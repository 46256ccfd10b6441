#!/usr/bin/env python3
"""Costs of an array: the daemon's processor time at 1 kHz over UDP, in datagrams of one Ethernet frame and in one for all, and TCP, lost frames, the time from sending to reading beside a
plain program that receives, multiplies and copies, and the instructions of the model against the number of taxels.

    array_costs.py [--frames N]     N: a count of lost frames beside four busy programs
"""
import argparse
import json
import math
import os
import pathlib
import socket
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/system"), str(ROOT / "node/python")]
import counted  # noqa: E402
import tactiled  # noqa: E402
from array_device import ArrayDevice  # noqa: E402
from daemon import BIN, Daemon, free_port  # noqa: E402

SECONDS = 5


def pair_of_ports():
    while True:
        port = free_port()
        try:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
                s.bind(("127.0.0.1", port + 1))
            return port
        except OSError:
            pass


def daemon_of(rows, values, port, way):
    device = ArrayDevice(rows=rows, columns=rows, values=values)
    text = device.config().replace(f":{device.port}\"", f":{port}\"").replace("echo = true", 'path = "direct"')
    text = text.replace(f"listen = {device.listen}", f"listen = {port + 1}")
    if way == "tcp":
        text = text.replace('driver = "udp"', 'driver = "tcp"\nformat = "cobs"').replace(f"listen = {port + 1}\n", "")
    daemon = Daemon(text)
    (daemon.folder / "skin.toml").write_text(device.calibration())
    device.socket.close()
    return daemon


def cpu_s(pid):
    """The processor time of all threads; that of /proc/PID/stat is sampled by a tick, to which 1 kHz may be synchronous."""
    return sum(int(task.read_text().split()[0]) for task in pathlib.Path(f"/proc/{pid}/task").glob("*/schedstat")) / 1e9


def feed(*words):
    return subprocess.Popen([BIN / "array_feeder", *map(str, words)], stdout=subprocess.PIPE, text=True)


def live(rows, values, way):
    """Prints the processor time and the latency of one array."""
    port = pair_of_ports()
    with daemon_of(rows, values, port, way) as daemon:
        daemon.start()
        os.environ["TACTILED_RUNTIME_DIR"] = str(daemon.segment.parent)
        feeder = feed(way, port, rows * rows, values, 1000, SECONDS)  # no reader that takes a part of the processor
        time.sleep(1)
        before = cpu_s(daemon.process.pid)
        time.sleep(SECONDS - 2)
        share = 100 * (cpu_s(daemon.process.pid) - before) / (SECONDS - 2)
        feeder.wait()
        seen = feed(way, port, rows * rows, values, 1000, SECONDS, daemon.name).communicate()[0]
        print(f"{way} {rows * rows} x {values}: {share:.1f} % of a core; {seen.strip()}", flush=True)
        if (rows, values, way) == (32, 3, "udp"):
            with tactiled.open(daemon.name) as node:
                begun = time.perf_counter()
                for _ in range(2000):
                    node.array("skin")
                print(f"python: {(time.perf_counter() - begun) / 2000 * 1e6:.1f} us", flush=True)


def plain(rows, values):
    print(f"plain {rows * rows} x {values}: {feed('plain', pair_of_ports(), rows * rows, values, 1000, SECONDS).communicate()[0].strip()}", flush=True)


def lost(frames):
    """Prints the frames that are lost of so many beside four busy programs."""
    port = pair_of_ports()
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4)]
    try:
        with daemon_of(32, 3, port, "udp") as daemon:
            daemon.start()
            feed("udp", port, 1024, 3, 1000, frames / 1000).wait()
            time.sleep(1)
            link = json.loads(daemon.ctl("status", "--json").stdout)["links"][0]
            print(f"lost {frames - link['frames']} of {frames}: {link}", flush=True)
    finally:
        for process in busy:
            process.kill()
            process.wait()


def instructions(taxels, values):
    return counted.a_step(lambda n: [BIN / "arrays", "--count", n, taxels, values], 20, 220)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--frames", type=int)
    asked = arguments.parse_args()
    if asked.frames:
        return lost(asked.frames)
    for rows, values, way in ((32, 1, "udp"), (32, 3, "udp"), (32, 3, "whole"), (64, 3, "whole"), (32, 3, "tcp")):
        live(rows, values, way)
        if (rows, values, way) == (32, 3, "udp"):
            plain(rows, values)
    few, many = instructions(16, 3), instructions(4096, 3)
    print(f"instructions: 16 taxels {few:.0f}, 4096 taxels {many:.0f}, exponent {math.log(many / few) / math.log(4096 / 16):.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
