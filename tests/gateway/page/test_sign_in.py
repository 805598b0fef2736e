"""Who may acknowledge: the PIN's file, sessions, what wrong attempts do, hosts, and the lines of the log."""

import asyncio
import json
import logging
import socket
import stat
from collections.abc import MutableMapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.applications import Starlette

from gateway.page import actions
from gateway.page.actions import GatewayAnswer, GatewayRequests
from gateway.page.channel import Parameters
from gateway.page.guard import AllowedHosts, is_same_origin
from gateway.page.http_server import LOG_INTERVAL_S, MAX_LINES_PER_INTERVAL, LogRateLimiter
from gateway.page.sign_in import (
    EXPIRY_S,
    MAX_SESSIONS,
    PIN_DIGITS,
    SignIn,
    make_pin,
    most_wrong_attempts,
    read_pin,
    replace_pin,
    successor_of,
)
from gateway.page.state import PageState
from tests.values import present

PIN = "12345678"


def test_the_pin_is_made_once_and_read_by_the_group_alone(tmp_path: Path) -> None:
    path = tmp_path / "data" / "page-pin"
    make_pin(path)
    first = read_pin(path)
    assert first is not None
    assert len(first) == PIN_DIGITS
    assert first.isdigit()
    assert stat.S_IMODE(path.stat().st_mode) & 0o137 == 0
    make_pin(path)
    assert read_pin(path) == first


@pytest.mark.parametrize("content", ["", "1234\n", "password\n", "12345678 or so\n", "\xff"])
def test_a_file_without_eight_digits_is_no_pin(tmp_path: Path, content: str) -> None:
    path = tmp_path / "page-pin"
    path.write_text(content, encoding="latin-1")
    assert read_pin(path) is None
    assert read_pin(tmp_path / "absent") is None
    assert read_pin(None) is None


def test_a_void_pin_is_replaced_by_a_longer_one_for_the_group_alone(tmp_path: Path) -> None:
    path = tmp_path / "page-pin"
    make_pin(path)
    pin = present(read_pin(path))
    for digits in (12, 16, 16):
        before = pin
        replace_pin(path, successor_of(pin))
        pin = present(read_pin(path))
        assert pin != before
        assert len(pin) == digits
        assert most_wrong_attempts(pin) >= most_wrong_attempts(before)
    assert stat.S_IMODE(path.stat().st_mode) & 0o137 == 0


def _people(pin: str = PIN) -> SignIn:
    people = SignIn()
    people.use(pin)
    return people


def test_a_session_ends_with_time_a_changed_pin_or_the_person() -> None:
    people = _people()
    token, other = people.sign_in("Ann", PIN, 0.0), people.sign_in("Bert", PIN, 0.0)
    assert present(people.session(token, EXPIRY_S - 1)).name == "Ann"
    assert people.session(token, EXPIRY_S) is None
    assert people.session("x" * 43, 1.0) is None
    assert people.session(None, 1.0) is None
    people.sign_out(token)
    assert people.session(token, 1.0) is None
    people.use(None)
    assert people.session(other, 1.0) is None
    assert not people.is_possible
    people.use(PIN)
    assert people.session(other, 1.0) is not None
    people.use("87654321")
    assert people.session(other, 1.0) is None


def test_a_session_ends_ten_minutes_after_its_last_use() -> None:
    assert EXPIRY_S == 600.0
    people = _people()
    token = people.sign_in("Ann", PIN, 0.0)
    for asked_s in (1.0, EXPIRY_S - 1):
        assert people.session(token, asked_s) is not None  # to ask is no use
    people.note_use(token, EXPIRY_S - 1)
    assert present(people.session(token, 2 * EXPIRY_S - 2)).name == "Ann"
    assert people.session(token, 2 * EXPIRY_S - 1) is None
    people.note_use(token, 2 * EXPIRY_S)  # too late
    people.note_use("x" * 43, 0.0)
    assert people.session(token, 2 * EXPIRY_S) is None
    assert people.session("x" * 43, 1.0) is None


class _Gateway(GatewayRequests):
    """Answers as it is told."""

    accepts = True

    async def submit(self, verb: str, request: dict[str, object]) -> GatewayAnswer:
        return GatewayAnswer(accepted=self.accepts, text=f"{verb} by {request['by']}")


def test_only_an_acknowledgement_that_is_accepted_uses_a_session(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    now_s = [1000.0]
    monkeypatch.setattr(actions, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    (tmp_path / "page-pin").write_text(PIN)
    parameters = Parameters(
        key="a/b", warn_deg=4, trip_deg=6, clear_deg=3, lean_trip_deg=3, pin_file=tmp_path / "page-pin"
    )
    ours, theirs = socket.socketpair()
    with ours, theirs:
        gateway = _Gateway(ours)
        endpoints = actions.Actions(PageState(parameters), gateway, 8321)
        app = Starlette(routes=[*endpoints.reading_routes(), *endpoints.changing_routes()])

        async def ask(path: str, content: object = None) -> int:
            """Ask as Ann's browser does; return the status."""
            return (await _exchange(app, path, content, cookie))[0]

        async def course() -> list[int]:
            statuses = []
            for wait_s, accepts in ((400.0, False), (150.0, True), (500.0, True), (599.0, False), (2.0, True)):
                now_s[0] += wait_s
                gateway.accepts = accepts
                await ask("/api/session")
                statuses.append(await ask("/api/acknowledge", {"incident": "b-1"}))
            return statuses

        async def sign_in() -> str:
            return (await _exchange(app, "/api/sign-in", {"name": "Ann", "pin": PIN}, ""))[1]

        cookie = asyncio.run(sign_in())
        assert asyncio.run(course()) == [409, 200, 200, 409, 401]


async def _exchange(app: Starlette, path: str, content: object, cookie: str) -> tuple[int, str]:
    """Send one request and return the status and the cookie that is set."""
    sent: list[MutableMapping[str, Any]] = []
    body = b"" if content is None else json.dumps(content).encode()

    async def receive() -> MutableMapping[str, Any]:
        return {"type": "http.request", "body": body, "more_body": False}

    async def send(message: MutableMapping[str, Any]) -> None:
        sent.append(message)

    method = "GET" if content is None else "POST"
    headers = [(b"cookie", cookie.encode())]
    scope = {"type": "http", "method": method, "path": path, "headers": headers, "query_string": b"", "client": None}
    await app(scope, receive, send)
    answered = dict(sent[0]["headers"])
    return sent[0]["status"], answered.get(b"set-cookie", b"").decode().partition(";")[0]


def test_wrong_pins_keep_nobody_out_until_the_pin_is_void() -> None:
    people, most = _people(), most_wrong_attempts(PIN)
    for _ in range(most - 1):
        assert people.sign_in("Eve", "00000000", 0.0) is None
    token = people.sign_in("Ann", PIN, 0.0)
    assert people.session(token, 1.0) is not None
    assert people.sign_in("Eve", "00000000", 0.0) is None
    assert people.sign_in("Eve", PIN, 0.0) is None
    people.use(PIN)  # the file still has it
    assert people.sign_in("Eve", PIN, 0.0) is None
    new = present(people.successor)
    people.use(new)
    assert people.session(token, 1.0) is not None
    assert people.sign_in("Eve", PIN, 0.0) is None
    assert people.sign_in("Ann", new, 0.0) is not None
    assert people.wrong_attempts == 1


def test_sessions_are_bounded() -> None:
    people = _people()
    tokens = [people.sign_in("Ann", PIN, 0.0) for _ in range(MAX_SESSIONS + 1)]
    assert people.session(tokens[0], 1.0) is None
    assert people.session(tokens[1], 1.0) is not None


@pytest.mark.parametrize(
    ("listen", "names", "host", "allowed"),
    [
        ("127.0.0.1", [], "127.0.0.1:8321", True),
        ("127.0.0.1", [], "localhost:8321", True),
        ("127.0.0.1", [], "LOCALHOST", True),
        ("127.0.0.1", [], "[::1]:8321", True),
        ("127.0.0.1", [], "evil.com", False),
        ("127.0.0.1", [], "evil.com:8321", False),
        ("127.0.0.1", [], "127.0.0.1.evil.com", False),
        ("127.0.0.1", [], "127.0.0.1@evil.com", False),
        ("127.0.0.1", [], "10.0.0.5", False),
        ("127.0.0.1", [], "", False),
        ("127.0.0.1", [], "[", False),
        ("127.0.0.1", ["crane-1.local"], "Crane-1.local:8321", True),
        ("10.0.0.5", [], "10.0.0.5:8321", True),
        ("10.0.0.5", [], "10.0.0.6:8321", False),
        ("0.0.0.0", [], "10.0.0.6:8321", True),
        ("0.0.0.0", [], "evil.com:8321", False),
        ("::", [], "[fd00::1]:8321", True),
    ],
)
def test_only_known_hosts_are_answered(listen: str, names: list[str], host: str, allowed: bool) -> None:
    assert AllowedHosts(listen, names).allows(host) is allowed


def test_only_the_page_itself_is_the_same_origin() -> None:
    assert is_same_origin("http://127.0.0.1:8321", "127.0.0.1:8321")
    for origin in ("", "null", "http://127.0.0.1:9999", "http://evil.com", "http://127.0.0.1:8321.evil.com"):
        assert not is_same_origin(origin, "127.0.0.1:8321")


def test_lines_that_browsers_cause_are_limited_and_counted() -> None:
    now = [0.0]
    limit = LogRateLimiter(lambda: now[0])

    def line() -> logging.LogRecord:
        return logging.LogRecord("x", logging.WARNING, "", 0, "bad %s", ("request",), None)

    assert [limit.filter(line()) for _ in range(MAX_LINES_PER_INTERVAL + 20)] == [True] * MAX_LINES_PER_INTERVAL + [
        False
    ] * 20
    now[0] = LOG_INTERVAL_S
    record = line()
    assert limit.filter(record)
    assert record.getMessage() == "bad request (20 lines were left out)"
