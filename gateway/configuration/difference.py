"""The difference between two configurations, key by key."""

from typing import Any

from pydantic import BaseModel, ConfigDict

from gateway.configuration.model import Configuration

Value = str | int | float | bool | list[str] | None


class KeyChange(BaseModel):
    """A key whose value differs; None: not given."""

    model_config = ConfigDict(frozen=True)

    key: str
    before: Value
    after: Value

    def __str__(self) -> str:
        return f"{self.key}: {_shown(self.before)} -> {_shown(self.after)}"


def difference(before: Configuration, after: Configuration) -> list[KeyChange]:
    """Return the keys with different values, with their defaults where they are not given, in the order of the sections."""
    old, new = flatten(before.model_dump(mode="json")), flatten(after.model_dump(mode="json"))
    keys = list(dict.fromkeys([*old, *new]))
    return [KeyChange(key=key, before=old.get(key), after=new.get(key)) for key in keys if old.get(key) != new.get(key)]


def flatten(table: dict[str, Any], prefix: str = "") -> dict[str, Value]:
    """Return the values of nested tables by their dotted keys."""
    flat: dict[str, Value] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[prefix + key] = value
    return flat


def _shown(value: Value) -> str:
    return "not given" if value is None else str(value)
