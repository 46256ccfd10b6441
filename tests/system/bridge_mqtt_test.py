#!/usr/bin/env python3
"""tactiled-mqtt before a real mosquitto: values of the segment, BAD as null, UNCERTAIN marked, the last will, nothing healthy 2 s after the
end of the bridge, a model of Home Assistant, the broker killed and restarted, TLS."""
import contextlib
import json
import os
import pathlib
import queue
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import threading
import time
import unittest

import jsonschema

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bridge_process import Process, bridge  # noqa: E402
from daemon import BIN, PATIENCE_S, ROOT, Stopwatch, free_port, halt, wait_for  # noqa: E402
from home_assistant import HomeAssistant  # noqa: E402
from unit_daemon import CALIBRATION, WATCHDOG_S, play, quality_is, unit_daemon  # noqa: E402

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
    """The way to a broker as one that speaks MQTT 3.1.1 alone: it answers a CONNECT of another version with code 1, as 3.1.1 demands."""

    def __init__(self, port):
        self.to, self.refused = port, 0
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        with contextlib.suppress(OSError):
            while True:
                threading.Thread(target=self.serve, args=(self.listener.accept()[0],), daemon=True).start()

    def serve(self, client):
        first = client.recv(4096)
        if first[first.index(b"MQTT") + 4] != 4:
            self.refused += 1
            client.sendall(b"\x20\x02\x00\x01")
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
            topic, _, text = line.partition(" ")
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
class Mqtt(unittest.TestCase):
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

    def test_messages_have_the_segments_values_and_their_schema(self):
        began_s = time.time()
        self.bridge()
        subscriber = self.subscriber()
        seen = {}
        subscriber.until(lambda topic, message: seen.update({topic: message}) or check(topic, message) or
                         (len(seen) == 5 and message.get("sequence", 0) > 50))
        self.assertEqual(set(seen), {f"{self.node}/{end}" for end in ("state", "grasp", "weight", "left/quality", "left/wrench")})
        wrench = seen[f"{self.node}/left/wrench"]
        self.assertEqual((wrench["force_N"], wrench["torque_Nm"], wrench["quality"]), ([1, 2, -3], [None] * 3, "good"))
        for sd_N in wrench["sd_force_N"]:
            self.assertAlmostEqual(sd_N, 0.01, places=6)  # it grows with the age of the zero
        self.assertTrue(began_s < wrench["t_s"] < time.time(), "no time of day")
        self.assertAlmostEqual(wrench["valid_until_s"] - wrench["t_s"], WATCHDOG_S, delta=0.01)
        for kind in ("state", "grasp", "weight", "left/quality"):
            message = seen[f"{self.node}/{kind}"]
            self.assertAlmostEqual(message["valid_until_s"] - message["t_s"], EXPIRY_S, delta=0.01)
        self.assertEqual(seen[f"{self.node}/grasp"]["quality"], "bad")  # there is no [grasp]
        self.assertEqual(seen[f"{self.node}/state"]["sensors"], ["left"])
        wrench["quality"] = "bad"
        with self.assertRaises(jsonschema.ValidationError):
            check("x/wrench", wrench)

    def test_the_rate_is_kept_and_no_sample_uncounted(self):
        self.bridge("--rate-Hz", "20")
        subscriber = self.subscriber(f"{self.node}/left/wrench")
        first = subscriber.until(self.is_good)
        found = [subscriber.until(self.is_good) for _ in range(40)]
        # By the times of the samples, because a busy machine may leave messages out: never faster, and usually not slower.
        times_s = [m["t_s"] for m in (first, *found)]
        self.assertGreater(times_s[-1] - times_s[0], 0.95 * 40 / 20)
        self.assertAlmostEqual(statistics.median(b - a for a, b in zip(times_s, times_s[1:])), 1 / 20, delta=0.01)
        self.assertEqual(sum(m["samples"] for m in found), found[-1]["sequence"] - first["sequence"])

    def test_a_deadband_leaves_out_what_does_not_move_and_renews_it(self):
        self.bridge("--deadband-N", "0.5", "--rate-Hz", "50")
        subscriber = self.subscriber(f"{self.node}/left/wrench")
        times_s = [subscriber.until(self.is_good)["t_s"] for _ in range(8)]
        # Usually, because a busy machine makes the value BAD for a moment, which is another quality.
        usual_s = statistics.median(b - a for a, b in zip(times_s, times_s[1:]))
        self.assertGreater(usual_s, 0.4)
        self.assertLess(usual_s, EXPIRY_S)

    def test_uncertain_is_marked_in_each_payload_and_not_shown_by_home_assistant(self):
        daemon = unit_daemon(calibration=CALIBRATION.replace("sd = [0.01, 0.01, 0.01]\n", "")).start()
        self.addCleanup(shutil.rmtree, daemon.folder)
        self.addCleanup(daemon.__exit__)
        wait_for(quality_is(daemon, "uncertain"), "a doubtful value")
        home = self.home()
        made = bridge("mqtt", daemon.name, "--port", self.broker.port, "--discovery", "homeassistant")
        self.addCleanup(made.__exit__)
        subscriber = self.subscriber(f"tactiled/{daemon.name}/#")
        seen = {}
        subscriber.until(lambda topic, message: seen.update({topic.rpartition("/")[2]: message}) or len(seen) == 5)
        self.assertEqual({kind: seen[kind]["quality"] for kind in ("wrench", "quality", "state")}, dict.fromkeys(("wrench", "quality", "state"), "uncertain"))
        self.assertIn("sd-unknown", seen["wrench"]["reasons"])
        wait_for(lambda: "quality" in home.shown(), "the quality")
        self.assertEqual(home.shown(), {"quality": "uncertain", "fault": "OFF"})

    def home(self):
        home = HomeAssistant(self.broker.port)
        self.addCleanup(home.close)
        return home

    def healthy_retained(self):
        """Texts that a subscriber gets which looks for retained messages alone, and which look healthy."""
        done = subprocess.run(["mosquitto_sub", "-V", "5", "-p", str(self.broker.port), "--retained-only", "-W", "1", "-F", "%t %p", "-t", "tactiled/#"],
                              capture_output=True, text=True)
        return [line for line in done.stdout.splitlines() if '"good"' in line or '"online":true' in line]

    def test_two_seconds_after_its_end_nothing_of_a_bridge_looks_healthy(self):
        for signal_number, end in ((signal.SIGKILL, "killed"), (signal.SIGSTOP, "stopped")):
            with self.subTest(end):
                server, home, subscriber = self.bridge("--discovery", "homeassistant"), self.home(), self.subscriber()
                wait_for(lambda: home.shown().get("Fz") == "-3.0" and "quality" in home.shown(), "the values")
                wait_for(lambda: self.healthy_retained(), "a retained state")
                server.process.send_signal(signal_number)
                if end == "stopped":
                    halt(server.process.pid)
                ended_s, ended_wall_s = time.monotonic(), time.time()
                healthy, home_late = [], None
                while (now_s := time.monotonic()) < ended_s + EXPIRY_S + 1:
                    if home_late is None and now_s > ended_s + EXPIRY_S / 2:
                        home_late = self.home()  # finds what is retained then
                    seen = self.healthy_retained() if now_s > ended_s + EXPIRY_S else []
                    healthy += [(round(now_s - ended_s, 2), line) for line in seen]
                    shown = home.shown()
                    if time.monotonic() > ended_s + EXPIRY_S + 0.1 and shown:
                        healthy.append((round(now_s - ended_s, 2), shown))
                    self.assertEqual(home_late.shown() if home_late else {}, {})
                self.assertEqual(healthy, [])
                self.assertEqual(home_late.names() - {"slips"}, {"Fx", "Fy", "Fz", "quality", "fault"})
                late = []
                with self.assertRaises(TimeoutError):  # all that came has ended
                    subscriber.until(lambda _, message: message["quality"] == "good" and late.append(message["valid_until_s"]), 0.5)
                self.assertGreater(len(late), 3)
                self.assertLessEqual(max(late), ended_wall_s + EXPIRY_S)
                for each in (server.kill, home.close, home_late.close, subscriber.close):
                    each()

    def test_a_broker_of_3_1_1_retains_nothing_healthy(self):
        relay = OldBroker(self.broker.port)
        self.addCleanup(relay.close)
        server = self.bridge("--discovery", "homeassistant", port=relay.port)
        self.subscriber().until(self.is_good)
        wait_for(lambda: "by 3.1.1" in server.log(), "the message")
        self.subscriber().until(lambda topic, message: topic.endswith("state") and message["online"])
        self.assertEqual(self.healthy_retained(), [])
        server.kill()
        self.subscriber().until(lambda topic, message: topic.endswith("state") and not message["online"])
        self.assertGreaterEqual(relay.refused, 1)

    def test_bad_is_null_and_killed_daemon_and_bridge_show(self):
        server = self.bridge()
        subscriber = self.subscriber()
        subscriber.until(self.is_good)
        with Stopwatch() as watch:
            self.daemon.process.kill()
            self.daemon.process.wait()
            bad = subscriber.until(lambda topic, message: topic.endswith("wrench") and message["quality"] == "bad")
            took_s = watch.seconds()
        print(f"\nBAD after kill -9 of the daemon, s: {took_s:.2f}")
        self.assertLess(took_s, 1)
        check("x/wrench", bad)
        self.assertEqual(bad["force_N"], [None] * 3)
        state = subscriber.until(lambda topic, message: topic.endswith("state") and not message["daemon"])
        self.assertTrue(state["online"])
        late = self.subscriber()  # a late subscriber gets the retained message
        self.assertEqual(late.until(lambda topic, _: topic.endswith("quality"))["quality"], "bad")
        (self.daemon.folder / "dev").unlink(missing_ok=True)
        self.daemon.others[0].kill()
        play(self.daemon)
        self.daemon.start()
        subscriber.until(self.is_good)
        server.kill()
        killed = time.monotonic()
        self.assertEqual(subscriber.until(lambda topic, message: topic.endswith("state") and not message["online"])["daemon"], False)
        print(f"last will after kill -9 of the bridge, s: {time.monotonic() - killed:.2f}")
        self.bridge()
        subscriber.until(lambda topic, message: topic.endswith("state") and message["online"])

    def test_a_clean_end_says_so(self):
        server = self.bridge()
        subscriber = self.subscriber(f"{self.node}/state")
        subscriber.until(lambda _, message: message["online"])
        self.assertEqual(server.stop(), 0)
        subscriber.until(lambda _, message: not message["online"])
        self.assertRegex(server.log(), r"ended; sent \d+, dropped \d, missed 0")  # messages before it was connected

    def test_a_broker_that_was_away_is_found_again_and_what_it_missed_is_counted(self):
        server = self.bridge("--rate-Hz", "50")
        subscriber = self.subscriber()
        subscriber.until(self.is_good)
        self.broker.process.kill()
        wait_for(lambda: "not connected" in server.log(), "the loss")
        time.sleep(2)
        self.assertEqual(quality_is(self.daemon, "good")(), True)
        self.broker.start()
        subscriber = self.subscriber()
        subscriber.until(self.is_good)
        state = subscriber.until(lambda topic, message: topic.endswith("state") and message.get("dropped", 0) > 0)
        print(f"\ndropped while the broker was away: {state['dropped']}")
        self.assertGreater(state["dropped"], 50)

    def test_a_broker_that_hangs_fills_no_memory(self):
        server = self.bridge("--rate-Hz", "0")
        self.subscriber().until(self.is_good)
        self.broker.process.process.send_signal(19)  # SIGSTOP
        before = server.status("VmRSS")
        time.sleep(5)
        self.assertLess(server.status("VmRSS") - before, 4096)
        self.broker.process.process.send_signal(18)
        self.subscriber().until(self.is_good)

    def test_no_broker_is_no_error(self):
        server = self.bridge(port=free_port())
        wait_for(lambda: "not connected" in server.log(), "the message")
        self.assertIsNone(server.process.poll())
        self.assertEqual(server.stop(), 0)

    def test_home_assistant_shows_what_is_good_and_nothing_else(self):
        self.bridge("--discovery", "homeassistant")
        home = self.home()
        wait_for(lambda: home.shown() == {"Fx": "1.0", "Fy": "2.0", "Fz": "-3.0", "quality": "good", "fault": "OFF"}, "the values")
        self.daemon.others[0].kill()
        wait_for(lambda: home.shown().get("quality") == "bad", "the end of the sensor")
        self.assertEqual(set(home.shown()), {"quality", "fault"})
        self.daemon.process.kill()
        self.daemon.process.wait()
        wait_for(lambda: home.shown() == {}, "the end of the daemon")
        late = self.home()
        wait_for(lambda: late.names() == home.names(), "the entities")  # discovery is retained
        self.assertEqual(late.shown(), {})

    def test_a_password_and_tls(self):
        folder = self.daemon.folder
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost",
                        "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout", folder / "key.pem", "-out", folder / "ca.pem"],
                       check=True, capture_output=True)
        (folder / "password").write_text("right one\n")
        (folder / "users").write_text("gripper7:right one\n")
        (folder / "users").chmod(0o600)
        subprocess.run(["mosquitto_passwd", "-U", folder / "users"], check=True, capture_output=True)
        for name in ("key.pem", "users"):  # mosquitto gives up root
            if os.geteuid() == 0:
                shutil.chown(folder / name, "mosquitto", "mosquitto")
        folder.chmod(0o755)
        secure = Broker(folder, "allow_anonymous false", f"password_file {folder}/users", f"cafile {folder}/ca.pem",
                        f"certfile {folder}/ca.pem", f"keyfile {folder}/key.pem")
        self.addCleanup(secure.process.__exit__)
        words = ["--tls-ca", folder / "ca.pem", "--user", "gripper7", "--password-file", folder / "password"]
        good = self.bridge(*words, "--broker", "localhost", port=secure.port)
        subscriber = self.subscriber("tactiled/#", secure.port, "--cafile", folder / "ca.pem", "-h", "localhost", "-u", "gripper7", "-P", "right one")
        subscriber.until(self.is_good)
        good.stop()
        (folder / "password").write_text("wrong one\n")
        wrong = self.bridge(*words, "--broker", "localhost", port=secure.port)
        wait_for(lambda: "refused" in wrong.log(), "the refusal")
        (folder / "password").write_text("right one\n")
        stranger = self.bridge("--tls", *words[2:], "--broker", "localhost", port=secure.port)  # its authority is not in /etc/ssl/certs
        time.sleep(2.5)
        self.assertIn("not connected", stranger.log())


if __name__ == "__main__":
    unittest.main(verbosity=2)
