"""What comes from the bus, before anything uses it: bounded, valid by the type of its topic, and asked for where it is an answer.

A question has a number that nobody can foresee, so that its answer cannot be prepared.
"""

import json
import re
import secrets
from collections.abc import Callable, Iterable
from typing import Any

import zenoh
from pydantic import ValidationError

from gateway.authorization.message_signature import MAX_SIGNATURE_BYTES, Question
from gateway.configuration.section import NAME
from gateway.topics import KEY_PREFIX, TOPICS, adapter

GATEWAY_KEY = re.compile(f"{KEY_PREFIX}{NAME}/{NAME}/{NAME}")
"""Key of a gateway: the names that a configuration allows."""
LONGEST_KEY = 256
"""Basis: a choice; keys have a prefix, a name of 64 characters and a topic."""
MOST_GATEWAYS = 5000
"""Bound of the memory that a peer with invented names can take. Basis: a choice; more than any fleet, some ten kilobytes each."""
LARGEST_MESSAGE_BYTES = 1 << 20
"""Largest message. Basis: a calibration with all poses and its record is the largest one, some 60 kB."""


def parse_message(topic: str, payload: bytes) -> dict[str, Any] | None:
    """Return the fields of a message; None where it is too large or not valid by the type of its topic."""
    if len(payload) > LARGEST_MESSAGE_BYTES or topic not in TOPICS:
        return None
    try:
        return _plain(topic, adapter(topic).validate_json(payload))
    except ValidationError:
        return None


def parse_status(payload: bytes) -> dict[str, dict[str, Any]] | None:
    """Return the valid messages of a status by topic; None where it is not a status."""
    if len(payload) > LARGEST_MESSAGE_BYTES:
        return None
    try:
        content = json.loads(payload)
    except (ValueError, RecursionError):
        return None
    if not isinstance(content, dict):
        return None
    found = {}
    for topic in TOPICS:
        if topic in content:
            try:
                found[topic] = _plain(topic, adapter(topic).validate_python(content[topic]))
            except ValidationError:
                continue  # a field that a newer version knows differently: the other topics are shown
    return found


def gateway_of(sample: zenoh.Sample, suffix: str) -> str | None:
    """Return the key of the gateway that a message names as its origin; None where no configuration allows that name."""
    key = str(sample.key_expr).removesuffix(f"/{suffix}")
    return key if is_gateway_key(key) else None


def is_gateway_key(key: str) -> bool:
    """Return whether a configuration allows a key as that of a gateway."""
    return len(key) <= LONGEST_KEY and GATEWAY_KEY.fullmatch(key) is not None


def _plain(topic: str, message: object) -> dict[str, Any]:
    fields: dict[str, Any] = adapter(topic).dump_python(message, mode="json")
    return fields


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
