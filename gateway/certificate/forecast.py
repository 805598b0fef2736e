"""Forecast of the days until the next calibration, from the records of a device."""

from collections.abc import Sequence

from gateway.calibration.drift.forecast import MIN_SPAN_DAYS, DriftReport, analyse_drift
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.documents.format import format_short
from gateway.documents.text import printable_text


def forecast(records: Sequence[CalibrationRecord]) -> DriftReport:
    """Return the drift over records, in any order. Raises `CalibrationError` where they are too few, or too close in time."""
    report = analyse_drift(records)
    if report.span_days < MIN_SPAN_DAYS:
        raise CalibrationError(
            f"{report.records} calibrations within a day show their repeatability and nothing about ageing"
        )
    return report


def sentence(report: DriftReport) -> str:
    """Return what a person should do, and by when."""
    within = report.within
    last = printable_text(report.last_utc[:10], 10)
    basis = f"from {report.records} records over {format_short(report.span_days)} days, the last of {last}"
    if within.beyond_horizon:
        return f"The error stays below {within.limit_deg:g}° for ten years or more, estimated {basis}."
    expected = "not in ten years" if within.expected_days is None else f"in {within.expected_days:.0f} days"
    return (
        f"Recalibrate within {within.days:.0f} days: by then the error of axis {within.axis} may reach {within.limit_deg:g}° "
        f"(upper end of its 95 % interval; expected {expected}), estimated {basis}."
    )
