"""Simulated sensors behind ptys, one daemon that reads them, and the readers of the daemon: a PLC and shared memory."""
import math
import os
import shutil
import struct
import sys
import threading
import time
import tty

from pymodbus.client import ModbusTcpClient

from daemon import ROOT, Daemon, wait_for
from simulated_sensors import SENSORS

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

RATE_HZ = 200
NONE_I16 = 0x8000


class Feeder(threading.Thread):
    """The devices: a pty for each sensor, with 200 frames a second each."""

    def __init__(self, folder, sensors):
        super().__init__(daemon=True)
        self.folder, self.sensors = folder, sensors
        self.load = {name: sensor.rest() for name, sensor in sensors.items()}
        self.spoil = {}  # name -> function that applies a broken wire to the channels
        self.master, self.slave, self.sequence = {}, {}, dict.fromkeys(sensors, 0)
        self.lock, self.ended = threading.Lock(), threading.Event()
        self.failure = None
        for name in sensors:
            self.plug(name)

    def plug(self, name):
        master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        link = self.folder / name
        link.unlink(missing_ok=True)
        link.symlink_to(os.ttyname(slave))
        with self.lock:
            self.master[name], self.slave[name] = master, slave

    def unplug(self, name):
        with self.lock:
            os.close(self.master.pop(name))
            os.close(self.slave.pop(name))

    def run(self):
        try:
            due = time.monotonic()
            while not self.ended.is_set():
                with self.lock:
                    for name, master in self.master.items():
                        channels = self.sensors[name].read(self.load[name])
                        channels = self.spoil.get(name, lambda same: same)(channels)
                        try:
                            os.write(master, self.sensors[name].frame(self.sequence[name], channels))
                        except BlockingIOError:
                            pass  # there is no reader yet
                        self.sequence[name] += 1
                due += 1 / RATE_HZ
                time.sleep(max(0, due - time.monotonic()))
        except Exception as failure:  # shown by close()
            self.failure = failure

    def close(self):
        self.ended.set()
        self.join()
        for name in list(self.master):
            self.unplug(name)
        if self.failure is not None:
            raise self.failure


class Plc:
    """A client of register map 1.0, by its page."""

    def __init__(self, port):
        self.client = ModbusTcpClient("127.0.0.1", port=port)
        assert self.client.connect()

    def registers(self, address, count):
        answer = self.client.read_input_registers(address, count=count, slave=1)
        assert not answer.isError(), answer
        assert answer.registers[0] == answer.registers[-1] or count < 25, "SEQ and SEQ_END differ"
        return answer.registers

    def ok_mask(self):
        return self.registers(10, 1)[0]

    def block(self, n):
        r = self.registers(100 + 25 * n, 25)
        return {"seq": r[0], "status": r[1], "fault": r[2], "i16": r[4:10], "cop": r[12:14], "lost": r[22], "raw": r[23]}

    def floats(self, n):
        r = self.registers(2100 + 25 * n, 25)
        values = struct.unpack(">11f", struct.pack(">22H", *r[2:24]))
        return {"seq": r[0], "status": r[1], "wrench": values[:6], "cop_mm": values[6:8]}

    def close(self):
        self.client.close()


def f32(value):
    return struct.unpack("f", struct.pack("f", value))[0]


def i16_of(value, resolution):
    return NONE_I16 if math.isnan(value) else max(-32767, min(32767, round(value / resolution))) & 0xFFFF


class Bench:
    """The daemon, its devices, the PLC and a reader of shared memory. A context manager."""

    def __init__(self, methods, calibrations):
        """methods: {sensor's name: method}; calibrations: folder with NAME-METHOD.toml."""
        self.sensors, text = {}, ""
        for name, method in methods.items():
            sensor = self.sensors[name] = SENSORS[name]()
            sensor.begin(method)
            text += sensor.toml(name, method)
        self.daemon = Daemon(text)
        self.number = {name: n for n, name in enumerate(methods)}
        for name, method in methods.items():
            fitted = self.sensors[name].fitted_as.get(method, method)
            shutil.copy(calibrations / f"{name}-{fitted}.toml", self.daemon.folder / f"{name}-{method}.toml")

    def __enter__(self):
        self.feeder = Feeder(self.daemon.folder, self.sensors)
        self.feeder.start()
        try:
            self.daemon.start()
            self.plc = Plc(self.daemon.port)
            self.node = tactiled.open(self.daemon.name)
            for name in self.sensors:
                wait_for(lambda: self.node.latest(name).quality in (tactiled.GOOD, tactiled.UNCERTAIN), f"{name}\n{self.daemon.log()}")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for part in ("plc", "node"):
            if hasattr(self, part):
                getattr(self, part).close()
        self.feeder.close()
        self.daemon.__exit__()
        shutil.rmtree(self.daemon.folder)

    def wait_all_good(self):
        """Method piezo knows its past only after a window."""
        wait_for(lambda: self.plc.ok_mask() == (1 << len(self.number)) - 1, "all to be GOOD")

    def apply(self, loads):
        """Returns when shared memory has two frames of these loads: the second one confirms a step."""
        with self.feeder.lock:
            self.feeder.load.update({name: {**self.sensors[name].rest(), **load} for name, load in loads.items()})
            first = {name: self.feeder.sequence[name] for name in loads}
        for name in loads:
            wait_for(lambda: self.node.latest(name).device_sequence > first[name] + 1, f"frames of {name}")

    def block(self, name):
        return self.plc.block(self.number[name])

    def together(self, name):
        """Returns (sensor block, floats, sample in shared memory), all of the same published frame."""
        for _ in range(500):
            block, floats = self.block(name), self.plc.floats(self.number[name])
            node, samples = self.node.snapshot()
            if block["seq"] == floats["seq"] == node.sequence & 0xFFFF:
                return block, floats, samples[name]
        raise AssertionError(f"{name}: no Modbus answer and snapshot of the same frame in 500 tries")


class Witness:
    """Follows sensors without faults."""

    def __init__(self, bench, names):
        self.samples = {name: [] for name in names}
        self.ended = threading.Event()
        self.threads = [threading.Thread(target=self.follow, args=(bench.daemon.name, name)) for name in names]
        for thread in self.threads:
            thread.start()

    def follow(self, node_name, name):
        with tactiled.open(node_name) as node:
            for sample in node.follow(name, timeout=1):
                self.samples[name].append(sample)
                if self.ended.is_set():
                    return

    def check(self, test):
        self.ended.set()
        for thread in self.threads:
            thread.join()
        for name, samples in self.samples.items():
            test.assertGreater(len(samples), 100, name)
            test.assertEqual({s.quality for s in samples}, {tactiled.GOOD}, name)
            test.assertEqual([s.sequence for s in samples], list(range(samples[0].sequence, samples[-1].sequence + 1)), name)
            test.assertEqual(samples[0].lost, samples[-1].lost, name)
