#!/usr/bin/env python3
"""host.py FOLDER: outside of the test machine: a USB serial cable that the test inside pulls and plugs.

Commands come through the machine's second serial port, FOLDER/control.sock: "plug RATE" connects FOLDER/usb.sock, which QEMU
shows as an FTDI adapter, and sends "n,value" lines with a checksum RATE times a second; "unplug" ends the connection.
"""
import pathlib
import select
import socket
import sys
import time


def connected(path):
    for _ in range(500):
        try:
            s = socket.socket(socket.AF_UNIX)
            s.connect(str(path))
            return s
        except OSError:
            time.sleep(0.02)
    raise SystemExit(f"host.py: {path} does not appear")


def line(number, value):
    text = f"{number},{value}"
    check = 0
    for c in text.encode():
        check ^= c
    return f"{text}*{check:02X}\n".encode()


def main(folder):
    control, usb, period_s, number, words = connected(folder / "control.sock"), None, 0.01, 0, b""
    due = time.monotonic()
    while True:
        wait_s = max(0, due - time.monotonic()) if usb else None
        if select.select([control], [], [], wait_s)[0]:
            got = control.recv(256)
            if not got:
                return
            words += got
            while b"\n" in words:
                command, words = words.split(b"\n", 1)
                if command.startswith(b"plug"):
                    period_s, due, usb = 1 / float(command.split()[1]), time.monotonic(), connected(folder / "usb.sock")
                elif command == b"unplug" and usb:
                    usb.close()
                    usb = None
        while usb and time.monotonic() >= due:
            usb.sendall(line(number, 2.5))
            number += 1
            due += period_s


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
