#!/usr/bin/env python3
"""The grasp, the weight and the wrench on the gripper in MQTT, in a model of Home Assistant and in ROS 2: two jaws lift 0.4 kg, a jaw falls
silent, and nothing shows the old weight."""
import pathlib
import shutil
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bridge_dds_test import Reader  # noqa: E402
from bridge_process import bridge  # noqa: E402
from daemon import BIN, wait_for  # noqa: E402
from guided_hand import begin  # noqa: E402
from home_assistant import HomeAssistant  # noqa: E402
from mqtt_clients import BROKER, Broker, Subscriber, check  # noqa: E402

MASS_kg, G_m_s2, PRESS_N = 0.4, 9.81, 5.0
DOMAIN = "84"
SIDES = {"left": ("[0, 1, 0]", "[1, 0, 0]"), "right": ("[0, -1, 0]", "[-1, 0, 0]")}  # x and z of S in G; y of S is z of G, down
CONFIG = f"[grasp]\ngravity_G_m_s2 = [0, 0, {G_m_s2}]\n" + "".join(
    f'\n[[grasp.jaw]]\nsensor = "{name}"\nx_S_in_G = {x}\nz_S_in_G = {z}\n' for name, (x, z) in SIDES.items()) + "\n[tool]\n" + "".join(
    f'\n[[tool.sensor]]\nsensor = "{name}"\nx_S_in_G = {x}\nz_S_in_G = {z}\nposition_G_mm = [0, 0, 0]\n' for name, (x, z) in SIDES.items())
NEEDED = [BIN / "tactiled-mqtt", BIN / "tactiled-dds", BIN / "fastdds_reader", pathlib.Path(BROKER)]


@unittest.skipIf([p for p in NEEDED if not p.exists()], f"missing: {[p.name for p in NEEDED if not p.exists()]}")
class Grasp(unittest.TestCase):
    def setUp(self):
        self.daemon, self.devices = begin(self, CONFIG, {"left": 3, "right": 3}, more="contact_on_N = 0.2\ncontact_off_N = 0.1")
        self.addCleanup(shutil.rmtree, self.daemon.folder, ignore_errors=True)
        self.broker = Broker(self.daemon.folder)
        self.addCleanup(lambda: self.broker.process.__exit__())
        self.home = HomeAssistant(self.broker.port)
        self.addCleanup(self.home.close)
        self.grasps, self.tools = Reader("rt/hand/grasp", domain=DOMAIN), Reader("rt/hand/tool_wrench", domain=DOMAIN)
        self.diagnostics = Reader("rt/diagnostics", domain=DOMAIN)
        self.addCleanup(self.diagnostics.close)
        self.addCleanup(self.grasps.close)
        self.addCleanup(self.tools.close)
        self.mqtt = bridge("mqtt", self.daemon.name, "--port", self.broker.port, "--discovery", "homeassistant")
        self.addCleanup(self.mqtt.__exit__)
        self.dds = bridge("dds", self.daemon.name, "--domain", DOMAIN, "--name", "hand")
        self.addCleanup(self.dds.__exit__)
        self.messages = Subscriber(self.broker.port)
        self.addCleanup(self.messages.close)

    def move(self, press_N, weight_N, seconds):
        begun, end_s = {name: list(device.reading) for name, device in self.devices.items()}, time.monotonic() + seconds
        while (left := end_s - time.monotonic()) > 0:
            share = 1 - left / seconds
            for name, device in self.devices.items():
                device.reading = [a + share * (b - a) for a, b in zip(begun[name], (0, weight_N / 2, -press_N))]
            time.sleep(0.005)

    def until(self, kind, condition):
        def is_it(topic, message):
            if topic.startswith("tactiled/"):
                check(topic, message)
            return topic == f"tactiled/{self.daemon.name}/{kind}" and condition(message)
        return self.messages.until(is_it)

    def grasp(self):
        """The newest grasp of ROS 2: quality, state, quality of the weight, its state, doubts, kg."""
        return self.grasps.lines[-1][3].split()[1:7] if self.grasps.lines else None

    def test_a_weight_is_shown_while_it_is_known_and_no_longer(self):
        self.until("grasp", lambda m: m["state"] == "open" and m["quality"] == "good")
        self.move(PRESS_N, 0, 1)
        time.sleep(0.5)  # the time for which the jaws press before they lift
        self.move(PRESS_N, MASS_kg * G_m_s2, 1)
        weight = self.until("weight", lambda m: m["quality"] == "good")
        self.assertEqual((weight["state"], weight["doubts"]), ("stable", []))
        self.assertAlmostEqual(weight["weight_kg"], MASS_kg, delta=0.03 * MASS_kg)
        self.assertEqual(self.until("grasp", lambda m: m["quality"] == "good")["state"], "holding")
        tool = self.until("tool", lambda m: m["quality"] == "good" and m["t_s"] > weight["t_s"])
        self.assertAlmostEqual(tool["force_N"][2], MASS_kg * G_m_s2, delta=0.1)
        wait_for(lambda: self.home.shown().get("grasp") == "holding" and "weight" in self.home.shown(), "Home Assistant")
        self.assertAlmostEqual(float(self.home.shown()["weight"]), MASS_kg, delta=0.03 * MASS_kg)
        wait_for(lambda: self.grasp() and self.grasp()[:4] == ["1", "holding", "1", "stable"], f"the grasp in ROS 2: {self.grasp()}")
        self.assertAlmostEqual(float(self.grasp()[5]), MASS_kg, delta=0.03 * MASS_kg)
        self.assertGreater(int(self.grasps.lines[-1][3].split()[0]), int(self.grasps.lines[-1][1]), "valid until, after the sample")
        wait_for(lambda: self.tools.lines, "the wrench on the gripper in ROS 2")
        self.assertAlmostEqual(self.tools.wrench()[2], MASS_kg * G_m_s2, delta=0.1)
        wait_for(lambda: self.diagnostics.lines and ": tool_wrench | good" in self.diagnostics.lines[-1][3], "the wrench in the diagnostics")
        self.devices["left"].is_silent = True
        self.until("weight", lambda m: m["quality"] == "bad" and m["weight_kg"] is None)
        self.until("tool", lambda m: m["quality"] == "bad" and m["force_N"] == [None] * 3)
        wait_for(lambda: not {"weight", "grasp", "slips", "Fz"} & set(self.home.shown()), f"the end in Home Assistant: {self.home.shown()}")
        wait_for(lambda: self.grasp()[:4] == ["3", "unknown", "3", "none"], "the end in ROS 2")
        wait_for(lambda: ": tool_wrench | bad: sensor" in self.diagnostics.lines[-1][3], "the reason of the wrench in ROS 2")
        sent = len(self.tools.lines)
        self.until("tool", lambda m: m["quality"] == "bad" and m["t_s"] > 0)
        self.devices["left"].is_silent = False
        wait_for(lambda: len(self.tools.lines) > sent, "the wrench again")
        self.assertGreater(int(self.tools.lines[sent][1]), int(self.tools.lines[sent - 1][1]) + 1.5e9)  # stale_ms is 2 s
        self.mqtt.kill()
        wait_for(lambda: not self.home.shown(), "the end of all entities", 3)


if __name__ == "__main__":
    unittest.main(verbosity=2)
