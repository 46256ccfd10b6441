#!/usr/bin/env python3
"""The readout of the thesis' sensor, whole: five electrodes through an analog switch to an AD7746 behind a TCA9548A, a second AD7746
with a data-ready line, the film over a UART; calibrations with the printed curves; forces in registers, read by a Modbus client."""
import pathlib
import socket
import struct
import time
import unittest

from i2c_test import Bus
from machine import ROOT, Witness, gpio_chip, link_of, machine_daemon, wait_for
from tactiled import GOOD

LINKS = f"""
[realtime]
period_us = 2000  # the machine has one slow CPU

[[link]]
name = "bus"
driver = "i2c"
bus = "BUS"

[[link.chip]]
device = 0
chip = "ad7746"
mux = {{address = 0x70, channel = 2}}
rate_Hz = 9  # as the thesis; the emulated adapter takes up to some 10 ms for a transfer
electrodes = 5
select = {{chip = "tactile", lines = ["mux_sel0", "mux_sel1", "8"]}}

[[link.chip]]
device = 1
chip = "ad7746"
mux = {{address = 0x70, channel = 3}}
rate_Hz = 9
data_ready = {{chip = "tactile", line = "drdy0"}}

[[link]]
name = "mcu"
driver = "uart"
device = "{{folder}}/mcu"
path = "direct"
format = "lines"
channels = 2
sequence = true
checksum = true

[[sensor]]
name = "cap"
link = "bus"
device = 0
model = "capacitive"
temperature_range_C = [23, 23]
calibration = "{ROOT}/config/calibration/capacitive_documents.toml"
stale_ms = 10000  # of an emulated machine on a busy host; a frame is 5 conversions of 110 ms

[[sensor]]
name = "single"
link = "bus"
device = 1
counts_per_unit = {4.096 / 0x800000!r}
model = "generic"
calibration = "{{folder}}/unit1.toml"
stale_ms = 500

[[sensor]]
name = "film"
link = "mcu"
model = "piezo"
calibration = "{ROOT}/config/calibration/piezo_documents.toml"
stale_ms = 500
"""
CAP, FILM = 100, 150  # blocks of the first and the third sensor in the map
FX, FY, FZ = 4, 5, 6


def centre_pf(press_N):
    return 0.0008 * press_N ** 2 + 0.0405 * press_N + 1.3039


def side_pf(force_N):  # towards the electrode; an electrode on the other side sees the force with the other sign
    return 0.0071 * force_N ** 2 + 0.038 * force_N + 1.2285


class Registers:
    """A Modbus client of a few lines, function 3."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=5)
        self.transaction = 0

    def read(self, at, count):
        self.transaction += 1
        self.socket.sendall(struct.pack(">HHHBBHH", self.transaction, 0, 6, 1, 3, at, count))
        answer = b""
        while len(answer) < 9 + 2 * count:
            got = self.socket.recv(300)
            assert got, "the server has closed the connection"
            answer += got
        assert struct.unpack(">H", answer[:2])[0] == self.transaction and answer[7] == 3
        return struct.unpack(f">{count}H", answer[9:])

    def force_N(self, block, component):
        raw = self.read(block, 25)[component]
        return None if raw == 0x8000 else (raw - 0x10000 if raw > 0x7FFF else raw) * 0.01


class Chain(unittest.TestCase):
    def press(self, press_N, fx_N):
        values = [side_pf(fx_N), side_pf(-fx_N), side_pf(0), side_pf(0), centre_pf(press_N)]  # on +x, -x, +y, -y, and the centre
        for electrode, pf in enumerate(values):
            self.bus.tell(f"pF 0 {electrode} {pf!r}")

    def test_electrodes_through_switch_and_converter_and_the_film_become_forces_in_registers(self):
        self.bus = Bus("ad7746:0x48:0x70:2", "ad7746:0x48:0x70:3")
        self.addCleanup(lambda: self.bus.close())
        _, lines = gpio_chip()
        self.bus.tell("select 0 " + " ".join(f"{lines}/sim_gpio{n}/value" for n in (2, 3, 8)))
        self.bus.tell(f"line 1 {lines}/sim_gpio0/pull")
        self.press(0, 0)
        daemon = machine_daemon(LINKS.replace("BUS", self.bus.path))
        self.addCleanup(daemon.__exit__)
        rows = daemon.folder / "film.csv"
        rows.write_text("t_s,Vp,Cn\n" + "".join(f"{0.01 * n:.2f},0.0768,{centre_pf(3)!r}\n" for n in range(2)))
        daemon.play("--in", rows, "--pty", daemon.folder / "mcu", "--format", "lines", "--sequence", "--checksum", "--rate", 100, "--loop")
        daemon.start()
        single = Witness(daemon, "single")
        self.addCleanup(single.close)
        registers = Registers(daemon.port)
        self.addCleanup(registers.socket.close)
        wait_for(lambda: registers.force_N(CAP, FZ) == 0, "the unloaded sensor", 60)
        took = []
        for press_N, fx_N in ((1, 0), (4, 0.6), (8, -0.9), (0, 1.1)):
            self.press(press_N, fx_N)
            began = time.monotonic()
            wait_for(lambda: abs((registers.force_N(CAP, FZ) or 0) + press_N) < 0.011 and
                     abs((registers.force_N(CAP, FX) or 0) - fx_N) < 0.011, f"{press_N} N of press and {fx_N} N of shear in the registers", 60)
            took.append(time.monotonic() - began)
            self.assertAlmostEqual(registers.force_N(CAP, FY), 0, delta=0.011)
        print(f"a load is in the registers after {min(took) * 1000:.0f} .. {max(took) * 1000:.0f} ms", flush=True)

        # The film is constant at 0 V and is pressed with 3 N: after some time constants only the centre electrode
        # shows the press.
        wait_for(lambda: abs((registers.force_N(FILM, FZ) or 0) + 3) < 0.011, "3 N of the film", 60)
        # The second converter numbers its conversions: its values appear in order.
        numbers = [round(s.force_S_N[2]) for _, s in list(single.samples) if s.quality == GOOD]
        self.assertGreater(len(numbers), 20)
        self.assertEqual(numbers, sorted(set(numbers)))
        print(f"beside it {len(numbers)} of {numbers[-1] - numbers[0] + 1} conversions of the other converter", flush=True)

        # No chip answers any more: the registers contain no force, and it returns.
        self.bus.tell("dead 0 1")
        wait_for(lambda: registers.force_N(CAP, FZ) is None, "no force")
        self.assertIsNone(registers.force_N(CAP, FX))
        self.assertIsNotNone(registers.force_N(FILM, FZ))
        self.bus.tell("dead 0 0")
        wait_for(lambda: registers.force_N(CAP, FX) is not None, "the force again", 60)

        # The switch's chip is removed: the link is disconnected, and no electrode's value is taken for another's;
        # then it returns.
        live = pathlib.Path("/sys/kernel/config/gpio-sim/tactile/live")
        live.write_text("0")
        wait_for(lambda: registers.force_N(CAP, FZ) is None, "no force without the switch")
        wait_for(lambda: link_of(daemon, "bus")["gone"] >= 1, "the link to be gone")
        live.write_text("1")
        _, lines = gpio_chip()
        self.bus.tell("select 0 " + " ".join(f"{lines}/sim_gpio{n}/value" for n in (2, 3, 8)))
        self.press(5, 0)
        wait_for(lambda: abs((registers.force_N(CAP, FZ) or 0) + 5) < 0.011, "the force, with the switch", 60)
        counts = link_of(daemon, "bus")
        print(", ".join(f"{key} {counts[key]}" for key in ("frames", "lost", "bus_error", "gone", "opened", "restarted")), flush=True)


if __name__ == "__main__":
    unittest.main()
