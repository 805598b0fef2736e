"""The page process as the daemon starts it: the private channel in, HTTP out."""

import contextlib
import json
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from gateway.daemon.outputs.page_channel import PageChannel
from gateway.page.channel import PARAMETERS, Frame, encode_frame, open_pair
from tests.gateway.page.conftest import FakeGateway, PageUnderTest
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow

PAGE = [sys.executable, "-m", "gateway.page"]
CSP = "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"


def _is(page: PageUnderTest, word: str) -> Callable[[], bool]:
    return lambda: bool(page.word() == word)


def test_state_health_and_metrics_follow_the_gateway(gateway: FakeGateway, page: PageUnderTest) -> None:
    wait_until(_is(page, "OK"), "OK")
    state = page.state()
    assert state["gateway"] is True
    assert state["topics"]["swing"]["phi_max_deg"] == 2.3
    assert set(state["age_s"]) == set(state["topics"])
    assert page.get("/healthz")[0] == 200
    assert "plumbline_phi_max_degrees{" in page.get("/metrics")[1]
    assert "drift" not in page.get("/metrics")[1]  # before it is known
    gateway.scene.drift = {"state": "alarm", "norm_error_mg": 9.0, "limit_mg": 5.0}
    wait_until(lambda: "plumbline_drift_alarm" in page.get("/metrics")[1], "the drift")
    assert "plumbline_drift_norm_error_g{" in page.get("/metrics")[1]

    gateway.scene.level = "trip"
    wait_until(_is(page, "TRIP"), "TRIP")
    assert page.get("/healthz")[0] == 200  # an alarm is no fault of the gateway

    gateway.speaking.clear()
    wait_until(_is(page, "STALE"), "STALE")
    status, body = page.get("/healthz")
    assert (status, json.loads(body)["ok"]) == (503, False)
    assert "plumbline_phi_max_degrees{" in page.get("/metrics")[1]  # the swing has the longer pause
    gateway.speaking.set()
    wait_until(_is(page, "TRIP"), "TRIP again")

    gateway.speaking.clear()
    wait_until(lambda: not page.state()["gateway"], "a gateway that hangs")
    assert page.get("/healthz")[0] == 503
    assert "plumbline_phi_max_degrees{" not in page.get("/metrics")[1]


def test_a_page_that_starts_first_waits_for_its_gateway(
    channel: PageChannel, page: PageUnderTest, start_gateway: Callable[[PageChannel], FakeGateway]
) -> None:
    assert page.word() == "NO DATA"
    assert page.get("/healthz")[0] == 503
    with contextlib.closing(start_gateway(channel)):
        wait_until(_is(page, "OK"), "OK")


def test_static_files_and_headers(page: PageUnderTest) -> None:
    for path, media_type in {"/": "text/html", "/base.css": "text/css", "/page.js": "text/javascript"}.items():
        with urllib.request.urlopen(page.url + path, timeout=PATIENCE_S) as response:
            assert response.headers.get_content_type() == media_type
            assert response.headers["Content-Security-Policy"] == CSP
            assert response.headers["X-Content-Type-Options"] == "nosniff"
            assert response.headers["Cache-Control"] == "no-store"
    for path in ("/nothing", "/../server.py", "/%2e%2e/server.py", "/static/page.js"):
        assert page.get(path)[0] == 404
    request = urllib.request.Request(page.url + "/api/state", data=b"{}", method="POST")
    with pytest.raises(urllib.error.HTTPError, match="405") as refused:
        urllib.request.urlopen(request, timeout=PATIENCE_S)
    refused.value.close()


def _events(response: Any) -> Iterator[dict[str, str]]:
    event: dict[str, str] = {}
    for line in response:
        name, _, value = line.decode().rstrip("\n").partition(": ")
        if name:
            event[name] = value
        elif event:
            yield event
            event = {}


@pytest.mark.usefixtures("gateway")
def test_updates_are_pushed(gateway: FakeGateway, page: PageUnderTest) -> None:
    wait_until(_is(page, "OK"), "OK")
    with urllib.request.urlopen(page.url + "/api/events", timeout=PATIENCE_S) as response:
        assert response.headers.get_content_type() == "text/event-stream"
        events = _events(response)
        assert next(events) == {"retry": "500"}
        first, history = next(events), next(events)
        assert history["event"] == "history"
        assert json.loads(history["data"])["points"][0][2] == 2.3
        assert (first["event"], json.loads(first["data"])["verdict"]["word"]) == ("state", "OK")
        gateway.scene.phi_max_deg = 3.7
        pushed = [next(events) for _ in range(10)]
        while (last := json.loads(pushed[-1]["data"]))["topics"].get("swing", {}).get("phi_max_deg") != 3.7:
            pushed.append(next(events))
    numbers = [int(event["id"]) for event in pushed]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert {event["event"] for event in pushed} == {"change"}
    assert last["topics"]["calibration"]["record"] == {}
    indices = [row[0] for event in pushed for row in json.loads(event["data"])["points"]]
    assert indices == list(range(indices[0], indices[-1] + 1))


@pytest.mark.usefixtures("gateway")
def test_what_has_not_changed_and_what_a_browser_has_of_the_history_is_not_sent_again(page: PageUnderTest) -> None:
    wait_until(_is(page, "OK"), "OK")
    parts = ("alert_log", "page")

    def first_events(query: str, count: int) -> list[Any]:
        with urllib.request.urlopen(f"{page.url}/api/events{query}", timeout=PATIENCE_S) as response:
            events = _events(response)
            next(events)
            return [json.loads(next(events)["data"]) for _ in range(count)]

    state, history, _, *pushed = first_events("", 8)
    assert all(part in state for part in parts)
    assert all(part not in push for part in parts for push in pushed)
    assert all("verdict" in push and "age_s" in push for push in pushed)
    newest = history["points"][-1][0]
    again = first_events(f"?history={history['id']}&after={newest}", 2)[1]
    assert [row[0] for row in again["points"]] == list(range(newest + 1, newest + 1 + len(again["points"])))
    for query in (f"?history=other&after={newest}", f"?history={history['id']}&after=-1", "?after=x"):
        assert first_events(query, 2)[1]["points"][0][0] == history["points"][0][0]


def test_invalid_payloads_are_ignored(gateway: FakeGateway, page: PageUnderTest) -> None:
    wait_until(_is(page, "OK"), "OK")
    for payload in (b"", b"\x00\xff", b"[]", b'{"time_ns": 1e999}', b"[" * 5000):
        before = _invalid(page)

        def counted(payload: bytes = payload, before: int = before) -> bool:
            gateway.put("health", payload)  # more than once: a good one may come over it before it is read
            return _invalid(page) > before

        wait_until(counted, f"{payload[:20]!r} to be counted")
    assert page.word() == "OK"


def _invalid(page: PageUnderTest) -> int:
    found = re.search(r"^plumbline_page_invalid_messages_total\{.*\} (\d+)$", page.get("/metrics")[1], re.M)
    assert found is not None
    return int(found[1])


@pytest.mark.usefixtures("gateway")
@pytest.mark.parametrize("ending", ["SIGTERM", "SIGINT", "parent gone"])
def test_it_ends_quietly_with_a_browser_attached(
    channel: PageChannel, ending: str, capfd: pytest.CaptureFixture[str]
) -> None:
    page = PageUnderTest(channel)  # here, so that it inherits the captured standard error
    wait_until(_is(page, "OK"), "OK")
    with urllib.request.urlopen(page.url + "/api/events", timeout=PATIENCE_S) as response:
        assert response.readline() == b"retry: 500\n"
        if ending == "parent gone":
            channel.close()
        else:
            page.process.send_signal(signal.Signals[ending])
        assert page.process.wait(PATIENCE_S) == 0
        response.read()
    page.listener.close()
    assert capfd.readouterr() == ("", "")


def test_it_ends_while_it_waits_for_its_gateway(page: PageUnderTest) -> None:
    assert page.word() == "NO DATA"
    assert page.close() == 0


GOOD = b'{"key": "plumbline/v1/a/b/c", "fd": 0, "warn_deg": 4, "trip_deg": 6}'


@pytest.mark.parametrize(
    ("frame", "says"),
    [
        (Frame(PARAMETERS, 0.0, b"{}"), "key: Field required"),
        (Frame("alert", 0.0, b"{}"), "no parameters from the gateway"),
        (None, "no parameters from the gateway"),
        (Frame(PARAMETERS, 0.0, GOOD.replace(b'"fd": 0', b'"fd": 99')), "fd: 99"),
    ],
)
def test_wrong_start_parameters_end_it_with_one_line(frame: Frame | None, says: str) -> None:
    ours, theirs = open_pair()
    with theirs:
        if frame is not None:
            ours.send(encode_frame(frame))
        ours.close()
        ended = subprocess.run(
            PAGE, stdin=theirs.fileno(), capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
    assert ended.returncode == 2
    assert says in ended.stderr
    assert ended.stderr.count("\n") == 1


def test_a_standard_input_that_is_no_channel_is_refused_in_one_line() -> None:
    ended = subprocess.run(PAGE, input="{}", capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert (ended.returncode, ended.stderr.count("\n")) == (2, 1)


def test_the_socket_outlives_the_process(page: PageUnderTest) -> None:
    page.process.kill()
    with socket.create_connection(page.listener.getsockname(), timeout=PATIENCE_S):
        page.start_again()
        wait_until(_is(page, "NO DATA"), "an answer")
