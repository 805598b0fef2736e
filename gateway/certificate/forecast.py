"""Within how many days to calibrate again, by the records of a device, in a sentence."""

from collections.abc import Sequence

from gateway.calibration.drift.records import DriftReport, drift_of
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.certificate.element import short
from gateway.certificate.figures import significant

SHORTEST_SPAN_DAYS = 1.0
"""Records within a day of each other show how well calibrating repeats, and nothing of ageing."""


def forecast(records: Sequence[CalibrationRecord]) -> DriftReport:
    """The drift over records, in any order. Raises `CalibrationError` where they are too few, or too near each other."""
    report = drift_of(records)
    if report.span_days < SHORTEST_SPAN_DAYS:
        raise CalibrationError(
            f"{report.records} calibrations within a day show how well they repeat and nothing of ageing"
        )
    return report


def sentence(report: DriftReport) -> str:
    """What a person should do, and by when."""
    within = report.within
    last = short(report.last_utc[:10], 10)
    seen = f"from {report.records} records over {significant(report.span_days)} days, the last of {last}"
    if within.beyond_horizon:
        return f"The error stays below {within.limit_deg:g}° for ten years or more, {seen}."
    expected = "not in ten years" if within.expected_days is None else f"in {within.expected_days:.0f} days"
    return (
        f"Recalibrate within {within.days:.0f} days: then the error of axis {within.axis} may reach {within.limit_deg:g}° "
        f"(upper end of its 95 % interval; expected {expected}), {seen}."
    )
