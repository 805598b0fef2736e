"""Queries to a gateway, below its client: with any payload and any attachment."""

import json
from pathlib import Path
from typing import Any

import zenoh

from gateway.authorization.credential import Challenge
from gateway.bus.credentials import load_credentials
from tests.values import present
from tests.waiting import PATIENCE_S

KEY = "plumbline/v1/demo-site/crane-1/hook-1"
"""Of a gateway whose configuration names no other."""

Answer = tuple[bool, Any]
"""Whether the request was accepted, and the content of the reply."""


def query(
    session: zenoh.Session, verb: str, payload: bytes | None = None, attachment: bytes | None = None, key: str = KEY
) -> list[Answer]:
    """Every answer to a request."""
    replies = session.get(f"{key}/rpc/{verb}", payload=payload, attachment=attachment, timeout=PATIENCE_S)
    return [(reply.ok is not None, _content(reply)) for reply in replies]


def query_signed(session: zenoh.Session, verb: str, payload: bytes, data_dir: Path) -> list[Answer]:
    """Every answer to a request with the token of a data folder."""
    return query(session, verb, payload, sign(session, verb, payload, data_dir))


def sign(session: zenoh.Session, verb: str, payload: bytes, data_dir: Path) -> bytes:
    """The attachment that proves the token of a data folder."""
    ((_, challenge),) = query(session, "challenge")
    proof = load_credentials(data_dir).prove(f"{KEY}/rpc/{verb}", payload, Challenge.model_validate(challenge))
    return present(proof)


def _content(reply: zenoh.Reply) -> Any:
    answer = present(reply.err) if reply.ok is None else reply.ok
    return json.loads(answer.payload.to_bytes())
