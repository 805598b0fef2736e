"""The table of alert rules: what each compares with which limits.

The alert manager, the metrics and the incident page follow from it. The operator's page names a rule by its text `rule_<name>`,
and says what has happened by its text `<name>_alarm`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gateway.messages import CALIBRATION_RULE
from gateway.motion.estimate import MotionEstimate
from gateway.stages.alerts import Limits, Reading, larger_reading

if TYPE_CHECKING:  # the page has the rules' names, and no configuration
    from gateway.configuration.model import AlertsSection

LEAN_CLEAR_SHARE = 0.8
"""The lean alert clears below this share of its limit. Basis: a choice; a lean at its limit does not clear by noise, and one that
is mended does."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What is known at an update, from which a rule takes its reading."""

    motion: MotionEstimate
    tilt: Reading | None
    """The low-passed static tilt; None unless the load rests."""
    is_calibrated: bool


@dataclass(frozen=True, slots=True)
class AlertRule:
    """One row."""

    name: str
    limits: "Callable[[AlertsSection], Limits]"
    reading: Callable[[Evaluation], Reading | None]
    """The angle as it is compared; None where it is not known."""


def swing_reading(motion: MotionEstimate) -> Reading | None:
    """Return the larger of the present angle and the expected peak, as they are compared; None where they are not known."""
    if motion.angle_rad is None or motion.u_rad is None:
        return None
    peak = motion.expected_peak
    coming = None if peak is None else Reading.of(peak.angle_rad, peak.u_rad, peak.in_s, motion.period_s or math.inf)
    return larger_reading(Reading.of(motion.angle_rad, motion.u_rad), coming)


def lean_reading(evaluation: Evaluation) -> Reading | None:
    """Return the lean: the tilt of a load at rest, else the centre of its swing; None where it is not known."""
    motion = evaluation.motion
    if not evaluation.is_calibrated:
        return None
    if evaluation.tilt is not None:
        return evaluation.tilt
    if motion.angle_rad is None or motion.lean_rad is None or motion.lean_u_rad is None:
        return None
    return Reading.of(motion.lean_rad, motion.lean_u_rad)


def _swing_limits(section: "AlertsSection") -> Limits:
    return Limits(
        trip_rad=math.radians(section.trip_deg),
        clear_rad=math.radians(section.clear_deg),
        hold_s=section.hold_s,
        warn_rad=math.radians(section.warn_deg),
    )


def _lean_limits(section: "AlertsSection") -> Limits:
    trip_rad = math.radians(section.lean_trip_deg)
    return Limits(trip_rad=trip_rad, clear_rad=LEAN_CLEAR_SHARE * trip_rad, hold_s=section.hold_s)


SWING = AlertRule("swing", _swing_limits, lambda evaluation: swing_reading(evaluation.motion))
ALERT_RULES = (
    SWING,
    AlertRule("lean", _lean_limits, lean_reading),
)
RULE_NAMES = (*(rule.name for rule in ALERT_RULES), CALIBRATION_RULE)
"""The rules of a gateway; one that is not active is normal."""
