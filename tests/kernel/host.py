#!/usr/bin/env python3
"""host.py FOLDER: runs outside of the test machine: a USB serial cable that the test inside disconnects and connects.

Commands come through the machine's second serial port, FOLDER/control.sock: "plug" connects FOLDER/usb.sock, which
QEMU shows as an FTDI adapter, "line" sends the next "n,value" line with a checksum, "unplug" ends the connection. The
machine inside sets the pace, because its clock differs.
"""
import pathlib
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
    control, usb, number, words = connected(folder / "control.sock"), None, 0, b""
    while got := control.recv(4096):
        words += got
        *commands, words = words.split(b"\n")
        for command in commands:
            if command == b"plug":
                usb = connected(folder / "usb.sock")
            elif command == b"unplug" and usb:
                usb.close()
                usb = None
            elif command == b"line" and usb:
                usb.sendall(line(number, 2.5))
                number += 1


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
