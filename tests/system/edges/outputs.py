"""The outputs of the product: with mqtt.py and plc.py the one place that knows their fields for value, quality, time and expiry."""
import http.client
import json
import math
import socket
import struct
import time

import tactiled
from promql import Store, panel, rules

from edges.mqtt import HomeAssistant, HomeAssistantGrasp, HomeAssistantTool, HomeAssistantWeight, Mqtt, MqttGrasp, MqttTool, MqttWeight
from edges.output import GOOD, SENSOR, Output
from edges.plc import Plc, PlcTool, PlcWeight


class Prometheus(Output):
    """A model: scrapes twice a second, within 0.4 s; the dashboard's series of good forces. A value may be older by one scrape interval."""
    name, needs = "Prometheus, forces of the dashboard", {"sensor", "daemon", "bridge", "network"}
    period_s, timeout_s = 0.5, 0.4
    limit_s = 1.0 + period_s
    series = "Normal force"

    def open(self):
        self.store, self.scrapes = Store(), 0
        self.thread(self.scrape)

    def scrape(self):
        began_s = time.monotonic()
        try:
            text = self.rig.get("/metrics", self.timeout_s)
        except (OSError, http.client.HTTPException):
            text = None
        with self.lock:
            self.store.scraped(began_s, "gripper:8080", text)
            self.scrapes += 1
        time.sleep(max(0, began_s + self.period_s - time.monotonic()))

    def ask(self, expression):
        with self.lock:
            return self.store.ask(expression, time.monotonic())

    def look(self):
        found = self.ask(panel(self.series)[0])
        return (min(found.values()), self.told(min(found.values()))) if found else None


class PrometheusWeight(Prometheus):
    name, needs, series = "Prometheus, weight of the dashboard", Prometheus.needs - {"sensor"}, "Weight"


class PrometheusTool(Prometheus):
    name, needs, series = "Prometheus, wrench on the gripper of the dashboard", Prometheus.needs - {"sensor"}, "Force on the gripper, z"


class PrometheusStates(Prometheus):
    """The rows of the dashboard's table of states. A state looks healthy unless the quality in its row says that it is not. Its time is that
    of the number of the same scrape."""
    name, needs, metric, number = "Prometheus, state of the weight", Prometheus.needs - {"sensor"}, "tactiled_weight_state", "tactiled_weight_kilograms"
    healthy, rows = "stable", panel("Weight and its doubts now")[0]

    def look(self):
        series = [(dict(labels), value) for labels, value in self.ask(f"{self.rows} or {self.number}").items()]
        qualities = [labels.get("quality") for labels, _ in series if (labels["__name__"], labels.get("state")) == (self.metric, self.healthy)]
        if all(quality in ("uncertain", "bad") for quality in qualities):
            return None
        return (self.healthy, self.told(min((value for labels, value in series if labels["__name__"] == self.number), default=math.nan)))


class PrometheusGrasp(PrometheusStates):
    """A query of a user: the dashboard does not show this state."""
    name, metric, number = "Prometheus, state of the gripper", "tactiled_grip_state", "tactiled_grip_newtons"
    healthy, rows = "holding", "tactiled_grip_state == 1"


class Rules(Prometheus):
    """The numbers at the top of the dashboard and the conditions of the alert rules: healthy if none of them shows anything."""
    name = "Prometheus, numbers and alerts"
    of_the_machine = {"TactiledNoRealTime", "TactiledFramesLost"}  # a busy machine causes them, and they concern no value

    def look(self):
        numbers = [value for title in ("Grippers that do not publish", "Sensors without a value", "Sensors that are uncertain") for value in self.ask(panel(title)[0]).values()]
        alerts = {alert: list(found) for alert, (expression, *_) in rules().items() if alert not in self.of_the_machine and (found := self.ask(expression))}
        self.why = f"numbers {numbers}, alerts {alerts}"
        return ("all is well", None) if self.scrapes and not any(numbers) and not alerts else None


class Dds(Output):
    """A reader of Fast DDS on the topic of the wrench: each message is used."""
    name, topic, stands = "DDS", f"{SENSOR}/wrench", True

    def open(self):
        self.lines(self.rig.bin / "fastdds_reader", self.rig.domain, "600", f"rt/{self.rig.node.replace('-', '_')}/{self.topic}")

    def came(self, line):
        _, sent, _, numbers = line.split(" ", 3)
        self.show((float(numbers.split()[2]), int(sent) / 1e9 - time.time() + time.monotonic()))


class DdsWeight(Dds):
    """The topic of the grasp: a message is used until its `valid_until`."""
    name, needs, topic, lasts_s = "DDS, weight", Dds.needs - {"sensor"}, "grasp", math.inf
    until_s, field = 0.0, 6

    def came(self, line):
        words = line.split(" ")
        to_clock_s = time.monotonic() - time.time()
        self.until_s = int(words[3]) / 1e9 + to_clock_s
        good = int(words[self.field]) == GOOD and time.monotonic() < self.until_s
        self.show((self.name, int(words[1]) / 1e9 + to_clock_s) if good else None)

    def look(self):
        return self.newest if time.monotonic() < self.until_s else None


class DdsGrasp(DdsWeight):
    name, field = "DDS, grasp", 4


class DdsTool(Dds):
    name, needs, topic = "DDS, wrench on the gripper", Dds.needs - {"sensor"}, "tool_wrench"


class Rdt(Output):
    """A client of a Net F/T: a record with the status 0 is used. It asks again while nothing comes."""
    name, needs, stands = "RDT", {"sensor", "daemon", "bridge", "network"}, True

    def open(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(0.5)
        self.thread(self.receive)

    def receive(self):
        self.socket.sendto(struct.pack("!HHI", 0x1234, 2, 0), ("127.0.0.1", self.rig.rdt))
        while not self.ended:
            self.wait()
            fields = struct.unpack("!IIIiiiiii", self.socket.recv(100))
            self.show((fields[5] / 1e6, self.told(fields[5] / 1e6)) if fields[2] == 0 else None)


class LinuxCnc(Output):
    """The pins of the HAL component: fz is used while `valid` is TRUE and a watchdog of 0.2 s sees `heartbeat` change."""
    name, timeout_s = "LinuxCNC", 0.2

    def open(self):
        self.beat, self.changed_s = None, 0.0
        self.thread(self.watch)

    def pin(self, name, kind):
        offsets = dict(line.rsplit(".", 1)[1].split() for line in self.rig.hal_pins.read_text().splitlines())
        return struct.unpack_from(kind, self.rig.hal_memory.read_bytes(), int(offsets[name]))[0]

    def watch(self):
        beat = self.pin("heartbeat", "?")
        if self.beat not in (None, beat):
            self.changed_s = time.monotonic()
        self.beat = beat

    def look(self):
        if time.monotonic() - self.changed_s > self.timeout_s or not self.pin("valid", "?"):
            return None
        return (self.pin("fz", "d"), time.monotonic() - self.pin("age-s", "d"))


class Web(Output):
    """The stream of the web page. A frame is shown for 0.5 s at most, as by the page."""
    name, needs, lasts_s, stands = "Web page, stream", {"sensor", "daemon", "bridge", "network"}, 0.5, True

    def open(self):
        self.thread(self.follow)

    def follow(self):
        connection = http.client.HTTPConnection("127.0.0.1", self.rig.web, timeout=1)
        try:
            connection.request("GET", "/api/stream")
            answer, is_frame = connection.getresponse(), True
            while not self.ended and (line := answer.readline()):
                self.wait()
                if line.startswith(b"event: "):
                    is_frame = False
                elif line.startswith(b"data: ") and is_frame:
                    frame = json.loads(line[6:])
                    sensor = frame["sensors"][0] if frame["sensors"] else {}
                    is_young = time.monotonic() - frame["t_s"] < self.lasts_s  # the page judges that by its own clock
                    good = is_young and frame["alive"] and sensor.get("quality") == GOOD
                    self.show((sensor["force_N"][2], frame["t_s"] - sensor["age_ms"] / 1000) if good else None)
                elif line == b"\n":
                    is_frame = True
        finally:
            connection.close()


class Api(Output):
    """/api/status, asked ten times a second with a limit of 0.3 s."""
    name, needs = "Web page, /api/status", {"sensor", "daemon", "bridge", "network"}

    def open(self):
        self.thread(self.ask)

    def ask(self):
        time.sleep(0.08)
        status = json.loads(self.rig.get("/api/status", 0.3))
        sensor = status["sensors"][0] if status["sensors"] else {}
        good = status["alive"] and sensor.get("quality") == "good"
        self.show((sensor["force_S_N"][2], status["t_s"] - sensor["age_ms"] / 1000) if good else None)


class ApiWeight(Api):
    """The states look healthy unless their quality says that they are not."""
    name, needs = "Web page, weight of /api/status", Api.needs - {"sensor"}
    keys, healthy = ("grasp", "weight_state", "weight_quality", "weight_kg"), "stable"

    def ask(self):
        time.sleep(0.08)
        status = json.loads(self.rig.get("/api/status", 0.3))
        part, state, quality, number = self.keys
        fields = status.get(part) or {}
        good = status["alive"] and fields.get(state) == self.healthy and fields.get(quality, "good") == "good"
        self.show((self.name, self.told(self.number(fields[number]))) if good else None)

    def number(self, value):
        return value


class ApiGrasp(ApiWeight):
    name, keys, healthy = "Web page, grasp of /api/status", ("grasp", "state", "quality", "grip_N"), "holding"


class ApiTool(ApiWeight):
    name, keys, healthy = "Web page, wrench on the gripper of /api/status", ("tool", "quality", "quality", "force_G_N"), "good"

    def number(self, value):
        return value[2]


class Python(Output):
    name, needs = "Python", {"sensor", "daemon"}
    node = None

    def open(self):
        pass

    def look(self):
        try:
            self.node = self.node or tactiled.open(self.rig.node)
            sample = self.node.latest(SENSOR)
        except tactiled.Error:
            return None
        return (sample.force_S_N[2], sample.t_ns / 1e9) if sample.quality == GOOD else None


class C(Output):
    name, needs, program = "C", {"sensor", "daemon"}, "reader_c"

    def open(self):
        self.lines(self.rig.folder / self.program, self.rig.node, SENSOR)

    stands = True

    def came(self, line):
        quality, fz_N, t_s = line.split()
        self.show((float(fz_N), float(t_s)) if int(quality) == GOOD else None)


class Cpp(C):
    name, program = "C++", "reader_cpp"


FORCES = [Plc, Mqtt, HomeAssistant, Prometheus, Rules, Dds, Rdt, LinuxCnc, Web, Api, Python, C, Cpp]
# A node that holds an object has these: the weight, the grasp, and the wrench on the gripper.
WEIGHTS = [PlcWeight, MqttWeight, HomeAssistantWeight, PrometheusWeight, PrometheusStates, DdsWeight, ApiWeight]
GRASPS = [MqttGrasp, HomeAssistantGrasp, PrometheusGrasp, DdsGrasp, ApiGrasp]
TOOLS = [PlcTool, MqttTool, HomeAssistantTool, PrometheusTool, DdsTool, ApiTool]
