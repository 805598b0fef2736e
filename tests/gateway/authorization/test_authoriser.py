"""The authoriser: who is let in, with which role, and only once."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.authorization.authoriser import CODE_BITS, MAX_REMEMBERED, WINDOW_S, Authoriser, SignedRequest
from gateway.authorization.caller import Caller, NotAuthorised, Role
from gateway.authorization.credential import prove_by_token
from tests.values import present

BOOT = "0123456789ab"
SECRET = bytes(range(32))
KEY = "plumbline/v1/a/b/c/rpc/cancel"
PAYLOAD = b'{"id": "request-1", "by": "ann"}'
NOW_NS = 1_767_225_600_000_000_000
STEP_NS = 1 << CODE_BITS


@pytest.fixture
def authoriser() -> Authoriser:
    return Authoriser(BOOT, SECRET)


def signed(authoriser: Authoriser, secret: bytes = SECRET, now_ns: int = NOW_NS, **change: Any) -> SignedRequest:
    """A request that answers a challenge; changed after it was signed."""
    credential = prove_by_token(secret, KEY, PAYLOAD, authoriser.challenge(now_ns))
    request = {"key_expr": KEY, "payload": PAYLOAD, "attachment": credential.model_dump_json().encode()}
    return SignedRequest(**{**request, **change})


def refusal(authoriser: Authoriser, request: SignedRequest, now_ns: int = NOW_NS) -> str:
    with pytest.raises(NotAuthorised) as caught:
        authoriser.admit(request, Role.SERVICE, now_ns)
    assert "\n" not in str(caught.value)
    return caught.value.kind


def test_a_request_with_the_gateways_token_is_admitted_with_every_right(authoriser: Authoriser) -> None:
    caller = authoriser.admit(signed(authoriser), Role.SERVICE, NOW_NS + 10**9)
    asked_ns = present(caller.asked_ns)
    assert caller == Caller(None, Role.SERVICE, "token", asked_ns)
    assert abs(asked_ns - NOW_NS) < 2 * STEP_NS


def test_a_request_without_a_credential_is_refused(authoriser: Authoriser) -> None:
    assert refusal(authoriser, SignedRequest(KEY, PAYLOAD, None)) == "no_credential"


def test_a_credential_by_another_secret_is_refused(authoriser: Authoriser) -> None:
    assert refusal(authoriser, signed(authoriser, secret=bytes(32))) == "wrong_token"


@pytest.mark.parametrize("change", [{"payload": PAYLOAD + b" "}, {"key_expr": KEY.replace("cancel", "zero")}])
def test_a_credential_is_worth_nothing_for_another_request(authoriser: Authoriser, change: dict[str, Any]) -> None:
    assert refusal(authoriser, signed(authoriser, **change)) == "wrong_token"


def test_a_captured_request_is_refused_when_it_is_sent_again(authoriser: Authoriser) -> None:
    request = signed(authoriser)
    authoriser.admit(request, Role.SERVICE, NOW_NS)
    assert refusal(authoriser, request, NOW_NS + 1) == "replayed_credential"


def test_a_credential_expires_and_is_not_good_before_its_challenge(authoriser: Authoriser) -> None:
    late_ns = NOW_NS + round(WINDOW_S * 1e9) + 1
    assert refusal(authoriser, signed(authoriser), late_ns) == "stale_credential"
    assert refusal(authoriser, signed(authoriser), NOW_NS - 2 * STEP_NS) == "stale_credential"


def test_a_request_that_was_signed_for_an_invented_later_challenge_is_worth_nothing_then(
    authoriser: Authoriser,
) -> None:
    later_ns = NOW_NS + 94 * 10**9
    for guess in range(1000):
        challenge = authoriser.challenge(NOW_NS).model_copy(update={"time_ns": later_ns + guess})
        credential = prove_by_token(SECRET, KEY, PAYLOAD, challenge)
        kept = SignedRequest(KEY, PAYLOAD, credential.model_dump_json().encode())
        assert refusal(authoriser, kept, later_ns + 10**9) == "stale_credential"


def test_challenges_of_one_time_differ_between_boots_of_one_gateway() -> None:
    times_ns = {Authoriser(BOOT, SECRET).challenge(NOW_NS).time_ns for _ in range(3)}
    assert len(times_ns) == 3
    assert all(0 < NOW_NS - time_ns < 2 * STEP_NS for time_ns in times_ns)


def test_a_credential_of_another_boot_is_refused(authoriser: Authoriser) -> None:
    request = signed(authoriser)
    assert refusal(Authoriser("ba9876543210", SECRET), request) == "stale_credential"


@pytest.mark.slow
def test_a_flood_of_good_credentials_cannot_make_the_gate_forget_one_and_take_it_again(authoriser: Authoriser) -> None:
    first = signed(authoriser)
    authoriser.admit(first, Role.SERVICE, NOW_NS)
    for number in range(1, MAX_REMEMBERED + 1):
        now_ns = NOW_NS + number * STEP_NS
        authoriser.admit(signed(authoriser, now_ns=now_ns), Role.SERVICE, now_ns)
    assert refusal(authoriser, first, NOW_NS + (MAX_REMEMBERED + 1) * STEP_NS) == "stale_credential"


@given(st.binary(max_size=300))
def test_random_credentials_are_refused(attachment: bytes) -> None:
    assert refusal(Authoriser(BOOT, SECRET), SignedRequest(KEY, PAYLOAD, attachment)) == "malformed_credential"


@pytest.mark.slow
@given(st.sampled_from(["boot_id", "time_ns", "mac", "scheme"]), st.one_of(st.text(), st.integers(), st.none()))
def test_a_credential_with_a_random_field_is_refused(field: str, value: Any) -> None:
    authoriser = Authoriser(BOOT, SECRET)
    credential = prove_by_token(SECRET, KEY, PAYLOAD, authoriser.challenge(NOW_NS)).model_dump()
    attachment = json.dumps({**credential, field: value}).encode()
    if credential[field] != value:
        assert refusal(authoriser, SignedRequest(KEY, PAYLOAD, attachment)) in {
            "malformed_credential",
            "stale_credential",
            "wrong_token",
        }
