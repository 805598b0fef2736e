"""A line on which the traffic of an office and a gateway can be cut."""

import socket
import threading
from contextlib import suppress


class Line:
    """A line between the office and the gateway that can be cut and mended."""

    def __init__(self, endpoint: str) -> None:
        self._target = ("127.0.0.1", int(endpoint.rsplit(":", 1)[1]))
        self._sockets: list[socket.socket] = []
        self._cut = threading.Event()
        self._server = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._server.getsockname()[1]}"
        self._threads: list[threading.Thread] = []
        self._acceptor = threading.Thread(target=self._accept)
        self._acceptor.start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                office, _ = self._server.accept()
                if self._cut.is_set():
                    office.close()
                    continue
                try:
                    gateway = socket.create_connection(self._target)
                except OSError:  # it is not there
                    office.close()
                    continue
                self._sockets += [office, gateway]
                for pair in ((office, gateway), (gateway, office)):
                    self._threads.append(threading.Thread(target=self._carry, args=pair))
                    self._threads[-1].start()

    def _carry(self, source: socket.socket, target: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                target.sendall(data)

    def cut(self) -> None:
        self._cut.set()
        for one in self._sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for one in self._sockets:
            one.close()
        self._threads.clear()
        self._sockets.clear()

    def mend(self) -> None:
        self._cut.clear()

    def close(self) -> None:
        self._cut.set()
        self._server.shutdown(socket.SHUT_RDWR)
        self._acceptor.join()
        self.cut()
        self._server.close()
