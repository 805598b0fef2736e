"""The report of `plumbline fleet drift`: the table of the sensors, and the drift of each as in the source's Tables 6 to 8."""

import math
from collections.abc import Sequence

from gateway.calibration.drift.fleet_drift import DriftRow, SensorDrift
from gateway.calibration.record import FigureSeries, RecordFigure
from gateway.certificate.bench_report import ReportTable, render_bench_report
from gateway.documents.format import UNKNOWN, format_fixed, format_number, format_with_uncertainty
from gateway.numerics.array import Array
from gateway.units import HOURS_PER_DAY

MAX_SHOWN_SENSORS = 20
"""Sensors whose calibrations are shown one by one, the most urgent ones. Basis: a choice; a page each."""


def render_drift_report(sensors: Sequence[SensorDrift], on: str, limit_deg: float, warnings: Sequence[str]) -> str:
    """Return the page."""
    shown = sensors[:MAX_SHOWN_SENSORS]
    return render_bench_report(
        "Drift of the sensors",
        facts=(
            ("On", on),
            ("Limit", f"{limit_deg:g}°"),
            ("Sensors", str(len(sensors))),
            ("Overdue", str(sum(sensor.is_overdue for sensor in sensors))),
        ),
        tables=(
            ReportTable("Sensors, the most urgent first", SENSOR_HEADER, tuple(map(sensor_row, sensors))),
            *(_change_table(sensor) for sensor in shown if len(sensor.table) > 1),
        ),
        figures=[figure for sensor in shown if len(sensor.table) > 1 for figure in _figures(sensor)],
        warnings=warnings,
    )


SENSOR_HEADER = ("sensor", "last calibration", "age / d", "drift since the one before / °", "next", "due in / d", "by")


def sensor_row(sensor: SensorDrift) -> tuple[str, ...]:
    """Return the cells of a sensor below `SENSOR_HEADER`."""
    drift = UNKNOWN
    if sensor.drift_deg is not None and sensor.u_drift_deg is not None:
        drift = f"{format_with_uncertainty(sensor.drift_deg, sensor.u_drift_deg)} ({sensor.drift_axis})"
    return (
        sensor.device_id,
        sensor.last_utc[:10],
        format_fixed(sensor.age_days, 0),
        drift,
        sensor.next_utc.date().isoformat(),
        format_fixed(sensor.due_days, 0),
        sensor.basis,
    )


def _change_table(sensor: SensorDrift) -> ReportTable:
    first, *later = sensor.table
    header = ("time / h", *(f"offset {axis}" for axis in "xyz"), *(f"scale {axis}" for axis in "xyz"), "tilt error / °")
    values = (format_fixed(0, 1), *_numbers(first.offset.tolist()), *_numbers(first.scale.tolist()), UNKNOWN)
    largest = (
        "largest",
        *_percent([max(abs(row.offset_change[axis]) for row in later) for axis in range(3)]),
        *_percent([max(abs(row.scale_change[axis]) for row in later) for axis in range(3)]),
        format_fixed(max(math.degrees(row.tilt_error_rad.max()) for row in later), 3),
    )
    return ReportTable(
        f"{sensor.device_id}: change since the first calibration, {first.created_utc[:10]}",
        header,
        (values, *(_change_row(row) for row in later), largest),
        "First row: raw values; then changes in per cent, as in Łuczak et al. 2022, Tables 6 to 8. Tilt error by eq. 19 and 20.",
    )


def _change_row(row: DriftRow) -> tuple[str, ...]:
    return (
        format_fixed(row.elapsed_h, 1),
        *_percent(row.offset_change.tolist()),
        *_percent(row.scale_change.tolist()),
        format_fixed(math.degrees(row.tilt_error_rad.max()), 3),
    )


def _percent(values: Sequence[float]) -> list[str]:
    return [f"{format_fixed(100 * value, 3)} %" if math.isfinite(value) else UNKNOWN for value in values]


def _numbers(values: Sequence[float]) -> list[str]:
    return [format_number(float(value), 5) for value in values]


def _figures(sensor: SensorDrift) -> tuple[RecordFigure, RecordFigure]:
    """Return offset and scale factor over time (Łuczak et al. 2022, Figure 7)."""
    device = sensor.device_id[:80]
    return (
        _figure(
            sensor,
            f"{device}: offset",
            "change of the offset / mg",
            [(1000 * row.offset_change_g, 1000 * row.u_offset_change_g) for row in sensor.table],
        ),
        _figure(
            sensor,
            f"{device}: scale factor",
            "change of the scale factor / %",
            [(100 * row.scale_change, 100 * row.u_scale_change) for row in sensor.table],
        ),
    )


def _figure(sensor: SensorDrift, title: str, y_label: str, values: Sequence[tuple[Array, Array]]) -> RecordFigure:
    """Return the figure of values with standard uncertainties, each of shape (3,) per calibration."""
    days = tuple(row.elapsed_h / HOURS_PER_DAY for row in sensor.table)
    series = tuple(
        FigureSeries(
            name=axis,
            x=days,
            y=tuple(float(value[place]) for value, _ in values),
            u=tuple(float(u_value[place]) for _, u_value in values),
        )
        for place, axis in enumerate("xyz")
    )
    return RecordFigure(
        title=title,
        x_label="time since the first calibration / d",
        y_label=y_label,
        series=series,
        caption="Bars: ± 2 u of both records. Compare Łuczak et al. 2022, Figure 7.",
    )
