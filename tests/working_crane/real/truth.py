"""The truth at each sample: the line from the pivot to the end of the rope, and what moves the crane."""

import numpy as np

from tests.blind.mechanics import Array
from tests.working_crane.real.engine import Trace
from tests.working_crane.real.moves import Moves
from tests.working_crane.real.rig import Rig

THRESHOLD = 2e-3
"""m/s^2 and m/s: the crane is at work beyond it."""


def truth_at(rig: Rig, trace: Trace, rows: slice) -> dict[str, Array]:
    """Return the columns of `truth.csv` but the slope at the housing."""
    pivot = np.mean([trace.sites[name][rows] for name in rig.pivots], axis=0)
    line, load = trace.sites[rig.end][rows] - pivot, trace.sites[rig.load][rows] - pivot
    half = slice(2 * rows.start, 2 * rows.stop, 2 * rows.step)
    time_s = np.round(rig.moves.time_s[half], 6)
    count = len(time_s)
    driven = np.ones(count) if rig.always_driven else _driven(rig)[half]
    gust = np.zeros(count) if rig.gust is None else rig.gust[half].astype(float)
    if rig.touch:
        gust = np.maximum(gust, trace.touched[rows])
    return {
        "time_s": time_s,
        "angle_deg": _lean_deg(line),
        "azimuth_deg": np.degrees(np.arctan2(line[:, 1], line[:, 0])),
        "driven": driven.astype(float),
        "hoisting": (np.abs(rig.moves.velocity("hoist")) > THRESHOLD)[half].astype(float),
        "gust": gust,
        "length_m": np.linalg.norm(line, axis=1),
        "slope_deg": np.zeros(count),
        "load_deg": _lean_deg(load),
    }


def heading_rad(rig: Rig, trace: Trace) -> Array:
    """Return the turn of the rope about itself at each step: it follows the jib late."""
    steps = len(trace.touched)
    if rig.heading_lag_s is None:
        return np.zeros(steps)
    jib = rig.moves.displacement("slew")[::2][:steps]
    heading, share = np.zeros(steps), 1 - np.exp(-trace.step_s / rig.heading_lag_s)
    for row in range(1, steps):
        heading[row] = heading[row - 1] + share * (jib[row - 1] - heading[row - 1])
    return heading


def _driven(rig: Rig) -> Array:
    """Return whether the pivot is commanded to accelerate, at the half steps."""
    driven: Array = (np.linalg.norm(commanded_m_s2(rig.moves, rig), axis=1) > THRESHOLD).astype(float)
    return driven


def commanded_m_s2(moves: Moves, rig: Rig) -> Array:
    """Return the commanded acceleration of the pivot: straight, or outward, sideways and up on a jib, shape (n, 3)."""
    straight = np.column_stack([moves.acceleration("x"), moves.acceleration("y"), np.zeros(len(moves.time_s))])
    if "slew" not in rig.driven:
        return straight
    radius_m, height_m = float(rig.facts["radius_m"]), float(rig.facts["height_m"])
    rate, accel = moves.velocity("slew"), moves.acceleration("slew")
    reach, reach_rate, reach_accel = (
        moves.displacement("trolley"),
        moves.velocity("trolley"),
        moves.acceleration("trolley"),
    )
    luff, luff_rate, luff_accel = moves.displacement("luff"), moves.velocity("luff"), moves.acceleration("luff")
    out = radius_m * np.cos(luff) - height_m * np.sin(luff)
    up = radius_m * np.sin(luff) + height_m * np.cos(luff)
    outward = reach_accel - up * luff_accel - out * luff_rate**2 - (out + reach) * rate**2
    sideways = (out + reach) * accel + 2 * rate * (reach_rate - up * luff_rate)
    upward = out * luff_accel - up * luff_rate**2
    return np.column_stack([outward, sideways, upward])


def _lean_deg(line: Array) -> Array:
    angle: Array = np.degrees(np.arctan2(np.hypot(line[:, 0], line[:, 1]), -line[:, 2]))
    return angle
