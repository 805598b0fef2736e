"""Hub, metrics, start parameters."""

import asyncio
import json
import re
from dataclasses import replace
from typing import Any

import pytest

from gateway.page.channel import Parameters, encode_parameters, parse_parameters
from gateway.page.hub import MAX_STREAMS_PER_ADDRESS, MAX_WAITING_PUSHES, EventStream, event
from gateway.page.metrics import Counters, format_exposition
from gateway.page.verdict import PageEvidence
from gateway.topics import TOPIC_OF
from tests.gateway.scene import Scene

KEY = "plumbline/v1/north-yard/crane-3/hook"
PARAMETERS = Parameters(key=KEY, warn_deg=4.0, trip_deg=6.0, fd=5)
LABELS = {"site": "north-yard", "crane": "crane-3", "sensor": "hook"}
COUNTERS = Counters(received={"tilt": 7}, invalid=1, clients=3, dropped_clients=4)


async def _next(stream: Any) -> bytes:
    async with asyncio.timeout(5):
        return bytes(await anext(stream))


def test_browsers_share_one_payload_and_the_slow_one_is_dropped() -> None:
    async def scenario() -> None:
        hub = EventStream()
        quick, slow = (hub.stream(address, lambda: b"hello\n\n") for address in "ab")
        assert await _next(quick) == await _next(slow) == b"retry: 500\n\nhello\n\n"
        payload = event("state", {"a": 1}, number=7)
        for _ in range(MAX_WAITING_PUSHES + 1):
            hub.publish(payload)
            assert await _next(quick) is payload
        assert (len(hub), hub.dropped) == (1, 1)
        with pytest.raises(StopAsyncIteration):
            await _next(slow)  # ended, and what it had not read is forgotten
        hub.close()
        with pytest.raises(StopAsyncIteration):
            await _next(quick)
        assert hub.closed

    asyncio.run(scenario())


def test_a_browser_is_greeted_with_what_is_known_when_it_is_admitted() -> None:
    """A push has only what has changed: what changes between the request and the admission would be lost."""

    async def scenario() -> None:
        hub, known = EventStream(), [b"old"]
        stream = hub.stream("a", lambda: known[-1])
        known.append(b"new")
        hub.publish(b"change to new")  # before the admission
        assert await _next(stream) == b"retry: 500\n\nnew"
        hub.publish(b"next")
        assert await _next(stream) == b"next"
        hub.close()

    asyncio.run(scenario())


def test_a_new_browser_replaces_the_oldest_of_its_address_where_there_are_too_many() -> None:
    async def scenario() -> None:
        hub = EventStream()
        streams = [hub.stream("a", bytes) for _ in range(MAX_STREAMS_PER_ADDRESS)]
        other = hub.stream("b", bytes)
        for stream in (other, *streams, hub.stream("a", bytes)):
            await _next(stream)
        assert (len(hub), hub.dropped) == (MAX_STREAMS_PER_ADDRESS + 1, 1)
        with pytest.raises(StopAsyncIteration):
            await _next(streams[0])
        hub.publish(b"news")
        assert await _next(streams[1]) == await _next(other) == b"news"
        hub.close()

    asyncio.run(scenario())


def test_numbers_that_are_not_finite_become_null_in_an_event() -> None:
    text = event("state", {"nan": float("nan"), "inf": float("inf"), "line": "a\nb"}, number=3).decode()
    assert text.startswith("id: 3\nevent: state\ndata: ")
    assert text.endswith("\n\n")
    assert text.count("\n") == 4
    assert json.loads(text.split("data: ")[1]) == {"nan": None, "inf": None, "line": "a\nb"}


def _evidence(scene: Scene, **ages_s: float) -> PageEvidence:
    latest = {TOPIC_OF[type(message)].name: message for message in scene.messages(0, 1)}
    return PageEvidence(True, latest, dict.fromkeys(latest, 0.25) | ages_s, 1.0)


def _samples(text: str) -> dict[str, float]:
    rows = [line.rsplit(" ", 1) for line in text.splitlines() if not line.startswith("#")]
    return {name: float(value) for name, value in rows}


def test_metrics_are_exposition_format(scene: Scene) -> None:
    text = format_exposition(_evidence(scene), COUNTERS, LABELS)
    labels = 'site="north-yard",crane="crane-3",sensor="hook"'
    samples = _samples(text)
    assert samples[f"plumbline_phi_max_degrees{{{labels}}}"] == 2.3
    assert samples[f"plumbline_phi_max_u_degrees{{{labels}}}"] == 0.1
    assert samples[f'plumbline_alert_level{{{labels},level="normal"}}'] == 1
    assert samples[f'plumbline_alert_level{{{labels},level="trip"}}'] == 0
    assert samples[f'plumbline_verdict{{{labels},verdict="OK"}}'] == 1
    assert samples[f"plumbline_samples_total{{{labels}}}"] == 450123
    assert samples[f"plumbline_lost_samples_total{{{labels}}}"] == 12
    assert samples[f'plumbline_faults_total{{{labels},fault="overrun"}}'] == 2
    assert samples[f'plumbline_age_seconds{{{labels},topic="tilt"}}'] == 0.25
    assert samples[f"plumbline_recording_error{{{labels}}}"] == 0
    families = {name.split("{")[0] for name in samples}
    assert families == set(re.findall(r"^# TYPE (\w+) (?:gauge|counter)$", text, re.M))
    assert families == set(re.findall(r"^# HELP (\w+) \S.*$", text, re.M))
    assert text.endswith("\n")


def test_metrics_omit_stale_and_unknown_values(scene: Scene) -> None:
    scene.level = "trip"
    stale = format_exposition(_evidence(scene, swing=60.0, alert=60.0), COUNTERS, LABELS)
    assert "phi_max" not in stale
    assert 'level="unknown"} 1' in stale
    assert 'verdict="STALE"} 1' in stale
    scene.phi_max_deg = None
    assert "plumbline_phi_max_degrees" not in format_exposition(_evidence(scene), COUNTERS, LABELS)
    nothing = format_exposition(PageEvidence(False, {}, {}, 1.0), COUNTERS, LABELS)
    assert _samples(nothing)['plumbline_up{site="north-yard",crane="crane-3",sensor="hook"}'] == 0


def test_start_parameters_are_encoded_and_parsed() -> None:
    parameters = replace(PARAMETERS, title="Crane 3", lean_trip_deg=3.0)
    assert parse_parameters(encode_parameters(parameters)) == parameters
    assert parameters.place == LABELS


@pytest.mark.parametrize(
    ("line", "names"),
    [
        (b"", "parameters"),
        (b"[]", "parameters"),
        (b"{}", "key"),
        (encode_parameters(PARAMETERS).replace(b"hook", b"hook/**"), "key"),
        (encode_parameters(PARAMETERS).replace(b"4.0", b"-4.0"), "warn_deg"),
        (encode_parameters(PARAMETERS).replace(b'"fd"', b'"df"'), "df"),
    ],
)
def test_wrong_start_parameters_are_named_in_one_line(line: bytes, names: str) -> None:
    with pytest.raises(ValueError, match=names) as refused:
        parse_parameters(line)
    assert "\n" not in str(refused.value)
