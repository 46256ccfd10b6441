"""The values of the register map that every client must read, and the daemon that serves them."""
import json
import pathlib
import socket
import struct
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from daemon import wait_for  # noqa: E402
from unit_daemon import CONFIG, quality_is, unit_daemon  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
RTU_ADDRESS = 7

OPEN_TO_WRITERS = """commands = true
scratch = true
max_requests_per_s = 0
settings = "{folder}/settings.toml"
"""
RTU = f"""
[modbus.rtu]
device = "{{folder}}/rtu"
baud = 19200
parity = "even"
address = {RTU_ADDRESS}
"""


def map_daemon(rtu=False, tare_ms=20):
    """Starts a daemon with one sensor that reads (1, 2, -3) N, with every part of the map enabled; its force is good."""
    sensor = CONFIG + f"tare_ms = {tare_ms}\n"
    config = OPEN_TO_WRITERS + (RTU if rtu else "") + sensor
    return unit_daemon(rows="0,1,2,-3\n0.005,1,2,-3\n", config=config)


def start_map(daemon):
    daemon.start()
    wait_for(quality_is(daemon, "good"), "a good sample")
    wait_for(lambda: listens(daemon.port), "the server to listen")
    adopt_number(daemon.port)


def adopt_number(port):
    """Writes the first CMD_SEQ of this address since the start, which runs nothing; later numbers of the clients run."""
    with socket.create_connection(("127.0.0.1", port), 3) as client:
        client.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 6, 5004, 0))
        assert client.recv(12)[7:] == struct.pack(">BHH", 6, 5004, 0)


def listens(port):
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0


CONSTANTS = [0x1234, 0x10000 - 1234, *struct.unpack(">10H", struct.pack(">if", 0x12345678, 1234.5)
             + struct.pack(">f", 1234.5)[2:] + struct.pack(">f", 1234.5)[:2] + b"ABCDEFGH")]

# Every client fills such a table; a client that lacks a function omits its lines.
EXPECTED = {
    "magic": [0x5441, 0x4354],
    "map_version": 0x010A,
    "constants": CONSTANTS,
    "constants_fc4": CONSTANTS,
    "int16": -1234,
    "int32": 0x12345678,
    "float_abcd": 1234.5,
    "float_cdab": 1234.5,
    "text": "ABCDEFGH",
    "force_cN": [100, 200, -300],
    "force_N": [1, 2, -3],
    "force_N_low_word_first": [1, 2, -3],
    "inputs_ok": [1, 0],
    "coils": [0] * 34,
    "scratch_fc6": 0xA55A,
    "scratch_fc16": [1, 0xFFFF, 3],
    "scratch_fc22": 0x0017,
    "scratch_fc23": [4, 5, 6],
    # CMD_SEQ_ACK - CMD_SEQ, CMD_STATE, CMD_RESULT, and the increase of TARE_COUNT
    "tare_block": [0, 2, 0, 1],
    "tare_fc23": [0, 2, 0, 1],
    "tare_register": 1,
    "tare_coil": 1,
    # exceptions: FC 6 to 0, FC 16 to 9000, FC 5 to coil 34, FC 15 beyond coil 33
    "refused": [2, 2, 2, 2],
    "refused_fc22": 2,
    "refused_fc23": 2,
    "fc17": 0,  # the server id is answered
    "identity": ["tactiled", "tactiled"],
}


def expected(without=()):
    return {name: value for name, value in EXPECTED.items() if name not in without}


def table(words, env=None):
    """Runs a client that prints lines "NAME JSON"; returns them as a table."""
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, timeout=60, env=env)
    if done.returncode != 0:
        raise AssertionError(f"{words}: status {done.returncode}\n{done.stdout}{done.stderr}")
    lines = [line.split(" ", 1) for line in done.stdout.splitlines()]
    return {name: json.loads(value) for name, value in lines}
