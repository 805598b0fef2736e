"""The result of one check of `plumbline doctor`."""

from dataclasses import dataclass
from typing import Literal

Grade = Literal["good", "note", "bad"]


@dataclass(frozen=True, slots=True)
class CheckResult:
    """A grade, the place that was checked, and one line."""

    grade: Grade
    place: str
    text: str
