#!/usr/bin/env python3
"""Four links at once: UART, CAN FD, an AD7746 on I2C at 91 Hz, Modbus RTU at 100 Hz. No frame is lost; CPU time and
latency are measured.

KERNEL_TEST="SECONDS_TO_RUN=600 UART_HZ=1000 CAN_HZ=4000" tests/kernel/run.sh four_links asks for more than the
default.
"""
# Two emulated cores, one of them for the devices: those do not take their time from the computer that they are connected to.
# QEMU: -smp 2
import json
import os
import pathlib
import subprocess
import time
import unittest

from i2c_test import Bus as I2c
from machine import BIN, Daemon, link_of, unit_calibration, wait_for
import tactiled

SECONDS = float(os.environ.get("SECONDS_TO_RUN", 20))
UART_HZ, CAN_HZ = float(os.environ.get("UART_HZ", 500)), float(os.environ.get("CAN_HZ", 500))
SOCKETS = 4 << 20  # bytes, net.core.rmem_max: the advice in drivers/README.md for a fast bus
LINKS = """
[realtime]
period_us = 2000
cpu = 1  # the devices have the other one

[[link]]
name = "uart"
driver = "uart"
device = "{folder}/uart"
format = "cobs"

[[link]]
name = "can"
driver = "can"
interface = "vcan0"

[[link.device]]
device = 0
id = 0x1ABCDE0
extended = true
bytes = 64
signals = [{start = 0, length = 32, order = "intel", type = "unsigned"}]
sequence = {start = 32, length = 16, order = "intel"}

[[link]]
name = "i2c"
driver = "i2c"
bus = "BUS"

[[link.chip]]
device = 0
chip = "ad7746"
mux = {address = 0x70, channel = 2}

[[link]]
name = "modbus"
driver = "modbus"
device = "{folder}/rtu"
baud = 115200
timeout_ms = 500  # a host that is busy keeps an emulated device waiting, too

[[link.slave]]
device = 0
rate_Hz = 100
function = 4
registers = [{name = "number", at = 0}, {name = "again", at = 1}]
"""
CHANNELS = {"uart": 6, "can": 1, "i2c": 1, "modbus": 2}
SENT_IN = {"uart": 0, "can": 2}  # the component of the force that contains the time of sending
SENSORS = "".join(f"""
[[sensor]]
name = "{name}"
link = "{name}"
model = "generic"
calibration = "{{folder}}/unit{channels}.toml"
stale_ms = 1000
""" + ('channels = ["c1", "c2", "c3", "c4", "c5", "c6", "-", "-"]\n' if name == "uart" else "") for name, channels in CHANNELS.items())


def kernel_threads(beginning):
    return [int(path.parts[2]) for path in pathlib.Path("/proc").glob("[0-9]*/comm") if path.read_text().startswith(beginning)]


def be_hardware(pid, priority):
    """A device waits for no program, and takes no program's time."""
    os.sched_setscheduler(pid, os.SCHED_FIFO, os.sched_param(priority))
    os.sched_setaffinity(pid, {0})


def cpu_s():
    """CPU seconds of every thread of the machine: {(process, thread id): (its name, user, kernel)}."""
    tick, all_of = os.sysconf("SC_CLK_TCK"), {}
    for path in pathlib.Path("/proc").glob("[0-9]*/task/[0-9]*/stat"):
        try:
            name, fields = path.read_text().split("(", 1)[1].rsplit(")", 1)
        except OSError:  # it has just ended
            continue
        user, kernel = fields.split()[11:13]
        all_of[int(path.parts[2]), int(path.parts[4])] = (name, int(user) / tick, int(kernel) / tick)
    return all_of


def used_s(before, after, process=None):
    """[(CPU seconds, user's part, name)] in between, most first; of one process or of each thread."""
    used = []
    for key, (name, user, kernel) in after.items():
        _, user_before, kernel_before = before.get(key, ("", 0, 0))
        if process in (None, key[0]):
            used.append((user + kernel - user_before - kernel_before, user - user_before, name))
    return sorted(used, reverse=True)


def latency_ms(name, sample):
    """Returns the time from sending, if the sample contains it, else from the sample's timestamp, to its publication
    in shared memory."""
    if name not in SENT_IN:
        return (sample.t_published_ns - sample.t_ns) / 1e6
    late_us = sample.t_published_ns / 1e3 - sample.raw_force_S_N[SENT_IN[name]]  # modulo a second; a turn of the pipeline is
    return (late_us + 500_000) % 1e6 / 1e3 - 500                                 # published with the time of its
                                                                                 # begin


class FourLinks(unittest.TestCase):
    def start(self):
        pathlib.Path("/proc/sys/net/core/rmem_max").write_text(str(SOCKETS))
        i2c = I2c("ad7746:0x48:0x70:2")
        self.addCleanup(i2c.close)
        for pid in (i2c.emulator.process.pid, *kernel_threads("vhci_")):
            be_hardware(pid, 96)
        for pid in kernel_threads("ksoftirqd/0"):  # the feeder's data pass through it, and it would wait for the
                                                   # feeder
            os.sched_setscheduler(pid, os.SCHED_FIFO, os.sched_param(97))
        daemon = Daemon(LINKS.replace("BUS", i2c.path) + SENSORS)
        self.addCleanup(daemon.__exit__)
        for channels in CHANNELS.values():
            (daemon.folder / f"unit{channels}.toml").write_text(unit_calibration(channels))
        feeder = subprocess.Popen([BIN / "link_feeder", str(SECONDS), daemon.folder / "uart", daemon.folder / "rtu", "vcan0", str(UART_HZ),
                                   str(CAN_HZ)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.addCleanup(feeder.communicate)
        self.addCleanup(feeder.kill)
        self.assertEqual(feeder.stdout.readline(), "ready\n")
        be_hardware(feeder.pid, 95)  # it catches up after a delay
        daemon.start()
        wait_for(lambda: all(link_of(daemon, name)["open"] for name in CHANNELS), "the links")
        return daemon, feeder

    def test_nothing_is_lost(self):
        daemon, feeder = self.start()
        node, late = tactiled.Node(daemon.name), {name: [] for name in CHANNELS}
        before, cpu, began = {name: link_of(daemon, name) for name in CHANNELS}, cpu_s(), time.monotonic()
        feeder.stdin.write("go\n")
        feeder.stdin.flush()
        while time.monotonic() < began + SECONDS:
            for name in late:
                sample = node.latest(name)
                if sample.quality != tactiled.BAD:
                    late[name].append(latency_ms(name, sample))
            time.sleep(0.2)
        sent = json.loads(feeder.stdout.readline())
        cpu_after, seconds = cpu_s(), time.monotonic() - began
        time.sleep(1)  # time for frames on the way
        counted_s = time.monotonic() - began
        after = {name: link_of(daemon, name) for name in CHANNELS}
        feeder.stdin.write("end\n")
        feeder.stdin.flush()

        used = sum(s for s, _, _ in used_s(cpu, cpu_after, daemon.process.pid))
        print(f"\n{seconds:.1f} s; the daemon used {100 * used / seconds:.0f} % of one emulated core; the feeder's worst turn was "
              f"{sent['worst_late_ms']:.0f} ms late, {sent['refused']} of its messages found no room")
        print("busiest threads, % of one core (of them not in the kernel): " +
              ", ".join(f"{name} {100 * s / seconds:.0f} ({100 * user / seconds:.0f})" for s, user, name in used_s(cpu, cpu_after)[:10]))
        for name, stamps in late.items():
            stamps.sort()
            counted = {key: after[name][key] - before[name][key] for key in before[name] if isinstance(before[name][key], int)}
            rest = " ".join(f"{key} {value}" for key, value in counted.items() if value and key not in ("open", "bytes", "frames"))
            latency = f"p50 {stamps[len(stamps) // 2]:.1f}, p99 {stamps[len(stamps) * 99 // 100]:.1f} ms" if stamps else "never seen"
            print(f"{name:7} {counted['frames']:8} frames, {counted['frames'] / (sent['seconds'] if name in SENT_IN else counted_s):7.1f} a second; "
                  f"{'sent' if name in SENT_IN else 'last byte'} to shared memory {latency}  {rest}", flush=True)
            with self.subTest(link=name):
                for counter in ("lost", "ring_full", "overrun", "gone", "bad_checksum", "bad_length"):
                    if (name, counter) != ("i2c", "lost"):  # the emulated adapter is slower than the chip; missed
                                                            # conversions are reported
                        self.assertEqual(counted[counter], 0, counter)
                if name in SENT_IN:
                    self.assertEqual(counted["frames"], sent[name])
                if name == "modbus":
                    self.assertEqual(counted["bus_error"], 0)
        self.assertLess(sent["seconds"], 1.05 * SECONDS, "the host was too slow: these were not the rates that were asked for")


if __name__ == "__main__":
    unittest.main()
