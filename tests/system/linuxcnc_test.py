#!/usr/bin/env python3
"""The HAL component of node/bridges/linuxcnc compiles against LinuxCNC's own headers, and stays an example of 150 lines."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from daemon import ROOT  # noqa: E402

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


if __name__ == "__main__":
    unittest.main(verbosity=2)
