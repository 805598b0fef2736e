"""Questions to gateways: each with a number that nobody can foresee, so that its answer cannot be prepared."""

import secrets
from collections.abc import Callable, Iterable
from typing import Any

import zenoh

from gateway.authorization.message_signature import MAX_SIGNATURE_BYTES, Question


def make_question(payload: bytes = b"") -> Question:
    """Return a question whose answer cannot be prepared."""
    return Question(payload, secrets.token_bytes(16))


def send_question(
    session: zenoh.Session,
    key_expr: str,
    question: Question,
    timeout_s: float,
    take: Callable[[zenoh.Reply], object] | None = None,
) -> Iterable[zenoh.Reply]:
    """Ask, and return all answers, or pass them on: the library alone would keep one of several with the same key."""
    options: dict[str, Any] = {
        "payload": question.payload,
        "attachment": question.attachment or None,
        "timeout": timeout_s,
        "consolidation": zenoh.ConsolidationMode.NONE,
    }
    if take is None:
        answers: Iterable[zenoh.Reply] = session.get(key_expr, **options)
        return answers
    session.get(key_expr, take, **options)
    return ()


def read_attachment(sample: zenoh.Sample) -> bytes | None:
    """Return the attachment of a sample, as far as it may be a signature."""
    attachment = sample.attachment
    return None if attachment is None or len(attachment) > MAX_SIGNATURE_BYTES else attachment.to_bytes()
