"""What a process tells the service manager that has started it."""

import os
import socket
from collections.abc import Mapping


class ServiceNotifier:
    """Tells systemd that the process is ready, alive or stopping; does nothing outside a service."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) if address else None

    def send(self, state: str) -> None:
        """Send `READY=1`, `WATCHDOG=1` or `STATUS=...`. A manager that does not listen does not stop the process."""
        if self._socket is None:
            return
        try:
            self._socket.sendto(state.encode(), self._address)
        except OSError:
            return

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
