"""The motion over a recording in which the crane works: the smoothed history, and the swing where no free swing explains it.

It is reported as text, as JSON and as a table.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from devices.pendulum.small_swing import small_swing_period_s
from gateway.measurement.axial_check import Contradiction, find_contradiction
from gateway.measurement.followed_recording import SmoothedMotion
from gateway.measurement.source import Source
from gateway.motion.estimate import MotionState
from gateway.motion.history import LargestAngle, MotionHistory, MotionPhase
from gateway.motion.hypotheses import IS_DRIVEN, IS_FREE, IS_GUST, IS_HOISTING
from gateway.swing.data.input_checks import find_fault_in_means
from gateway.swing.estimate import SwingEstimate
from gateway.swing.estimation.make_estimate import NO_MOTION, NOT_AS_STATED
from gateway.swing.rig import MountedHousing
from gateway.units import degrees

MAX_DRIVE_S, MAX_DRIVE_SHARE = 12.0, 0.5
"""Duration of a drive, and its share of the recording, from which on the smoothed motion is doubted. Basis: ramps of cranes last
up to 9 s; what is taken for one drive lasts up to 27 s in simulated work of three minutes."""
WORKING: frozenset[MotionState] = frozenset({"driven", "hoisting", "wind"})
"""States that no free swing explains."""
MOVING: frozenset[MotionState] = frozenset({"driven", "hoisting"})
"""States in which the crane moves."""
MAX_UNKNOWN_PERIODS = 0.5
"""Time without a known angle up to which the largest angle of a recording is known, in periods of a small swing. Basis: an angle
reaches its largest value twice in a period."""
CONTRADICTION_SQUARED, CONTRADICTION_SHARE = 9.0, 0.05
"""Squared difference of two angles over its variance that is a contradiction (three sigma), and the share of the time from which
on a gyroscope is left out. Basis: a choice; chance has 0.3 % beyond three sigma, and a wrong gyroscope most of the time."""
DOUBTED = (
    "it has trolley or bridge accelerate for {:.0f} s without a break, as no crane does; "
    "a load that swings in two ways, or a housing that is not where stated, looks like this"
)
BY_SMOOTHING = "largest angle from the smoothed motion, because the crane worked"
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
_KINDS = {
    "free": IS_FREE,
    "driven": IS_DRIVEN & ~IS_HOISTING,
    "gust": ~IS_DRIVEN & IS_GUST & ~IS_HOISTING,
    "free_hoisting": ~IS_DRIVEN & ~IS_GUST & IS_HOISTING,
    "driven_hoisting": IS_DRIVEN & IS_HOISTING,
    "gust_hoisting": ~IS_DRIVEN & IS_GUST & IS_HOISTING,
}
"""Hypotheses of each column; a drive beside a wind counts as a drive."""


@dataclass(frozen=True, slots=True)
class RecordingMotion:
    """The motion over a recording."""

    housing: MountedHousing
    history: MotionHistory
    phases: tuple[MotionPhase, ...]
    largest: LargestAngle | None
    """None: not known at any time."""
    known_share: float
    """Part of the time at which the angle is known."""
    doubt: str | None = None
    """Why the motion is unreliable, with its intervals; None: nothing speaks against it."""
    uses_gyro: bool | None = None
    """The motion includes a gyroscope; False: its rates contradict the accelerometer; None: there is none."""

    @property
    def crane_worked(self) -> bool:
        """The crane moved or a gust pushed the load."""
        return any(phase.state in WORKING for phase in self.phases)

    @property
    def state_at_largest(self) -> MotionState | None:
        """What crane and load did at the largest angle."""
        if self.largest is None:
            return None
        return self.history.state[int(np.abs(self.history.time_s - self.largest.time_s).argmin())]

    @property
    def crane_moved_at_largest(self) -> bool | None:
        """Whether trolley, bridge or winch moved at the largest angle."""
        return None if self.largest is None else self.state_at_largest in MOVING


def is_free_swing(swing: SwingEstimate) -> bool:
    """Return whether one free swing, or a load at rest, explains the whole recording."""
    return swing.coverage95_rad is not None and not swing.hoists_s and not swing.reasons


def has_motion(source: Source, swing: SwingEstimate) -> bool:
    """Return whether the motion of a recording can be known: the housing's place is, and the sensor is not at fault."""
    is_clipped = source.find_clipped()
    was_fitted = swing.swinging is not None or swing.reduced_chi_square is not None or NO_MOTION in swing.reasons
    is_usable = was_fitted or (is_clipped.any() and not is_clipped.all())
    if source.housing is None or not is_usable:
        return False
    return find_fault_in_means(source.force_g[~is_clipped]) is None


def recording_motion(source: Source, swing: SwingEstimate, smoothed: SmoothedMotion) -> RecordingMotion | None:
    """Return the motion of a recording; None where the housing's place is not known."""
    if source.housing is None:
        return None
    history, uses_gyro = smoothed.plain, None
    if source.gyro is not None:
        uses_gyro = smoothed.sharpened is not None and _agree(smoothed.plain, smoothed.sharpened)
        history = smoothed.sharpened if smoothed.sharpened is not None and uses_gyro else history
    duration_s = float(source.recording.time_s[-1] - source.recording.time_s[0])
    known_share = float(np.isfinite(history.angle_rad).mean()) * max(0.0, 1 - smoothed.fault_s / duration_s)
    phases = history.phases()
    doubt = find_doubt(
        swing, phases, duration_s, find_contradiction(source, source.housing.moving_with_load(), history)
    )
    return RecordingMotion(
        source.housing, history, phases, history.largest_angle(), known_share, doubt=doubt, uses_gyro=uses_gyro
    )


def find_doubt(
    swing: SwingEstimate, phases: Sequence[MotionPhase], duration_s: float, contradiction: Contradiction | None
) -> str | None:
    """Return why a smoothed motion is unreliable; None: nothing speaks against it.

    A free swing shows that rig and sensor are not as stated, on which the motion rests, or that its angles are wrong. Or one
    drive fills most of the recording and lasts longer than that of a crane, so that what moves is none.
    """
    if any(reason.startswith(NOT_AS_STATED) for reason in swing.reasons):
        return NOT_AS_STATED
    if contradiction is not None:
        return str(contradiction)
    longest_s = max((phase.to_s - phase.from_s for phase in phases if phase.state == "driven"), default=0.0)
    return DOUBTED.format(longest_s) if longest_s > max(MAX_DRIVE_S, MAX_DRIVE_SHARE * duration_s) else None


def _agree(plain: MotionHistory, sharpened: MotionHistory) -> bool:
    """Return whether the motion with a gyroscope agrees with that by the accelerometer alone."""
    angles = [each.angle_rad * np.exp(1j * each.azimuth_rad) for each in (plain, sharpened)]
    squared = np.abs(angles[0] - angles[1]) ** 2 / (plain.u_rad**2 + sharpened.u_rad**2)
    known = squared[np.isfinite(squared)]
    return len(known) > 0 and bool(np.mean(known > CONTRADICTION_SQUARED) < CONTRADICTION_SHARE)


def with_smoothed_angle(swing: SwingEstimate, motion: RecordingMotion) -> SwingEstimate:
    """Return the swing with the largest smoothed angle where no free swing explains the recording and the crane worked.

    The rope's length is the smoothed one then, too: a segment in which the crane worked has another period than a free swing.
    """
    history, largest = motion.history, motion.largest
    if largest is None or swing.coverage95_rad is not None or not motion.crane_worked:
        return swing
    unknown_s = (1 - motion.known_share) * (swing.to_s - swing.from_s)
    if unknown_s > MAX_UNKNOWN_PERIODS * motion.housing.small_swing_period_s:
        return swing
    at = int(np.abs(history.time_s - largest.time_s).argmin())
    if motion.doubt is not None:
        return replace(swing, reasons=(f"the smoothed motion is unreliable: {motion.doubt}", *swing.reasons))
    azimuth_rad, length_m = float(history.azimuth_rad[at]), float(history.length_m[at])
    return replace(
        swing,
        swinging=True,
        phi_max_rad=largest.angle_rad,
        u_rad=largest.u_rad,
        coverage95_rad=largest.coverage95_rad,
        azimuth_rad=azimuth_rad - math.pi * round(azimuth_rad / math.pi),
        period_s=small_swing_period_s(length_m, motion.housing.gravity_m_s2),
        length_m=length_m,
        length_u_m=float(history.length_u_m[at]),
        reasons=(BY_SMOOTHING, *swing.reasons),
    )


def motion_json(motion: RecordingMotion) -> dict[str, Any]:
    """Return the phases and the largest angle."""
    largest = None
    if motion.largest is not None:
        moved = {"state": motion.state_at_largest, "crane_moved": motion.crane_moved_at_largest}
        largest = _largest_json(motion, motion.largest) | moved
    return {
        "largest": largest,
        "known_percent": 100 * motion.known_share,
        "doubted": motion.doubt is not None,
        "gyroscope": GYRO_TEXT[motion.uses_gyro],
        "phases": [
            {
                "state": phase.state,
                "from_s": phase.from_s,
                "to_s": phase.to_s,
                "largest": None if phase.largest is None else _largest_json(motion, phase.largest),
            }
            for phase in motion.phases
        ],
    }


def _largest_json(motion: RecordingMotion, largest: LargestAngle) -> dict[str, Any]:
    """Return an angle; without its uncertainty where the motion is doubted, whose intervals do not hold."""
    coverage95_deg = [degrees(end_rad) for end_rad in largest.coverage95_rad]
    return {
        "time_s": largest.time_s,
        "angle_deg": degrees(largest.angle_rad),
        "u_deg": degrees(largest.u_rad) if motion.doubt is None else None,
        "coverage95_deg": coverage95_deg if motion.doubt is None else None,
    }


def motion_rows(motion: RecordingMotion) -> list[tuple[str, str]]:
    """Return label and text of each line: the largest angle, and one line for each phase."""
    rows = [("motion", _largest_text(motion))]
    if (gyroscope := GYRO_TEXT[motion.uses_gyro]) is not None:
        rows.append(("", f"gyroscope {gyroscope}"))
    for phase in motion.phases[:MAX_SHOWN_PHASES]:
        angle = "" if phase.largest is None else f", up to {_angle_text(motion, phase.largest)}"
        rows.append(("", f"{phase.from_s:.1f}-{phase.to_s:.1f} s {STATE_TEXT[phase.state]}{angle}"))
    if (others := len(motion.phases) - MAX_SHOWN_PHASES) > 0:
        rows.append(("", f"and {others} more phases; --json has all of them"))
    return rows


def _largest_text(motion: RecordingMotion) -> str:
    if motion.largest is None or motion.state_at_largest is None:
        return "not known"
    moved = "the crane moved" if motion.crane_moved_at_largest else f"{STATE_TEXT[motion.state_at_largest]}"
    doubt = "" if motion.doubt is None else "unreliable: "
    text = f"{doubt}largest angle {_angle_text(motion, motion.largest)} at {motion.largest.time_s:.1f} s, {moved}"
    if motion.known_share > WHOLLY_KNOWN:
        return text
    return f"{text}; the angle is known {100 * motion.known_share:.0f} % of the time and may be larger in the rest"


def _angle_text(motion: RecordingMotion, largest: LargestAngle) -> str:
    """Return an angle with its interval; without one where the motion is doubted, whose intervals do not hold."""
    angle, low, high = (f"{degrees(each_rad):.3f}°" for each_rad in (largest.angle_rad, *largest.coverage95_rad))
    return f"{angle} (95 % {low} to {high})" if motion.doubt is None else f"{angle}, uncertainty unknown"


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
