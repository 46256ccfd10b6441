"""A client of RDT, written from the protocol's description, which shares nothing with the bridge."""
import socket
import struct
import time

from daemon import PATIENCE_S


class Client:
    def __init__(self, port, address="127.0.0.1", timeout=PATIENCE_S):
        self.socket, self.timeout = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), timeout
        self.socket.settimeout(timeout)
        self.to = (address, port)

    def request(self, command, count=0):
        self.socket.sendto(struct.pack("!HHI", 0x1234, command, count), self.to)

    def record(self):
        """rdt_sequence, ft_sequence, status, six values in N and Nm."""
        data = self.socket.recv(100)
        assert len(data) == 36, data
        fields = struct.unpack("!IIIiiiiii", data)
        return *fields[:3], [counts / 1e6 for counts in fields[3:]]

    def records(self, seconds):
        """All that come within a time."""
        until, found = time.monotonic() + seconds, []
        while (left := until - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                found.append(self.record())
            except socket.timeout:
                pass
        self.socket.settimeout(self.timeout)
        return found

    def close(self):
        self.socket.close()
