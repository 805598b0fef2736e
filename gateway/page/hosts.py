"""The names under which browsers may reach the page, so that no other site can read it by DNS rebinding."""

import ipaddress
from collections.abc import Sequence
from urllib.parse import urlsplit

LOOPBACK = ("localhost", "127.0.0.1", "::1")


class AllowedHosts:
    """The Host headers that are answered: loopback, the address of `page.listen`, and the names of `page.hosts`.

    Where the page listens at all addresses, every address is allowed and no name: rebinding needs a name.
    """

    def __init__(self, listen_host: str, names: Sequence[str] = ()) -> None:
        self._names = {name.lower() for name in (*LOOPBACK, listen_host, *names)}
        self._any_address = _is_unspecified(listen_host)

    def allows(self, host_header: str) -> bool:
        """Return whether a Host header is allowed; its port does not matter."""
        try:
            name = urlsplit(f"//{host_header}").hostname
        except ValueError:
            return False
        if not name or "@" in host_header or "/" in host_header:
            return False
        return name in self._names or (self._any_address and _is_address(name))


def is_same_origin(origin: str, host_header: str) -> bool:
    """Return whether the Origin header of a browser names the host that it asks."""
    return origin in (f"http://{host_header}", f"https://{host_header}")


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _is_unspecified(host: str) -> bool:
    return _is_address(host) and ipaddress.ip_address(host).is_unspecified
