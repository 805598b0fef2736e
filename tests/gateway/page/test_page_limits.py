"""Hostile browsers: silent, half-sent, forgotten and foreign connections keep nobody from the page."""

import contextlib
import http.client
import socket
import time
import urllib.request
from collections.abc import Iterator

import pytest

from gateway.daemon.outputs.page_channel import PageChannel
from gateway.page.http_server import MAX_CONNECTIONS_PER_ADDRESS, REQUEST_S
from gateway.page.hub import MAX_STREAMS_PER_ADDRESS, ConnectionLimiter
from tests.gateway.page.conftest import FakeGateway, PageUnderTest
from tests.waiting import PATIENCE_S, wait_until

MANY = 200
HALF = b"GET /api/state HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "


class Place:
    def __init__(self, address: str, idle: bool = True) -> None:
        self.address, self.idle, self.ended = address, idle, False

    def end(self) -> None:
        self.ended = True


def test_the_oldest_idle_place_of_the_same_address_makes_room() -> None:
    limiter: ConnectionLimiter[Place] = ConnectionLimiter(4, 2)
    busy, idle, other = Place("a", idle=False), Place("a"), Place("b")
    assert all(map(limiter.admit, (busy, idle, other)))
    assert limiter.admit(Place("a"))
    assert [busy.ended, idle.ended, other.ended] == [False, True, False]
    assert (len(limiter), limiter.ended) == (3, 1)


def test_a_full_house_takes_from_the_address_that_has_most() -> None:
    limiter: ConnectionLimiter[Place] = ConnectionLimiter(4, 4)
    lonely, crowd = Place("b"), [Place("a") for _ in range(3)]
    assert all(map(limiter.admit, (lonely, *crowd)))
    assert limiter.admit(Place("c"))
    assert [place.ended for place in (lonely, *crowd)] == [False, True, False, False]


def test_nobody_is_ended_who_is_being_answered() -> None:
    limiter: ConnectionLimiter[Place] = ConnectionLimiter(2, 2)
    busy = [Place("a", idle=False), Place("a", idle=False)]
    assert all(map(limiter.admit, busy))
    assert not limiter.admit(Place("a"))
    assert (limiter.refused, len(limiter)) == (1, 2)
    limiter.release(busy[0])
    assert limiter.admit(Place("a"))


@contextlib.contextmanager
def _connections(page: PageUnderTest, content: bytes, count: int = MANY) -> Iterator[list[socket.socket]]:
    with contextlib.ExitStack() as held:
        opened = []
        for _ in range(count):
            connection = held.enter_context(socket.create_connection(page.listener.getsockname(), timeout=PATIENCE_S))
            if content:
                connection.sendall(content)
            opened.append(connection)
        yield opened


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"", HALF], ids=["silent", "half-sent"])
def test_held_connections_do_not_keep_others_out(gateway: FakeGateway, page: PageUnderTest, content: bytes) -> None:
    wait_until(lambda: page.word() == "OK", "OK")
    with _connections(page, content):
        for _ in range(20):
            assert page.get("/api/state")[0] == 200
            time.sleep(0.02)


def _is_ended(connection: socket.socket) -> bool:
    try:
        return connection.recv(4096) == b""
    except ConnectionError:
        return True
    except TimeoutError:
        return False


@pytest.mark.slow
def test_a_request_that_is_not_complete_in_time_is_ended(idle_page: PageUnderTest) -> None:
    assert idle_page.get("/healthz")[0] == 503
    begun_s = time.monotonic()
    with _connections(idle_page, HALF, count=2) as (silent, slow):
        silent.settimeout(0.2)
        slow.settimeout(0.2)
        while not (_is_ended(silent) and _is_ended(slow)):
            assert time.monotonic() - begun_s < REQUEST_S + PATIENCE_S
            with contextlib.suppress(OSError):
                slow.sendall(b"x")  # each byte alone does not prolong the time


@pytest.mark.slow
def test_event_streams_that_are_held_do_not_keep_others_out(gateway: FakeGateway, page: PageUnderTest) -> None:
    wait_until(lambda: page.word() == "OK", "OK")
    request = b"GET /api/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    with _connections(page, request, count=MAX_STREAMS_PER_ADDRESS + 20):
        for _ in range(3):
            with urllib.request.urlopen(page.url + "/api/events", timeout=PATIENCE_S) as stream:
                assert stream.readline() == b"retry: 500\n"
    assert MAX_STREAMS_PER_ADDRESS < MAX_CONNECTIONS_PER_ADDRESS


@pytest.mark.slow
@pytest.mark.parametrize("path", ["/", "/api/state", "/metrics", "/healthz", "/api/events"])
def test_a_foreign_host_gets_nothing(idle_page: PageUnderTest, path: str) -> None:
    connection = http.client.HTTPConnection(idle_page.url.removeprefix("http://"), timeout=PATIENCE_S)
    with contextlib.closing(connection):
        connection.request("GET", path, headers={"Host": "evil.com"})
        response = connection.getresponse()
        assert response.status == 421
        assert b"plumbline/v1" not in response.read()
        connection.request("GET", "/healthz", headers={"Host": "crane-3.local"})
        assert connection.getresponse().status == 503  # answered: no data yet


@pytest.mark.slow
def test_large_and_broken_requests_are_refused_and_the_log_stays_short(
    capfd: pytest.CaptureFixture[str], channel: PageChannel
) -> None:
    page = PageUnderTest(channel)  # here, so that it inherits the captured standard error
    for content in (b"GET / HTTP/1.1\r\nX: " + b"x" * 100_000, b"\x16\x03\x01 no HTTP\r\n\r\n") * 30:
        address = page.listener.getsockname()
        with socket.create_connection(address, PATIENCE_S) as connection, contextlib.suppress(ConnectionError):
            connection.sendall(content)
            while connection.recv(4096):
                pass
    assert page.get("/healthz")[0] == 503
    page.close()
    assert 0 < capfd.readouterr().err.count("\n") <= 10
