"""The socket at which a page is served."""

import socket


def listen_at(host: str, port: int, backlog: int | None = None) -> socket.socket:
    """Return a socket that listens at an address, of IPv6 too. Raises `OSError`."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family, backlog=backlog)
