"""A real mosquitto, its subscribers, and the set-up of tests of tactiled-mqtt."""
import contextlib
import json
import pathlib
import queue
import shutil
import socket
import subprocess
import sys
import threading
import time
import unittest

import jsonschema

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bridge_process import Process, bridge  # noqa: E402
from daemon import BIN, PATIENCE_S, ROOT, free_port, wait_for  # noqa: E402
from unit_daemon import quality_is, unit_daemon  # noqa: E402

SCHEMA = json.loads((ROOT / "node/bridges/mqtt.schema.json").read_text())
KIND = {"wrench": "wrench", "quality": "quality_message", "grasp": "grasp", "weight": "weight", "tool": "tool", "state": "state"}
EXPIRY_S = 2
BROKER = shutil.which("mosquitto") or "/usr/sbin/mosquitto"


def check(topic, message):
    jsonschema.validate(message, {"$ref": f"#/$defs/{KIND[topic.rpartition('/')[2]]}", "$defs": SCHEMA["$defs"]})


class Broker:
    def __init__(self, folder, *lines, port=None):
        self.port = port or free_port()
        self.config = folder / f"mosquitto-{self.port}.conf"
        self.config.write_text("\n".join(["persistence false", f"listener {self.port} 127.0.0.1", *(lines or ["allow_anonymous true"])]) + "\n")
        self.start()

    def start(self):
        self.process = Process(BROKER, "-c", self.config, ready="running")


class OldBroker:
    """The way to a broker as one that speaks MQTT 3.1.1 alone: it refuses a CONNECT of another version, with code 1 as 3.1.1 demands, or with
    that of MQTT 5."""

    ANSWERS = {"3.1.1": b"\x20\x02\x00\x01", "5": b"\x20\x03\x00\x84\x00"}

    def __init__(self, port, answer):
        self.to, self.refused, self.answer, self.is_old, self.is_away, self.sockets = port, 0, self.ANSWERS[answer], True, False, []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        with contextlib.suppress(OSError):
            while True:
                threading.Thread(target=self.serve, args=(self.listener.accept()[0],), daemon=True).start()

    def serve(self, client):
        first = client.recv(4096)
        if self.is_away:
            client.close()
            return
        self.sockets.append(client)
        if self.is_old and first[first.index(b"MQTT") + 4] != 4:
            self.refused += 1
            client.sendall(self.answer)
            client.close()
            return
        broker = socket.create_connection(("127.0.0.1", self.to))
        broker.sendall(first)
        threading.Thread(target=self.pass_on, args=(broker, client), daemon=True).start()
        self.pass_on(client, broker)

    @staticmethod
    def pass_on(a, b):
        with contextlib.suppress(OSError):
            while data := a.recv(4096):
                b.sendall(data)
        for each in (a, b):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)

    def renew(self):
        """From now on a broker that speaks MQTT 5 answers at this port; the connections end."""
        self.is_old = False
        self.cut()

    def cut(self):
        """The connections end."""
        for each in self.sockets:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)

    def close(self):
        self.listener.close()


class Subscriber:
    """mosquitto_sub: topics with their messages, as they come."""

    def __init__(self, port, topic="tactiled/#", *words):
        self.process = subprocess.Popen(["mosquitto_sub", "-p", str(port), "-v", "-t", topic, *map(str, words)], stdout=subprocess.PIPE, text=True)
        self.messages = queue.Queue()
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.process.stdout:
            topic, _, text = line.rstrip("\n").partition(" ")
            if text != "(null)":  # an empty message: the broker forgets what it retained
                self.messages.put((topic, json.loads(text)))

    def until(self, condition, seconds=PATIENCE_S):
        """The first message for which condition(topic, message) is true."""
        limit = time.monotonic() + seconds
        while (left := limit - time.monotonic()) > 0:
            try:
                topic, message = self.messages.get(timeout=left)
            except queue.Empty:
                break
            if condition(topic, message):
                return message
        raise TimeoutError

    def close(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


@unittest.skipUnless((BIN / "tactiled-mqtt").exists(), "tactiled-mqtt is not built: libmosquitto-dev was missing")
@unittest.skipUnless(pathlib.Path(BROKER).exists() and shutil.which("mosquitto_sub"), "mosquitto is not installed")
class MqttTest(unittest.TestCase):
    """A daemon with a good value, and a broker."""

    def setUp(self):
        self.daemon = unit_daemon().start()
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        wait_for(quality_is(self.daemon, "good"), "a good value")
        self.broker = Broker(self.daemon.folder)
        self.addCleanup(lambda: self.broker.process.__exit__())
        self.node = f"tactiled/{self.daemon.name}"

    def bridge(self, *words, port=None):
        made = bridge("mqtt", self.daemon.name, "--port", port or self.broker.port, *words)
        self.addCleanup(made.__exit__)
        return made

    def subscriber(self, topic="tactiled/#", port=None, *words):
        made = Subscriber(port or self.broker.port, topic, *words)
        self.addCleanup(made.close)
        return made

    def is_good(self, topic, message):
        return topic == f"{self.node}/left/wrench" and message["quality"] == "good"
