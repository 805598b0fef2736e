"""What is no request is refused with the place and the reason, whatever it is."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.recalibration.requests import LARGEST_PAYLOAD, VERBS, RequestError, parse_fetch, parse_request

GOOD = {"id": "request-1", "by": "ann"}


@pytest.mark.parametrize("verb", VERBS)
def test_id_and_name_are_enough(verb):
    request = parse_request(verb, json.dumps(GOOD).encode())
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
    ],
)
def test_what_is_wrong_is_named(verb, change, place):
    with pytest.raises(RequestError, match=f"^{place}: ") as caught:
        parse_request(verb, json.dumps(GOOD | change).encode())
    assert "\n" not in str(caught.value)


def test_a_payload_has_a_largest_size():
    with pytest.raises(RequestError, match="is the most"):
        parse_request("commit", json.dumps(GOOD).encode() + b" " * LARGEST_PAYLOAD)


@given(st.binary(max_size=200))
def test_no_payload_does_more_than_be_refused(payload):
    for verb in VERBS:
        with pytest.raises(RequestError):
            parse_request(verb, payload)


def test_fetch_asks_for_the_list_unless_told():
    assert parse_fetch(b"").what == "records"
    with pytest.raises(RequestError, match="say which one"):
        parse_fetch(b'{"what": "record"}')
