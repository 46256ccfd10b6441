#!/usr/bin/env python3
"""All bridges over a daemon that restarts with its sensors in another order, and bridges that stand still: no client gets a value under
another sensor's name, or an old one as a new one."""
import collections
import json
import pathlib
import shutil
import signal
import subprocess
import sys
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bridge_process import Process, bridge  # noqa: E402
from daemon import BIN, ROOT, Daemon, free_port, halt, wait_for, wait_until_it_rests  # noqa: E402
from rdt_client import Client  # noqa: E402
from unit_daemon import CALIBRATION, CONFIG, quality_is  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

BROKER = shutil.which("mosquitto") or "/usr/sbin/mosquitto"
NEEDED = [BIN / "tactiled-mqtt", BIN / "tactiled-dds", BIN / "fastdds_reader", pathlib.Path(BROKER)]
DOMAIN = "83"
FORCES = {"left": (1, 2, -3), "right": (4, 5, -6), "third": (7, 8, -9)}
STALE_MS = 100


def config(names):
    return "".join(CONFIG.replace("stale_ms = 2000", f"stale_ms = {STALE_MS}").replace("usb0", f"usb-{name}").replace("/dev", f"/{name}").replace('"left"', f'"{name}"') for name in names)


class Seen:
    """Values that clients of all kinds received: by (kind, sensor), a list of (time of receipt, time of the
    sample or its number, forces)."""

    def __init__(self):
        self.values = collections.defaultdict(list)
        self.broken = threading.Event()

    def follow(self, kind, process):
        def read():
            for line in process.stdout:
                now_s = time.time()
                if kind == "mqtt":
                    topic, _, text = line.partition(" ")
                    message = json.loads(text)
                    if message["quality"] == "good":
                        self.values[kind, topic.split("/")[2]].append((now_s, message["t_s"], tuple(message["force_N"])))
                else:
                    _, sent, name, numbers = line.split(" ", 3)
                    self.values[kind, name].append((now_s, int(sent) / 1e9, tuple(map(float, numbers.split()[:3]))))
        threading.Thread(target=read, daemon=True).start()

    def follow_rdt(self, name, client):
        def read():
            while client.socket.fileno() >= 0:
                try:
                    record = client.record()
                    self.values["rdt", name].append((time.time(), record[1], tuple(record[3][:3])))
                except OSError:
                    pass
        threading.Thread(target=read, daemon=True).start()

    def counts(self):
        return {key: len(values) for key, values in self.values.items()}

    def wrong(self):
        return {key: sorted({force for *_, force in values} - {FORCES[key[1]]}) for key, values in self.values.items()
                if {force for *_, force in values} != {FORCES[key[1]]}}


@unittest.skipIf([p for p in NEEDED if not p.exists()], f"missing: {[p.name for p in NEEDED if not p.exists()]}")
class Restart(unittest.TestCase):
    def setUp(self):
        self.daemon = Daemon("[shm]\nhistory = 16384\n\n" + config(("left", "right")))
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        self.head = self.daemon.config.read_text().split("[[link]]")[0]
        (self.daemon.folder / "unit.toml").write_text(CALIBRATION)
        for name, force in FORCES.items():
            row = ",".join(map(str, force))
            (self.daemon.folder / f"{name}.csv").write_text(f"t_s,c1,c2,c3\n0,{row}\n0.01,{row}\n")
            self.daemon.play("--in", self.daemon.folder / f"{name}.csv", "--pty", self.daemon.folder / name, "--format", "lines", "--sequence", "--rate", 200, "--loop")
        self.daemon.start()
        wait_for(quality_is(self.daemon, "good"), "a good value")
        self.seen, self.bridges = Seen(), []
        broker = free_port()
        settings = self.daemon.folder / "mosquitto.conf"
        settings.write_text(f"persistence false\nlistener {broker} 127.0.0.1\nallow_anonymous true\n")
        self.start(Process(BROKER, "-c", settings, ready="running"))
        self.client("dds", BIN / "fastdds_reader", DOMAIN, "120", *(f"rt/hand/{name}/wrench" for name in FORCES))
        self.client("mqtt", "mosquitto_sub", "-p", broker, "-v", "-t", "tactiled/+/+/wrench")
        ports = [free_port() for _ in range(2)]
        self.bridges = [self.start(bridge("mqtt", self.daemon.name, "--port", broker, "--rate-Hz", 0)), self.start(bridge("dds", self.daemon.name, "--domain", DOMAIN, "--name", "hand")),
                        self.start(bridge("rdt", self.daemon.name, "--zero", "mx,my,mz", "--sensor", "left", "--listen", f"127.0.0.1:{ports[0]}", "--sensor", "right", "--listen", f"127.0.0.1:{ports[1]}"))]
        for name, port in zip(("left", "right"), ports):
            client = Client(port, timeout=1)
            self.addCleanup(client.close)
            client.request(2)
            self.seen.follow_rdt(name, client)
        self.until_more(6)

    def start(self, process):
        self.addCleanup(process.__exit__)
        return process

    def client(self, kind, *words):
        process = subprocess.Popen([str(word) for word in words], stdout=subprocess.PIPE, text=True)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        self.seen.follow(kind, process)

    def until_more(self, streams):
        """Waits until so many streams have given ten further values."""
        before = self.seen.counts()
        wait_for(lambda: sum(n > before.get(key, 0) + 10 for key, n in self.seen.counts().items()) == streams, f"{streams} streams: {self.seen.counts()}")

    def test_values_stay_with_their_names_when_the_daemon_restarts_with_other_sensors(self):
        for names, streams in ((("right", "left"), 6), (("third", "right", "left"), 8), (("right",), 3), (("left", "third", "right"), 8)):
            self.daemon.stop()
            self.daemon.config.write_text(self.head + config(names).replace("{folder}", str(self.daemon.folder)))
            self.daemon.start()
            self.until_more(streams)
        self.assertEqual(self.seen.wrong(), {})

    def test_a_bridge_that_stood_still_gives_no_old_value(self):
        """By the times of the samples, because a busy machine delays the way to a client."""
        for each in self.bridges:
            halt(each.process.pid)
        stopped_s = time.time()
        time.sleep(2)
        continued_s = time.time()
        for each in self.bridges:
            each.process.send_signal(signal.SIGCONT)
        self.until_more(6)
        to_wall_s = time.time() - time.monotonic()
        for (kind, name), values in self.seen.values.items():
            if kind == "rdt":  # it has the number of a sample
                with tactiled.open(self.daemon.name) as node, node.follow(name, 0, from_oldest=True) as samples:
                    at_s = {sample.sequence: sample.t_ns / 1e9 + to_wall_s for sample in samples}
                self.assertLess(min(at_s.values()), stopped_s)
            taken_s = [at_s.get(taken, 0) if kind == "rdt" else taken for _, taken, _ in list(values)]
            self.assertGreater(max(taken_s), continued_s - STALE_MS / 1000, (kind, name))
            self.assertEqual([t for t in taken_s if stopped_s < t < continued_s - STALE_MS / 1000 - 0.01], [], (kind, name))

    def test_a_daemon_that_stands_still_is_bad_and_goes_on(self):
        self.daemon.process.send_signal(signal.SIGSTOP)
        try:
            wait_until_it_rests(self.seen.counts, "the values")
            before = self.seen.counts()
            time.sleep(0.5)
            self.assertEqual(self.seen.counts(), before)
        finally:
            self.daemon.process.send_signal(signal.SIGCONT)
        self.until_more(6)
        self.assertEqual(self.seen.wrong(), {})


if __name__ == "__main__":
    unittest.main(verbosity=2)
