"""Encoding of recorded messages as JSON: what is not known is left out, so that viewers find plain numbers only."""

from dataclasses import fields, is_dataclass
from functools import cache
from math import isfinite
from typing import Any

import msgspec
import numpy as np

from gateway.messages import Log, Message

_ENCODER = msgspec.json.Encoder()


def encode_recorded(message: Message | Log) -> bytes:
    """Encode a message without its fields that are null or not finite."""
    return _ENCODER.encode(_known(message))


def _known(record: Any) -> dict[str, Any]:
    """Return the fields of a message, or of a part of one, that have a value."""
    content = {}
    for name in _field_names(record.__class__):
        value = _plain(getattr(record, name))
        if value is not None:
            content[name] = value
    return content


def _plain(value: Any) -> Any:
    """Return a value as JSON takes it; None for a number, or a list with one, that is not finite."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, list) and value and not isinstance(value[0], int | str):
        entries = [_plain(entry) for entry in value]
        return None if None in entries else entries
    return _known(value) if is_dataclass(value) else value


@cache
def _field_names(type_: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(type_))
