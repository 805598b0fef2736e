"""Helpers for figures as inline SVG, whichever way a figure is drawn, and the colours of all documents.

Line colours: Okabe and Ito 2008, for all eyes.
"""

import itertools
import math
import re
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
CURVE_POINTS = 900
"""Points of a curve across a figure. Basis: more than paper or a screen can show at its width."""
INK = "#1a1a1a"
FAINT = "#5a5f66"
LINE = "#c9ced4"
MEASURED = "#949aa1"
BEFORE = "#d55e00"
AFTER = "#0072b2"
SHADE = "#f0e442"
EVENT = "#a3357a"
ALARM = "#b00012"
PALETTE = {
    "ink": INK,
    "faint": FAINT,
    "line": LINE,
    "after": AFTER,
    "before": BEFORE,
    "event": EVENT,
    "measured": MEASURED,
    "alarm": ALARM,
}
"""The colours that the style sheet uses, by the names of its custom properties."""


@dataclass(frozen=True, slots=True)
class Figure:
    """A drawn figure."""

    svg: str
    """Made by this program alone, all text in it escaped: templates insert it as markup."""
    caption: str = ""


def tick_step(half_range: float) -> float:
    """Return a round step that gives at most three ticks on either side of zero."""
    power = 10.0 ** math.floor(math.log10(half_range / 2))
    return next(power * factor for factor in (1, 2, 5, 10) if half_range / (power * factor) < 3.5)


def decimate_curve(time_s: Array, values: Array, points: int = CURVE_POINTS) -> tuple[Array, Array]:
    """Return a curve (n,) with fewer points that looks the same: minimum and maximum of each interval, in order of time.

    Where a value is NaN, so is one of the interval, so that a gap remains.
    """
    if len(time_s) <= points:
        return time_s, values
    edges = np.linspace(0, len(time_s), points // 2 + 1).astype(int)
    places = np.concatenate([first + _extreme_places(values[first:last]) for first, last in itertools.pairwise(edges)])
    return time_s[places], values[places]


def decimate_band(time_s: Array, low: Array, high: Array, points: int = CURVE_POINTS) -> tuple[Array, Array, Array]:
    """Return a band (n,) with fewer points that covers the same: the lowest and the highest value of each interval."""
    if len(time_s) <= points:
        return time_s, low, high
    starts = np.linspace(0, len(time_s), points, endpoint=False).astype(int)
    return time_s[starts], np.fmin.reduceat(low, starts), np.fmax.reduceat(high, starts)


def _extreme_places(values: Array) -> NDArray[np.intp]:
    """Return the places of minimum, maximum and the first NaN."""
    unknown = np.isnan(values)
    if not unknown.any():
        return np.array(sorted({int(values.argmin()), int(values.argmax())}))
    extremes = [] if unknown.all() else [int(np.nanargmin(values)), int(np.nanargmax(values))]
    return np.unique([int(unknown.argmax()), *extremes])


def inline_svg(svg: str, name: str, label: str) -> str:
    """Return an SVG file as an element of a page.

    Prologue and fixed size go, ids get `name` as a prefix because those of a page must differ, coordinates are rounded to a
    hundredth of a point because they are most of the file. `label` is the text for readers who cannot see the figure.
    """
    body = svg[svg.index("<svg") :]
    opening, rest = body.split(">", 1)
    box = re.search(r'viewBox="[^"]*"', opening)
    if box is None:
        raise ValueError("the SVG has no viewBox")
    rest = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", rest)
    rest = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), rest)
    head = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    text = f'{head} {box[0]} role="img" aria-label="{escape(label)}">{rest}'
    return text.encode("utf-8", "replace").decode("utf-8")
