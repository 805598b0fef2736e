"""The messages that the pipeline emits and that are recorded, published and displayed. Angles in degrees, accelerations in g.

A number that could not be computed is null on the bus and left out in recordings, and `reasons` state why; a field that is left
out reads as null. The JSON Schemas in recordings and in the output of `plumbline config schema --topic` are generated from these
classes. `docs/reference/messages.md` states the rules for their versions.
"""

from gateway.messages.alert import CALIBRATION_RULE, LEVEL_RANK, ActiveAlert, Alert, AlertEventKind, Level, Validity
from gateway.messages.calibration import NO_SESSION, Calibration, CalibrationSession, SessionPhase, SessionPose
from gateway.messages.header import (
    SCHEMA_VERSION,
    CalibrationStatus,
    ClockQuality,
    Degrees,
    Interval,
    Message,
    Seconds,
    Vector,
)
from gateway.messages.health import (
    SOURCES,
    CalibrationOffer,
    FoxgloveTime,
    Health,
    HealthState,
    Log,
    Mark,
    NewestStatement,
)
from gateway.messages.motion import (
    Cause,
    Condition,
    Formulas,
    HorizontalVector,
    Motion,
    MotionProbabilities,
    MotionState,
    Swing,
    Tilt,
    Verdict,
)
from gateway.messages.samples import Acceleration, ClockOffset, Readings, Samples

__all__ = [
    "CALIBRATION_RULE",
    "LEVEL_RANK",
    "NO_SESSION",
    "SCHEMA_VERSION",
    "SOURCES",
    "Acceleration",
    "ActiveAlert",
    "Alert",
    "AlertEventKind",
    "Calibration",
    "CalibrationOffer",
    "CalibrationSession",
    "CalibrationStatus",
    "Cause",
    "ClockOffset",
    "ClockQuality",
    "Condition",
    "Degrees",
    "Formulas",
    "FoxgloveTime",
    "Health",
    "HealthState",
    "HorizontalVector",
    "Interval",
    "Level",
    "Log",
    "Mark",
    "Message",
    "Motion",
    "MotionProbabilities",
    "MotionState",
    "NewestStatement",
    "Readings",
    "Samples",
    "Seconds",
    "SessionPhase",
    "SessionPose",
    "Swing",
    "Tilt",
    "Validity",
    "Vector",
    "Verdict",
]
