"""A model of Home Assistant's entities of MQTT, as its documentation describes them: discovery, availability with its modes, value_template
and expire_after. It reads a broker by mosquitto_sub and knows nothing of the bridge."""
import datetime
import json
import subprocess
import threading
import time


class Fields:
    """The value_json of a template; a missing field is undefined, which is false."""

    def __init__(self, fields):
        self.fields = fields

    def __getattr__(self, name):
        value = self.fields.get(name)
        return Fields(value) if isinstance(value, dict) else value


def render(template, payload):
    """The result of a template of one expression whose syntax is also that of Python."""
    expression = template.strip().removeprefix("{{").removesuffix("}}").strip()
    return str(eval(expression, {"__builtins__": {}}, {"value_json": Fields(json.loads(payload)), "now": datetime.datetime.now}))


class Entity:
    def __init__(self, config):
        self.config = config
        self.available = {each["topic"]: False for each in config.get("availability", [])}
        self.value, self.received_s = None, None

    def take(self, topic, payload, now_s):
        for each in self.config.get("availability", []):
            if each["topic"] == topic:
                result = render(each["value_template"], payload)
                if result in (each.get("payload_available", "online"), each.get("payload_not_available", "offline")):
                    self.available[topic] = result == each.get("payload_available", "online")
        if self.config["state_topic"] == topic:
            result = render(self.config["value_template"], payload)
            self.value, self.received_s = (None if result == "None" else result), now_s

    def state(self, now_s):
        """The value that a dashboard shows; None: unavailable or unknown."""
        assert self.config["availability_mode"] == "all", self.config
        expired = self.received_s is None or now_s - self.received_s > self.config["expire_after"]
        return self.value if all(self.available.values()) and not expired else None


class HomeAssistant:
    """Entities by their unique_id, from the moment of its start on."""

    def __init__(self, port, root="homeassistant", prefix="tactiled"):
        self.entities, self.lock, self.root = {}, threading.Lock(), root
        self.retained = {}  # by topic: an entity that is found later gets them, too, as it subscribes then
        self.process = subprocess.Popen(["mosquitto_sub", "-p", str(port), "-F", "%r %t %p", "-t", f"{root}/#", "-t", f"{prefix}/#"], stdout=subprocess.PIPE, text=True)
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.process.stdout:
            retained, topic, payload = line.rstrip("\n").split(" ", 2)
            with self.lock:
                if topic.startswith(self.root + "/"):
                    self.find(Entity(json.loads(payload)))
                    continue
                if not payload:  # no template has a result for it
                    continue
                if retained == "1":
                    self.retained[topic] = payload
                for entity in self.entities.values():
                    entity.take(topic, payload, time.monotonic())

    def find(self, entity):
        known = self.entities.get(entity.config["unique_id"])
        if known is not None and known.config == entity.config:
            return
        self.entities[entity.config["unique_id"]] = entity
        for topic, payload in self.retained.items():
            entity.take(topic, payload, time.monotonic())

    def shown(self):
        """Values that are shown now, by the last part of the entities' ids."""
        with self.lock:
            now_s = time.monotonic()
            states = {name.rpartition("_")[2]: entity.state(now_s) for name, entity in self.entities.items()}
        return {name: state for name, state in states.items() if state is not None}

    def names(self):
        with self.lock:
            return {name.rpartition("_")[2] for name in self.entities}

    def close(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()
