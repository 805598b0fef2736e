"""A turn of a sensor about a horizontal shaft, and the advice on the aligning screws that follows from it.

The shaft is parallel to one of the axes (Łuczak et al. 2022, sec. 2.2 and 3), which reads a constant if it is parallel to it.
If it is tilted towards another axis by e, it reads e times the reading of that axis: a sine over the turn, with a peak-to-peak
of 2 e (Zams and Łuczak 2024, eq. 2).

Screw 4 of the source turns the unit about x, screw 5 about y, screw 3 about z. The x axis is aligned by screws 3 and 5, then
the y axis by screw 4 alone; the z axis follows from both. A unit of its own for each axis (Zams and Łuczak 2024) has two
screws.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from gateway.calibration.alignment.assistant import K_ALIGNED, TOLERANCE_RAD
from gateway.numerics.array import Array

N_SECTORS = 24
"""Sectors of a turn whose readings are averaged. Basis: a choice; 15 degrees each, with several readings, in which the sine
of a tilt changes little."""
MIN_SECTORS = 20
"""Least number of sectors with a reading in a turn that counts. Basis: a choice; a turn by hand skips a few, and 60 degrees
missing leave both directions determined."""
MIN_ACROSS_G = 0.7
"""Least reading across the shaft, g; below it the shaft is not horizontal, or another axis lies along it. Basis: a shaft within
45 degrees of the horizontal."""
RANGE_OF_SECTORS = 3.9
"""Expected range of the sectors' noise, in standard deviations. Definition: for 24 values of a normal distribution."""
HOUSING_DEVIATION_RAD = math.radians(0.01)
"""Deviation of perpendicularity of a machined steel housing, DP (Łuczak et al. 2022, sec. 2.1)."""
AXES = "xyz"
SHARED_SCREWS: dict[str, tuple[str, ...]] = {"x": ("y", "z"), "y": ("x",), "z": ()}
"""Axes about which the one unit is turned to align an axis."""
OWN_SCREWS: dict[str, tuple[str, ...]] = {"x": ("y", "z"), "y": ("x", "z"), "z": ("x", "y")}
"""Axes about which each axis' own unit is turned to align it."""
SCREW_NUMBERS = {"x": 4, "y": 5, "z": 3}
"""Number of the screw in the source, by the axis about which it turns the unit. Definition: numbers of the source."""
K_SHOWN = 3.0
"""Standard uncertainties by which a tilt must exceed zero to be worth turning a screw. Basis: a choice; noise alone reaches it in
0.3 % of the turns."""


@dataclass(frozen=True, slots=True)
class Turn:
    """What one full turn shows."""

    axis: int
    """Axis along the shaft, 0 to 2."""
    peak_to_peak_g: float
    """Largest minus smallest mean of the sectors."""
    floor_g: float
    """Peak-to-peak that noise and quantisation cause with a perfect alignment."""
    towards: tuple[float, float, float]
    """Direction of the axis: its components along the others, rad; 0 for itself."""
    u_rad: float
    """Standard uncertainty of each component."""

    @property
    def misalignment_rad(self) -> float:
        """Angle between the axis and the shaft."""
        return float(np.hypot.reduce(self.towards))


def fit_turn(force_g: Array, axis: int, step_g: float = 0.0) -> Turn | None:
    """Return what the readings of one turn show, (n, 3), in g; None if too few sectors have readings.

    `step_g` is the quantisation step, LSB.
    """
    across = [other for other in range(3) if other != axis]
    sector = np.floor((turning_angle_rad(force_g, axis) / (2 * np.pi)) % 1 * N_SECTORS).astype(np.int64)
    filled, place = np.unique(sector % N_SECTORS, return_inverse=True)
    if len(filled) < MIN_SECTORS:
        return None
    count = np.bincount(place)
    mean_g = np.column_stack([np.bincount(place, values) / count for values in force_g.T])
    design = np.column_stack([mean_g[:, across], np.ones(len(mean_g))])
    found, *_ = np.linalg.lstsq(design, mean_g[:, axis], rcond=None)
    residual_g = mean_g[:, axis] - design @ found
    sigma_g = float(np.sqrt(residual_g @ residual_g / (len(mean_g) - 3)))
    towards = [0.0, 0.0, 0.0]
    for other, component in zip(across, found[:2].tolist(), strict=True):
        towards[other] = component
    return Turn(
        axis=axis,
        peak_to_peak_g=float(np.ptp(mean_g[:, axis])),
        floor_g=max(RANGE_OF_SECTORS * sigma_g, 2 * step_g),
        towards=(towards[0], towards[1], towards[2]),
        u_rad=float(np.hypot(sigma_g * np.sqrt(2 / len(mean_g)), step_g / np.sqrt(12))),
    )


def turning_angle_rad(force_g: Array, axis: int) -> Array:
    """Return the angle about the shaft of readings (n, 3), unwrapped, shape (n,)."""
    first, second = (other for other in range(3) if other != axis)
    return np.unwrap(np.arctan2(force_g[:, second], force_g[:, first]))


def shaft_axis(force_g: Array) -> int | None:
    """Return the axis along the shaft of readings (n, 3): the one about which they turn fully; None without a turn."""
    for axis in range(3):
        across = [other for other in range(3) if other != axis]
        is_horizontal = np.hypot(*force_g[:, across].T).min() > MIN_ACROSS_G
        if is_horizontal and np.ptp(turning_angle_rad(force_g, axis)) >= 2 * np.pi:
            return axis
    return None


def alignment_precision_error_rad(variation_g: float) -> float:
    """Return APE, the angle that a remaining variation of plus or minus `variation_g` hides (eq. 1)."""
    return math.asin(min(abs(variation_g), 1.0))


def total_alignment_error_rad(precision_error_rad: float, housing_deviation_rad: float) -> float:
    """Return TAE, the sum of APE and the housing's deviation of perpendicularity (eq. 2)."""
    return precision_error_rad + housing_deviation_rad


def calibration_error_rad(housing_deviation_rad: float) -> float:
    """Return CE, the error of a six-position calibration by faces that are off by this angle (eq. 3)."""
    return math.asin(1 - math.cos(housing_deviation_rad))


@dataclass(frozen=True, slots=True)
class AligningUnit:
    """Screws of an aligning unit."""

    lead_m: float = 0.5e-3
    """Advance per turn, m; that of an M3 screw."""
    lever_m: float = 10e-3
    """Distance from the axis of rotation to the screw, m."""
    reversed_axes: frozenset[str] = frozenset()
    """Axes whose screw turns the unit in the negative sense when screwed in."""
    screws: dict[str, tuple[str, ...]] = field(default_factory=lambda: SHARED_SCREWS)


@dataclass(frozen=True, slots=True)
class TurnAdvice:
    """What to do after a turn."""

    state: Literal["adjust", "aligned", "converged", "at_floor"]
    """`converged`: aligned as far as the screws of this axis reach; `at_floor`: noise hides what is left."""
    screw_axis: str | None
    """Axis about which the screw to be turned turns the unit."""
    direction: Literal["in", "out"] | None
    turns: float
    """Number of turns of the screw."""
    precision_error_rad: float
    """APE by the largest of the remaining variation, its floor and the fitted tilt (eq. 1)."""
    total_error_rad: float
    """TAE: with the housing's deviation of perpendicularity (eq. 2)."""
    text: str


def advise_after_turn(
    turn: Turn,
    before: Turn | None = None,
    unit: AligningUnit | None = None,
    *,
    housing_deviation_rad: float = HOUSING_DEVIATION_RAD,
) -> TurnAdvice:
    """Return what to do; `before` is the turn before, which shows whether the last adjustment went the wrong way."""
    unit = unit or AligningUnit()
    name = AXES[turn.axis]
    variation_g = max(turn.peak_to_peak_g / 2, turn.floor_g / 2, math.sin(turn.misalignment_rad))
    precision_rad = alignment_precision_error_rad(variation_g)
    total_rad = total_alignment_error_rad(precision_rad, housing_deviation_rad)
    needed = _rotations(turn)
    allowed = {axis: needed[axis] for axis in unit.screws[name]}
    if not allowed:
        text = f"{name} has no screw of its own: its alignment follows from the other axes"
        return TurnAdvice("converged", None, None, 0.0, precision_rad, total_rad, text)
    screw = max(allowed, key=lambda axis: abs(allowed[axis]))
    angle_rad = allowed[screw]
    if abs(angle_rad) + K_ALIGNED * turn.u_rad <= TOLERANCE_RAD:
        return _finished(turn, allowed, needed, precision_rad, total_rad)
    if abs(angle_rad) <= K_SHOWN * turn.u_rad:
        text = f"at the floor: no tilt beyond u = {math.degrees(turn.u_rad):.3f} deg shows; average longer, or turn more slowly"
        return TurnAdvice("at_floor", None, None, 0.0, precision_rad, total_rad, text)
    sign = -1 if screw in unit.reversed_axes else 1
    direction: Literal["in", "out"] = "in" if sign * angle_rad > 0 else "out"
    turns = math.tan(abs(angle_rad)) * unit.lever_m / unit.lead_m
    text = (
        f"turn screw {SCREW_NUMBERS[screw]} (about {screw}) {direction} by {turns:.2f} turns: "
        f"{name} is off by {math.degrees(abs(angle_rad)):.3f} deg about {screw}{_worse(turn, before, screw)}"
    )
    return TurnAdvice("adjust", screw, direction, turns, precision_rad, total_rad, text)


def _rotations(turn: Turn) -> dict[str, float]:
    """Return the rotation of the unit about each axis that makes the sensitive axis parallel to the shaft, rad."""
    rotation = -np.cross(np.eye(3)[turn.axis], turn.towards)
    return {axis: float(value) for axis, value in zip(AXES, rotation, strict=True)}


def _worse(turn: Turn, before: Turn | None, screw: str) -> str:
    if before is None or before.axis != turn.axis:
        return ""
    is_larger = abs(_rotations(turn)[screw]) > abs(_rotations(before)[screw]) + K_SHOWN * turn.u_rad
    return f"; it was less before: if you turned this screw, it is --reversed {screw}" if is_larger else ""


def _finished(
    turn: Turn,
    allowed: dict[str, float],
    needed: dict[str, float],
    precision_rad: float,
    total_rad: float,
) -> TurnAdvice:
    """Return that the screws have nothing left to do, with what no screw of this axis corrects."""
    rest_rad = max((abs(angle) for axis, angle in needed.items() if axis not in allowed), default=0.0)
    if rest_rad + K_ALIGNED * turn.u_rad <= TOLERANCE_RAD:
        text = f"aligned within {math.degrees(TOLERANCE_RAD):.3f} deg"
        return TurnAdvice("aligned", None, None, 0.0, precision_rad, total_rad, text)
    text = (
        f"converged: {math.degrees(rest_rad):.3f} deg remain that no screw of {AXES[turn.axis]} corrects; "
        "the axes are not perpendicular"
    )
    return TurnAdvice("converged", None, None, 0.0, precision_rad, total_rad, text)
