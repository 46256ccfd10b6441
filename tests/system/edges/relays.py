"""A network that can be cut: relays for TCP and UDP on the loopback. While it is cut, TCP keeps what was sent, and UDP loses it."""
import contextlib
import socket
import threading
import time


class Network:
    def __init__(self):
        self.is_cut, self.ended, self.sockets = False, False, []

    def wait(self):
        while self.is_cut and not self.ended:
            time.sleep(0.005)
        return not self.ended

    def kept(self, made):
        self.sockets.append(made)
        return made

    def tcp(self, port):
        """Returns the port of a relay to `port`."""
        server = self.kept(socket.create_server(("127.0.0.1", 0)))

        def accept():
            with contextlib.suppress(OSError):
                while True:
                    client = self.kept(server.accept()[0])
                    threading.Thread(target=connect, args=(client,), daemon=True).start()

        def connect(client):
            try:
                self.wait()
                far = self.kept(socket.create_connection(("127.0.0.1", port), 5))
                far.settimeout(None)
            except OSError:
                client.close()
                return
            for ends in ((client, far), (far, client)):
                threading.Thread(target=pump, args=ends, daemon=True).start()

        def pump(source, sink):
            with contextlib.suppress(OSError):
                while (data := source.recv(65536)) and self.wait():
                    sink.sendall(data)
            for end in (source, sink):
                with contextlib.suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)
                end.close()

        threading.Thread(target=accept, daemon=True).start()
        return server.getsockname()[1]

    def udp(self, port):
        """Returns the port of a relay to `port`, with a socket for each client."""
        server = self.kept(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        server.bind(("127.0.0.1", 0))
        far = {}

        def back(client, upstream):
            with contextlib.suppress(OSError):
                while True:
                    with contextlib.suppress(ConnectionRefusedError):
                        data = upstream.recv(65536)
                        if not self.is_cut:
                            server.sendto(data, client)

        def forth():
            with contextlib.suppress(OSError):
                while True:
                    data, client = server.recvfrom(65536)
                    if client is None:  # closed
                        return
                    if client not in far:
                        far[client] = self.kept(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
                        far[client].connect(("127.0.0.1", port))
                        threading.Thread(target=back, args=(client, far[client]), daemon=True).start()
                    if not self.is_cut:
                        with contextlib.suppress(ConnectionRefusedError):
                            far[client].send(data)

        threading.Thread(target=forth, daemon=True).start()
        return server.getsockname()[1]

    def close(self):
        self.ended = True
        for each in self.sockets:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
