"""Clients of a Net F/T, written from the protocol's description, which share nothing with the bridge."""
import socket
import struct
import time
import urllib.request
import xml.etree.ElementTree

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


class NetFt:
    """A client that knows the address alone: it takes counts and units from the device's page, as those of ATI's users do, and refuses a record
    whose status is not 0."""

    def __init__(self, port, http_port, address="127.0.0.1"):
        self.client, self.page = Client(port, address), f"http://{address}:{http_port}/netftapi2.xml"
        fields = self.fields()
        assert fields["scfgfu"] == "N" and fields["scfgtu"] == "N-m" and fields["comrdte"] == "Enabled", fields
        self.counts = [float(fields["cfgcpf"])] * 3 + [float(fields["cfgcpt"])] * 3
        self.ranges = self.numbers(fields["cfgmr"])
        self.rate_Hz = int(fields["comrdtrate"])

    def fields(self):
        with urllib.request.urlopen(self.page, timeout=PATIENCE_S) as answer:
            return {element.tag: element.text or "" for element in xml.etree.ElementTree.fromstring(answer.read())}

    @staticmethod
    def numbers(text):
        return [float(word) for word in text.split(";") if word]

    def now(self):
        """Status and values of the page; no values: there are none."""
        fields = self.fields()
        return int(fields["runstat"], 16), [n / c for n, c in zip(self.numbers(fields["runft"]), self.counts)]

    def read(self, count):
        self.client.request(2, count)
        values = []
        for _ in range(count):
            _, _, status, *counts = struct.unpack("!IIIiiiiii", self.client.socket.recv(100))
            if status != 0:
                raise ValueError(f"status 0x{status:08x}")
            values.append([n / c for n, c in zip(counts, self.counts)])
        return values

    def close(self):
        self.client.close()
