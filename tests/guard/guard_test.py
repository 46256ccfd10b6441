#!/usr/bin/env python3
"""The release daemon under the guard: clean by itself, and each planted breach of the rules is found.

    guard_test.py                     the daemon with every plant, and without one: 1 minute
    guard_test.py --sections 1000000  without a plant until the pipeline's thread was armed so often; prints what was seen
"""
import json
import os
import pathlib
import random
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import unittest
import zlib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "system"))
from daemon import BIN, ROOT, Daemon, wait_for  # noqa: E402
from modbus_slaves import Hostile, Pty, Server, crc  # noqa: E402
from unit_daemon import CALIBRATION  # noqa: E402

# In memory on every machine: a segment on a disk has page faults, and the daemon warns of that.
os.environ.setdefault("TACTILED_RUNTIME_DIR", "/dev/shm")
GUARD = os.environ.get("RTGUARD", str(ROOT / "build/release/tests/guard/librtguard.so"))
CONFIG = """
[realtime]
period_us = {period}

[[link]]
name = "usb0"
driver = "uart"
device = "{folder}/dev"
path = "direct"
format = "cobs"

[[link]]
name = "usb1"
driver = "uart"
device = "{folder}/text"
path = "direct"
format = "lines"
channels = 3
sequence = true

[[sensor]]
name = "binary"
link = "usb0"
model = "generic"
calibration = "{folder}/unit.toml"

[[sensor]]
name = "text"
link = "usb1"
model = "generic"
calibration = "{folder}/unit.toml"
"""
GRASP = """
[grasp]
gravity_G_m_s2 = [0, 0, 9.81]
friction = 0.7
objects = "objects.toml"

[[grasp.jaw]]
sensor = "binary"
x_S_in_G = [0, 0, -1]
z_S_in_G = [1, 0, 0]

[[grasp.jaw]]
sensor = "text"
x_S_in_G = [0, 0, -1]
z_S_in_G = [-1, 0, 0]
"""
# Two jaws that close, hold 0.2 kg and open, again and again: c1 c2 c3 are fx fy fz.
ROWS = "t_s,c1,c2,c3\n" + "".join(
    f"{i / 1000},{-0.98 if 700 <= i < 1500 else 0.01 * (i % 3)},0,{-5 if 300 <= i < 1600 else 0.01 * (i % 2)}\n" for i in range(2000))
OBJECTS = 'format = 1\n[[object]]\nid = 1\nname = "an-object-whose-name-is-long"\nmass_kg = 0.2\nsd_kg = 0.01\n'
CLEAN = ("malloc", "free", "lock", "syscall", "minor_fault", "major_fault")
PLANTS = {  # plant: what must be found at least
    "string": ["malloc", "free"], "vector": ["malloc"], "function": ["malloc", "free"], "aligned_new": ["malloc", "free"], "free": ["free"],
    "throw": ["malloc", "free"], "mutex": ["lock"], "shared_mutex": ["lock"], "spin_lock": ["lock"], "write": ["syscall"], "fprintf": ["syscall"],
    "usleep": ["syscall"], "open": ["syscall"], "untouched_page": ["minor_fault"], "localtime": ["malloc"],
}


def reload(d, dice):
    """SIGHUP with a sensor retuned, one calibrated anew, the grasp changed, a broken file, or nothing new."""
    kind = dice.randrange(5)
    good = d.config.read_text()
    if kind == 0:
        good = re.sub(r"friction = [\d.]+", f"friction = {dice.uniform(0.2, 1):.3f}", good)
    elif kind == 1:
        good = re.sub(r'model = "generic"\n(filter_hz = \d+\n)?', f'model = "generic"\nfilter_hz = {dice.randrange(5, 100)}\n', good)
    elif kind == 2:
        (d.folder / "unit.toml").write_text(CALIBRATION.replace('"unit"', f'"{dice.randrange(1000)}"'))
    d.config.write_text(good[:dice.randrange(len(good))] if kind == 3 else good)
    before = len(d.log())
    for _ in range(dice.randrange(1, 4)):
        d.process.send_signal(signal.SIGHUP)
    wait_for(lambda: "SIGHUP: " in d.log()[before:], "an answer to SIGHUP")
    d.config.write_text(good)


def misbehave(d, dice):
    """A device of three channels that says what it must not, then a while nothing."""
    pty = Pty(d.folder / "text")
    for number in range(dice.randrange(50, 300)):
        line = f"{number},1,2,-3\n".encode()
        pty.send(dice.choice((line, line, line[:dice.randrange(len(line))], bytes(dice.randrange(256) for _ in range(40)), b"7" * 700 + b"\n",
                              line.replace(b"2", b"nan"), line.replace(b"2", b"1e99"), line + line, b"")))
        time.sleep(0.002)
    time.sleep(dice.uniform(0, 0.3))
    pty.close()


def reports(daemon):
    """Returns the guard's findings for each thread, except one that was never armed: the thread of several links
    while there are few frames."""
    threads = [json.loads(line) for line in (daemon.folder / "guard.json").read_text().splitlines()]
    return [t for t in threads if t["thread"] != "links" or t["sections"] > 0]


def calls_of(thread):
    return set(thread["allowed_calls"]) - {"202"}  # futex: a wake, where the guard allowed it


def run(seconds, plant=None, thread="pipeline", period=250, stir=False):
    """The daemon under the guard. Returns its exit status and the report's lines."""
    env, dice = {"LD_PRELOAD": GUARD}, random.Random(1)
    if plant:
        env.update(RTGUARD_PLANT=plant, RTGUARD_PLANT_THREAD=thread)
    with Daemon((CONFIG + GRASP).replace("{period}", str(period)), env=env) as d:
        d.env["RTGUARD_REPORT"] = str(d.folder / "guard.json")
        (d.folder / "unit.toml").write_text(CALIBRATION)
        (d.folder / "rows.csv").write_text(ROWS)
        (d.folder / "objects.toml").write_text(OBJECTS)
        d.play("--in", d.folder / "rows.csv", "--pty", d.folder / "dev", "--format", "cobs", "--rate", 1000, "--loop")
        d.play("--in", d.folder / "rows.csv", "--pty", d.folder / "text", "--format", "lines", "--sequence", "--rate", 500, "--loop")
        d.start()
        until = time.monotonic() + seconds
        while time.monotonic() < until:  # events of the daemon's life: tares, queries, a device that disconnects and
                                         # returns
            time.sleep(min(1, seconds / 4))
            if stir:
                d.ctl("tare", "all")
                d.ctl("weigh", "start")
                d.ctl("teach", "--reload")
                reload(d, dice)
                player = d.others.pop()
                player.terminate()
                player.wait()
                misbehave(d, dice)
                d.play("--in", d.folder / "rows.csv", "--pty", d.folder / "text", "--format", "lines", "--sequence", "--rate", 500, "--loop")
        if stir:
            print("reloads:", ", ".join(f"{d.log().count(word)} {word}" for word in ("SIGHUP: changed", "SIGHUP: refused", "SIGHUP: neither")), flush=True)
        status, _ = d.stop()
        return status, reports(d)


# A sensor for each of two links.
SENSORS = "".join(f"""
[[sensor]]
name = "{name}"
link = "{name}"
model = "generic"
calibration = "FOLDER/unit.toml"
""" for name in ("{0}", "{1}")).replace("FOLDER", "{{folder}}")


def clean(test, daemon, seconds):
    """Runs the daemon for so long. No thread of it may do a thing; returns the report's lines, and what `status` says of the links."""
    daemon.env["RTGUARD_REPORT"] = str(daemon.folder / "guard.json")
    (daemon.folder / "unit.toml").write_text(CALIBRATION)
    daemon.start()
    time.sleep(seconds)
    links = json.loads(daemon.ctl("status", "--json").stdout)["links"]
    status, _ = daemon.stop()
    threads = reports(daemon)
    for t in threads:
        test.assertGreater(t["sections"], 100)
        test.assertEqual({k: t[k] for k in CLEAN}, dict.fromkeys(CLEAN, 0), t)
    test.assertEqual(status, 0, daemon.log())
    return threads, links


class Guard(unittest.TestCase):
    def test_the_release_daemon_is_clean(self):
        status, threads = run(6, stir=True)
        self.assertEqual(sorted(t["thread"] for t in threads), ["link", "link", "pipeline"])
        for t in threads:
            self.assertGreater(t["sections"], 500)
            self.assertEqual({k: t[k] for k in CLEAN}, dict.fromkeys(CLEAN, 0), t)
            self.assertEqual(calls_of(t), {"0", "271"} if t["thread"] == "link" else set())  # read, ppoll
        self.assertEqual(status, 0)

    def test_each_plant_is_found(self):
        for plant, kinds in PLANTS.items():
            with self.subTest(plant):
                status, threads = run(0.6, plant)
                pipeline = next(t for t in threads if t["thread"] == "pipeline")
                for kind in kinds:
                    self.assertGreater(pipeline[kind], 0, f"{plant} not found as {kind}: {pipeline}")
                self.assertEqual(status, 97)

    def test_a_plant_in_a_link_thread_is_found(self):
        for plant, kind in (("string", "malloc"), ("mutex", "lock"), ("open", "syscall")):
            with self.subTest(plant):
                status, threads = run(2, plant, "link")
                self.assertGreater(sum(t[kind] for t in threads if t["thread"] == "link"), 0)
                self.assertEqual(status, 97)

    def test_modbus_links_are_clean_whatever_their_slaves_do(self):
        link = """
[[link]]
name = "NAME"
driver = "modbus"
WHERE
[[link.slave]]
rate_Hz = 200
sequence = {at = 13}
registers = [{name = "c1", at = 10}, {name = "c2", at = 11}, {name = "c3", at = 12}]

[[sensor]]
name = "NAME"
link = "NAME"
model = "generic"
calibration = "{folder}/unit.toml"
"""
        server = Server()
        with Daemon(link.replace("NAME", "net").replace("WHERE", f'address = "127.0.0.1:{server.port}"') +
                    link.replace("NAME", "line").replace("WHERE", 'device = "{folder}/dev"\nbaud = 115200\ntimeout_ms = 20').replace("rate_Hz = 200", "rate_Hz = 60"),
                    env={"LD_PRELOAD": GUARD}) as d:
            d.env["RTGUARD_REPORT"] = str(d.folder / "guard.json")
            (d.folder / "unit.toml").write_text(CALIBRATION)
            misdeeds = {name: 0.05 for name in ("late", "silence", "unit", "exception", "length", "short", "noise", "hang_up")}
            slaves = [Hostile(end, misdeeds, seed=1, late_s=0.06) for end in (server, Pty(d.folder / "dev"))]
            for slave in slaves:
                slave.start()
            d.start()
            time.sleep(8)
            status, _ = d.stop()
            for slave in slaves:
                slave.close()
            threads = reports(d)
            self.assertEqual(status, 0)
            calls = set()
            for t in threads:
                self.assertEqual({k: t[k] for k in CLEAN}, dict.fromkeys(CLEAN, 0), t)
                calls |= calls_of(t)
            self.assertEqual(calls, {"0", "1", "44", "45", "271"})  # read, write, sendto, recvfrom, ppoll

    def test_streams_of_other_makers_are_clean_also_when_they_fall_silent_or_end(self):
        text = "F={-5.00,0.25,-1.50,0.001,0.002,0.003},20480\n".encode()
        body = bytes([0x20, 0x4E]) + struct.pack("<6h", -500, 25, -150, 1, 2, 3)
        line = body + crc(body)
        server, stop = socket.create_server(("127.0.0.1", 0)), threading.Event()

        def phases():  # a device with 0.6 s of frames and 1.4 s of silence: the request is repeated
            return time.monotonic() % 2 < 0.6

        def network():
            client = None
            while not stop.wait(0.005):
                if client is None:
                    client = server.accept()[0]
                    until = time.monotonic() + 2.5
                try:
                    if phases():
                        client.sendall(text)
                except OSError:  # the daemon has opened the link again
                    until = 0
                if time.monotonic() > until:
                    client.close()
                    client = None
            if client is not None:
                client.close()

        def serial(pty):
            while not stop.wait(0.01):
                pty.receive(0)  # the requests
                if phases():
                    pty.send(line)

        links = f"""
[[link]]
name = "net"
driver = "tcp"
address = "127.0.0.1:{server.getsockname()[1]}"
path = "direct"
format = "kms40"

[[link]]
name = "line"
driver = "uart"
device = "{{folder}}/dev"
path = "direct"
baud = 19200
format = "ft300"
""" + SENSORS.format("net", "line")
        with server, Daemon(links, env={"LD_PRELOAD": GUARD}) as d:
            pty = Pty(d.folder / "dev")
            devices = [threading.Thread(target=network, daemon=True), threading.Thread(target=serial, args=[pty], daemon=True)]
            for device in devices:
                device.start()
            threads, seen = clean(self, d, 8)
            stop.set()
            for device in devices:
                device.join(5)
            pty.close()
        for link in seen:
            self.assertGreater(link["frames"], 100)
            self.assertGreater(link["restarted"], 0, "it was never asked again")
        self.assertGreater(seen[0]["gone"], 0)
        calls = {call for t in threads for call in calls_of(t)}
        self.assertEqual(calls, {"0", "1", "44", "271"})  # read, write, sendto, ppoll

    def test_arrays_in_datagrams_are_clean_also_damaged_late_and_from_others(self):
        device, other, stop = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)] + [threading.Event()]
        device.bind(("127.0.0.2", 0))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        dice = random.Random(1)

        def message(body):
            return body + struct.pack("<I", zlib.crc32(body))

        def send():  # 300 taxels of three values in three pieces
            device.setblocking(False)
            for number in range(1_000_000):
                if stop.wait(0.002):
                    return
                try:
                    while line := device.recv(64):
                        device.sendto(message(struct.pack("<B3xII", 4, int(line[1:]), 1000 * number)), ("127.0.0.1", port))
                except BlockingIOError:
                    pass
                pieces = [message(struct.pack("<BBBBIIHBBHH", 3, 0, 2, 2, number, 1000 * number, 300, 3, 0, first, 100) + bytes(600))
                          for first in (0, 100, 200)]
                kind = dice.randrange(20)
                if kind == 0:
                    pieces = [dice.randbytes(dice.randrange(2000))] + pieces[1:]
                elif kind == 1:
                    dice.shuffle(pieces)
                    pieces.append(pieces[0])
                elif kind == 2:
                    other.sendto(pieces[0], ("127.0.0.1", port))
                elif kind == 3 and number % 200 == 3:
                    time.sleep(0.3)
                for piece in pieces:
                    device.sendto(piece, ("127.0.0.1", port))

        links = f"""
[[link]]
name = "skin"
driver = "udp"
address = "127.0.0.2:{device.getsockname()[1]}"
listen = {port}
taxels = 300
values = 3
echo = true
"""
        with device, other, Daemon(CONFIG.replace("{period}", "250") + links, env={"LD_PRELOAD": GUARD}) as d:
            (d.folder / "rows.csv").write_text(ROWS)
            d.play("--in", d.folder / "rows.csv", "--pty", d.folder / "dev", "--format", "cobs", "--rate", 1000, "--loop")
            d.play("--in", d.folder / "rows.csv", "--pty", d.folder / "text", "--format", "lines", "--sequence", "--rate", 500, "--loop")
            sender = threading.Thread(target=send, daemon=True)
            sender.start()
            threads, seen = clean(self, d, 6)
            stop.set()
            sender.join(5)
        skin = next(link for link in seen if link["name"] == "skin")
        for count in ("frames", "skipped_bytes", "repeated", "lost"):
            self.assertGreater(skin[count], 10, count)
        calls = next(calls_of(t) for t in threads if "299" in calls_of(t))
        self.assertEqual(calls - {"230"}, {"44", "271", "299"})  # sendto, ppoll, recvmmsg; perhaps clock_nanosleep

    def test_the_thread_that_reads_several_links_is_clean(self):
        names = [f"l{i}" for i in range(8)]
        with Daemon("".join(f"""
[[link]]
name = "{name}"
driver = "uart"
device = "{{folder}}/{name}"
format = "cobs"

[[sensor]]
name = "{name}"
link = "{name}"
model = "generic"
calibration = "{{folder}}/unit.toml"
""" for name in names), env={"LD_PRELOAD": GUARD}) as d:
            (d.folder / "rows.csv").write_text(ROWS)
            for name in names:
                d.play("--in", d.folder / "rows.csv", "--pty", d.folder / name, "--format", "cobs", "--rate", 1500, "--loop")
            threads, seen = clean(self, d, 6)
        shared = [t for t in threads if t["thread"] == "links"]
        self.assertEqual(len(shared), 1, "the links were not read by one thread")
        self.assertGreater(shared[0]["sections"], 1000)
        self.assertEqual(calls_of(shared[0]), {"0"})  # read(), without a poll before it
        for link in seen:
            self.assertGreater(link["frames"], 3000)

    def test_a_recording_and_a_scene_are_clean(self):
        with Daemon(CONFIG.replace("{period}", "250")) as d:
            (d.folder / "unit.toml").write_text(CALIBRATION)
            (d.folder / "rows.csv").write_text(ROWS)
            d.play("--in", d.folder / "rows.csv", "--pty", d.folder / "dev", "--format", "cobs", "--rate", 1000, "--loop")
            d.start()
            file = d.folder / "back.mcap"
            subprocess.run([BIN / "tactilectl", "record", file, "--config", d.config, "--node", d.name, "--seconds", "2"], check=True,
                           capture_output=True, timeout=20)
            d.stop()
            links = f"""
[[link]]
name = "back"
driver = "replay"
file = "{file}"
link = "usb0"
at_end = "again"

[[link]]
name = "scene"
driver = "sim"
scene = "{ROOT}/config/scenes/drop.toml"
at_end = "again"
""" + SENSORS.format("back", "scene")
            with Daemon(links, env={"LD_PRELOAD": GUARD}) as again:
                threads, seen = clean(self, again, 5)
        for link in seen:
            self.assertGreater(link["frames"], 500)
        self.assertGreater(seen[0]["gone"], 0, "the recording never began again")
        calls = {call for t in threads for call in calls_of(t)}
        self.assertEqual(calls, {"0", "230"})  # read, clock_nanosleep

    def test_reading_the_clock_is_no_breach(self):
        status, _ = run(0.6, "clock")
        self.assertEqual(status, 0, "clock_gettime enters the kernel on this machine: tactiled would, too")


if __name__ == "__main__":
    if "--sections" in sys.argv:
        wanted = int(sys.argv[sys.argv.index("--sections") + 1])
        status, threads = run(wanted / 4000 * 1.1 + 1, stir=True)  # beside other work it is armed less often
        for t in threads:
            print(json.dumps(t))
        sys.exit(status if min(t["sections"] for t in threads if t["thread"] == "pipeline") >= wanted else 1)
    unittest.main(verbosity=2)
