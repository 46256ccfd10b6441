"""read_mcap.py FILE: messages of each topic of an MCAP file, by the specification (mcap.dev/spec) and Debian's lz4
and zstandard. Every CRC, every index entry and the statistics are checked; a difference raises an exception."""
import json
import pathlib
import struct
import sys
import zlib

import lz4.frame
import zstandard

MAGIC = b"\x89MCAP0\r\n"
EXPAND = {"": bytes, "lz4": lz4.frame.decompress, "zstd": lambda data: zstandard.ZstdDecompressor().decompress(data)}


class Fields:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, n):
        assert self.at + n <= len(self.data), "a field is cut"
        self.at += n
        return self.data[self.at - n:self.at]

    def number(self, kind):
        return struct.unpack("<" + kind, self.take(struct.calcsize("<" + kind)))[0]

    def text(self):
        return self.take(self.number("I")).decode()


def records(data, at=0):
    """Returns (offset, opcode, content) of each record."""
    while at < len(data):
        op, size = struct.unpack_from("<BQ", data, at)
        assert at + 9 + size <= len(data), f"the record at {at} is cut"
        yield at, op, data[at + 9:at + 9 + size]
        at += 9 + size


def messages(path):
    """Returns (topic, sequence, data) of each message, in the order of the file, which may be cut."""
    data, topics = pathlib.Path(path).read_bytes(), {}
    try:
        for _, op, content in records(data, len(MAGIC)):
            f = Fields(content)
            if op == 0x04:
                number = f.number("H")
                f.number("H")
                topics[number] = f.text()
            elif op == 0x06:
                f.take(28)
                kind = f.text()
                for _, _, message in records(EXPAND[kind](f.take(f.number("Q")))):
                    channel, sequence = struct.unpack_from("<HI", message)
                    yield topics[channel], sequence, message[22:]
            elif op == 0x0F:  # the end of the data; the index has the channels once more
                return
    except AssertionError:
        return


def read(path):
    data = pathlib.Path(path).read_bytes()
    assert data.startswith(MAGIC) and data.endswith(MAGIC)
    body = data[:-len(MAGIC)]
    topics, count, chunks, attachments, chunk = {}, {}, {}, {}, None
    total, statistics, kinds = 0, None, set()
    for at, op, content in records(body, len(MAGIC)):
        f = Fields(content)
        if op == 0x04:
            number = f.number("H")
            f.number("H")
            topics[number] = f.text()
        elif op == 0x06:
            begin, end, size, crc = f.number("Q"), f.number("Q"), f.number("Q"), f.number("I")
            kind = f.text()
            kinds.add(kind)
            chunk = EXPAND[kind](f.take(f.number("Q")))
            assert len(chunk) == size and zlib.crc32(chunk) == crc, f"the chunk at {at} is damaged"
            chunks[at] = kind
            for _, inner, message in records(chunk):
                assert inner == 0x05
                channel, _, time_ns = struct.unpack_from("<HIQ", message)
                assert begin <= time_ns <= end
                count[channel] = count.get(channel, 0) + 1
                total += 1
        elif op == 0x07:
            channel, entries = f.number("H"), Fields(f.take(f.number("I")))
            while entries.at < len(entries.data):
                time_ns, offset = entries.number("Q"), entries.number("Q")
                assert struct.unpack_from("<HIQ", chunk, offset + 9)[::2] == (channel, time_ns), "an index entry is wrong"
        elif op == 0x08:
            f.take(16)
            start = f.number("Q")
            f.number("Q")
            f.take(f.number("I"))
            f.number("Q")
            assert chunks[start] == f.text(), "a chunk index is wrong"
        elif op == 0x09:
            f.take(16)
            name, _ = f.text(), f.text()
            attachments[name] = len(f.take(f.number("Q")))
            assert zlib.crc32(content[:f.at]) == f.number("I"), name
        elif op == 0x0B:
            statistics = f.number("Q")
        elif op == 0x02:
            summary = struct.unpack_from("<Q", content)[0]
            assert zlib.crc32(data[summary:at + 9 + 16]) == struct.unpack_from("<I", content, 16)[0], "the summary is damaged"
    assert statistics == total, "the statistics are wrong"
    return {"messages": total, "topics": {topics[n]: c for n, c in count.items()}, "compression": sorted(kinds), "attachments": attachments}


if __name__ == "__main__":
    print(json.dumps(read(sys.argv[1])))
