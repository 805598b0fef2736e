"""Whether the levels of the alerts are known, as one word for receivers, and when that must be sent at once."""

import math

from gateway.messages import CalibrationStatus, Validity
from gateway.stages.alerts import Reading
from gateway.stages.conditions.verdict import ConditionResult

URGENT: tuple[Validity, ...] = ("no_samples", "suspended", "uncalibrated")
"""Their begin and end do not wait for the next heartbeat."""


class ValidityMonitor:
    """The validity of one pipeline."""

    def __init__(self) -> None:
        self.present: Validity = "not_known"

    def update(self, condition: ConditionResult, calibration: CalibrationStatus, swing: Reading | None) -> bool:
        """Take the present state; return whether receivers must know at once."""
        before, self.present = self.present, _validity(condition, calibration, swing)
        return before != self.present and (before in URGENT or self.present in URGENT)


def _validity(condition: ConditionResult, calibration: CalibrationStatus, swing: Reading | None) -> Validity:
    if condition.gates.get("fresh") is False:
        return "no_samples"
    if condition.gates.get("on_rope") is False:
        return "suspended"
    if calibration == "uncalibrated":
        return "uncalibrated"
    return "not_known" if swing is None or not math.isfinite(swing.value_rad) else "valid"
