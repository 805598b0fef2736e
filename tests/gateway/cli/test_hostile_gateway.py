"""Commands that talk to a hostile peer in place of a gateway: nothing is written elsewhere, nothing steers the terminal."""

import json
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from gateway.atomic_io import write_private
from gateway.authorization.credential import TOKEN_NAME, token_id
from gateway.bus.client import RpcReply
from gateway.bus.session import open_session
from gateway.bus.untrusted import parse_message, parse_status
from gateway.calibration.record import content_hash
from gateway.cli.main import main
from gateway.errors import printable
from gateway.topics import TOPICS
from tests.ports import unused_port

KEY = "plumbline/v1/a/b/c"
MARK = {"time_ns": 1, "clock": "replayed", "sequence": 1, "id": "request-1", "by": "ann", "text": "hello"}
ESCAPE = "\x1b[2J\x1b]0;owned\x07"


class HostileGateway:
    """Answers every verb with what a test gives, and publishes garbage."""

    def __init__(self) -> None:
        self.endpoint = f"tcp/127.0.0.1:{unused_port()}"
        self.answers: dict[str, Callable[[Any], bytes | None]] = {}
        """The answer to each verb; None: the query is dropped."""
        self.asked: list[tuple[str, bool]] = []
        """Verbs that were asked for, and whether with a credential or a random number."""
        self._session = open_session("peer", [], [self.endpoint])
        self._alive = self._session.liveliness().declare_token(f"{KEY}/alive")
        self._queryable = self._session.declare_queryable(f"{KEY}/rpc/*", self._answer)
        self._stopping = threading.Event()
        self._threads: list[threading.Thread] = []

    def _answer(self, query: zenoh.Query) -> None:
        verb = str(query.key_expr).rpartition("/")[2]
        request = json.loads(query.payload.to_bytes() or b"{}") if query.payload is not None else {}
        self.asked.append((verb, query.attachment is not None))
        answer = self.answers.get(verb, lambda _: b"\xff\xfe")(request)
        with query:
            if answer is not None:
                query.reply(f"{KEY}/rpc/{verb}", answer)

    def publish(self, topic: str, *payloads: bytes) -> None:
        """Publish payloads until the end of the test."""

        def work() -> None:
            while not self._stopping.is_set():
                for payload in payloads:
                    self._session.put(f"{KEY}/{topic}", payload)
                time.sleep(0.02)

        self._threads.append(threading.Thread(target=work))
        self._threads[-1].start()

    def close(self) -> None:
        self._stopping.set()
        for thread in self._threads:
            thread.join()
        self._queryable.undeclare()
        self._session.close()


@pytest.fixture
def hostile() -> Iterator[HostileGateway]:
    made = HostileGateway()
    yield made
    made.close()


def record(record_id: str) -> dict[str, Any]:
    identity = [[float(row == column) for column in range(12)] for row in range(12)]
    content = {
        "format": 1,
        "id": record_id,
        "device_id": "part-7",
        "method": "six-position",
        "created_utc": "2026-01-01T00:00:00Z",
        "software": "x",
        "by": "eve",
        "parent": None,
        "unit": "g",
        "offset": [0.0, 0.0, 0.0],
        "correction_matrix": [row[:3] for row in identity[:3]],
        "covariance": identity,
        "prediction_interval_g": 0.1,
        "temperature_c": None,
    }
    return content | {"sha256": content_hash(content)}


def listing(record_id: str) -> dict[str, Any]:
    return {"device_id": "part-7", "in_force": None, "review": None, "history": [], "records": [{"id": record_id}]}


@pytest.mark.slow
@pytest.mark.parametrize("record_id", ["../owned", "/tmp/owned", "..", "a/b", "a\x1b[2J", ".bashrc", "a" * 200])
def test_a_fetched_id_never_becomes_a_path(
    hostile: HostileGateway, tmp_path: Path, capsys: pytest.CaptureFixture[str], record_id: str
) -> None:
    hostile.answers["fetch"] = lambda request: json.dumps(
        {"record": record(record_id)} if request.get("what") == "record" else listing(record_id)
    ).encode()
    folder = tmp_path / "out"
    folder.mkdir()
    assert main(["remote", "fetch", "--connect", hostile.endpoint, "--out", str(folder)]) == 2
    assert list(folder.iterdir()) == []
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    err = capsys.readouterr().err
    assert (err.count("\n"), "\x1b" in err) == (1, False)


def test_another_record_than_the_one_asked_for_is_not_written(
    hostile: HostileGateway, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def answer(request: dict[str, Any]) -> bytes:
        if request.get("what") == "audit":
            return json.dumps({"audit": []}).encode()
        return json.dumps({"record": record("../owned")} if request.get("what") == "record" else listing("r1")).encode()

    hostile.answers["fetch"] = answer
    assert main(["remote", "fetch", "--connect", hostile.endpoint, "--out", str(tmp_path)]) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["audit.jsonl", "in_force.json"]
    said = capsys.readouterr()
    assert "another record came" in said.err
    assert "none of them in force: the factory's, if it has one" in said.out


@pytest.mark.slow
@pytest.mark.parametrize(
    "status",
    [
        b"\xff\xfe",
        b"[" * 100_000,
        b"5",
        b'{"health": 5, "calibration": []}',
        json.dumps({"health": {"drift": {"norm_error_mg": ESCAPE}, "calibration_id": None}}).encode(),
        json.dumps({"alert": {"level": ESCAPE, "text": ESCAPE}}).encode(),
        json.dumps({"mark": {**MARK, "by": ESCAPE, "text": ESCAPE}}).encode(),
    ],
)
def test_a_hostile_status_ends_in_one_line_and_steers_nothing(
    hostile: HostileGateway, capsys: pytest.CaptureFixture[str], status: bytes
) -> None:
    hostile.answers["status"] = lambda _: status
    main(["remote", "status", "--connect", hostile.endpoint])
    main(["remote", "status", "--json", "-", "--connect", hostile.endpoint])
    captured = capsys.readouterr()
    assert "\x1b" not in captured.out + captured.err


def test_a_hostile_answer_to_a_command_is_printed_harmlessly(
    hostile: HostileGateway, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    hostile.answers["challenge"] = lambda _: b'{"boot_id": "../../x", "time_ns": "later"}'
    hostile.answers["mark"] = lambda _: json.dumps({"accepted": True, "text": f"done{ESCAPE}\nsecond line"}).encode()
    assert main(["remote", "mark", "hello", "--by", "ann", "--connect", hostile.endpoint]) == 0
    out = capsys.readouterr().out
    assert ("\x1b" in out, out.count("\n")) == (False, 1)


@pytest.mark.slow
def test_a_challenge_that_a_flood_has_displaced_is_asked_for_again(
    hostile: HostileGateway, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    write_private(tmp_path / TOKEN_NAME, b"1" * 64 + b"\n", 0o600)
    challenge = {"boot_id": "0" * 12, "time_ns": 5, "scheme": "token", "token_id": token_id(bytes.fromhex("1" * 64))}
    answers = iter([None, json.dumps(challenge).encode()])
    hostile.answers["challenge"] = lambda _: next(answers)
    hostile.answers["mark"] = lambda _: json.dumps({"accepted": True, "text": "marked"}).encode()
    command = ["remote", "mark", "x", "--by", "ann", "--connect", hostile.endpoint, "--credentials", str(tmp_path)]
    assert main(command) == 0
    assert capsys.readouterr().out == "mark: marked\n"
    assert [with_it for verb, with_it in hostile.asked if verb == "mark"] == [True]


def test_watching_survives_garbage_and_shows_what_is_valid(
    hostile: HostileGateway, capsys: pytest.CaptureFixture[str]
) -> None:
    good = {**MARK, "by": ESCAPE}
    forged = b'{"by": "x"}\n{"key": "plumbline/v1/other/crane/1/alert", "message": {}}'
    hostile.publish("mark", b"\xff\xfe", forged, b"", b"[" * 5000, json.dumps(good).encode())
    arguments = ["remote", "watch", "--topics", "mark", "--count", "2", "--connect", hostile.endpoint]
    assert main(arguments) == 0
    captured = capsys.readouterr()
    lines = [json.loads(line) for line in captured.out.splitlines()]
    assert [(line["key"], line["message"]["text"]) for line in lines] == [(f"{KEY}/mark", "hello")] * 2
    assert "\x1b" not in captured.out + captured.err


@pytest.mark.slow
@given(st.text())
def test_nothing_printable_steers_a_terminal(text: str) -> None:
    assert printable(text).isprintable()
    assert RpcReply(True, {"text": text}).text == printable(text)


@pytest.mark.slow
@given(st.sampled_from(sorted(TOPICS)), st.binary())
def test_random_messages_are_refused(topic: str, payload: bytes) -> None:
    assert parse_message(topic, payload) is None
    assert parse_status(payload) in (None, {})
