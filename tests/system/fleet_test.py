#!/usr/bin/env python3
"""A fleet on one machine: each gripper with its daemon, bridges and metrics, through one mosquitto, one DDS domain and one scrape. Names do
not collide, nothing is lost, and a broker that is away changes nothing in a daemon. Prints what it costs.

    FLEET=100 /usr/bin/python3 tests/system/fleet_test.py"""
import json
import math
import os
import pathlib
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import urllib.request

from prometheus_client.parser import text_string_to_metric_families

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bridge_process import Process  # noqa: E402
from daemon import BIN, ROOT, free_port, wait_for  # noqa: E402

FLEET = int(os.environ.get("FLEET", "4"))
SECONDS = float(os.environ.get("SECONDS", "5" if FLEET < 20 else "30"))
RATE_Hz = 50
MQTT_Hz = 10  # the default; a message counts the samples since the last one
DASHBOARD = json.loads((ROOT / "node/bridges/grafana.json").read_text())
BROKER = shutil.which("mosquitto") or "/usr/sbin/mosquitto"
NEEDED = [BIN / name for name in ("tactiled-mqtt", "tactiled-dds", "tactiled-web", "fastdds_reader")] + [pathlib.Path(BROKER)]

CONFIG = """
[node]
name = "{name}"
control = "{folder}/{name}.sock"
zeros = "{folder}/{name}.zeros.toml"

[realtime]
required = false

[[link]]
name = "scene"
driver = "sim"
scene = "{folder}/press.toml"
at_end = "again"

[[sensor]]
name = "left"
link = "scene"
model = "table"
calibration = "{root}/config/calibration/table_documents.toml"
stale_ms = 1000
"""


def ports(count):
    found = set()
    while len(found) < count:
        found.add(free_port())
    return sorted(found)


class Lines:
    """The output of a program, line by line, split at spaces."""

    def __init__(self, columns, *words):
        self.process = subprocess.Popen([str(word) for word in words], stdout=subprocess.PIPE, text=True)
        self.lines = []
        threading.Thread(target=self.read, args=(columns,), daemon=True).start()

    def read(self, columns):
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n").split(" ", columns - 1))

    def close(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


def percentiles(values):
    cuts = statistics.quantiles(values, n=100)
    return f"p50 {1000 * cuts[49]:.1f} ms, p99 {1000 * cuts[98]:.1f} ms"


@unittest.skipIf([p for p in NEEDED if not p.exists()], f"missing: {[p.name for p in NEEDED if not p.exists()]}")
class Fleet(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tactiled-fleet-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        scene = (ROOT / "config/scenes/press_ramp.toml").read_text().split("[[expect]]")[0]
        (self.folder / "press.toml").write_text(scene.replace("format = 1\n", f"format = 1\nrate_Hz = {RATE_Hz}\n", 1))
        self.names = [f"fleet-{os.getpid()}-{n}" for n in range(FLEET)]
        self.topics = [f"rt/{name.replace('-', '_')}/left/wrench" for name in self.names]
        broker, *self.web_ports = ports(FLEET + 1)
        (self.folder / "mosquitto.conf").write_text(f"persistence false\nlistener {broker} 127.0.0.1\nallow_anonymous true\n")
        self.broker_port = broker
        self.broker = self.start(BROKER, "-c", self.folder / "mosquitto.conf", ready="running")
        self.mqtt = Lines(3, "mosquitto_sub", "-p", broker, "-F", "%U %t %p", "-t", "tactiled/+/left/wrench")
        self.addCleanup(self.mqtt.close)
        self.dds = Lines(4, BIN / "fastdds_reader", "79", "3000", *self.topics)
        self.addCleanup(self.dds.close)
        self.parts = {"daemon": [], "mqtt": [], "dds": [], "web": []}
        for name, port in zip(self.names, self.web_ports):
            config = self.folder / f"{name}.toml"
            config.write_text(CONFIG.format(name=name, folder=self.folder, root=ROOT))
            self.part("daemon", BIN / "tactiled", "--config", config)
            self.part("mqtt", BIN / "tactiled-mqtt", "--node", name, "--port", broker, "--rate-Hz", MQTT_Hz)
            self.part("dds", BIN / "tactiled-dds", "--node", name, "--domain", "79", "--many", "--frame-prefix", f"{name}/", "--uncertain")  # a simulated table has no sd
            self.part("web", BIN / "tactiled-web", "--node", name, "--listen", f"127.0.0.1:{port}")
        self.client = self.start("mosquitto_sub", "-p", broker, "-t", "tactiled/+/state", "-v")

    def start(self, *words, ready=None):
        made = Process(*words, ready=ready)
        self.addCleanup(made.__exit__)
        return made

    def part(self, kind, *words):
        self.parts[kind].append(self.start(*words))

    def mqtt_since(self, begin):
        """For each node: (received s, message)."""
        found = {name: [] for name in self.names}
        for received, topic, text in self.mqtt.lines[begin:]:
            found[topic.split("/")[1]].append((float(received), json.loads(text)))
        return found

    def dds_since(self, begin):
        found = {name: [] for name in self.names}
        for received, sent, frame, _ in self.dds.lines[begin:]:
            found[frame.split("/")[0]].append((int(received) / 1e9, int(sent) / 1e9))
        return found

    def scrape(self):
        up, names = set(), set()
        for port in self.web_ports:
            text = urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=30).read().decode()
            for family in text_string_to_metric_families(text):
                names.add(family.name)  # a weight that is not known has no sample
                for sample in family.samples:
                    if sample.name == "tactiled_up" and sample.value == 1:
                        up.add(sample.labels["node"])
                    names.add(sample.name)
                    if sample.name == "tactiled_sensor_force_newtons":
                        self.assertFalse(math.isnan(sample.value), port)
        wanted = set(re.findall(r"\btactiled_\w+", json.dumps([p["targets"] for p in DASHBOARD["panels"]])))
        self.assertGreater(len(wanted), 5)
        self.assertEqual(wanted - names, set())
        return up

    def seen(self):
        return (len({line[1] for line in self.mqtt.lines}), len({line[2] for line in self.dds.lines}))

    def cpu(self):
        return {kind: sum(p.cpu_s() for p in parts) for kind, parts in self.parts.items()}

    def test_every_gripper_is_seen_by_each_client_and_nothing_is_lost(self):
        began = time.monotonic()
        wait_for(lambda: self.seen() == (FLEET, FLEET), f"all grippers: {self.seen()}", 60 + 2 * FLEET)
        print(f"\n{FLEET} grippers are seen by all clients after {time.monotonic() - began:.1f} s")
        time.sleep(2)
        at = (len(self.mqtt.lines), len(self.dds.lines), self.cpu(), time.monotonic())
        time.sleep(SECONDS)
        cpu, taken_s = self.cpu(), time.monotonic() - at[3]
        mqtt, dds = self.mqtt_since(at[0]), self.dds_since(at[1])
        scraped = time.monotonic()
        self.assertEqual(self.scrape(), set(self.names))
        scraped = time.monotonic() - scraped
        lost = expected = 0
        rates = []
        for name in self.names:
            messages = [message for _, message in mqtt[name]]
            numbers = [message["sequence"] for message in messages]
            self.assertEqual(numbers, sorted(set(numbers)), name)
            lost += numbers[-1] - numbers[0] - sum(message["samples"] for message in messages[1:])
            expected += numbers[-1] - numbers[0]
            rates.append((numbers[-1] - numbers[0]) / (messages[-1]["t_s"] - messages[0]["t_s"]))
        times = {name: [sent for _, sent in dds[name]] for name in self.names}
        not_seen = sum(round((sent[-1] - sent[0]) * RATE_Hz) + 1 - len(sent) for sent in times.values())
        print(f"MQTT: {sum(map(len, mqtt.values()))} messages of {expected} samples, {lost} lost, {percentiles([r - m['t_s'] for found in mqtt.values() for r, m in found])}")
        print(f"DDS: {sum(map(len, times.values()))} samples, {not_seen} not seen, {percentiles([r - s for found in dds.values() for r, s in found])}")
        print(f"a scrape of {FLEET}: {scraped:.2f} s")
        for kind in cpu:
            rss = statistics.mean(p.status("VmRSS") for p in self.parts[kind]) / 1024
            print(f"{kind}: {100 * (cpu[kind] - at[2][kind]) / taken_s / FLEET:.2f} % of a CPU and {rss:.1f} MB each")
        self.assertEqual(lost, 0)
        self.assertAlmostEqual(min(rates), RATE_Hz, delta=2)
        self.assertLess(not_seen, 0.01 * expected)  # by times of samples, which a busy daemon may leave out
        self.broker_away()

    def dropped(self):
        """The count of each node in its last state."""
        found = dict.fromkeys(self.names, 0)
        for line in self.client.log().splitlines():
            topic, _, text = line.partition(" ")
            if text.startswith("{"):
                found[topic.split("/")[1]] = json.loads(text).get("dropped", 0)
        return found

    def broker_away(self):
        begin, before = len(self.dds.lines), self.dropped()
        self.broker.kill()
        time.sleep(SECONDS)
        now_s = time.time()  # the daemons' samples go on
        wait_for(lambda: all(found and found[-1][1] > now_s for found in self.dds_since(begin).values()), "later samples of each")
        self.assertEqual({p.process.poll() for parts in self.parts.values() for p in parts}, {None})
        self.start(BROKER, "-c", self.folder / "mosquitto.conf", ready="running")
        back = time.monotonic()
        expected = 0.8 * MQTT_Hz * SECONDS

        def news():
            now = self.dropped()
            return [now[name] - before[name] for name in self.names]

        wait_for(lambda: min(news()) >= expected, f"the counts of what was dropped: {news()}", 60)
        print(f"broker away for {SECONDS:.0f} s: every bridge is back after {time.monotonic() - back:.1f} s and reports "
              f"{min(news())} to {max(news())} dropped messages")


if __name__ == "__main__":
    unittest.main(verbosity=2)
