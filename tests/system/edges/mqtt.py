"""MQTT as a subscriber and Home Assistant see it."""
import contextlib
import json
import math
import re
import time

from edges.output import Output


class Mqtt(Output):
    """A subscriber that keeps the last message of each topic: it uses a value if that message says that it is good, and does not say that its time is over."""
    name, needs, limit_s = "MQTT", {"sensor", "daemon", "bridge", "broker", "network"}, 2.0
    topics = ("tactiled/#",)

    def open(self):
        self.last = {}
        self.lines("mosquitto_sub", "-p", self.rig.broker_port, "-v", *(word for topic in self.topics for word in ("-t", topic)))

    def came(self, line):
        topic, _, text = line.partition(" ")
        with self.lock:
            self.last[topic] = (time.monotonic(), json.loads(text) if text != "(null)" else None)  # empty: the broker forgets what it retained

    def look(self):
        with self.lock:
            messages = [(topic, message) for topic, (_, message) in self.last.items() if message and self.is_about(topic)]
        good = [(message.get("t_s", math.nan), topic) for topic, message in messages
                if self.is_good(message) and time.time() < message.get("valid_until_s", math.inf)]
        if not good:
            return None
        t_s, topic = max(good)
        return (topic, None if math.isnan(t_s) else t_s - time.time() + time.monotonic())

    def is_about(self, topic):
        return topic.endswith(("/wrench", "/quality", "/state"))

    def is_good(self, message):
        return message.get("quality") == "good"


class HomeAssistant(Mqtt):
    """A model of its MQTT sensors: value_template, availability, expire_after. A number of an available entity looks healthy."""
    name, topics, unit = "Home Assistant (model)", ("homeassistant/#", "tactiled/#"), "N"

    def look(self):
        with self.lock:
            last = dict(self.last)
        for topic, (_, config) in last.items():
            if topic.startswith("homeassistant/") and config and config.get("unit_of_measurement") == self.unit:
                received_s, message = last.get(config["state_topic"], (0, None))
                late = time.monotonic() - received_s > config.get("expire_after", math.inf)
                if message is None or late or not self.is_available(config, last):
                    continue
                state = rendered(config["value_template"], message)
                with contextlib.suppress(TypeError, ValueError):
                    return (float(state), None)
        return None

    def is_available(self, config, last):
        each = config.get("availability", [{"topic": config[key], "value_template": config.get("availability_template", "{{ value }}")}
                                           for key in ("availability_topic",) if key in config])
        states = [rendered(a["value_template"], last[a["topic"]][1]) == "online" if a["topic"] in last else False for a in each]
        return any(states) if config.get("availability_mode") == "any" else all(states)


class Attributes(dict):
    def __getattr__(self, key):
        value = self.get(key)
        return Attributes(value) if isinstance(value, dict) else value


def rendered(template, message):
    """Returns the value of a template of one expression, in the part of Jinja that is Python, too."""
    expression, = re.fullmatch(r"\{\{ (.*) \}\}", template).groups()
    return eval(expression, {"__builtins__": {}}, {"value_json": Attributes(message), "none": None, "true": True, "false": False})  # noqa: S307


class MqttWeight(Mqtt):
    name, needs = "MQTT, weight", Mqtt.needs - {"sensor"}

    def is_about(self, topic):
        return topic.endswith("/weight")


class HomeAssistantWeight(HomeAssistant):
    name, needs, unit = "Home Assistant (model), weight", Mqtt.needs - {"sensor"}, "kg"
