"""Clients that connect, read answers and disconnect in hostile ways: each function returns "" or the wrong answer."""
import contextlib
import os
import resource
import select
import signal
import socket
import time

import hostile_pdus as pdus
from daemon import Stopwatch, wait_for
from hostile_client import AT_ONCE_S, PLACES, PLC, Client, common, show
from hostile_pdus import CLOSED, GOOD, GOOD_ANSWER, MAGIC, MAGIC_IS, adu, read


def deaf(port):
    """Sends requests permanently and reads nothing."""
    with contextlib.ExitStack() as held:
        client = held.enter_context(Client(port, receive_bytes=4096))
        client.socket.setblocking(False)
        poll = select.poll()
        poll.register(client.socket, select.POLLOUT)
        began, watch = time.monotonic(), held.enter_context(Stopwatch())
        while watch.seconds() < 6:
            events = poll.poll(50)
            if events and events[0][1] & (select.POLLERR | select.POLLHUP):
                seconds = time.monotonic() - began
                return "" if seconds > 1.8 and watch.seconds() < 4.5 else f"closed after {seconds:.2f} s"
            if events:
                try:
                    client.socket.send(adu(read(3, 100, 125)) * 100)
                except BlockingIOError:
                    pass
                except ConnectionError:
                    continue
        return "still open after 6 s"


def slow_reader(port):
    with Client(port, receive_bytes=4096) as client:
        client.send(adu(read(3, 9000, 12)) * 1000)
        whole, got = adu(pdus.holds(3, *pdus.CONSTANTS)) * 1000, b""
        while len(got) < len(whole):
            data = client.socket.recv(512)
            if not data:
                break
            got += data
            time.sleep(0.005)
        return "" if got == whole else f"{len(got)} of {len(whole)} bytes, the same up to {common(got, whole)}"


def half_closed(port):
    with Client(port) as client:
        client.send(b"".join(pdus.HUNDRED))
        client.socket.shutdown(socket.SHUT_WR)
        got = client.frames()
        return "" if got == pdus.HUNDRED_ANSWERS + [CLOSED] else f"{len(got) - 1} answers, then {got[-1]}"


def half_closed_at_once(port):
    with Client(port) as client:
        client.socket.shutdown(socket.SHUT_WR)
        got = client.frames()
        return "" if got == [CLOSED] else show(got)


def half_closed_in_a_frame(port):
    with Client(port) as client:
        client.send(GOOD + GOOD[:5])
        client.socket.shutdown(socket.SHUT_WR)
        got = client.frames()
        return "" if got == [GOOD_ANSWER, CLOSED] else show(got)


def reset_in_a_frame(port):
    for size in range(1, len(GOOD)):
        client = Client(port)
        client.send(GOOD[:size])
        client.reset()
    return ""


def reset_before_the_answers(port):
    for _ in range(200):
        client = Client(port)
        client.send(adu(read(3, 100, 125)) * 50)
        client.reset()
    return ""


def closed_in_a_frame(port):
    for size in range(1, len(GOOD)):
        with Client(port) as client:
            client.send(GOOD[:size])
    return ""


def connect_and_close(port):
    for _ in range(500):
        Client(port).socket.close()
    return ""


def connect_and_reset(port):
    for _ in range(500):
        Client(port).reset()
    return ""


def burst_while_the_daemon_is_halted(suite):
    """Simulates an interruption by a busy machine. No connection may have to wait for its second SYN, which comes
    after 1 s."""
    clients = [socket.socket() for _ in range(64)]
    poll = select.poll()
    os.kill(suite.daemon.process.pid, signal.SIGSTOP)
    try:
        for client in clients:
            client.setblocking(False)
            client.connect_ex(("127.0.0.1", suite.port))
            poll.register(client, select.POLLOUT)
        time.sleep(0.01)
    finally:
        os.kill(suite.daemon.process.pid, signal.SIGCONT)
    try:
        time.sleep(AT_ONCE_S)
        connected = len(poll.poll(0))
        return "" if connected == len(clients) else f"{len(clients) - connected} still wait after {AT_ONCE_S} s"
    finally:
        for client in clients:
            client.close()


def connections_that_stay(port):
    """More than FD_SETSIZE connections on the client's side; the server keeps its places and closes the rest."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, min(hard, 4096)), hard))
    clients = [Client(port) for _ in range(1100)]
    wait_for(lambda: places_taken(clients) <= PLACES, "the server to close the rest")
    for client in clients:
        client.socket.close()
    return ""


def places_taken(clients):
    poll = select.poll()
    for client in clients:
        poll.register(client.socket, select.POLLIN)
    return len(clients) - len(poll.poll(0))  # readable means closed, because nothing was requested


def silent_clients(port):
    clients = [Client(port) for _ in range(3 * PLACES)]
    wait_for(lambda: places_taken(clients) <= PLACES, "the server to close the rest")
    answer = None
    with Client(port) as late:  # takes the place of one that has never asked
        answer = late.ask(MAGIC)
    for client in clients:
        client.socket.close()
    return "" if answer == MAGIC_IS else f"the one that speaks: {show(answer)}"


def full_house(port):
    """With the witness, every place is taken by a polling client."""
    pollers = [Client(port) for _ in range(PLACES - 1)]
    plcs, newcomers = [], []
    try:
        for n in range(20):
            polled = [client.ask(MAGIC) for client in pollers]
            if polled != [MAGIC_IS] * len(pollers):
                return f"{polled.count(MAGIC_IS)} of {len(pollers)} that poll are served in turn {n}"
            newcomers.append(Client(port))
            answer = newcomers[-1].ask(MAGIC)
            if answer != CLOSED:
                return f"one too many: {show(answer)}"
        for n in range(4):
            plcs.append(Client(port, source=PLC))
            served = [client.ask(MAGIC) for client in plcs].count(MAGIC_IS)
            if served != n + 1:
                return f"{served} of {n + 1} connections of the PLC are served"
        plcs.append(Client(port, source=PLC))
        served = [client.ask(MAGIC) for client in plcs].count(MAGIC_IS)
        polled = [client.ask(MAGIC) for client in pollers].count(MAGIC_IS)
        if (served, polled) != (4, len(pollers)):
            return f"at the end {served} of 5 of the PLC and {polled} of {len(pollers)} that poll"
        return ""
    finally:
        for client in pollers + plcs + newcomers:
            client.socket.close()


def outside_the_allow_list(port):
    with Client(port, source="127.0.1.1") as client, Stopwatch() as watch:
        client.send(GOOD)
        got = client.frame()
        return "" if got == CLOSED and watch.seconds() < AT_ONCE_S else f"{show(got)} after {watch.seconds():.2f} s"
