"""`remote status` as a person reads it: the state first, nothing raw, nothing good where a message is missing."""

import json
from datetime import timedelta
from typing import Any

import pytest

from gateway.fleet.status_text import judge_answer, status_lines
from gateway.messages import Message
from gateway.topics import TOPIC_OF, encode
from tests.gateway.fleet.test_fleet_state import KEY, NOW_UTC
from tests.gateway.scene import SAMPLE_TIME_NS, Scene

DRIFT = {"at_rest": "not known yet", "by_records": "not known"}


def answer(*messages: Message) -> dict[str, Any]:
    return {TOPIC_OF[type(message)].name: json.loads(encode(message)) for message in messages}


def page(topics: dict[str, Any], later_s: float = 1.0) -> list[str]:
    now_utc = NOW_UTC + timedelta(seconds=later_s)
    status, messages = judge_answer(KEY, topics, None, 100.0, now_utc)
    return status_lines(status, messages, DRIFT, now_utc)


def test_a_gateway_that_is_well_is_said_so_first() -> None:
    lines = page(answer(*Scene().messages(0, SAMPLE_TIME_NS)))
    assert lines[0] == "north-yard/crane-3/hook: OK"
    found = {line.split()[0] for line in lines[1:]}
    assert {"swing", "condition", "alerts", "calibration", "drift", "device", "faults", "recording", "gateway"} <= found
    assert not any("clock differs" in line for line in lines)


def test_a_clock_that_differs_is_said() -> None:
    assert any(
        "its clock differs from this one by +600 s" in line
        for line in page(answer(*Scene().messages(0, SAMPLE_TIME_NS)), 600.0)
    )


@pytest.mark.parametrize("missing", ["swing", "condition", "alert", "health"])
def test_an_answer_that_lacks_a_message_is_not_ok(missing: str) -> None:
    topics = answer(*Scene().messages(0, SAMPLE_TIME_NS))
    del topics[missing]
    first = page(topics)[0]
    assert (first != "north-yard/crane-3/hook: OK") == (missing != "health")


@pytest.mark.parametrize(
    "hostile", [None, 7, "text", [], {}, {"text": "\x1b[2J"}, {"schema_version": 1, "text": ["\x1b]0;owned\x07"]}]
)
def test_what_is_no_message_is_left_out(hostile: Any) -> None:
    topics = dict.fromkeys((*answer(*Scene().messages(0, SAMPLE_TIME_NS)), "no_such_topic"), hostile)
    lines = page(topics)
    assert lines[0].endswith("NO DATA")


def test_control_characters_of_the_bus_do_not_reach_the_terminal() -> None:
    topics = answer(*Scene().messages(0, SAMPLE_TIME_NS))
    topics["alert"]["text"] = "fine\x1b[2J\nnorth-yard/other: OK"
    lines = page(topics)
    assert not any("\x1b" in line or "\n" in line for line in lines)
    assert any("fine" in line for line in lines)
