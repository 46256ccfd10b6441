"""A PLC with the printed text: one thread reads the view over Modbus, the other one is a task of 30 ms that calls the blocks in every cycle."""
import math
import socket
import struct
import time

from plc_view import SIZE, text
from st.interpreter import Program

from edges.output import Output

VIEW = 600


class Plc(Output):
    name, needs, lasts_s, stands = "PLC text", {"sensor", "daemon", "network"}, math.inf, True
    block, text = "FB_TACTILED_SENSOR", None

    def open(self):
        Plc.text = Plc.text or text()
        self.program, self.socket, self.registers, self.reads, self.called = Program(Plc.text), None, [0] * SIZE, 0, 0
        self.first, self.second = self.program.instance("FB_TACTILED"), self.program.instance(self.block)
        self.thread(self.read)
        self.thread(self.cycle)

    def read(self):
        time.sleep(0.03)
        self.registers = self.answer()
        self.reads += 1

    def answer(self):
        try:
            self.socket = self.socket or socket.create_connection(("127.0.0.1", self.rig.modbus), 0.3)
            self.socket.settimeout(0.3)
            self.socket.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 4, VIEW, SIZE))
            answer = b""
            while len(answer) < 9 + 2 * SIZE:
                if not (data := self.socket.recv(300)):
                    raise ConnectionError
                answer += data
            return list(struct.unpack(f">{SIZE}H", answer[9:]))
        except OSError:
            if self.socket:
                self.socket.close()
            self.socket = None
            raise

    def cycle(self):
        time.sleep(0.01)  # thread() sleeps for 20 ms
        reads = self.reads
        self.program.now_ms = int(time.monotonic() * 1000)
        self.first.call(VIEW_REGS=self.registers, READ_DONE=reads != self.called)
        self.called = reads
        self.use(self.first.values)
        self.show(self.value() if self.is_good() else None)

    def is_good(self):
        return self.second.value("OK")

    def use(self, pieces):
        self.second.call(SENSOR=pieces["SENSOR"][0])

    def value(self):
        return (self.second.value("FZ_N"), time.monotonic() - self.second.value("AGE_MS") / 1000)


class PlcWeight(Plc):
    name, needs, block = "PLC text, weight", Plc.needs - {"sensor"}, "FB_TACTILED_WEIGHT"

    def use(self, pieces):
        self.second.call(**{name: pieces[name] for name in ("NODE", "GRASP", "DOUBTS")})

    def value(self):
        return (self.second.value("WEIGHT_KG"), self.told(self.second.value("WEIGHT_KG")))


class PlcTool(Plc):
    name, needs, block = "PLC text, wrench on the gripper", Plc.needs - {"sensor"}, "FB_TACTILED_WRENCH"

    def use(self, pieces):
        self.second.call(WRENCH=pieces["WRENCH"])

    def value(self):
        return (self.second.value("FZ_N"), self.told(self.second.value("FZ_N")))
