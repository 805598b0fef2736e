"""The motion over a recording as text, as JSON and as a table."""

from typing import Any

import numpy as np

from gateway.measurement.motion import MAX_DRIVE_S, RecordingMotion
from gateway.motion.estimate import MotionState
from gateway.motion.history import LargestAngle, MotionHistory
from gateway.motion.hypotheses import IS_DRIVEN, IS_FREE, IS_GUST, IS_HOISTING
from gateway.units import degrees

MAX_SHOWN_PHASES = 12
"""Phases in the text for the terminal. Basis: a choice; half a screen."""
GYRO_TEXT = {True: "used", False: "left out: its rates contradict the accelerometer", None: None}
STATE_TEXT: dict[MotionState, str] = {
    "rest": "at rest",
    "free": "free swing",
    "driven": "trolley or bridge moving",
    "hoisting": "hoisting",
    "wind": "gust",
    "unknown": "not known",
}


WHOLLY_KNOWN = 0.99
"""Share of the time with a known angle from which on the rest is not worth a word. Basis: a choice; the first second of a
recording is always unknown."""


def motion_json(motion: RecordingMotion) -> dict[str, Any]:
    """Return the phases and the largest angle."""
    largest = None
    if motion.largest is not None:
        moved = {"state": motion.state_at_largest, "crane_moved": motion.crane_moved_at_largest}
        largest = _largest_json(motion.largest) | moved
    return {
        "largest": largest,
        "known_percent": 100 * motion.known_share,
        "doubted": motion.is_doubted,
        "gyroscope": GYRO_TEXT[motion.uses_gyro],
        "phases": [
            {
                "state": phase.state,
                "from_s": phase.from_s,
                "to_s": phase.to_s,
                "largest": None if phase.largest is None else _largest_json(phase.largest),
            }
            for phase in motion.phases
        ],
    }


def _largest_json(largest: LargestAngle) -> dict[str, Any]:
    return {
        "time_s": largest.time_s,
        "angle_deg": degrees(largest.angle_rad),
        "u_deg": degrees(largest.u_rad),
        "coverage95_deg": [degrees(end_rad) for end_rad in largest.coverage95_rad],
    }


def motion_rows(motion: RecordingMotion) -> list[tuple[str, str]]:
    """Return label and text of each line: the largest angle, and one line for each phase."""
    rows = [("motion", _largest_text(motion))]
    if (gyroscope := GYRO_TEXT[motion.uses_gyro]) is not None:
        rows.append(("", f"gyroscope {gyroscope}"))
    for phase in motion.phases[:MAX_SHOWN_PHASES]:
        angle = "" if phase.largest is None else f", up to {_angle_text(phase.largest)}"
        rows.append(("", f"{phase.from_s:.1f}-{phase.to_s:.1f} s {STATE_TEXT[phase.state]}{angle}"))
    if (others := len(motion.phases) - MAX_SHOWN_PHASES) > 0:
        rows.append(("", f"and {others} more phases; --json has all of them"))
    return rows


def _largest_text(motion: RecordingMotion) -> str:
    if motion.largest is None or motion.state_at_largest is None:
        return "not known"
    moved = "the crane moved" if motion.crane_moved_at_largest else f"{STATE_TEXT[motion.state_at_largest]}"
    doubt = f"unreliable, because one drive lasts longer than {MAX_DRIVE_S:.0f} s: " if motion.is_doubted else ""
    text = f"{doubt}largest angle {_angle_text(motion.largest)} at {motion.largest.time_s:.1f} s, {moved}"
    if motion.known_share > WHOLLY_KNOWN:
        return text
    return f"{text}; the angle is known {100 * motion.known_share:.0f} % of the time and may be larger in the rest"


def _angle_text(largest: LargestAngle) -> str:
    low, high = (degrees(end_rad) for end_rad in largest.coverage95_rad)
    return f"{degrees(largest.angle_rad):.3f}° (95 % {low:.3f}° to {high:.3f}°)"


def motion_table(history: MotionHistory) -> str:
    """Return the history as CSV, one row for each bin; what is not known is empty."""
    columns = {
        "angle_deg": np.degrees(history.angle_rad),
        "u_deg": np.degrees(history.u_rad),
        "azimuth_deg": np.degrees(history.azimuth_rad),
        "rate_deg_s": np.degrees(history.rate_rad_s),
        "pivot_accel_x_m_s2": history.pivot_acceleration_m_s2[:, 0],
        "pivot_accel_y_m_s2": history.pivot_acceleration_m_s2[:, 1],
        "pivot_accel_u_m_s2": history.pivot_acceleration_u_m_s2,
        "hoist_m_s": history.hoist_m_s,
        "hoist_u_m_s": history.hoist_u_m_s,
        "length_m": history.length_m,
        "length_u_m": history.length_u_m,
    }
    columns |= {f"p_{name}": history.probabilities[:, which].sum(axis=1) for name, which in _KINDS.items()}
    values = np.column_stack(list(columns.values()))
    rows = [
        ",".join([f"{time_s:.3f}", *("" if np.isnan(value) else f"{value:.6g}" for value in row), state])
        for time_s, row, state in zip(history.time_s, values, history.state, strict=True)
    ]
    return "\n".join([",".join(["time_s", *columns, "state"]), *rows]) + "\n"


_KINDS = {
    "free": IS_FREE,
    "driven": IS_DRIVEN & ~IS_HOISTING,
    "gust": ~IS_DRIVEN & IS_GUST & ~IS_HOISTING,
    "free_hoisting": ~IS_DRIVEN & ~IS_GUST & IS_HOISTING,
    "driven_hoisting": IS_DRIVEN & IS_HOISTING,
    "gust_hoisting": ~IS_DRIVEN & IS_GUST & IS_HOISTING,
}
"""Hypotheses of each column; a drive beside a wind counts as a drive."""
