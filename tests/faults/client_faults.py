"""Clients of the Modbus server that block it, disconnect, or are too many."""
import os
import socket
import struct
import time

from strikes import STRACE, strike


def connect(rig):
    return socket.create_connection(("127.0.0.1", rig.daemon.port), timeout=2)


def slow_client():
    def begin(rig):
        rig.slow, rig.closed = connect(rig), "not GOOD: left open; "
        before = rig.witness.answers
        for byte in struct.pack(">HHHBBHH", 1, 0, 6, 1, 4, 0, 10)[:6]:
            try:
                rig.slow.send(bytes([byte]))
            except OSError:
                rig.closed = "closed; "
                break
            time.sleep(0.3)
        rig.answers = rig.witness.answers - before
    return strike(begin, lambda rig: rig.slow.close(), lasts=0, expect=None, then=lambda rig: f"{rig.closed}{rig.answers} answers to the other client meanwhile")


def flood_of_connections():
    def begin(rig):
        before = rig.witness.answers
        rig.flood = []
        for _ in range(300):
            try:
                rig.flood.append(connect(rig))
            except OSError:
                pass
        time.sleep(1)
        rig.answers = rig.witness.answers - before
    return strike(begin, lambda rig: [c.close() for c in rig.flood], lasts=0, expect=None, then=lambda rig: f"{rig.answers} answers to the other client meanwhile")


def client_that_never_reads():
    def begin(rig):
        rig.deaf = connect(rig)
        rig.deaf.setblocking(False)
        request = struct.pack(">HHHBBHH", 1, 0, 6, 1, 4, 0, 125)
        until = time.monotonic() + 1
        while time.monotonic() < until:
            try:
                rig.deaf.send(request * 50)
            except OSError:
                time.sleep(0.01)
    return strike(begin, lambda rig: rig.deaf.close(), lasts=0, expect=None, then=lambda rig: f"{rig.witness.answers} answers to the other client")


def reset_in_the_middle():
    def begin(rig):
        for _ in range(200):
            c = connect(rig)
            c.send(b"\0\1\0\0\0\6\1")
            c.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            c.close()
    return strike(begin, lasts=0.3, expect=None, then=lambda rig: f"{len(os.listdir(f'/proc/{rig.daemon.process.pid}/fd'))} descriptors")


def failing_accepts():
    return strike(lambda rig: [connect(rig).close() for _ in range(20)], lasts=0.5, expect=None, before=(
        *STRACE, "-e", "trace=accept4,sendto", "-e", "inject=accept4:error=ECONNABORTED:when=3+3"))


def few_descriptors():
    def begin(rig):
        rig.many = []
        for _ in range(60):
            try:
                rig.many.append(connect(rig))
            except OSError:
                break
        rig.left.unplug()
    def end(rig):
        for c in rig.many:
            c.close()
        rig.left.plug()
    return strike(begin, end, lasts=1, before=("prlimit", "--nofile=40:40"))
