"""Arrays of taxels over UDP and TCP, with the release daemon: what readers see, and what they see when the device, the link or
the daemon fails."""
import math
import os
import signal
import socket
import struct
import sys
import threading
import unittest

from pymodbus.client import ModbusTcpClient

from daemon import ROOT, Daemon, ctl, wait_for
from array_device import ArrayDevice, array_daemon, with_crc
from unit_daemon import quality_is

sys.path.insert(0, str(ROOT / "node/python"))
import tactiled  # noqa: E402

FZ = 100 + 6  # register of the first sensor's fz, 0.01 N


def no_forces(array):
    return all(math.isnan(value) for row in array.force_S_N.tolist() for value in row)


class Datagrams(unittest.TestCase):
    def setUp(self):
        self.device = ArrayDevice(rows=8, columns=12, values=3).start()
        self.daemon = array_daemon(self.device, stale_ms=200)
        os.environ["TACTILED_RUNTIME_DIR"] = str(self.daemon.segment.parent)
        self.node = tactiled.open(self.daemon.name)

    def tearDown(self):
        self.node.close()
        self.daemon.__exit__()
        self.device.__exit__()

    def array(self):
        return self.node.array("skin")

    def test_readers_see_the_press_where_it_is(self):
        self.device.body = lambda _: (4e-3, -3e-3, 3.0, 5e-3)
        wait_for(lambda: abs(self.array().sample.force_S_N[2] + 3) < 0.3 and self.array().sample.quality == tactiled.GOOD, "3 N")
        array = self.array()
        self.assertEqual(array.n_out, 0)
        self.assertAlmostEqual(array.cop_S_m[0], 4e-3, delta=5 * array.cop_sd_m[0] + 1e-4)
        self.assertAlmostEqual(array.cop_S_m[1], -3e-3, delta=5 * array.cop_sd_m[1] + 1e-4)
        self.assertAlmostEqual(sum(row[2] for row in array.force_S_N.tolist()), array.sample.force_S_N[2], delta=1e-3)
        places = self.node.places("skin")
        peak = places[array.peak_taxel]
        self.assertLess(math.hypot(peak[0] - 4e-3, peak[1] + 3e-3), 2e-3)
        self.assertEqual(self.node.latest("skin").quality, tactiled.GOOD)

    def test_missing_and_saturated_taxels_have_no_force(self):
        self.device.missing = {5, 90}
        wait_for(lambda: self.array().n_out == 2, "two taxels out")
        array = self.array()
        self.assertEqual((array.state[5], array.state[90], array.state[6]), (tactiled.TAXEL_MISSING, tactiled.TAXEL_MISSING, 0))
        self.assertTrue(math.isnan(array.force_S_N.tolist()[5][2]))
        self.device.saturated = {40}
        wait_for(lambda: self.array().sample.reasons & tactiled.SATURATED, "saturated")
        self.assertEqual(self.array().sample.quality, tactiled.UNCERTAIN)

    def test_a_silent_device_has_no_forces(self):
        self.device.is_paused = True
        wait_for(lambda: self.array().sample.quality == tactiled.BAD, "no value")
        self.assertTrue(no_forces(self.array()))
        self.device.is_paused = False
        wait_for(lambda: self.array().sample.quality == tactiled.GOOD, "a value again")

    def test_a_dead_daemon_has_no_forces(self):
        self.assertFalse(no_forces(self.array()))
        os.kill(self.daemon.process.pid, signal.SIGKILL)
        wait_for(lambda: self.array().sample.quality == tactiled.BAD, "no value", 2)
        self.assertTrue(no_forces(self.array()))
        self.daemon.process.wait()

    def test_another_sender_is_counted_and_not_believed(self):
        self.device.body = lambda _: (0.0, 0.0, 1.0, 5e-3)
        wait_for(lambda: abs(self.array().sample.force_S_N[2] + 1) < 0.3, "1 N")
        stranger = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        numbers = [20000] * 288
        piece = with_crc(struct.pack("<BBBBIIHBBHH", 3, 0, 2, 0, self.device.sequence + 10, 0, 96, 3, 0, 0, 96) + struct.pack("<288h", *numbers))
        for _ in range(50):
            stranger.sendto(piece, ("127.0.0.1", self.device.listen))
        stranger.close()
        wait_for(lambda: "skipped_bytes" in self.daemon.ctl("status").stdout, "counted bytes")
        self.assertLess(abs(self.array().sample.force_S_N[2] + 1), 0.3)

    def test_a_tare_sets_every_taxel_to_zero(self):
        self.device.body = lambda _: (0.0, 0.0, 0.4, 5e-3)
        wait_for(lambda: abs(self.array().sample.force_S_N[2] + 0.4) < 0.1, "0.4 N")
        wait_for(lambda: self.daemon.ctl("tare", "skin").returncode == 0, "a tare")
        wait_for(lambda: abs(self.array().sample.force_S_N[2]) < 0.1, "0 N")
        array = self.array()
        self.assertEqual(array.sample.quality, tactiled.GOOD, array.sample.reasons_text)
        self.assertLess(max(abs(row[2]) for row in array.force_S_N.tolist()), 0.04)

    def test_a_restart_keeps_the_tare_of_the_wrench_and_not_of_the_taxels(self):
        """Without the zeros of the taxels no check sees their faults."""
        wait_for(lambda: self.daemon.ctl("tare", "skin").returncode == 0, "a tare")
        self.daemon.stop()
        self.daemon.start()
        wait_for(lambda: self.node.latest("skin").reasons_text == ["zero-unknown"], "a value again")
        self.assertEqual(self.node.latest("skin").quality, tactiled.UNCERTAIN)
        array = self.array()
        self.assertEqual(array.sample.reasons_text, ["zero-unknown"])
        self.assertTrue(math.isnan(array.cop_S_m[0]) and math.isnan(self.node.latest("skin").cop_S_m[0]))
        self.assertEqual(array.sample.quality, tactiled.UNCERTAIN)
        wait_for(lambda: self.daemon.ctl("tare", "skin").returncode == 0, "a tare")
        wait_for(lambda: self.array().sample.quality == tactiled.GOOD, "a known zero")

    def test_a_reload_with_taxels_of_other_components_is_refused(self):
        file = self.daemon.folder / "skin.toml"
        text = file.read_text().replace("[[0.001, 0, 0], [0, 0.001, 0], [0, 0, -0.001]]", "[[0, 0, -0.001]]")
        file.write_text(text.replace('["fx", "fy", "fz", "mx", "my", "mz"]', '["fz", "mx", "my"]'))
        self.daemon.process.send_signal(signal.SIGHUP)
        wait_for(lambda: "SIGHUP: refused" in self.daemon.log(), "a refusal")
        self.assertIn("the places and components of taxels", self.daemon.log())
        wait_for(lambda: self.array().sample.quality == tactiled.GOOD, "a value")

    def test_registers_have_the_wrench(self):
        self.device.body = lambda _: (0.0, 0.0, 3.0, 5e-3)
        plc = ModbusTcpClient("127.0.0.1", port=self.daemon.port)

        def force_N():
            word = plc.read_input_registers(FZ, count=1).registers[0]
            return (word - 0x10000 if word >= 0x8000 else word) / 100

        wait_for(lambda: abs(force_N() + 3) < 0.3, "3 N")
        plc.close()


class Refusals(unittest.TestCase):
    def test_a_calibration_of_another_shape_is_refused(self):
        with ArrayDevice(rows=8, columns=12) as device:
            daemon = Daemon(device.config().replace("taxels = 96", "taxels = 95"))
            (daemon.folder / "skin.toml").write_text(device.calibration())
            done = ctl("check", daemon.config)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn('is for 96 taxels of 1 values, link "skin" carries 95 taxels of 1 values', done.stderr)


class Stream(unittest.TestCase):
    """The same pieces over a TCP connection, coded with COBS."""

    @staticmethod
    def cobs(plain):
        out, block = bytearray(), bytearray()
        for byte in plain:
            if byte:
                block.append(byte)
            if not byte or len(block) == 254:
                out += bytes([len(block) + 1]) + block
                block.clear()
                if byte:
                    continue
        out += bytes([len(block) + 1]) + block
        return bytes(out) + b"\0"

    def test_readers_see_the_press(self):
        device = ArrayDevice(rows=16, columns=16)
        listener = socket.create_server(("127.0.0.1", 0))
        ended = threading.Event()

        def serve():
            connection = listener.accept()[0]
            while not ended.wait(0.01):
                numbers = device.numbers(0)
                for piece in device.pieces(device.sequence * 10_000, numbers):
                    try:
                        connection.sendall(self.cobs(piece))
                    except OSError:
                        return
                device.sequence += 1

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        text = device.config().replace('driver = "udp"', 'driver = "tcp"\nformat = "cobs"\npath = "direct"').replace("echo = true", "")
        text = text.replace(f"listen = {device.listen}\n", "").replace(f":{device.port}\"", f":{listener.getsockname()[1]}\"")
        daemon = Daemon(text)
        (daemon.folder / "skin.toml").write_text(device.calibration())
        with daemon.start():
            wait_for(quality_is(daemon, "good"), "a good value")
            os.environ["TACTILED_RUNTIME_DIR"] = str(daemon.segment.parent)
            with tactiled.open(daemon.name) as node:
                wait_for(lambda: abs(node.array("skin").sample.force_S_N[2] + 2) < 0.4, "2 N")
        ended.set()
        thread.join()
        listener.close()
        device.socket.close()


if __name__ == "__main__":
    unittest.main()
