"""Changes since the parent record, and the forecast of the days until the next calibration."""

from collections.abc import Sequence
from dataclasses import dataclass

from gateway.calibration.drift.change import DriftChange, change_between
from gateway.calibration.drift.forecast import MEASURING_METHODS, MIN_SPAN_DAYS, DriftReport, analyse_drift
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.documents.format import (
    UNKNOWN,
    as_sentence,
    format_fixed,
    format_short,
    format_with_uncertainty,
    printable_text,
)

SIGNIFICANT_CHANGE_SIGMA = 2.0
"""A change beyond this many standard uncertainties is one. Definition: about 95 % (GUM 6.3)."""
MAX_COMPARISON_CHARACTERS = 260
"""Characters of a text. Basis: a choice; three lines."""


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


@dataclass(frozen=True, slots=True)
class Changes:
    """Differences between a record and its parent."""

    rows: tuple[tuple[str, ...], ...]
    """Per axis: name, offset in mg, scale in mg at 1 g, tilt error and rotation in degrees, which of them is significant."""
    paragraph: str
    forecast: str
    """When to calibrate again; empty where the records cannot say."""
    forecast_note: str
    """Warnings about the forecast, or why there is none."""


def changes_since(
    record: CalibrationRecord, parent: CalibrationRecord, earlier: Sequence[CalibrationRecord]
) -> Changes | str:
    """Return the changes against the parent, and the drift over all records at hand; or why they cannot be compared."""
    try:
        change = change_between(parent, record)
    except CalibrationError as error:
        return f"Not compared: {error}"
    measured = record.method in MEASURING_METHODS
    until, note = _forecast([*earlier, parent, record])
    return Changes(_rows(change, measured), _change_paragraph(change, measured), until, note)


def differs_from_named(record: CalibrationRecord, parent: CalibrationRecord | None) -> list[str]:
    """Return a warning where the record compared with is not the one that this record names as its parent."""
    if parent is None or parent.id == record.parent:
        return []
    return [f"compared with record {parent.id}, but the parent that this record names is {record.parent or 'none'}"]


def _rows(change: DriftChange, measured: bool) -> tuple[tuple[str, ...], ...]:
    """Return a row per axis; without uncertainties where the record copies its parent's values."""
    return tuple(
        (
            "xyz"[axis],
            _figure(1000 * change.offset_g[axis], 1000 * change.u_offset_g[axis], measured),
            _figure(1000 * change.scale[axis], 1000 * change.u_scale[axis], measured),
            format_fixed(float(change.tilt_error_deg[axis]), 3),
            _figure(change.rotation_deg[axis], change.u_rotation_deg[axis], measured),
            _significant_changes(change, axis) if measured else UNKNOWN,
        )
        for axis in range(3)
    )


def _figure(value: float, u_value: float, measured: bool) -> str:
    return format_with_uncertainty(float(value), float(u_value)) if measured else format_fixed(float(value), 3)


def _significant_changes(change: DriftChange, axis: int) -> str:
    pairs = [
        ("offset", change.offset_g[axis], change.u_offset_g[axis]),
        ("scale", change.scale[axis], change.u_scale[axis]),
    ]
    changed = [name for name, value, u_value in pairs if abs(value) > SIGNIFICANT_CHANGE_SIGMA * u_value]
    return " and ".join(changed) or "no"


def _change_paragraph(change: DriftChange, measured: bool) -> str:
    worst_deg = format_fixed(float(change.tilt_error_deg.max()), 3)
    uncertainty = (
        "± is the expanded uncertainty of both records, taken as independent."
        if measured
        else "This record copies offset and scale from its parent; it measured neither."
    )
    return (
        f"With the parent record, this sensor would now have a tilt error of up to {worst_deg}° on its worst axis, rotations "
        f"excluded. {uncertainty}"
    )


def _forecast(records: list[CalibrationRecord]) -> tuple[str, str]:
    """Return the forecast and its warnings, or nothing and the reason."""
    unique = list({record.id: record for record in records}.values())
    try:
        report = forecast(unique)
    except CalibrationError as error:
        return "", printable_text(f"No forecast: {error}.", MAX_COMPARISON_CHARACTERS)
    return sentence(report), printable_text(as_sentence("; ".join(report.warnings)), MAX_COMPARISON_CHARACTERS)
