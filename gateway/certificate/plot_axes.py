"""The area of a plot, and the scales of its axes with their ticks, as coordinates; y points down."""

import math
from dataclasses import dataclass

from gateway.documents.figures import tick_step
from gateway.documents.format import format_short

TICK_DIGITS = 6
"""Basis: a choice; the least half range of a scale is a millionth of its values."""


@dataclass(frozen=True, slots=True)
class PlotArea:
    """The size of a figure, and the frame in it."""

    width: float = 380.0
    height: float = 190.0
    left: float = 44.0
    right: float = 372.0
    top: float = 10.0
    bottom: float = 160.0


AREA = PlotArea()
"""Area of every figure of a certificate."""


@dataclass(frozen=True, slots=True)
class Tick:
    """A tick of an axis."""

    place: float
    label: str
    is_zero: bool = False


@dataclass(frozen=True, slots=True)
class Scale:
    """A linear scale from values to coordinates."""

    centre: float
    half: float
    low_place: float
    high_place: float

    def place(self, value: float) -> float:
        """Return the coordinate of a value."""
        middle = (self.low_place + self.high_place) / 2
        return middle + (value - self.centre) / self.half * (self.high_place - self.low_place) / 2

    def ticks(self) -> tuple[Tick, ...]:
        """Return the ticks at round values, at most seven."""
        step = tick_step(self.half)
        first, last = math.ceil((self.centre - self.half) / step), math.floor((self.centre + self.half) / step)
        return tuple(
            Tick(self.place(count * step), format_short(count * step, TICK_DIGITS), count == 0)
            for count in range(first, last + 1)
        )
