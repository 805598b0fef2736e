"""The address of a server, of both families."""

import socket

import pytest

from gateway.configuration.section import host_and_port, written
from gateway.page.channel import listen_at


@pytest.mark.parametrize("address", ["127.0.0.1:8321", "[::1]:8321", "crane-1.local:80", "0.0.0.0:0"])
def test_an_address_is_read_and_written_alike(address: str) -> None:
    assert written(*host_and_port(address)) == address


@pytest.mark.parametrize(
    "address",
    ["8321", ":8321", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "::1:8321", "a b:1", "127.0.0.1:-1", "x:١"],
)
def test_what_is_no_address_is_named(address: str) -> None:
    with pytest.raises(ValueError, match=r"address|port"):
        host_and_port(address)


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_a_client_reaches_what_listens(host: str) -> None:
    with listen_at(host, 0) as listener, socket.create_connection(listener.getsockname()[:2], timeout=5) as client:
        accepted, _ = listener.accept()
        with accepted:
            client.sendall(b"x")
            assert accepted.recv(1) == b"x"
