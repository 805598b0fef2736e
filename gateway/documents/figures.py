"""Helpers for figures as inline SVG, whichever way a figure is drawn."""

import itertools
import math
import re
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
CURVE_POINTS = 900
"""Of a curve across a figure: more than paper or a screen can show."""


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
    """Return a curve (n,) with fewer points that looks the same: minimum and maximum of each interval, in order of time."""
    if len(time_s) <= points:
        return time_s, values
    edges = np.linspace(0, len(time_s), points // 2 + 1).astype(int)
    kept = [
        first + np.unique([values[first:last].argmin(), values[first:last].argmax()])
        for first, last in itertools.pairwise(edges)
    ]
    places = np.concatenate(kept)
    return time_s[places], values[places]


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
