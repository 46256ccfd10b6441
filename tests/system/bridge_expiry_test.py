#!/usr/bin/env python3
"""tactiled-mqtt before a real mosquitto and a model of Home Assistant: UNCERTAIN is marked, and nothing looks healthy 2 s after the end of
the bridge, the daemon or the sensor, with MQTT 5 and with 3.1.1."""
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bridge_process import bridge  # noqa: E402
from daemon import Stopwatch, halt, wait_for  # noqa: E402
from home_assistant import HomeAssistant  # noqa: E402
from mqtt_clients import EXPIRY_S, Broker, MqttTest, OldBroker  # noqa: E402
from unit_daemon import CALIBRATION, quality_is, unit_daemon  # noqa: E402


class Expiry(MqttTest):
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
                watch, ended_wall_s = self.enterContext(Stopwatch()), time.time()
                healthy, home_late = [], None
                while (passed_s := watch.seconds()) < EXPIRY_S + 1:
                    if home_late is None and passed_s > EXPIRY_S / 2:
                        home_late = self.home()  # finds what is retained then
                    seen = self.healthy_retained() if passed_s > EXPIRY_S else []
                    healthy += [(round(passed_s, 2), line) for line in seen]
                    passed_s, shown = watch.seconds(), home.shown()  # the time before the look, without that by which this machine was late
                    if passed_s > EXPIRY_S + 0.1 and shown:
                        healthy.append((round(passed_s, 2), shown))
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
        for answer in OldBroker.ANSWERS:
            with self.subTest(answer):
                relay = OldBroker(self.broker.port, answer)
                self.addCleanup(relay.close)
                server = self.bridge("--discovery", "homeassistant", port=relay.port)
                wait_for(lambda: "by 3.1.1" in server.log(), "the message")
                self.subscriber().until(self.is_good)
                self.subscriber().until(lambda topic, message: topic.endswith("state") and message["online"])
                self.assertEqual(self.healthy_retained(), [])
                server.kill()
                self.subscriber().until(lambda topic, message: topic.endswith("state") and not message["online"])
                self.assertGreaterEqual(relay.refused, 1)

    def test_mqtt_5_is_used_again_when_the_broker_speaks_it(self):
        relay = OldBroker(self.broker.port, "3.1.1")
        self.addCleanup(relay.close)
        server = self.bridge(port=relay.port)
        wait_for(lambda: "connected by MQTT 3.1.1" in server.log(), "the older version")
        relay.renew()
        wait_for(lambda: any('"online":true' in line for line in self.healthy_retained()), "a state that the broker retains")
        wait_for(lambda: "tactiled-mqtt: connected;" in server.log(), "the message")

    def test_a_broker_that_takes_nothing_is_left_before_its_backlog_grows_old(self):
        """By TCP_USER_TIMEOUT, after 2 s; without it by the keep-alive of MQTT, after 15 s."""
        with socket.create_server(("127.0.0.1", 0)) as listener:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
            server = self.bridge("--rate-Hz", "0", port=listener.getsockname()[1])
            connection = listener.accept()[0]
            self.addCleanup(connection.close)
            self.assertIn(b"MQTT", connection.recv(4096))
            connection.sendall(b"\x20\x03\x00\x00\x00" b"\x90\x04\x00\x01\x00\x00")  # CONNACK and SUBACK, and nothing is read from now on
            with Stopwatch() as watch:
                wait_for(lambda: "not connected: " in server.log(), "the end of the connection")
                self.assertLess(watch.seconds(), 10)

    def test_the_later_one_of_two_bridges_is_silent_until_the_first_one_ends(self):
        first, elsewhere = self.bridge(), self.bridge("--prefix", "elsewhere")
        self.subscriber().until(self.is_good)
        second = self.bridge()
        wait_for(lambda: "silent, because another bridge" in second.log(), "the message")
        subscriber, senders = self.subscriber(f"{self.node}/state"), []
        subscriber.until(lambda _, message: senders.append(message["bridge"]) or len(senders) == 6)
        self.assertEqual(len(set(senders)), 1)
        self.subscriber("elsewhere/#").until(lambda topic, message: topic.endswith("wrench") and message["quality"] == "good")
        self.assertEqual([log.count("silent") for log in (first.log(), elsewhere.log())], [0, 0])
        first.kill()
        subscriber.until(lambda _, message: message["online"] and message["bridge"] != senders[0])
        self.subscriber().until(self.is_good)

    def test_a_later_bridge_sends_nothing_before_it_hears_the_first_one(self):
        """By the log of the broker, at its start and after a broker that was away for longer than it remembers the first one."""
        for is_old in (False, True):
            with self.subTest(is_old=is_old):
                broker = Broker(self.daemon.folder, "allow_anonymous true", "log_type all")
                relay = OldBroker(broker.port, "3.1.1")
                relay.is_old = is_old
                first = self.bridge(port=broker.port)
                self.subscriber(port=broker.port).until(self.is_good)
                second = self.bridge(port=relay.port)
                wait_for(lambda: second.log().count("silent, because another bridge") == 1, "the message")
                relay.is_away = True
                relay.cut()
                wait_for(lambda: "not connected" in second.log().rpartition("silent")[2], "the end of the silence")
                relay.is_away = False
                wait_for(lambda: second.log().count("silent, because another bridge") == 2, "the message after the connection")
                second.kill()
                log = broker.process.log()
                self.assertEqual(len(set(re.findall(r" as (tactiled-mqtt-\S+)", log))), 2)
                senders = re.findall(r"Received PUBLISH from (\S+) ", log)
                self.assertEqual({sender: senders.count(sender) for sender in senders if sender != senders[0]}, {})
                for end in (first.kill, relay.close, broker.process.__exit__):
                    end()

    def test_the_last_will_of_another_bridge_is_replaced_at_once(self):
        """The will of a later bridge, which was silent, says "online": false in the topic of the first one. By turns it would last up to 0.5 s."""
        self.bridge()
        subscriber, turns = self.subscriber(f"{self.node}/state"), 20
        subscriber.until(lambda _, message: message["online"])
        with Stopwatch() as watch:
            for _ in range(turns):
                subprocess.run(["mosquitto_pub", "-p", str(self.broker.port), "-r", "-t", f"{self.node}/state", "-m", '{"online":false}'], check=True)
                subscriber.until(lambda _, message: not message["online"])
                subscriber.until(lambda _, message: message["online"])
            took_s = watch.seconds()
        print(f"\nlast will of another bridge until the state, ms: {1000 * took_s / turns:.0f}")
        self.assertLess(took_s, turns * 0.5 / 2)

    def test_the_retained_values_of_an_earlier_version_end_with_the_first_connection(self):
        old = {f"{self.node}/left/quality": '{"schema":1,"quality":"good"}', f"{self.node}/grasp": '{"schema":1,"quality":"good","state":"holding"}',
               f"{self.node}/state": '{"schema":1,"online":true,"daemon":true}'}
        relay = OldBroker(self.broker.port, "3.1.1")
        self.addCleanup(relay.close)
        for port in (self.broker.port, relay.port):
            for topic, text in old.items():
                subprocess.run(["mosquitto_pub", "-p", str(self.broker.port), "-r", "-t", topic, "-m", text], check=True)
            self.assertEqual(len(self.healthy_retained()), len(old))
            server = self.bridge(port=port)
            wait_for(lambda: not [line for line in self.healthy_retained() if '"schema":1' in line], f"the end of the old values at port {port}")
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


if __name__ == "__main__":
    unittest.main(verbosity=2)
