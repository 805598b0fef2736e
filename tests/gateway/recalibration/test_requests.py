"""Validation of requests: every invalid payload is refused with the place and the reason."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.recalibration.requests import MAX_PAYLOAD_BYTES, VERBS, Fetch, RequestError, parse_payload

GOOD = {"id": "request-1", "by": "ann"}


@pytest.mark.parametrize("verb", VERBS)
def test_id_and_person_are_sufficient(verb: str) -> None:
    request = parse_payload(VERBS[verb], json.dumps(GOOD).encode())
    assert (request.id, request.by, request.reason) == ("request-1", "ann", "")


@pytest.mark.parametrize(
    ("verb", "change", "place"),
    [
        ("commit", {"by": ""}, "by"),
        ("commit", {"by": "ann\nbob asked for everything"}, "by"),
        ("commit", {"by": "a" * 81}, "by"),
        ("commit", {"id": "short"}, "id"),
        ("commit", {"id": "../../etc/passwd"}, "id"),
        ("commit", {"record": "../r1"}, "record"),
        ("commit", {"reason": "x" * 501}, "reason"),
        ("commit", {"force": True}, "force"),
        ("rollback", {"to": ".."}, "to"),
        ("recalibrate", {"method": "guess"}, "method"),
        ("recalibrate", {"housing_off_rope": "perhaps"}, "housing_off_rope"),
        ("recalibrate", {"housing_off_rope": "yes"}, "housing_off_rope"),
        ("recalibrate", {"housing_off_rope": 1}, "housing_off_rope"),
    ],
)
def test_an_invalid_field_is_named(verb: str, change: dict[str, Any], place: str) -> None:
    with pytest.raises(RequestError, match=f"^{place}: ") as caught:
        parse_payload(VERBS[verb], json.dumps(GOOD | change).encode())
    assert "\n" not in str(caught.value)


def test_an_id_is_described_in_words() -> None:
    with pytest.raises(
        RequestError, match="id: should be an id of 8 to 64 letters, digits, dots, underscores and hyphens"
    ):
        parse_payload(VERBS["commit"], json.dumps(GOOD | {"id": "it:"}).encode())


def test_a_payload_beyond_the_largest_size_is_refused() -> None:
    with pytest.raises(RequestError, match="are allowed"):
        parse_payload(VERBS["commit"], json.dumps(GOOD).encode() + b" " * MAX_PAYLOAD_BYTES)


@given(st.binary(max_size=200))
def test_random_payloads_are_refused(payload: bytes) -> None:
    for verb in VERBS:
        with pytest.raises(RequestError):
            parse_payload(VERBS[verb], payload)


def test_fetch_requests_the_list_by_default() -> None:
    assert parse_payload(Fetch, b"").what == "records"
    with pytest.raises(RequestError, match="name the record"):
        parse_payload(Fetch, b'{"what": "record"}')
