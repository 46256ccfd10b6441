#!/usr/bin/env python3
"""Starts a daemon without a limit of requests and measures its Modbus server with modbus_load, beside a bare echo.

    modbus_beside.py [ROUNDS]      5 rounds take a minute; TACTILED_BIN=FOLDER measures another build
"""
import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "system"))
from daemon import BIN  # noqa: E402
from unit_daemon import CONFIG, unit_daemon  # noqa: E402

if __name__ == "__main__":
    with unit_daemon(config="max_requests_per_s = 0\nmax_clients = 64\n" + CONFIG) as daemon:
        daemon.start()
        words = [BIN / "modbus_load", str(daemon.port), str(daemon.process.pid), sys.argv[1] if len(sys.argv) > 1 else "5"]
        sys.exit(subprocess.run(words, check=False).returncode)
