"""A device, or a relay on the way from it to the daemon, as a process of its own.

    relay.py SOURCE SINK         SOURCE: device:RATE_Hz:FIELDS (of "sequence", "clock", joined by +), tcp:HOST:PORT, tty:PATH
                                 SINK: tcp:HOST (a free port, which is printed), pty (its path is printed)

Each line of the device ends with the CLOCK_MONOTONIC milliseconds at which it was measured, counted from $BEGAN_MS, so that a
reader knows the true age of each value. Commands come as lines on standard input:

    lag S         each line is passed on S seconds after it came
    hold S        nothing is passed on for S seconds, then all at once
    pause S       the device measures nothing for S seconds
    pace S        one line is passed on every S seconds, by the relay's own timer; the others wait
    cap N         at most N lines wait; the oldest ones are lost
    fast PPM      the device, its clock and its rate, is fast by PPM
    keep 1        while no client is connected lines wait, and come later from then on; until keep 0: they are lost, those that wait, too
    fifo N        N bytes wait in the device while the port takes none, as in the firmware of a USB port; later ones are lost
    lose N        N bytes of the stream are lost, once
    swap 1        each second line is passed on before the one that came before it
    repeat_old S  the next line carries the value of S seconds ago under its new number
    jump S        the device's clock is set on by S seconds
    ahead S       the true time is S seconds ahead of CLOCK_MONOTONIC: the machine was suspended, the device was not
    restart       the device's counter and clock begin again
    unit K        the device's clock counts K in a microsecond
    retain 1      each new client gets the last line first
    kick          the clients are disconnected
"""
import collections
import contextlib
import os
import pty
import select
import socket
import sys
import time
import tty


def crc16(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = ((crc << 1) ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


class Device:
    def __init__(self, rate_Hz, fields):
        self.period_s, self.fields, self.n = 1 / rate_Hz, fields, 0
        self.clock_zero_s, self.paused_until, self.ahead_s, self.old_s = 0.0, 0.0, 0.0, 0.0
        self.clock_unit, self.fast = 1, 1.0
        self.due = time.monotonic()
        self.past = collections.deque(maxlen=2000)

    def lines(self, now):
        while self.due <= now:
            self.due += self.period_s / self.fast
            if self.due < self.paused_until:
                continue
            true_s = self.due + self.ahead_s
            cells = [str(self.n)] if "sequence" in self.fields else []
            content = ["%d" % (int((true_s - self.clock_zero_s) * 1e6 * self.clock_unit * self.fast) & 0xFFFFFFFF)] if "clock" in self.fields else []
            content.append("%.3f" % (true_s * 1000 - float(os.environ["BEGAN_MS"])))
            self.past.append((true_s, content))
            if self.old_s:
                content = next(old for t, old in self.past if t >= true_s - self.old_s)
                self.old_s = 0.0
            body = ",".join(cells + content).encode()
            self.n = self.n + 1 & 0xFFFFFFFF
            yield body + b"*%04X\n" % crc16(body)


class Sink:
    def __init__(self, where):
        self.clients, self.fifo, self.fifo_bytes = [], b"", 0
        self.last, self.retains = b"", False
        if where == "pty":
            self.master, self.slave = pty.openpty()  # the slave stays open, so that a daemon may come and go
            tty.setraw(self.slave)
            os.set_blocking(self.master, False)
            self.server, self.name = None, os.ttyname(self.slave)
        else:
            self.server = socket.create_server((where.split(":")[1], 0))
            self.server.setblocking(False)
            self.name = "%s:%d" % self.server.getsockname()[:2]

    def fds(self):
        return [self.server, *self.clients] if self.server else []

    def serve(self, ready):
        if self.server in ready:
            client = self.server.accept()[0]
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.clients = [client]
            if self.retains:
                client.sendall(b"# welcome\n" + self.last)
        for client in [c for c in self.clients if c in ready]:
            with contextlib.suppress(OSError):
                if client.recv(4096):
                    continue
            self.clients.remove(client)
            client.close()

    def is_open(self):
        return self.server is None or bool(self.clients)

    def kick(self):
        while self.clients:
            self.clients.pop().close()

    def send(self, data):
        self.last = data
        with contextlib.suppress(OSError):
            if self.server is None:
                if self.fifo_bytes and len(self.fifo) + len(data) <= self.fifo_bytes:
                    self.fifo, data = self.fifo + data, b""
                if self.fifo_bytes:
                    self.fifo = self.fifo[os.write(self.master, self.fifo):]
                else:
                    os.write(self.master, data)
            elif self.clients:
                self.clients[0].sendall(data)


def main(source, sink):
    kind, _, rest = source.partition(":")
    device = reader = None
    if kind == "device":
        rate, _, fields = rest.partition(":")
        device = Device(float(rate), fields)
    elif kind == "tcp":
        host, port = rest.rsplit(":", 1)
        reader = socket.create_connection((host, int(port)))
    else:
        reader = open(rest, "rb", buffering=0)
    sink = Sink(sink)
    print(sink.name, flush=True)
    way, rest = collections.deque(), b""
    state = {"lag": 0.0, "keep": 0.0, "lose": 0.0, "swap": 0.0, "pace": 0.0, "cap": 0.0}
    held_until, moved_s, late, paced_until = 0.0, 0.0, None, 0.0
    while True:
        now = time.monotonic()
        until = [device.due] if device else []
        until += [max(way[0][0], held_until, paced_until)] if way and (sink.is_open() or not state["keep"]) else []
        ready = select.select([sys.stdin, *([reader] if reader else []), *sink.fds()], [], [], max(0.0, min(until, default=now + 1) - now))[0]
        now = time.monotonic()
        sink.serve(ready)
        commands = os.read(0, 65536) if sys.stdin in ready else b"\n"
        if not commands:
            return
        for command in filter(None, commands.decode().split("\n")):
            word, _, value = command.partition(" ")
            value = float(value or 0)
            if word == "hold":
                held_until = now + value
            elif word == "pause":
                device.paused_until = now + value
            elif word == "jump":
                device.clock_zero_s -= value
            elif word == "ahead":
                device.ahead_s = value
            elif word == "repeat_old":
                device.old_s = value
            elif word == "fifo":
                sink.fifo_bytes = int(value)
            elif word == "unit":
                device.clock_unit = int(value)
            elif word == "fast":
                device.fast = 1 + value / 1e6
            elif word == "retain":
                sink.retains = bool(value)
            elif word == "kick":
                sink.kick()
            elif word == "restart":
                device.n, device.clock_zero_s = 0, now + device.ahead_s - 0.1
            else:
                state[word] = value
                moved_s = moved_s if state["keep"] else 0.0
        lines = list(device.lines(now)) if device else []
        if reader in ready:
            data = reader.recv(65536) if isinstance(reader, socket.socket) else reader.read(4096)
            if not data:
                return
            *lines, rest = (rest + data).split(b"\n")
            lines = [line + b"\n" for line in lines]
        for line in lines:
            if state["swap"] and late is None:
                late = line
                continue
            for each in [line] if late is None else [line, late]:
                way.append((max(now + moved_s + state["lag"], way[-1][0] if way else 0.0), each))
            late = None
        if state["keep"] and not state["pace"] and not sink.is_open():  # it goes on where it was, as slowly as before
            late_s = max(0.0, now - way[0][0]) if way else 0.0
            moved_s += late_s
            way = collections.deque((t + late_s, line) for t, line in way)
        while way and (len(way) > state["cap"] > 0 or not (sink.is_open() or state["keep"])):
            way.popleft()
        while way and way[0][0] <= now >= max(held_until, paced_until) and (sink.is_open() or not state["keep"]):
            line = way.popleft()[1]
            paced_until = max(paced_until + state["pace"], now - state["pace"])
            if state["lose"]:
                cut = min(len(line), int(state["lose"]))
                line, state["lose"] = line[cut // 2:len(line) - (cut - cut // 2)], 0.0
            sink.send(line)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt, ConnectionError):
        main(*sys.argv[1:])
