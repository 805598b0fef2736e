"""The checks of `plumbline doctor`, the diagnostic bundle, and the result of one check."""

from dataclasses import dataclass, field
from typing import Any, Literal

Grade = Literal["good", "note", "bad"]


@dataclass(frozen=True, slots=True)
class CheckResult:
    """A grade, the place that was checked, and one line."""

    grade: Grade
    place: str
    text: str
    values: dict[str, Any] = field(default_factory=dict)
    """What was measured, for a record of the check."""
    sketch: tuple[str, ...] = ()
    """Lines of a drawing for people."""
