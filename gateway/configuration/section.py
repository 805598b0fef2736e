"""What every section of the configuration has in common."""

from collections.abc import Iterable
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from gateway.errors import pattern_of

KEY_PATTERN = pattern_of(
    r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", "letters, digits, '.', '_' and '-', and begin with a letter or a digit"
)


class Section(BaseModel):
    """A table of the file. Unknown keys are refused, and values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def one_of(values: Iterable[str | int]) -> Any:
    """Return the type of a key that has one of these values: a literal that follows from a table."""
    return Literal[tuple(values)]
