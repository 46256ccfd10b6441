"""The register map as pymodbus reads it, over TCP or a serial line."""
import struct
import time

from pymodbus.client import ModbusTcpClient

if hasattr(ModbusTcpClient, "read_device_information"):  # pymodbus 3.8, Debian 13
    def device_information(client, code, first, slave):
        return client.read_device_information(read_code=code, object_id=first, slave=slave)

    def report_server_id(client, slave):
        return client.report_slave_id(slave=slave)

    def query_data(client, word, slave):
        """Returns the answer, and its data as bytes."""
        answer = client.diag_query_data(struct.pack(">H", word), slave=slave)
        return answer, answer.message

    def mask_write_register(client, address, and_mask, or_mask, slave):
        return client.mask_write_register(address=address, and_mask=and_mask, or_mask=or_mask, slave=slave)

    def write_and_read(client, address, values, read_address, count, slave):
        return client.readwrite_registers(read_address=read_address, read_count=count, write_address=address, values=values, slave=slave)
else:  # pymodbus 3.0, Debian 12
    from pymodbus.diag_message import ReturnQueryDataRequest
    from pymodbus.mei_message import ReadDeviceInformationRequest
    from pymodbus.other_message import ReportSlaveIdRequest

    def device_information(client, code, first, slave):
        return client.execute(ReadDeviceInformationRequest(code, first, unit=slave))

    def report_server_id(client, slave):
        return client.execute(ReportSlaveIdRequest(unit=slave))

    def query_data(client, word, slave):
        """Returns the answer, and its data as bytes."""
        answer = client.execute(ReturnQueryDataRequest(word, unit=slave))
        return answer, struct.pack(f">{len(answer.message)}H", *answer.message)

    def mask_write_register(client, address, and_mask, or_mask, slave):
        return client.mask_write_register(address, and_mask, or_mask, unit=slave)

    def write_and_read(client, address, values, read_address, count, slave):
        return client.readwrite_registers(
            read_address=read_address, read_count=count, write_address=address, write_registers=values, unit=slave)


class Pymodbus:
    def __init__(self, client, slave):
        """client: a connected ModbusTcpClient or ModbusSerialClient of pymodbus."""
        self.client = client
        self.slave = slave

    def holding(self, address, count=1):
        return self.registers(self.client.read_holding_registers(address, count=count, slave=self.slave))

    def input(self, address, count=1):
        return self.registers(self.client.read_input_registers(address, count=count, slave=self.slave))

    @staticmethod
    def registers(answer):
        assert not answer.isError(), answer
        return answer.registers

    @staticmethod
    def exception(answer):
        return answer.exception_code if answer.isError() else 0

    def written(self, answer):
        assert not answer.isError(), answer
        return answer

    def table(self):
        return {**self.reads(), **self.scratch(), **self.tares(), **self.refusals()}

    def reads(self):
        client, slave = self.client, self.slave
        constants = self.holding(9000, 12)
        raw = struct.pack(">12H", *constants)
        low = self.input(3102, 6)
        swapped = struct.pack(">6H", *(low[i ^ 1] for i in range(6)))
        coils = client.read_coils(0, count=34, slave=slave)
        inputs = client.read_discrete_inputs(32, count=2, slave=slave)
        return {
            "magic": self.holding(0, 2),
            "map_version": self.holding(2)[0],
            "constants": constants,
            "constants_fc4": self.input(9000, 12),
            "int16": struct.unpack_from(">h", raw, 2)[0],
            "int32": struct.unpack_from(">i", raw, 4)[0],
            "float_abcd": struct.unpack_from(">f", raw, 8)[0],
            "float_cdab": struct.unpack(">f", raw[14:16] + raw[12:14])[0],
            "text": raw[16:].decode(),
            "force_cN": list(struct.unpack(">3h", struct.pack(">3H", *self.input(104, 3)))),
            "force_N": list(struct.unpack(">3f", struct.pack(">6H", *self.input(2102, 6)))),
            "force_N_low_word_first": list(struct.unpack(">3f", swapped)),
            "inputs_ok": [int(bit) for bit in self.written(inputs).bits[:2]],
            "coils": [int(bit) for bit in self.written(coils).bits[:34]],
        }

    def scratch(self):
        client, slave = self.client, self.slave
        self.written(client.write_register(5100, 0xA55A, slave=slave))
        self.written(client.write_registers(5101, [1, 0xFFFF, 3], slave=slave))
        self.written(client.write_register(5104, 0x0012, slave=slave))
        self.written(mask_write_register(client, 5104, 0x00F2, 0x0025, slave))
        return {
            "scratch_fc6": self.holding(5100)[0],
            "scratch_fc16": self.holding(5101, 3),
            "scratch_fc22": self.holding(5104)[0],
            "scratch_fc23": self.write_and_read(5105, [4, 5, 6], 5105, 3),
        }

    def write_and_read(self, address, values, read_address, count):
        return self.registers(write_and_read(self.client, address, values, read_address, count, self.slave))

    def tares(self):
        seen = {}
        before, sequence = self.holding(120)[0], self.holding(25)[0] + 1
        self.written(self.client.write_registers(5000, [1, 1, 0, 0, sequence], slave=self.slave))
        seen["tare_block"] = self.finished(sequence, before)

        before, sequence = self.holding(120)[0], sequence + 1
        ack = self.write_and_read(5000, [1, 1, 0, 0, sequence], 25, 3)[0]
        later, *others = self.finished(sequence, before)
        seen["tare_fc23"] = [ack - sequence + later, *others]

        before = self.holding(120)[0]
        self.written(self.client.write_register(5010, 1, slave=self.slave))
        seen["tare_register"] = self.counted(before)

        before = self.holding(120)[0]
        self.written(self.client.write_coil(0, True, slave=self.slave))
        poll(lambda: self.client.read_coils(0, count=1, slave=self.slave).bits[0], lambda running: not running)
        seen["tare_coil"] = self.counted(before)
        return seen

    def finished(self, sequence, before):
        ack, state, result = poll(lambda: self.holding(25, 3), lambda seen: seen[0] == sequence and seen[1] != 1)
        return [ack - sequence, state, result, self.holding(120)[0] - before]

    def counted(self, before):
        now = poll(lambda: self.holding(120)[0], lambda seen: seen != before)
        poll(lambda: self.holding(7)[0], lambda status: not status & 0x100)
        return now - before

    def refusals(self):
        client, slave = self.client, self.slave
        self.written(client.write_coils(16, [True, False], slave=slave))
        identity = device_information(client, 1, 0, slave)
        return {
            "refused": [self.exception(answer) for answer in (
                client.write_register(0, 1, slave=slave),
                client.write_registers(9000, [1, 2], slave=slave),
                client.write_coil(34, True, slave=slave),
                client.write_coils(33, [False, False], slave=slave))],
            "refused_fc22": self.exception(mask_write_register(client, 0, 0, 1, slave)),
            "refused_fc23": self.exception(write_and_read(client, 0, [1], 0, 1, slave)),
            "fc17": self.exception(report_server_id(client, slave)),
            "identity": [self.written(identity).information[i].decode() for i in (0, 1)],
        }


def poll(read, good, seconds=30):
    until = time.monotonic() + seconds
    seen = read()
    while not good(seen) and time.monotonic() < until:
        time.sleep(0.005)
        seen = read()
    return seen
