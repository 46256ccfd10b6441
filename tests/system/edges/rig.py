"""A daemon, every bridge, a broker and a network that can be cut, each of which a cause can kill, stop and bring back."""
import http.client
import json
import os
import pathlib
import shutil
import signal
import subprocess
import time

from bridge_process import Process
from daemon import BIN, ROOT, free_port, halt, wait_for
from forged_node import GOOD, NO_VALUE, UNCERTAIN, ForgedNode, end_segment
from python_reader import LAYOUT
from unit_daemon import CONFIG, play, quality_is, unit_daemon
from edges.output import TURN_S
from edges.relays import Network

BROKER = shutil.which("mosquitto") or "/usr/sbin/mosquitto"
NEEDED = [BIN / name for name in ("tactiled-mqtt", "tactiled-dds", "tactiled-rdt", "tactiled-web", "fastdds_reader")] + [pathlib.Path(BROKER)]
HERE = pathlib.Path(__file__).parent
STALE_MS = 500
TOOL = """
[tool]

[[tool.sensor]]
sensor = "left"
x_S_in_G = [1, 0, 0]
z_S_in_G = [0, 0, 1]
position_G_mm = [0, 0, 0]
"""
TOOL_DOUBTED = LAYOUT.enums["tool_why"]["TOOL_DOUBTED"]
# Retained by versions of the bridge before MQTT 5, without an end.
OLD_RETAINED = {"left/quality": {"schema": 1, "quality": "good", "reasons": []}, "grasp": {"schema": 1, "quality": "good", "state": "holding", "slips": 0}}


class Rig:
    bin, domain = BIN, "91"
    cleared_s = 0.0

    def __init__(self):
        self.daemon = unit_daemon(config=CONFIG.replace("stale_ms = 2000", f"stale_ms = {STALE_MS}"))
        self.node, self.folder = self.daemon.name, self.daemon.folder
        self.network, self.forged, self.is_silent = Network(), None, False
        self.broker_port, web, rdt = free_port(), free_port(), free_port()
        (self.folder / "broker.conf").write_text(f"persistence false\nlistener {self.broker_port} 127.0.0.1\nallow_anonymous true\n")
        self.modbus, self.mqtt = self.network.tcp(self.daemon.port), self.network.tcp(self.broker_port)
        self.web, self.rdt, self.hal_memory, self.hal_pins = self.network.tcp(web), self.network.udp(rdt), self.folder / "memory", self.folder / "pins"
        self.compile()
        self.commands = {
            "mqtt": (BIN / "tactiled-mqtt", "--node", self.node, "--port", self.mqtt, "--discovery", "homeassistant"),
            "dds": (BIN / "tactiled-dds", "--node", self.node, "--domain", self.domain),
            "rdt": (BIN / "tactiled-rdt", "--node", self.node, "--zero", "mx,my,mz", "--listen", f"127.0.0.1:{rdt}"),
            "web": (BIN / "tactiled-web", "--node", self.node, "--listen", f"127.0.0.1:{web}"),
            "linuxcnc": (self.folder / "tactiled_hal", self.node, "left")}
        self.daemon.start()
        wait_for(quality_is(self.daemon, "good"), "a good value")
        self.start_broker()
        for topic, message in OLD_RETAINED.items():
            subprocess.run(["mosquitto_pub", "-p", str(self.broker_port), "-r", "-t", f"tactiled/{self.node}/{topic}", "-m", json.dumps(message)], check=True)
        self.start_bridges()

    def compile(self):
        for name, *words in (("reader_c", "cc", HERE / "reader.c"), ("reader_cpp", "c++", "-std=c++17", HERE / "reader.cpp"),
                             ("tactiled_hal", "cc", "-DULAPI", f"-I{ROOT}/tests/system/fake_hal", ROOT / "node/bridges/linuxcnc/tactiled_hal.c", "-lm")):
            subprocess.run([*words, "-O1", f"-I{ROOT}/node/include", "-o", self.folder / name], check=True)

    def get(self, path, timeout_s):
        connection = http.client.HTTPConnection("127.0.0.1", self.web, timeout=timeout_s)
        try:
            connection.request("GET", path)
            return connection.getresponse().read().decode()
        finally:
            connection.close()

    # ---- the parts: each has a way to end, to stand still, and to come back

    def start_broker(self):
        self.broker = Process(BROKER, "-c", self.folder / "broker.conf", ready="running")

    def start_bridges(self):
        self.hal_pins.unlink(missing_ok=True)  # as `halcmd unload` does
        env = {**os.environ, "HAL_MEMORY": str(self.hal_memory), "HAL_PINS": str(self.hal_pins)}
        self.bridges = {name: Process(*words, env=env) for name, words in self.commands.items()}

    def processes(self, part):
        return {"sensor": lambda: [self.daemon.others[-1]], "daemon": lambda: [self.daemon.process], "bridge": lambda: [b.process for b in self.bridges.values()],
                "broker": lambda: [self.broker.process]}[part]()

    def kill(self, part):
        for process in self.processes(part):
            process.kill()
            process.wait()

    def stop(self, part):
        for process in self.processes(part):
            halt(process.pid)

    def go_on(self, part):
        for process in self.processes(part):
            process.send_signal(signal.SIGCONT)

    def bring_back(self, part):
        {"sensor": self.start_sensor, "daemon": self.daemon.start, "bridge": self.start_bridges, "broker": self.start_broker}[part]()

    def clear(self):
        """Clears the faults that the daemon has latched. Call it again: a busy machine delays the device beyond stale_ms now and then."""
        if self.forged is None and time.monotonic() - self.cleared_s > 1:
            self.daemon.ctl("clear")
            self.cleared_s = time.monotonic()

    def start_sensor(self):
        (self.folder / "dev").unlink(missing_ok=True)
        play(self.daemon)

    def cut(self, _):
        self.network.is_cut = True

    def mend(self, _):
        self.network.is_cut = False

    def end(self, _):
        self.daemon.stop()

    # ---- a node whose samples are chosen

    def forge(self):
        """The daemon goes on, and its Modbus service serves the forged segment: to all its readers its own one has ended."""
        self.daemon.stop()
        self.daemon.config.write_text(self.daemon.config.read_text() + TOOL)
        self.daemon.start()
        wait_for(quality_is(self.daemon, "good"), "a good value")
        self.clear()
        with open(self.daemon.segment, "r+b") as file:
            self.forged = ForgedNode(self.node, file.read())
            end_segment(file)
        self.forged.show_tool(quality=NO_VALUE)
        self.forged.clock = lambda now_ns: now_ns / 1e9 % TURN_S

    def doubt(self, bit):
        self.forged.show(bit)

    def believe(self, _):
        self.forged.show(0)

    def hold(self):
        """From now on the node holds an object of a stable weight, and the sensor is good."""
        self.believe(None)
        self.forged.show_grasp(state=4, weight_state=2, weight_kg=0.2, weight_sd_kg=0.002, weight_doubts=0)
        self.forged.show_tool(quality=GOOD, why=0, sd_force_N=(0.1, 0.1, 0.1))

    def doubt_weight(self, bit):
        """The state alone (bit 0), or the doubt alone: no doubt may hide behind the state."""
        self.forged.show_grasp(weight_state=2 if bit else 1, weight_doubts=bit)

    def believe_weight(self, _):
        self.hold()

    def doubt_tool(self, _):
        self.forged.show_tool(quality=UNCERTAIN, why=TOOL_DOUBTED)

    def believe_tool(self, _):
        self.forged.show_tool(quality=GOOD, why=0)

    def stop_forging(self, _):
        self.is_silent = True
        self.forged.lock.acquire()

    def forge_on(self, _):
        self.is_silent = False
        self.forged.lock.release()

    def close(self):
        self.network.close()
        if self.is_silent:
            self.forge_on(None)
        if self.forged:
            self.forged.__exit__()
        for process in [*self.bridges.values(), self.broker]:
            if process.process.poll() is None:
                process.process.send_signal(signal.SIGCONT)
            process.__exit__()
        self.daemon.__exit__()
        shutil.rmtree(self.folder, ignore_errors=True)
