"""What is authenticated: signed with a known key, of this boot, in time, once; everything else is doubtful, and says why."""

import time
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from gateway.authorization.message_signature import MessageSigner, Question
from gateway.bus.authenticity import LONGEST_ANSWER_S, MAX_AGE_S, OLD, UNANSWERED, UNSIGNED, Authenticity, Doubt
from gateway.bus.known_gateways import Signers, known_statement
from gateway.pki.signing_key import SigningKey, fingerprint
from tests.values import present

YARD = "plumbline/v1/yard/c1/hook-1"
UNNAMED = "plumbline/v1/demo-site/crane-1/hook-1"
PAYLOAD = b'{"level":"normal"}'
ASKED = Question(b"", b"0123456789abcdef")


class Gateway:
    """A gateway whose clock stands where the test puts it, one hour before this machine's."""

    def __init__(self, name: str = YARD, boot_id: str = "0123456789ab", key: SigningKey | None = None) -> None:
        self.name = name
        self.key = key or SigningKey(Ed25519PrivateKey.generate())
        self.later_s = 0.0
        self._begun_s = time.monotonic()
        self.signer = MessageSigner(lambda: self.key, boot_id, lambda: round((self.later_s + 3600) * 1e9))

    def send(
        self, receiver: Authenticity, delay_s: float = 0.0, topic: str = "alert", live: bool = True
    ) -> Doubt | None:
        """What the receiver doubts about a message that is signed now."""
        attachment = self.signer.sign_message(f"{self.name}/{topic}", PAYLOAD)
        at_s = self._begun_s + self.later_s + delay_s
        return receiver.judge_message(self.name, topic, PAYLOAD, attachment, at_s, live=live)

    def answer(self, receiver: Authenticity, delay_s: float = 0.0) -> Doubt | None:
        """What the receiver doubts about an answer that has come just now."""
        name = f"{self.name}/rpc/challenge"
        attachment = self.signer.sign_answer(name, PAYLOAD, ASKED, accepted=True)
        return receiver.judge_answer(name, ASKED, PAYLOAD, attachment, time.monotonic() - delay_s)


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    return {"XDG_STATE_HOME": str(tmp_path)}


@pytest.fixture
def receiver(environment: dict[str, str]) -> Authenticity:
    return Authenticity(environment=environment)


def kind(doubt: Doubt | None) -> str:
    return present(doubt).kind


def test_the_first_answer_pins_the_key_and_messages_are_authentic_from_then_on(
    receiver: Authenticity, environment: dict[str, str]
) -> None:
    gateway = Gateway()
    assert gateway.send(receiver) is UNANSWERED
    assert gateway.answer(receiver) is None
    assert present(known_statement(YARD, environment)).public_key == gateway.key.public_hex
    assert gateway.send(receiver) is None
    later = Authenticity(environment=environment)
    assert gateway.send(later) is UNANSWERED  # the key is known, and not whether this is the present
    assert gateway.answer(later) is None
    gateway.later_s = 1.0
    assert gateway.send(later) is None


def test_what_is_not_signed_is_worse_once_a_key_is_known(receiver: Authenticity, environment: dict[str, str]) -> None:
    gateway = Gateway()
    unsigned = YARD, "alert", PAYLOAD, None, time.monotonic()
    assert receiver.judge_message(*unsigned) is UNSIGNED
    assert gateway.answer(receiver) is None
    assert kind(receiver.judge_message(*unsigned)) == "wrong"
    assert kind(Authenticity(environment=environment).judge_message(*unsigned)) == "wrong"
    assert kind(receiver.judge_answer(f"{YARD}/rpc/mark", ASKED, PAYLOAD, None, time.monotonic())) == "wrong"


def test_another_key_is_named_with_the_command_that_accepts_it(
    receiver: Authenticity, environment: dict[str, str]
) -> None:
    assert Gateway().answer(receiver) is None
    other = Gateway()
    for doubt in (other.send(receiver), other.answer(receiver)):
        assert kind(doubt) == "wrong"
        assert f"--gateway {YARD} --accept-key {fingerprint(other.key.public_hex)}" in present(doubt).text
    accepting = Authenticity(accepted=fingerprint(other.key.public_hex), environment=environment)
    assert kind(Gateway().answer(accepting)) == "wrong"
    assert other.answer(accepting) is None
    assert other.answer(receiver) is None  # the pin is read again


def test_who_answers_first_at_the_first_contact_is_pinned_and_the_true_gateway_then_shows_it(
    receiver: Authenticity,
) -> None:
    true, between = Gateway(), Gateway()
    assert between.answer(receiver) is None  # what docs/reference/exchange.md says of the first contact
    assert kind(true.answer(receiver)) == kind(true.send(receiver)) == "wrong"


def test_where_a_folder_with_keys_is_named_no_other_one_is_pinned(environment: dict[str, str]) -> None:
    true, between = Gateway(), Gateway()
    careful = Authenticity(Signers(lambda: [true.key.public_hex], are_all=True), environment=environment)
    assert kind(between.send(careful)) == kind(between.answer(careful)) == "wrong"
    assert kind(careful.judge_message(YARD, "alert", PAYLOAD, None, time.monotonic())) == "wrong"
    assert true.answer(careful) is None
    assert known_statement(YARD, environment) is None


def test_beside_a_gateway_whose_key_was_found_no_other_one_is_pinned(environment: dict[str, str]) -> None:
    true, between = Gateway(), Gateway()
    local = Authenticity(Signers(lambda: [true.key.public_hex]), environment=environment)
    assert true.answer(local) is None
    assert kind(between.answer(local)) == "wrong"
    assert true.send(local) is None


def test_a_message_counts_once_and_for_a_short_time(receiver: Authenticity) -> None:
    gateway = Gateway()
    assert gateway.answer(receiver) is None
    gateway.later_s = 1.0
    assert gateway.send(receiver) is None
    assert gateway.send(receiver) is OLD
    assert gateway.send(receiver, topic="swing") is None
    gateway.later_s = 2.0
    assert gateway.send(receiver, delay_s=MAX_AGE_S + 1) is OLD
    assert gateway.send(receiver, delay_s=MAX_AGE_S - 1) is None


def test_messages_of_an_earlier_boot_are_not_fresh(receiver: Authenticity) -> None:
    before = Gateway()
    assert before.answer(receiver) is None
    after = Gateway(boot_id="ba9876543210", key=before.key)
    assert after.send(receiver) is UNANSWERED
    assert after.answer(receiver) is None
    assert after.send(receiver) is None
    before.later_s = 1.0
    assert before.send(receiver, delay_s=60.0) is OLD
    assert before.send(receiver, delay_s=60.0, live=False) is None  # kept by a storage: old, and says so


def test_a_clock_that_drifts_is_asked_again(receiver: Authenticity) -> None:
    gateway = Gateway()
    assert gateway.answer(receiver) is None
    gateway.later_s = 10.0
    assert gateway.send(receiver, delay_s=-4.0) is None  # this machine slept, or its clock is slower
    gateway.later_s = 11.0
    assert gateway.send(receiver, delay_s=2.0) is OLD


def test_an_answer_that_was_held_back_tells_no_time(receiver: Authenticity) -> None:
    gateway = Gateway()
    assert gateway.answer(receiver, delay_s=LONGEST_ANSWER_S + 1) is None
    assert gateway.send(receiver) is UNANSWERED


def test_a_name_that_many_gateways_have_is_known_by_a_folder_alone(environment: dict[str, str]) -> None:
    gateway = Gateway(UNNAMED)
    stranger = Authenticity(environment=environment)
    assert kind(gateway.send(stranger)) == kind(gateway.answer(stranger)) == "unknown"
    assert known_statement(UNNAMED, environment) is None
    friend = Authenticity(Signers(lambda: [gateway.key.public_hex]), environment=environment)
    assert gateway.answer(friend) is None
    assert gateway.send(friend) is None


def test_the_key_of_another_gateway_in_a_folder_does_not_replace_a_pin(environment: dict[str, str]) -> None:
    stolen = Gateway()
    friend = Authenticity(Signers(lambda: [stolen.key.public_hex]), environment=environment)
    assert Gateway().answer(friend) is None
    assert kind(stolen.answer(friend)) == kind(stolen.send(friend)) == "wrong"


def test_without_a_place_for_pins_nothing_is_trusted_at_the_first_contact() -> None:
    gateway = Gateway()
    nowhere = Authenticity(environment={})
    assert kind(gateway.send(nowhere)) == kind(gateway.answer(nowhere)) == "unknown"


def test_a_signature_for_another_gateway_or_topic_is_wrong(receiver: Authenticity) -> None:
    gateway = Gateway()
    assert gateway.answer(receiver) is None
    attachment = gateway.signer.sign_message(f"{YARD}/swing", PAYLOAD)
    assert kind(receiver.judge_message(YARD, "alert", PAYLOAD, attachment, time.monotonic())) == "wrong"
    other = YARD.replace("c1", "c2")
    assert kind(receiver.judge_message(other, "swing", PAYLOAD, attachment, time.monotonic())) != ""
    for name in ("plumbline/v1/a\x1b/b/c", "plumbline/v1/a", "x" * 300):
        assert kind(receiver.judge_message(name, "swing", PAYLOAD, attachment, time.monotonic())) == "unknown"
