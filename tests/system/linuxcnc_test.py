#!/usr/bin/env python3
"""The HAL component of node/bridges/linuxcnc: it stays an example of 150 lines, compiles against LinuxCNC's own headers, and in a model of
HAL `valid` is TRUE for nothing but a value that may be used."""
import math
import mmap
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import ROOT, halt, wait_for  # noqa: E402
from forged_node import ForgedNode  # noqa: E402
from unit_daemon import CALIBRATION, quality_is, unit_daemon  # noqa: E402

sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

SOURCE = ROOT / "node/bridges/linuxcnc/tactiled_hal.c"
HEADERS = pathlib.Path(os.environ.get("LINUXCNC_INCLUDE", "/usr/include/linuxcnc"))


class LinuxCnc(unittest.TestCase):
    def test_it_is_an_example(self):
        self.assertLessEqual(len(SOURCE.read_text().splitlines()), 150)

    @unittest.skipUnless((HEADERS / "hal.h").exists(), "linuxcnc-uspace-dev is not installed")
    def test_it_compiles_without_a_warning(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run(["cc", "-O2", "-Wall", "-Wextra", "-Werror", "-DULAPI", f"-I{HEADERS}", f"-I{ROOT}/node/include",
                                   "-c", "-o", f"{folder}/tactiled_hal.o", SOURCE], capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stderr), (0, ""))


class Component:
    """The component in the model of HAL, in a folder of its own."""

    def __init__(self, folder, node):
        program, memory, pins = folder / "tactiled_hal", folder / "memory", folder / "pins"
        subprocess.run(["cc", "-O2", "-Wall", "-Wextra", "-DULAPI", f"-I{ROOT}/tests/system/fake_hal", f"-I{ROOT}/node/include", "-o", program, SOURCE, "-lm"], check=True)
        self.process = subprocess.Popen([program, node, "left"], env={**os.environ, "HAL_MEMORY": str(memory), "HAL_PINS": str(pins)})
        wait_for(lambda: pins.exists() and "accept-uncertain" in pins.read_text(), "the pins")
        self.at = {name.removeprefix("tactiled.left."): int(offset) for name, offset in map(str.split, pins.read_text().splitlines())}
        with open(memory, "r+b") as file:
            self.memory = mmap.mmap(file.fileno(), 4096)

    def bit(self, name):
        return bool(self.memory[self.at[name]])

    def set(self, name, value):
        self.memory[self.at[name]] = value

    def force(self):
        return [struct.unpack_from("d", self.memory, self.at[name])[0] for name in ("fx", "fy", "fz")]

    def close(self):
        self.process.kill()
        self.process.wait()
        self.memory.close()


class Hal(unittest.TestCase):
    def component(self, **kinds):
        self.daemon = unit_daemon(**kinds).start()
        self.addCleanup(shutil.rmtree, self.daemon.folder)
        self.addCleanup(self.daemon.__exit__)
        made = Component(self.daemon.folder, self.daemon.name)
        self.addCleanup(made.close)
        return made

    def test_a_good_value_is_valid_until_the_daemon_ends_or_stands_still(self):
        hal = self.component()
        for end in (signal.SIGSTOP, signal.SIGKILL):
            wait_for(lambda: hal.bit("valid"), "a good value")
            self.assertEqual((hal.force(), hal.bit("uncertain")), ([1, 2, -3], False))
            self.daemon.process.send_signal(end)
            if end == signal.SIGSTOP:
                halt(self.daemon.process.pid)
            wait_for(lambda: not hal.bit("valid"), "the end")
            self.assertTrue(all(map(math.isnan, hal.force())))
            self.daemon.process.send_signal(signal.SIGCONT)

    def test_a_simulated_value_is_marked(self):
        hal = self.component()
        wait_for(lambda: hal.bit("valid"), "a good value")
        self.assertFalse(hal.bit("simulated"))
        data = self.daemon.segment.read_bytes()
        self.daemon.stop()
        wait_for(lambda: not hal.bit("valid"), "the end of the daemon")
        with ForgedNode(self.daemon.name, data) as node:
            node.put_status(tactiled.SIMULATED)
            wait_for(lambda: hal.bit("valid") and hal.bit("simulated"), "a value that is marked")

    def test_an_uncertain_value_is_valid_on_request_alone(self):
        hal = self.component(calibration=CALIBRATION.replace("sd = [0.01, 0.01, 0.01]\n", ""))
        wait_for(quality_is(self.daemon, "uncertain"), "a doubtful value")
        wait_for(lambda: hal.bit("uncertain"), "the pin")
        self.assertFalse(hal.bit("valid"))
        self.assertTrue(all(map(math.isnan, hal.force())))
        hal.set("accept-uncertain", 1)
        wait_for(lambda: hal.bit("valid"), "the value")
        self.assertEqual((hal.force(), hal.bit("uncertain")), ([1, 2, -3], True))
        hal.set("accept-uncertain", 0)
        wait_for(lambda: not hal.bit("valid"), "the end of the value")


if __name__ == "__main__":
    unittest.main(verbosity=2)
