"""The release daemon with two devices behind ptys, whose true values are known, and a witness in shared memory and
over Modbus."""
import collections
import contextlib
import math
import os
import pathlib
import pty
import random
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import tty

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/system"), str(ROOT / "node/python")]
import tactiled  # noqa: E402
from daemon import BIN, Daemon, wait_for  # noqa: E402,F401
from floors import hurry  # noqa: E402

RATE_HZ, STALE_MS, FROZEN_AFTER = 100, 100, 20
SENSORS = ("left", "right")
CALIBRATION = """format = 1
model = "generic"
method = "matrix"
channels = ["a", "b", "c"]
channel_unit = "counts"
zero = [0.0, 0.0, 0.0]
components = ["fx", "fy", "fz"]
matrix = [[0.001, 0.0, 0.0], [0.0, 0.001, 0.0], [0.0, 0.0, 0.001]]
sd = [0.01, 0.01, 0.01]
full_scale = [500.0, 500.0, 500.0]
"""
SENSOR = """
[[link]]
name = "usb_{name}"
driver = "uart"
device = "{{folder}}/{name}"
path = "direct"
format = "lines"
channels = 3
sequence = true
checksum = true

[[sensor]]
name = "{name}"
link = "usb_{name}"
model = "generic"
calibration = "{{folder}}/unit.toml"
stale_ms = {stale}
frozen_after = {frozen}
rate_Hz = {rate}
saturates_at = [-8388608, 8388607]
"""
CONFIG = "".join(SENSOR.format(name=name, stale=STALE_MS, frozen=FROZEN_AFTER, rate=RATE_HZ) for name in SENSORS)


def count_of(sensor, sequence, k):
    """Returns channel k: its own offset, a wave, noise; no other frame and no mixture has these values."""
    n = sequence & 0xFFFF
    mixed = (n * 2654435761 + sensor * 40503 + k * 2246822519) & 0xFFFFFFFF
    mixed = ((mixed ^ mixed >> 15) * 2246822519) & 0xFFFFFFFF
    phase = n % 512
    return 20000 * (sensor + 1) + 1000 * k + 8 * min(phase, 512 - phase) + (mixed >> 26) - 32


def with_ptys_of_its_own():
    """Restarts in a mount name space with its own ttys, because other programs' tests reuse the numbers."""
    if os.environ.get("TACTILED_OWN_PTYS") or os.geteuid() != 0:
        return
    mounts = "mount -t devpts -o newinstance,ptmxmode=0666 devpts /dev/pts && mount --bind /dev/pts/ptmx /dev/ptmx"
    os.environ["TACTILED_OWN_PTYS"] = "1"
    os.execvp("unshare", ["unshare", "-m", "sh", "-c", mounts + ' && exec "$@"', "sh", sys.executable, *sys.argv])


def line_of(sequence, values):
    body = ",".join([str(sequence & 0xFFFFFFFF), *map(str, values)]).encode()
    check = 0
    for byte in body:
        check ^= byte
    return body + b"*%02X\n" % check


class Device(threading.Thread):
    """Sends a line each 10 ms. `spoil(line, device)` may return other bytes, or None for nothing."""

    def __init__(self, index, path, first=0):
        super().__init__(daemon=True)
        self.index, self.path, self.sequence = index, pathlib.Path(path), first
        self.sent, self.excused = {}, set()  # by sequence: time of sending; sequences that may be wrong
        self.late = []  # ns, from and to, if this program did not send in time
        self.spoil, self.values_of, self.period_s = None, None, 1 / RATE_HZ
        self.ended = threading.Event()
        self.master = None
        self.plug()
        self.start()

    def plug(self, path=None):
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        self.slave_path = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self.master, False)
        path = path or self.path
        path.unlink(missing_ok=True)
        path.symlink_to(self.slave_path)

    def unplug(self):
        self.path.unlink()  # like udev: another tty may get the number next
        master, self.master = self.master, None
        os.close(master)

    def run(self):
        hurry()
        due = time.monotonic()
        while not self.ended.is_set():
            due += self.period_s
            time.sleep(max(0, due - time.monotonic()))
            sequence = self.sequence
            values = [count_of(self.index, sequence, k) for k in range(3)]
            values_of, spoil = self.values_of, self.spoil  # another thread may remove them
            if values_of is not None:
                values = values_of(values, self)
            line = line_of(sequence, values)
            if spoil is not None:
                line = spoil(line, self)
            self.sequence += 1
            if line is None:
                continue
            self.sent[sequence & 0xFFFFFFFF] = now_ns = time.monotonic_ns()
            if now_ns - due * 1e9 > 40e6:
                self.late.append((int(due * 1e9), now_ns + 50_000_000))
            with contextlib.suppress(OSError, TypeError):
                os.write(self.master, line)

    def close(self):
        self.ended.set()
        self.join()
        if self.master is not None:
            os.close(self.master)


class Witness(threading.Thread):
    """Reads continuously, like a control program and like a PLC."""

    def __init__(self, name, port, devices):
        super().__init__(daemon=True)
        self.name_, self.port, self.devices = name, port, devices
        self.lies, self.looks, self.answers = collections.Counter(), 0, 0
        self.floor, self.excused = None, 0  # times of delays of other programs; number of old values that these
                                            # explain
        self.history = {name: [] for name in SENSORS}  # (time_ns, quality, reasons) at each change
        self.epochs = {name: set() for name in SENSORS}
        self.registers = []  # (time_ns, 32 + 50 registers) at each relevant change
        self.first_lie = ""
        self.ended = threading.Event()
        self.plc = threading.Thread(target=self.poll, daemon=True)  # a separate thread: a stopped daemon does not
                                                                    # answer
        self.plc.start()
        self.start()

    def run(self):
        hurry()
        node = None
        while not self.ended.is_set():
            if node is None:
                try:
                    node = tactiled.open(self.name_)
                except tactiled.Error:
                    time.sleep(0.002)
                    continue
            for device, name in zip(self.devices, SENSORS):
                self.look(device, name, node.latest(name))
            time.sleep(0.001)

    def lie(self, kind, text):
        self.lies[kind] += 1
        self.first_lie = self.first_lie or f"{kind}: {text}"

    def look(self, device, name, s):
        now_ns = time.monotonic_ns()
        self.looks += 1
        history = self.history[name]
        if not history or history[-1][1:] != (s.quality, s.reasons):
            history.append((now_ns, s.quality, s.reasons))
        if s.quality == tactiled.BAD:
            if not all(map(math.isnan, s.force_S_N)):
                self.lie("no sentinel", f"{name} {s.force_S_N}")
            return
        self.epochs[name].add(s.epoch)
        if s.quality != tactiled.GOOD or s.device_sequence in device.excused:
            return
        truth = [0.001 * count_of(device.index, s.device_sequence, k) for k in range(3)]
        if max(abs(a - b) for a, b in zip(truth, s.raw_force_S_N)) > 1e-9:
            self.lie("wrong value", f"{name} {s.device_sequence}: {s.raw_force_S_N}, true {truth}")
        sent_ns = device.sent.get(s.device_sequence, 0)
        # 20 ms: between this program's own reading of the clock and the sample; its waiting time for the processor is
        # not counted
        if now_ns - sent_ns > (STALE_MS + 20) * 1_000_000 and time.monotonic_ns() - now_ns < 5_000_000:
            held_ns = self.floor(sent_ns, now_ns) if self.floor is not None else 0
            if now_ns - sent_ns - held_ns <= (STALE_MS + 20) * 1_000_000:
                self.excused += 1
            else:
                self.lie("too old", f"{name}: {(now_ns - sent_ns) / 1e6:.1f} ms")

    def poll(self):
        hurry()
        client = None
        while not self.ended.wait(0.01):
            try:
                client = client or socket.create_connection(("127.0.0.1", self.port), timeout=0.3)
                self.look_at_registers(ask(client, 0, 32) + ask(client, 100, 50))
            except OSError:
                if client is not None:
                    client.close()
                client = None

    def look_at_registers(self, values):
        self.answers += 1
        if not self.registers or any(values[i] != self.registers[-1][1][i] for i in (7, 8, 9, 10, 15, 33, 34, 58, 59)):
            self.registers.append((time.monotonic_ns(), values))
        for i in range(2):
            block = values[32 + 25 * i:]
            if block[1] & 0x8000 and block[4:7] != (0x8000,) * 3:
                self.lie("register without sentinel", str(block[4:7]))
            if block[1] & 1 and block[4:7] == (0x8000,) * 3:
                self.lie("register ok without a value", "")

    def wait(self, name, quality, seconds, what):
        wait_for(lambda: self.history[name] and self.history[name][-1][1] == quality, what, seconds)
        return self.history[name][-1][0]

    def not_good(self, name, since_ns):
        """Returns times and reasons of everything that was not GOOD from then on, except if the device itself was
        late."""
        late = self.devices[SENSORS.index(name)].late
        return [(t, q, r) for t, q, r in self.history[name] if t >= since_ns and q != tactiled.GOOD and
                not (r == tactiled.STALE and any(begin <= t <= end for begin, end in late))]

    def close(self):
        self.ended.set()
        self.join()
        self.plc.join()


def ask(client, at, count):
    client.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 4, at, count))
    answer = b""
    while len(answer) < 9 + 2 * count:
        part = client.recv(300)
        if not part:
            raise ConnectionError
        answer += part
    return struct.unpack(f">{count}H", answer[9:])


class Rig:
    """before: the words of a command that runs the daemon. log: a descriptor without a reader here; -1: a separate
    one."""

    def __init__(self, before=(), config=CONFIG, first=0, env=None, log=None):
        self.daemon = Daemon(config, env=env)
        (self.daemon.folder / "unit.toml").write_text(CALIBRATION)
        self.devices = [Device(i, self.daemon.folder / name, first) for i, name in enumerate(SENSORS)]
        self.left, self.right = self.devices
        self.random = random.Random(1)
        self.before = [str(word).replace("{folder}", str(self.daemon.folder)) for word in before]
        self.witness, self.log = None, log

    def start(self):
        if self.log is not None:
            log = self.log if self.log >= 0 else None
            self.daemon.process = subprocess.Popen([*self.before, BIN / "tactiled", "--config", self.daemon.config], stderr=log)
        else:
            self.daemon.start(*self.before)
        self.witness = Witness(self.daemon.name, self.daemon.port, self.devices)
        for name in SENSORS:
            self.witness.wait(name, tactiled.GOOD, 10, f"{name} to be GOOD")
        time.sleep(0.3)
        return self

    def __enter__(self):
        try:
            return self.start()
        except BaseException:
            self.__exit__()
            raise

    def __exit__(self, *_):
        if self.witness is not None:
            self.witness.close()
        for device in self.devices:
            device.close()
        # A process that strace runs continues without it.
        for pid in self.pids():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)
                os.kill(pid, signal.SIGTERM)
        self.daemon.__exit__()
        wait_for(lambda: not self.pids(), "the end of the daemon")

    def pids(self):
        """Returns the process numbers of the daemon, however it was started."""
        found = []
        for entry in pathlib.Path("/proc").glob("[0-9]*/cmdline"):
            with contextlib.suppress(OSError):
                words = entry.read_bytes().split(b"\0")
                if words[0] == str(BIN / "tactiled").encode() and str(self.daemon.config).encode() in words:
                    found.append(int(entry.parent.name))
        return found
