"""A sensor that measures a force set by the test, a daemon that reads it, and PLCs with their own addresses."""
import json
import os
import signal
import threading
import time
import tty

from pymodbus.client import ModbusTcpClient

from daemon import Daemon, wait_for
from unit_daemon import CALIBRATION

SENSOR = """
[[link]]
name = "usb0"
driver = "uart"
device = "{folder}/dev"
format = "lines"
channels = 3
sequence = true
path = "direct"

[[sensor]]
name = "left"
link = "usb0"
model = "generic"
calibration = "{folder}/unit.toml"
stale_ms = 1000
"""
FULL_SCALE_N = 100.0  # the same as in unit_daemon.CALIBRATION


class Device(threading.Thread):
    """Sends its force 200 times a second, with some noise."""

    def __init__(self, path, force_N):
        super().__init__(daemon=True)
        self.force_N, self.is_silent, self.ended = force_N, False, threading.Event()
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.slave = slave
        os.set_blocking(self.master, False)
        path.symlink_to(os.ttyname(slave))
        self.start()

    def run(self):
        sequence = 0
        while not self.ended.wait(0.005):
            if self.is_silent:
                continue
            sequence += 1
            noise = 0.001 * (sequence % 3)
            x, y, z = self.force_N
            try:
                os.write(self.master, f"{sequence},{x + noise},{y - noise},{z + noise}\n".encode())
            except BlockingIOError:
                pass  # there is no daemon


def is_confirmed(sample):
    """Returns whether it has a value that the next one has confirmed, if it was a jump or the first of a stream."""
    return sample["force_S_N"][2] is not None and "stepped" not in sample["quality"]


class Held:
    """The daemon, its device and the view of a reader. A context manager."""

    def __init__(self, more="", commands=True, modbus="", node="", calibration=CALIBRATION):
        self.daemon = Daemon(SENSOR + more)
        text = self.daemon.config.read_text()
        if commands:
            modbus += "commands = true\n"
        text = text.replace("[modbus]\n", "[modbus]\n" + modbus).replace("[node]\n", "[node]\n" + node)
        self.daemon.config.write_text(text)
        (self.daemon.folder / "unit.toml").write_text(calibration)
        self.device = Device(self.daemon.folder / "dev", [0.0, 0.0, 0.0])
        self.clients = []

    def __enter__(self):
        try:
            self.start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for client in self.clients:
            client.close()
        self.daemon.__exit__()
        self.device.ended.set()
        self.device.join()

    def starts(self):
        path = self.daemon.folder / "tactiled.log"
        return path.read_text().count(": node ") if path.exists() else 0

    def start(self):
        before = self.starts()
        self.daemon.start()
        wait_for(lambda: self.starts() > before, "the start")  # a daemon that was killed leaves its segment
        self.settle()

    def restart(self, number=signal.SIGTERM, then_N=None):
        """then_N: the force from the end on."""
        self.daemon.process.send_signal(number)
        self.daemon.process.wait(timeout=60)
        if then_N is not None:
            self.device.force_N = [0.0, 0.0, then_N]
        self.start()

    def press(self, force_N):
        self.device.force_N = [0.0, 0.0, force_N]
        def is_there(now):  # a daemon that is killed before the confirmation leaves no force by which the next one knows the zero
            return is_confirmed(now) and abs((now["raw_force_S_N"][2] or 0) - force_N) < 0.1
        wait_for(lambda: is_there(self.sample()), f"{force_N} N")

    def sample(self):
        return json.loads(self.daemon.ctl("status", "--json").stdout)["sensors"][0]

    def settle(self):
        wait_for(lambda: is_confirmed(self.sample()), "a value")

    def read_force(self):
        """Returns (quality word, fz in N) of the newest sample with a confirmed value, because a busy machine interrupts the
        device or the daemon."""
        for _ in range(100):
            now = self.sample()
            if is_confirmed(now):
                return now["quality"], now["force_S_N"][2]
        raise TimeoutError("no value")

    def plc(self, address="127.0.0.1"):
        plc = Plc(self.daemon.port, address)
        self.clients.append(plc)
        return plc


class Plc:
    """A Modbus client whose connection ends with the daemon and is restored."""

    def __init__(self, port, address):
        self.port, self.address = port, address
        self.begin()
        self.client.connect()

    def begin(self):
        """Takes a new client: pymodbus waits out its whole timeout after a device that once gave no answer."""
        self.client = ModbusTcpClient("127.0.0.1", port=self.port, source_address=(self.address, 0), timeout=2)

    def close(self):
        self.client.close()

    def retried(self, request):
        for _ in range(200):
            try:
                if self.client.connect():
                    answer = request()
                    if not isinstance(answer, Exception) and not hasattr(answer, "string"):
                        return answer
            except Exception:  # pymodbus raises one of several when the connection ends
                pass
            self.client.close()
            self.begin()
            time.sleep(0.02)
        raise TimeoutError("no answer")

    def read(self, at, count):
        return self.retried(lambda: self.client.read_input_registers(at, count=count)).registers

    def block(self):
        return self.retried(lambda: self.client.read_holding_registers(5000, count=5)).registers

    def write(self, at, *values):
        answer = self.retried(lambda: self.client.write_registers(at, list(values)))
        return getattr(answer, "exception_code", 0)

    def write_one(self, at, value):
        answer = self.retried(lambda: self.client.write_register(at, value))
        return getattr(answer, "exception_code", 0)

    def write_coil(self, at, on=True):
        answer = self.retried(lambda: self.client.write_coil(at, on))
        return getattr(answer, "exception_code", 0)

    def outcome(self):
        """Returns CMD_SEQ_ACK, CMD_STATE, CMD_RESULT."""
        return tuple(self.read(0, 32)[25:28])

    def command(self, number, code, mask):
        """Writes the block and waits until it is settled."""
        exception = self.write(5000, code, mask, 0, 0, number)
        if exception:
            return exception
        wait_for(lambda: self.outcome()[1] != 1, "the command")
        return self.outcome()
