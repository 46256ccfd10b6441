#!/usr/bin/env python3
"""No reader sees a mixture of two arrays, while the daemon writes them at 1 kHz and readers in C, C++ and Python read them as
fast as they can. SECONDS=600 in the environment: a longer run, which prints its counts."""
import os
import time
import unittest

from array_device import array_daemon
from array_ramp import Ramp, Witnesses

SECONDS = float(os.environ.get("SECONDS", 5))
STALE_MS = 1000


class TornReads(unittest.TestCase):
    def test_no_array_is_a_mixture(self):
        # An array of 16 kB: a reader copies it for so long that the daemon may overwrite it meanwhile.
        with Ramp(rows=32, columns=32, values=3, rate_Hz=1000) as device, array_daemon(device, stale_ms=STALE_MS) as daemon:
            with Witnesses(daemon.name, "skin", STALE_MS, daemon.reader_env) as witnesses:
                time.sleep(SECONDS)
        if "SECONDS" in os.environ:
            print(witnesses)
        self.assertEqual(witnesses.faults(), {})


if __name__ == "__main__":
    unittest.main()
