#!/usr/bin/env python3
"""tactiled-mqtt before a real mosquitto: values of the segment, BAD as null, the last will, the broker killed and restarted, TLS."""
import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import time
import unittest

import jsonschema

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import ROOT, Stopwatch, free_port, wait_for  # noqa: E402
from mqtt_clients import EXPIRY_S, Broker, MqttTest, check  # noqa: E402
from unit_daemon import WATCHDOG_S, play  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402


class Mqtt(MqttTest):
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
        self.wait_for_samples(400)
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
        self.wait_for_samples(1000)
        self.assertLess(server.status("VmRSS") - before, 4096)
        self.broker.process.process.send_signal(18)
        self.subscriber().until(self.is_good)

    def wait_for_samples(self, count):
        """So many samples of the sensor, 200 in a second."""
        with tactiled.open(self.daemon.name) as node:
            first = node.latest("left").sequence
            wait_for(lambda: node.latest("left").sequence > first + count, f"{count} samples")

    def test_no_broker_is_no_error(self):
        server = self.bridge(port=free_port())
        wait_for(lambda: "not connected" in server.log(), "the message")
        self.assertIsNone(server.process.poll())
        self.assertEqual(server.stop(), 0)

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
        wait_for(lambda: "alert unknown ca" in secure.process.log(), "a connection that ends because the broker's certificate is not accepted")
        self.assertNotIn("tactiled-mqtt: connected", stranger.log())


if __name__ == "__main__":
    unittest.main(verbosity=2)
