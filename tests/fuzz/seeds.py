#!/usr/bin/env python3
"""seeds.py FOLDER: a few good inputs for each fuzz target, FOLDER/TARGET/: what no fuzzer would guess, such as a right checksum."""
import pathlib
import random
import struct
import sys
import tomllib
import zlib

ROOT = pathlib.Path(__file__).resolve().parents[2]


def crc16(data, reflected_polynomial=0xA001, crc=0xFFFF):
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ reflected_polynomial if crc & 1 else crc >> 1
    return crc


def cobs_crc(data):  # CRC-16/CCITT-FALSE, as drivers/wire/cobs_frame.md says
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021) & 0xFFFF if crc & 0x8000 else crc << 1 & 0xFFFF
    return crc


def cobs(data):
    out, block = b"", b""
    for byte in data:
        if byte == 0 or len(block) == 254:
            out += bytes([len(block) + 1]) + block
            block = b""
            if byte == 0:
                continue
        block += bytes([byte])
    return out + bytes([len(block) + 1]) + block + b"\0"


def checked_line(text):
    check = 0
    for c in text.encode():
        check ^= c
    return f"{text}*{check:02X}\n".encode()


def wire(put):
    formats = 11  # number in the target; 253 is a multiple of it
    stream = b"".join(checked_line(f"{n},{1000 * n},{n * 0.5},,nan") for n in range(5))
    put(bytes([0]) + stream)
    put(bytes([formats * 3]) + b"1,2,3,4,5\r\n2,3,4,5,6\r\n# nothing\n")
    for chunk in (0, 6, 40):
        frame = b"\x20\x4e" + struct.pack("<6h", 1, -2, 300, 4, -5, 6)
        put(bytes([formats * chunk % 253 + 2]) + (frame + struct.pack("<H", crc16(frame))) * 3)
        put(bytes([formats * chunk % 253 + 3]) + b"F={1.5,-2.0,3.25,0.1,0.2,0.3},%d\n" % (10 + chunk) * 3)
    answer = bytes([9, 3, 4, 0, 1, 0xFF, 0xFE])
    put(bytes([4]) + answer + struct.pack("<H", crc16(answer)))
    refusal = bytes([9, 0x83, 2])
    put(bytes([4 + formats]) + refusal + struct.pack("<H", crc16(refusal)))
    put(bytes([5]) + bytes.fromhex("202000000007") + answer)
    put(bytes([5 + formats * 2]) + bytes.fromhex("202000000003") + refusal)
    for kind, width in ((1, 3), (2, 4)):
        for flags in range(4):
            body = bytes([kind, 2, 3, flags]) + struct.pack("<HI", 7, 1000) + (struct.pack("<I", 2) if flags & 1 else b"") + bytes(range(3 * width))
            put(bytes([1]) + cobs(body + struct.pack("<H", cobs_crc(body))) * 2)
            put(bytes([6]) + body)  # the target adds the rest
    for channels in (32, 33, 60):
        put(bytes([6]) + bytes([1, 0, channels, 0]) + bytes(6) + bytes(range(3 * channels)))
        put(bytes([0]) + checked_line(",".join(str(n) for n in range(channels + 2))) + b"0,0,inf,-inf,1\n")
    put(bytes([0]) + b"\n0,0,inf,-inf,1\n1,2,1e999,3,4\n")
    put(bytes([7]) + struct.pack("<6h", 1, -2, 300, 4, -5, 6))
    put(bytes([8]) + answer)
    for choice in range(12):  # selects a registered format; then bytes of each kind
        put(bytes([10, choice]) + b"\n1,2,3\n2,,4\n1a2B\n0F00\n\0" + cobs(bytes(20)) + (frame + struct.pack("<H", crc16(frame))) + b"F={1,2,3,4,5,6},7\n")
    put(bytes([9]) + b"31\r\n00aBf\r\n1bf00\n2BF7f\r\n2BF7f\r\n7c012\n80102\n")


def array(put):
    for kind in (2, 3, 10, 18, 26, 250):  # a whole frame of each type, twice, and in two pieces
        for kind_of_number in range(6):
            whole = bytes([kind, kind_of_number, 0]) + bytes(1 if kind % 2 else 4) + bytes([1, 0, 4]) + bytes(range(32))
            put(bytes([3, 0, 2]) + whole * 2)
    put(bytes([3, 0, 2]) + bytes([3, 1, 0, 5, 1, 0, 2, 1, 2, 3, 1, 0, 5, 1, 2, 2, 3, 4, 1, 0, 0, 7, 1, 2]))


def dbc(put):
    put(b"BO_ 256 Tip: 8 X\n SG_ Fx : 0|16@1- (0.01,0) [-10|10] \"N\" X\n SG_ Count : 56|8@1+ (1,0) [0|0] \"\" X\n")
    put(b"BO_ 2147484000 Ext: 64 X\n SG_ S M : 0|8@1+ (1,0)\n SG_ A m0 : 15|16@0- (1,0)\n SG_ B m1 : 8|32@1- (1,0)\nSIG_VALTYPE_ 2147484000 B : 1;\n")
    put(b"VERSION \"\"\nNS_ :\nBS_:\nBU_: X\nBO_ 1 D: 8 X\n SG_ V : 0|64@1+ (0.5,-3)\nSIG_VALTYPE_ 1 V : 2;\nSG_MUL_VAL_ 1 V V 0-0;\nCM_ \"text\";\n")


def modbus(put):
    for pdu in ("01 0000 0008", "02 0000 0010", "03 0000 0020", "03 0064 007D", "03 0064 007E", "04 0064 0019", "05 0000 FF00", "06 13EC 0001", "0F 0000 0004 01 0F",
                "10 13EC 0002 04 0001 0002", "16 13EC 00F2 0025", "17 0000 0004 13EC 0001 02 0005", "2B 0E 01 00", "07", "03 2328 000C"):
        body = bytes.fromhex(pdu)
        put(struct.pack(">HHHB", 1, 0, len(body) + 1, 1) + body)
    put(bytes.fromhex("000100000006010300000020") * 4)


def record(op, content):
    return bytes([op]) + struct.pack("<Q", len(content)) + content


def text(value):
    return struct.pack("<I", len(value)) + value


def mcap(put):
    schema = record(3, struct.pack("<H", 1) + text(b"tactiled_msgs/msg/Frame") + text(b"ros2msg") + text(b"uint64 t_ns"))
    metadata = text(b"link") + text(b"usb0")
    channel = record(4, struct.pack("<HH", 1, 1) + text(b"/node/link/usb0/frames") + text(b"cdr") + text(metadata))
    body = b"\0\1\0\0" + struct.pack("<iIQQIIIIHBxI2d", 1, 2, 3, 4, 5, 1, 0, 0, 0, 1, 2, 2.5, -1)
    message = record(5, struct.pack("<HIQQ", 1, 0, 3, 3) + body)
    header = record(1, text(b"") + text(b"tactiled"))
    end = record(15, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0)) + b"\x89MCAP0\r\n"
    put(header + schema + channel + message * 2 + end)
    inside = schema + channel + message
    stranger = record(5, struct.pack("<HIQQ", 9, 0, 3, 3) + body)  # belongs to no channel
    put(header + record(6, struct.pack("<QQQI", 3, 3, len(stranger), 0) + text(b"") + struct.pack("<Q", len(stranger)) + stranger) + end)
    for crc in (0, zlib.crc32(inside), 1):
        chunk = record(6, struct.pack("<QQQI", 3, 3, len(inside), crc) + text(b"") + struct.pack("<Q", len(inside)) + inside)
        put(header + chunk + end)
    put(header + record(9, struct.pack("<QQ", 1, 1) + text(b"config.toml") + text(b"text/plain") + struct.pack("<Q", 3) + b"abc" + struct.pack("<I", 0)))


def tomls(*folders):
    def given(put):
        for folder in folders:
            for file in sorted((ROOT / folder).glob("*.toml")):
                if file.stat().st_size < 20_000:
                    put(file.read_bytes())
    return given


def decouple(put):
    rng = random.Random(1)
    generic = b'format = 1\nmodel = "generic"\nmethod = "matrix"\ncontact_model = "unknown"\nchannels = ["a", "b", "c"]\nchannel_unit = "N"\n' \
        b'zero = [0.0, 0.0, 0.0]\ncomponents = ["fx", "fz"]\nmatrix = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]\nsd = [0.01, 0.01]\nfull_scale = [10.0, 10.0]\n'
    files = [file.read_bytes() for file in sorted((ROOT / "config/calibration").glob("*.toml")) if file.stat().st_size < 20_000]
    for text in [generic, *files]:
        readings = b""
        for missing, saturated in ((0, 0), (1, 0), (4, 2), (0, 0)):
            how = (missing != 0) + 2 * (saturated != 0)
            readings += bytes([20, how]) + (struct.pack(">I", missing) if how & 1 else b"") + (struct.pack(">I", saturated) if how & 2 else b"")
            readings += b"".join(struct.pack("<d", rng.uniform(-0.01, 2)) for _ in tomllib.loads(text.decode())["channels"])
        put(text + b"\0" + readings)
        put(text + b"\0" + readings.replace(bytes([20, 0]), bytes([20, 4]), 1))
    put(generic + b"\0" + bytes([20, 0]) + struct.pack("<3d", 1.5e308, 1.5e308, 0))  # twice that is too much


def csv(put):
    put(b"t_s,R1,R3\n0,0.5,\n0.01,nan,-1e-3\n")
    put(b'\xef\xbb\xbf"t_s" , "fx ""N"""\r\n\r\n+1.5 ,"2"\r\n')
    put(b"t_s;R1\n0;1\n")
    put(b"t_s,R1\n0,+-3\n1,-+3\n2,+3\n")


def address(put):
    for line in (b"192.168.0.0/24\0\0\0\1", b"10.1.2.3/32", b"fd00::/8\0abcdefghijklmnop", b"::1/128", b"0.0.0.0/0", b"127.0.0.1:1502", b"[::1]:502", b"0.0.0.0:502", b"192.168.0.5/24"):
        put(line)


def registers(put):
    blocks(3, 8, 300)(put)
    put(bytes.fromhex("00000000 04 00 00 01 7F800000"))  # a float32 at 0 that is infinite; then one that is none
    put(bytes.fromhex("00000000 04 00 00 01 7FC00000"))


def server(put):
    blocks(6, 8, 120)(put)
    for size in (8, 12, 40, 100, 130):  # a whole request, then twice that and what is none; each is served, and heard
        request = bytes.fromhex("00010000") + struct.pack(">HBB", size - 6, 1, 4) + bytes(size - 8)
        put(bytes([0, 0, size]) + request + bytes([9, 6]))
        put(bytes([0, 0, size]) + request + bytes([0, size]) + request + bytes([0, 6]) + b"GET / " + bytes([9, 6]))
    put(bytes([0, 3, 7, 0, 63, 9, 6]))


def shm(put):
    blocks(5, 8, 60)(put)
    for ring in range(4):  # slots of one length, and where they begin; read twice
        for slot in (0, 1):
            put(bytes([0, 0, 2, 4 + ring, slot, 7, 140 + ring, slot, 11, 1, 0, 1, 0]))


def controls(put):
    blocks(8, 8, 120)(put)
    put(bytes([2, 35, 1, 1, 1]))  # TARE and UNTARE
    for mask in (3, 7):
        put(bytes([2, 32, 4, 1, mask, 0, 0, 1]))  # CMD .. CMD_SEQ


def isotp(put):
    blocks(9, 8, 120)(put)
    frames = [bytes([0x1F, 0xFF]) + bytes(6)] + [bytes([0x20 | n & 15]) + bytes(7) for n in range(1, 90)]
    put(b"".join(b"\0\x08" + frame for frame in frames))  # longer than there is room for
    for length in range(1, 8):
        put(bytes([0, length + 1, length]) + bytes(length))
        put(bytes([0, length, length]) + bytes(length - 1))  # says one more than there are


def http(put):
    host = "Host: localhost:8080"
    for n, path in enumerate(("/", "/api/status", "/api/events", "/api/stream", "/metrics", "/api/command", "/nothing", "/api/array?sensor=left")):
        put(bytes([30 * n]) + f"GET {path} HTTP/1.1\r\n{host}\r\n\r\n".encode())
    for fields in ((host, "Origin: http://localhost:8080"), ("Host: gripper.example", "Origin: https://gripper.example"), ("Host: [::1]:80",), ("Host: evil.example",),
                   (host, "Origin: http://evil.example"), (host, "Sec-Fetch-Site: cross-site", "Sec-Fetch-Mode: cors"), (host, "Sec-Fetch-Site: same-site", "Sec-Fetch-Mode: navigate")):
        put(b"\xff" + ("GET /metrics HTTP/1.1\r\n" + "\r\n".join(fields) + "\r\n\r\n").encode())
    body = '{"command":"tare","sensor":"left"}'
    right = [host, "Origin: http://localhost:8080", "Authorization: Bearer token-of-the-fuzzer-0", "Content-Type: application/json; x=y", f"Content-Length: {len(body)}"]
    for missing in (None, 1, 2, 3):
        fields = [field for n, field in enumerate(right) if n != missing]
        put(b"\x05" + ("POST /api/command HTTP/1.1\r\n" + "\r\n".join(fields) + "\r\n\r\n" + body).encode())
    for token in ("token-of-the-fuzzer-", "token-of-the-fuzzer-0x", "token-of-the-fuzzer-1"):
        fields = [f"Authorization: Bearer {token}" if field.startswith("Authorization") else field for field in right]
        put(b"\x05" + ("POST /api/command HTTP/1.1\r\n" + "\r\n".join(fields) + "\r\n\r\n" + body).encode())
    put(b"\x05" + ("POST /api/command HTTP/1.1\r\n" + "\r\n".join([*right, "Sec-Fetch-Site: same-site", "Sec-Fetch-Mode: navigate"]) + "\r\n\r\n" + body).encode())


def rtu(put):
    blocks(7, 8, 80)(put)
    for address in (0, *(5 ^ 1 << bit for bit in range(8))):  # every address; all but ours
        put(bytes([2, address, 1, 2]))


def blocks(seed, count, size):  # decisions: any bytes are good ones
    def given(put):
        rng = random.Random(seed)
        for _ in range(count):
            put(bytes(rng.randrange(256) for _ in range(size)))
    return given


def config(put):
    tomls("config", "config/calibration", "config/devices")(put)
    for serial in ("a\\\\b", "a\\u0001b", "a\\\"b"):  # a backslash, a letter that is none, a quote
        put(b'format = 1\nmodel = "generic"\nmethod = "matrix"\ncontact_model = "unknown"\nserial = "%s"\nchannels = ["a"]\nchannel_unit = "N"\n'
            b'zero = [0.0]\ncomponents = ["fz"]\nmatrix = [[1.0]]\nsd = [0.01]\nfull_scale = [10.0]\n' % serial.encode())


TARGETS = {"wire": wire, "array": array, "dbc": dbc, "modbus": modbus, "mcap": mcap, "config": config, "scene": tomls("config/scenes"), "decouple": decouple, "csv": csv,
           "address": address, "can": blocks(1, 8, 60), "isotp": isotp, "i2c": blocks(2, 16, 80), "registers": registers, "clocks": blocks(4, 8, 60),
           "shm": shm, "server": server, "rtu": rtu, "controls": controls, "http": http}


def main(folder):
    for target, make in TARGETS.items():
        (folder / target).mkdir(parents=True, exist_ok=True)
        count = 0

        def put(data):
            nonlocal count
            (folder / target / f"seed{count:03}").write_bytes(data)
            count += 1
        make(put)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
