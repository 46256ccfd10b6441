"""MQTT as a subscriber and Home Assistant see it."""
import contextlib
import datetime
import json
import math
import re
import time

from edges.output import Output


class Mqtt(Output):
    """A subscriber that keeps the last message of each topic: it uses a value if that message says that it is good, and does not say that its time is over."""
    name, needs, limit_s, stands = "MQTT", {"sensor", "daemon", "bridge", "broker", "network"}, 2.0, True
    topics, about = ("tactiled/#",), ("/wrench", "/quality", "/state")

    def open(self):
        self.last = {}
        self.lines("mosquitto_sub", "-p", self.rig.broker_port, "-v", *(word for topic in self.topics for word in ("-t", topic)))

    def came(self, line):
        topic, _, text = line.partition(" ")
        with self.lock:
            self.last[topic] = (time.monotonic(), json.loads(text) if text != "(null)" else None)  # empty: the broker forgets what it retained

    def look(self):
        with self.lock:
            messages = [(topic, message) for topic, (_, message) in self.last.items() if message and topic.endswith(self.about)]
        good = [(message.get("t_s", math.nan), topic) for topic, message in messages
                if self.is_good(message) and time.time() < message.get("valid_until_s", math.inf)]
        if not good:
            return None
        t_s, topic = min(good, key=lambda found: -math.inf if math.isnan(found[0]) else found[0])
        return (topic, None if math.isnan(t_s) else t_s - time.time() + time.monotonic())

    def is_good(self, message):
        return message.get("quality") == "good"


class HomeAssistant(Mqtt):
    """A model of its MQTT sensors: value_template, availability, expire_after. A number of an available entity looks healthy."""
    name, topics, entity = "Home Assistant (model)", ("homeassistant/#", "tactiled/#"), ("/wrench", "_Fz")

    def look(self):
        with self.lock:
            last = dict(self.last)
        for topic, (_, config) in last.items():
            if topic.startswith("homeassistant/") and config and config["state_topic"].endswith(self.entity[0]) and config["unique_id"].endswith(self.entity[1]):
                received_s, message = last.get(config["state_topic"], (0, None))
                late = time.monotonic() - received_s > config.get("expire_after", math.inf)
                if message is None or late or not self.is_available(config, last):
                    continue
                state = rendered(config["value_template"], message)
                with contextlib.suppress(TypeError, ValueError):
                    return (float(state), self.told(float(state)))
        return None

    def is_available(self, config, last):
        each = config.get("availability", [{"topic": config[key], "value_template": config.get("availability_template", "{{ value }}")}
                                           for key in ("availability_topic",) if key in config])
        states = [a["topic"] in last and last[a["topic"]][1] is not None and rendered(a["value_template"], last[a["topic"]][1]) == "online" for a in each]
        return any(states) if config.get("availability_mode") == "any" else all(states)


class Attributes(dict):
    def __getattr__(self, key):
        value = self.get(key)
        return Attributes(value) if isinstance(value, dict) else value


def rendered(template, message):
    """Returns the value of a template of one expression, in the part of Jinja that is Python, too."""
    expression, = re.fullmatch(r"\{\{ (.*) \}\}", template).groups()
    return eval(expression, {"__builtins__": {}}, {"value_json": Attributes(message), "now": datetime.datetime.now, "none": None, "true": True, "false": False})  # noqa: S307


class MqttWeight(Mqtt):
    name, needs, about = "MQTT, weight", Mqtt.needs - {"sensor"}, ("/weight",)


class MqttGrasp(Mqtt):
    name, needs, about = "MQTT, grasp", Mqtt.needs - {"sensor"}, ("/grasp",)


class MqttTool(Mqtt):
    name, needs, about = "MQTT, wrench on the gripper", Mqtt.needs - {"sensor"}, ("/tool",)


class HomeAssistantWeight(HomeAssistant):
    name, needs, entity = "Home Assistant (model), weight", Mqtt.needs - {"sensor"}, ("/weight", "_weight")


class HomeAssistantGrasp(HomeAssistant):
    name, needs, entity = "Home Assistant (model), grasp", Mqtt.needs - {"sensor"}, ("/grasp", "_slips")


class HomeAssistantTool(HomeAssistant):
    name, needs, entity = "Home Assistant (model), wrench on the gripper", Mqtt.needs - {"sensor"}, ("/tool", "_Fz")
