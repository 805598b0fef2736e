"""A signature is that of one message or answer alone: whatever is changed, it is refused."""

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.authorization.message_signature import (
    MAX_SIGNATURE_BYTES,
    MessageSigner,
    Question,
    join_signature,
    parse_signature,
    split_signature,
)
from gateway.pki.signing_key import SigningKey
from tests.values import present

NAME = "plumbline/v1/yard/c1/hook-1/alert"
PAYLOAD = b'{"level":"trip","active":[]}'
QUESTION = Question(b'{"id":"7"}', b"a number that nobody else could foresee")
LONGEST_TIME_NS = 2**63 - 1
KEY = SigningKey(Ed25519PrivateKey.generate())


@pytest.fixture
def signer() -> MessageSigner:
    return MessageSigner(lambda: KEY, "0123456789ab", lambda: LONGEST_TIME_NS)


def is_message(payload: bytes, attachment: bytes, key_expr: str = NAME) -> bool:
    signature = parse_signature(attachment)
    return signature is not None and signature.is_of_message(key_expr, payload)


def is_answer(payload: bytes, attachment: bytes | None, question: Question, *, accepted: bool = True) -> bool:
    signature = parse_signature(attachment)
    return signature is not None and signature.is_of_answer(NAME, payload, question, accepted=accepted)


def flipped(content: bytes, bit: int) -> bytes:
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


@pytest.mark.slow
def test_no_single_bit_of_a_message_or_of_its_signature_can_be_changed(signer: MessageSigner) -> None:
    attachment = present(signer.sign_message(NAME, PAYLOAD))
    assert len(attachment) < MAX_SIGNATURE_BYTES
    assert is_message(PAYLOAD, attachment)
    assert not any(is_message(flipped(PAYLOAD, bit), attachment) for bit in range(8 * len(PAYLOAD)))
    assert not any(is_message(PAYLOAD, flipped(attachment, bit)) for bit in range(8 * len(attachment)))


@pytest.mark.slow
def test_no_single_bit_of_a_refusal_can_be_changed(signer: MessageSigner) -> None:
    refusal = b'{"accepted":false,"reason":"no"}'
    sent = join_signature(refusal, signer.sign_answer(NAME, refusal, QUESTION, accepted=False))
    assert is_answer(*split_signature(sent), QUESTION, accepted=False)
    assert not any(
        is_answer(*split_signature(flipped(sent, bit)), QUESTION, accepted=False) for bit in range(8 * len(sent))
    )


@pytest.mark.slow
@settings(max_examples=50)
@given(payload=st.binary(), name=st.text(), asked=st.binary(), number=st.binary(), accepted=st.booleans())
def test_an_answer_is_that_to_its_question_alone(
    payload: bytes, name: str, asked: bytes, number: bytes, accepted: bool
) -> None:
    signer = MessageSigner(lambda: KEY, "0123456789ab", lambda: 1)
    attachment = present(signer.sign_answer(name, payload, Question(asked, number), accepted=accepted))
    signature = present(parse_signature(attachment))
    assert signature.is_of_answer(name, payload, Question(asked, number), accepted=accepted)
    assert not signature.is_of_answer(name, payload, Question(asked, number), accepted=not accepted)
    assert not signature.is_of_answer(name, payload, Question(asked, number + b"0"), accepted=accepted)
    assert not signature.is_of_answer(name, payload, Question(asked + b"0", number), accepted=accepted)
    assert not signature.is_of_answer(name + "0", payload, Question(asked, number), accepted=accepted)
    assert not signature.is_of_message(name, payload)


@given(attachment=st.binary(max_size=2 * MAX_SIGNATURE_BYTES))
def test_other_bytes_are_no_signature(attachment: bytes) -> None:
    assert parse_signature(attachment) is None
    assert split_signature(attachment)[1] is None


def test_without_a_key_nothing_is_signed() -> None:
    signer = MessageSigner(lambda: None, "0123456789ab", lambda: 1)
    assert signer.sign_message(NAME, PAYLOAD) is None
    assert join_signature(b'{"accepted":false}', None) == b'{"accepted":false}'
