"""Recordings with other bytes than tactilectl writes. Chunks are not compressed."""
import struct
import zlib


def records(data, at):
    """Begin and end of the content of each record of an MCAP file, with its kind."""
    while at + 9 <= len(data):
        kind, size = struct.unpack_from("<BQ", data, at)
        yield kind, at + 9, at + 9 + size
        at += 9 + size


def chunks(data):
    """Begin of the content and of the messages, and the end, of each uncompressed chunk."""
    for kind, begin, end in records(data, 8):
        if kind == 6:
            yield begin, begin + 28 + 4 + struct.unpack_from("<I", data, begin + 28)[0] + 8, end


def with_checksums(data):
    data = bytearray(data)
    for begin, first, end in chunks(data):
        struct.pack_into("<I", data, begin + 24, zlib.crc32(data[first:end]))
    return bytes(data)


def with_quality(data, quality):
    """A recording in which every second sample has this quality, and its numbers."""
    data = bytearray(data)
    samples = {bytes(data[begin:begin + 2]) for kind, begin, end in records(data, 8) if kind == 4 and b"/sample" in data[begin:end]}
    for _, first, end in chunks(data):
        messages = [at for kind, at, _ in records(data[:end], first) if kind == 5 and bytes(data[at:at + 2]) in samples]
        for at in messages[::2]:
            struct.pack_into("<I", data, at + 22 + 40, quality)
    return with_checksums(data)
