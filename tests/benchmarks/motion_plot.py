"""The drawing of a recording: true angle and estimate, the error in its band, what the crane does and is said to do."""

from collections.abc import Callable, Sequence
from itertools import groupby, pairwise

import numpy as np

from gateway.motion.estimate import MotionState
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from tests.benchmarks.motion_recordings import MANOEUVRES, WorkRecording

LEFT, RIGHT, TOP, BOTTOM = 60, 870, 46, 250
ERROR_TOP, ERROR_BOTTOM = 274, 374
STRIP, FIRST_STRIP, SECOND_STRIP, LEGEND = 14, 392, 414, 468
TRUE, ESTIMATE = "#222222", "#0072b2"
COLOURS = {
    "rest": "#e6e6e6",
    "free": "#bcd9ea",
    "driven": "#e69f00",
    "hoisting": "#009e73",
    "wind": "#cc79a7",
    "unknown": "#d55e00",
}
"""Of a state. Basis: Okabe and Ito 2008."""
STATE_OF: dict[str, tuple[MotionState, ...]] = {
    "free": ("free",),
    "drive": ("driven",),
    "hoist": ("hoisting",),
    "drive and hoist": ("driven", "hoisting"),
    "gust": ("wind",),
}


def svg(recording: WorkRecording, time_s: Array, angle_deg: Array, u_deg: Array, states: Sequence[str]) -> str:
    """Return the drawing; `angle_deg` and `u_deg` are NaN where the angle is not known."""
    truth_deg = recording.true("angle_deg", time_s)
    half_deg = NORMAL_975 * np.nan_to_num(u_deg)
    top_deg = 1.1 * float(np.nanmax([truth_deg, np.nan_to_num(angle_deg)]))
    x = LEFT + (RIGHT - LEFT) * time_s / time_s[-1]

    def y(value_deg: Array) -> Array:
        return BOTTOM - (BOTTOM - TOP) * np.clip(value_deg, 0, top_deg) / top_deg

    title = f"{recording.name}: rho {recording.rho:g}, noise {1e3 * recording.noise_g:g} mg, {recording.period_s:.1f} s period"
    drawing = [_text(LEFT, 24, f"Rope angle and error, {title}", 14, "start"), *_axes(top_deg, float(time_s[-1]))]
    error_deg = angle_deg - truth_deg
    widest_deg = float(np.nanmax(np.abs(error_deg[time_s > recording.period_s])))

    def y_error(value_deg: Array) -> Array:
        share = np.clip(value_deg / widest_deg, -1.1, 1.1)
        middle: Array = (ERROR_TOP + ERROR_BOTTOM) / 2 - (ERROR_BOTTOM - ERROR_TOP) / 2.2 * share
        return middle

    drawing += _error_axis(widest_deg, y_error)
    known = ~np.isnan(angle_deg)
    for begin, end in _runs(known):
        if known[begin]:
            upper, lower = y_error(half_deg[begin:end]), y_error(-half_deg[begin:end])
            around = _points([*x[begin:end], *x[begin:end][::-1]], [*upper, *lower[::-1]])
            drawing.append(f'<polygon points="{around}" fill="{ESTIMATE}" fill-opacity="0.3"/>')
            drawing.append(_line(x[begin:end], y_error(error_deg[begin:end]), TRUE, 0.8))
            drawing.append(_line(x[begin:end], y(angle_deg[begin:end]), ESTIMATE, 2.2))
    drawing.append(_line(x, y(truth_deg), TRUE, 0.8))
    drawing += _strip(x, [MANOEUVRES[place] for place in recording.manoeuvre(time_s)], FIRST_STRIP, "does")
    drawing += _strip(x, states, SECOND_STRIP, "said")
    drawing += _legend()
    head = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 900 484" font-family="sans-serif">'
    return "\n".join([head, '<rect width="900" height="484" fill="#ffffff"/>', *drawing, "</svg>\n"])


def _axes(top_deg: float, last_s: float) -> list[str]:
    step_deg = next(step for step in (0.5, 1, 2, 5, 10, 20) if top_deg / step < 8)
    lines = []
    for value in np.arange(0, top_deg, step_deg):
        at = BOTTOM - (BOTTOM - TOP) * value / top_deg
        lines.append(f'<path d="M{LEFT} {at:.1f} H{RIGHT}" stroke="#dddddd"/>')
        lines.append(_text(LEFT - 8, at + 4, f"{value:g}°", 12, "end"))
    for value in np.arange(0, last_s, 20):
        at = LEFT + (RIGHT - LEFT) * value / last_s
        lines.append(_text(at, SECOND_STRIP + STRIP + 18, f"{value:g} s", 12, "middle"))
    return lines


def _error_axis(widest_deg: float, y_error: Callable[[Array], Array]) -> list[str]:
    lines = []
    for value in (-widest_deg, 0.0, widest_deg):
        at = float(y_error(np.array(value)))
        lines.append(f'<path d="M{LEFT} {at:.1f} H{RIGHT}" stroke="#dddddd"/>')
        lines.append(_text(LEFT - 8, at + 4, f"{value:.2g}°", 12, "end"))
    return lines


def _strip(x: Array, names: Sequence[str], at: int, label: str) -> list[str]:
    """Draw one or two colours for each run of equal names."""
    found, begin = [_text(LEFT - 8, at + 11, label, 12, "end")], 0
    for name, run in groupby(names):
        end = begin + len(list(run))
        colours = [COLOURS[state] for state in STATE_OF.get(name, (name,))]
        height = STRIP / len(colours)
        width = x[min(end, len(x) - 1)] - x[begin]
        for place, colour in enumerate(colours):
            corner = f'x="{x[begin]:.1f}" y="{at + place * height:.1f}"'
            found.append(f'<rect {corner} width="{width:.1f}" height="{height:.1f}" fill="{colour}"/>')
        begin = end
    return found


def _legend() -> list[str]:
    found = [_line(np.array([LEFT, LEFT + 24]), np.array([LEGEND, LEGEND]), TRUE, 0.8)]
    found += [_text(LEFT + 30, LEGEND + 4, "true; error", 12, "start")]
    found += [_line(np.array([170, 194]), np.array([LEGEND, LEGEND]), ESTIMATE, 2.2)]
    found += [_text(200, LEGEND + 4, "estimate; 95 % band", 12, "start")]
    for place, (state, colour) in enumerate(COLOURS.items()):
        at = 340 + 90 * place
        found.append(f'<rect x="{at}" y="{LEGEND - 7}" width="14" height="14" fill="{colour}"/>')
        found.append(_text(at + 20, LEGEND + 4, state, 12, "start"))
    return found


def _runs(known: np.ndarray) -> list[tuple[int, int]]:
    edges = [0, *(np.flatnonzero(np.diff(known)) + 1).tolist(), len(known)]
    return list(pairwise(edges))


def _points(x: list[float], y: list[float]) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def _line(x: Array, y: Array, colour: str, width: float) -> str:
    return f'<polyline points="{_points(list(x), list(y))}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def _text(x: float, y: float, text: str, size: int, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" fill="#222222">{text}</text>'
