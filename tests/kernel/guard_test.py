#!/usr/bin/env python3
"""Drivers can and i2c under the guard of tests/guard, with faults of their buses. Inside the test machine."""
import json
import struct
import time
import unittest

from can_bus import ERROR, IP, PROTOCOL, Bus, Device, link
from i2c_test import LINKS, Bus as Adapter
from machine import ROOT, link_of, machine_daemon, sh, wait_for

GUARD = ROOT / "build/release/tests/guard/librtguard.so"
CLEAN = ("malloc", "free", "lock", "syscall", "minor_fault", "major_fault")


@unittest.skipUnless(GUARD.exists(), "the guard is for x86-64 in release")
class Guard(unittest.TestCase):
    def start(self, links, **plant):
        self.daemon = machine_daemon(links)
        self.addCleanup(self.daemon.__exit__)
        self.daemon.env.update(LD_PRELOAD=str(GUARD), RTGUARD_REPORT=str(self.daemon.folder / "guard.json"), **plant)
        self.daemon.start()

    def wait_for_frames(self, link, more):
        wanted = link_of(self.daemon, link)["frames"] + more
        wait_for(lambda: link_of(self.daemon, link)["frames"] >= wanted, f"frames of link {link}")

    def report(self):
        status, _ = self.daemon.stop()
        threads = [json.loads(line) for line in (self.daemon.folder / "guard.json").read_text().splitlines()]
        return status, [t for t in threads if t["thread"] != "links" or t["sections"] > 0]  # it reads links at high rates only

    def assert_clean(self, *calls):
        """`calls`: the numbers of the system calls of the two links; one of them is a tty's."""
        status, threads = self.report()
        self.assertEqual(sorted(t["thread"] for t in threads), ["link", "link", "pipeline"])
        for t in threads:
            self.assertGreater(t["sections"], 100)
            self.assertEqual({k: t[k] for k in CLEAN}, dict.fromkeys(CLEAN, 0), f"{t}\n{self.daemon.log()}")
        self.assertEqual({call for t in threads for call in t["allowed_calls"]}, {*calls, "0", "271"})  # read, ppoll
        self.assertEqual(status, 0)

    def test_a_can_link_is_clean_with_error_frames_a_flood_and_a_bus_that_goes_down(self):
        bus = Bus("vcan0")
        self.addCleanup(bus.close)
        self.start(link("vcan0"))
        device = Device(bus.sample)
        self.addCleanup(device.close)
        self.wait_for_frames("can", 50)
        for n in range(300):
            bus.send(ERROR | PROTOCOL, bytes(8))
            bus.send(0x123, struct.pack("<hH", n, n))
        sh(IP, "link", "set", "vcan0", "down")
        time.sleep(0.3)
        sh(IP, "link", "set", "vcan0", "up")
        self.wait_for_frames("can", 50)
        self.assertGreaterEqual(link_of(self.daemon, "can")["gone"], 1)
        self.assert_clean("299")  # recvmmsg

    def test_an_i2c_link_is_clean_with_a_chip_that_falls_silent_and_is_reset(self):
        bus = Adapter()
        self.addCleanup(bus.close)
        self.start(LINKS.replace("BUS", bus.path))
        self.wait_for_frames("bus", 50)
        bus.tell("dead 0 1")
        time.sleep(0.5)
        bus.tell("dead 0 0")
        self.wait_for_frames("bus", 50)
        bus.tell("reset 0")
        self.wait_for_frames("bus", 50)
        self.assertGreaterEqual(link_of(self.daemon, "bus")["restarted"], 1)
        self.assert_clean("16")  # ioctl; it waits with ppoll

    def test_a_planted_breach_is_found_on_this_machine_too(self):
        bus = Bus("vcan0")
        self.addCleanup(bus.close)
        self.start(link("vcan0"), RTGUARD_PLANT="open", RTGUARD_PLANT_THREAD="link")
        self.wait_for_frames("other", 600)  # a planted error occurs each 500 cycles
        status, threads = self.report()
        self.assertGreater(sum(t["syscall"] for t in threads if t["thread"] == "link"), 0)
        self.assertEqual(status, 97)


if __name__ == "__main__":
    unittest.main()
