"""Reads registers as fast as the server answers, 16 requests at a time, and counts answers that are not of one frame.

    /usr/bin/python3 tests/bench/torn_reads.py [READS]      a million takes about a minute
"""
import pathlib
import socket
import struct
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "system"))
from daemon import ROOT, Daemon  # noqa: E402
from map_test import CONFIG  # noqa: E402

AHEAD = 16


def main():
    reads = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    settings = "max_requests_per_s = 0\n\n[realtime]\nperiod_us = 250\n"
    with Daemon(settings + CONFIG) as daemon:
        daemon.play("--in", ROOT / "config/demo/table_demo.csv", "--pty", daemon.folder / "table", "--format", "cobs", "--bits", "32",
                    "--counts-per-unit", "1e9", "--speed", "40", "--loop")
        daemon.start()
        time.sleep(0.5)
        client = socket.create_connection(("127.0.0.1", daemon.port))
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        stream = client.makefile("rb", buffering=1 << 16)
        request = b"".join(struct.pack(">HHHBBHH", n, 0, 6, 1, 4, 0, 32) for n in range(AHEAD))
        torn, frames, last, began = 0, 0, None, time.monotonic()
        for _ in range(reads // AHEAD):
            client.sendall(request)
            for n in range(AHEAD):
                answer = stream.read(9 + 64)
                transaction, seq, end = struct.unpack_from(">H", answer)[0], answer[17:19], answer[71:73]
                torn += transaction != n or seq != end
                frames += seq != last
                last = seq
        seconds = time.monotonic() - began
        print(f"{reads} reads of 32 registers in {seconds:.1f} s, {frames} different frames ({frames / seconds:.0f} a second), {torn} torn")
        return 1 if torn else 0


if __name__ == "__main__":
    sys.exit(main())
