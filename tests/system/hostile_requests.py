"""Clients with hostile requests or rates: each function returns "" or the wrong answer."""
import random
import struct
import time

import hostile_pdus as pdus
from daemon import wait_for
from hostile_client import Client, show
from hostile_pdus import GOOD, MAGIC, MAGIC_IS, SCRATCH, UNLOCK, adu, coil, read, register


def mutated_frames(port):
    randomly = random.Random(20240229)
    good = [GOOD, adu(read(1, 0, 34)), adu(read(2, 0, 68)), adu(pdus.registers(SCRATCH, range(20))),
            adu(pdus.exchange(0, 32, SCRATCH, range(10))), adu(pdus.identity(14, 1, 0)),
            adu(pdus.mask(SCRATCH, 1, 2))]
    with Client(port) as patient:
        for n in range(400):
            frame = bytearray(randomly.choice(good))
            for _ in range(randomly.randint(1, 4)):
                at = randomly.randrange(len(frame))
                frame[at:at + randomly.randint(0, 2)] = randomly.randbytes(randomly.randint(0, 2)) or b"\0"
            with Client(port) as client:
                client.send(bytes(frame))
            if n % 20 == 0 and (answer := patient.ask(MAGIC)) != MAGIC_IS:
                return f"after {n}: {show(answer)}"
    return ""


def noise(port):
    randomly = random.Random(42)
    for _ in range(200):
        with Client(port) as client:
            client.send(randomly.randbytes(randomly.randint(1, 600)))
    return ""


def eight_clients_byte_by_byte(port):
    clients = [Client(port) for _ in range(8)]
    try:
        for at in range(len(GOOD)):
            for n, client in enumerate(clients):
                client.send(adu(read(3, 9000 + n, 1), n, n)[at:at + 1])
        got = [client.frame() for client in clients]
    finally:
        for client in clients:
            client.socket.close()
    return "" if got == [adu(pdus.holds(3, pdus.CONSTANTS[n]), n, n) for n in range(8)] else show(got)


def greedy(port):
    """Sends 100 requests before it reads the first answer, for 2 s."""
    until, rounds = time.monotonic() + 2, 0
    with Client(port) as client:
        while time.monotonic() < until or rounds < 6:
            client.send(b"".join(pdus.HUNDRED))
            got = [client.frame() for _ in pdus.HUNDRED]
            if got != pdus.HUNDRED_ANSWERS:
                return f"in round {rounds}: {show(got)}"
            rounds += 1
    return ""


def unlock_is_not_inherited(port):
    setting = register(5030, 100)
    for _ in range(10):
        with Client(port) as client:
            client.ask(UNLOCK)
        with Client(port) as client:
            if (got := client.ask(setting)) != pdus.refusal(setting, 2):
                return show(got)
    return ""


def values(client, at, count):
    return struct.unpack(f">{count}H", client.ask(read(3, at, count))[2:])


def is_idle(client):
    return values(client, 26, 1) != (1,) and client.ask(read(1, 0, 16)) == b"\1\2\0\0"


def tare_while_taring(port, gap_s=0.0):
    requests = [register(5010, 1), register(5010, 1), coil(0, 0xFF00), pdus.registers(5010, (1, 0)),
                pdus.exchange(0, 1, 5010, (1,)), pdus.coils(0, 1, b"\1")]
    with Client(port) as client:
        wait_for(lambda: is_idle(client), "earlier commands to end")
        before, = values(client, 120, 1)
        if gap_s == 0:
            client.send(b"".join(map(adu, requests)))
            got = [client.frame()[7:] for _ in requests]
        else:
            got = [client.ask(requests[0])]
            time.sleep(gap_s)
            got += map(client.ask, requests[1:])
        wait_for(lambda: values(client, 120, 1) != (before,) and is_idle(client), "the tare to end")
        tares = (values(client, 120, 1)[0] - before) & 0xFFFF
    want = requests[:1] + [pdus.refusal(pdu, 6) for pdu in requests[1:]]
    if (got, tares) != (want, 1):
        return f"{show(got)}, {tares} tares"
    return ""


def save_while_saving(port):
    save = register(5091, pdus.SAVE_WORD)
    with Client(port) as client:
        client.send(adu(save) * 20)
        got = [client.frame()[7:] for _ in range(20)]
        wait_for(lambda: client.ask(read(3, 5091, 1)) != pdus.holds(3, 1), "SAVE to end")
        end = client.ask(read(3, 5091, 1))
    bad = [pdu for pdu in got if pdu not in (save, pdus.refusal(save, 6))]
    return "" if got[0] == save and not bad and end == pdus.holds(3, 0) else f"{show(got)}, at the end {show(end)}"
