"""`plumbline fleet drift`: age, drift and next calibration of many sensors, the most urgent first."""

import argparse
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gateway.cli.argument_types import above_zero
from gateway.cli.command import command, option
from gateway.cli.output import JSON_OPTION, output_file

if TYPE_CHECKING:
    from gateway.calibration.drift.fleet_drift import SensorDrift


def _date(text: str) -> datetime:
    try:
        day = datetime.fromisoformat(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text} is no date such as 2026-11-22") from None
    return day if day.tzinfo is not None else day.replace(tzinfo=UTC)


@command(
    "drift",
    "age, drift and date of the next calibration of many sensors, the most urgent first",
    "Print age, drift and date of the next calibration of every sensor, the most urgent first, from its "
    "calibration records: those that were in force, without any that was withdrawn. Exit code 1: a sensor is overdue, or "
    "cannot be judged.",
    "example: plumbline fleet drift /var/lib/plumbline/calibration archive/*.json --html drift.html",
    option(
        "records",
        type=Path,
        nargs="+",
        metavar="RECORD",
        help="calibration records (.json), or folders of them, such as the store of a gateway",
    ),
    option(
        "--limit-deg",
        type=above_zero,
        default=0.5,
        metavar="DEG",
        help="tilt error at which a sensor is calibrated again (default %(default)s)",
    ),
    option(
        "--interval-days",
        type=above_zero,
        default=365.0,
        metavar="DAYS",
        help="longest time between two calibrations, whatever the records show (default %(default)s)",
    ),
    option("--on", type=_date, metavar="DATE", help="judge on this day, such as 2026-11-22 (default: today)"),
    JSON_OPTION,
    option("--html", type=output_file, metavar="FILE", help="write a report with tables and figures"),
)
def run_drift(arguments: argparse.Namespace) -> int:
    """Print the drift of all sensors; return 1 where one is overdue or cannot be judged."""
    from gateway.calibration.drift.fleet_drift import fleet_drift
    from gateway.calibration.input_files import read_records
    from gateway.certificate.drift_report import render_drift_report
    from gateway.cli.output import show, write_text

    now = arguments.on or datetime.now(UTC)
    read = read_records(arguments.records)
    limit_deg, interval_days = arguments.limit_deg, arguments.interval_days
    sensors, failures = fleet_drift(read.counted, now, limit_deg=limit_deg, interval_days=interval_days)
    without = {record.device_id for record in read.not_counted} - {record.device_id for record in read.counted}
    failures += tuple(f"{device_id}: no record that was made is in force" for device_id in sorted(without))
    result = {
        "on_utc": now.isoformat(),
        "limit_deg": arguments.limit_deg,
        "sensors": [_as_json(sensor) for sensor in sensors],
        "not_judged": list(failures),
    }
    show(_as_text(sensors, [*failures, *read.notes]), result, arguments.json)
    if arguments.html is not None:
        page = render_drift_report(sensors, now.date().isoformat(), arguments.limit_deg, failures)
        write_text(arguments.html, page)
    return 1 if failures or any(sensor.is_overdue for sensor in sensors) else 0


def _as_json(sensor: "SensorDrift") -> dict[str, Any]:
    from gateway.units import finite

    return {
        "device_id": sensor.device_id,
        "records": sensor.records,
        "last_utc": sensor.last_utc,
        "age_days": sensor.age_days,
        "drift_deg": sensor.drift_deg,
        "u_drift_deg": sensor.u_drift_deg,
        "drift_axis": sensor.drift_axis,
        "drift_days": sensor.drift_days,
        "next_utc": sensor.next_utc.isoformat(),
        "due_days": sensor.due_days,
        "basis": sensor.basis,
        "warnings": list(sensor.warnings),
        "table": [
            {
                "created_utc": row.created_utc,
                "elapsed_h": row.elapsed_h,
                "offset": row.offset.tolist(),
                "offset_change_percent": [finite(100 * change) for change in row.offset_change.tolist()],
                "scale": row.scale.tolist(),
                "scale_change_percent": (100 * row.scale_change).tolist(),
                "error_percent": (100 * row.error_g).tolist(),
                "tilt_error_rad": row.tilt_error_rad.tolist(),
            }
            for row in sensor.table
        ],
    }


def _as_text(sensors: "Sequence[SensorDrift]", notes: Sequence[str]) -> str:
    width = max([len("sensor"), *(len(sensor.device_id) for sensor in sensors)])
    lines = [f"{'sensor':{width}}  {'last':10}  {'age':>6}  {'drift':>16}  {'next':10}  {'due in':>8}  by"]
    for sensor in sensors:
        drift = "unknown" if sensor.drift_deg is None else f"{sensor.drift_deg:.3f} deg in {sensor.drift_days:.0f} d"
        due = "OVERDUE" if sensor.is_overdue else f"{sensor.due_days:.0f} d"
        lines.append(
            f"{sensor.device_id:{width}}  {sensor.last_utc[:10]}  {sensor.age_days:4.0f} d  {drift:>16}  "
            f"{sensor.next_utc.date()}  {due:>8}  {sensor.basis}"
        )
    return "\n".join([*lines, *(f"note: {note}" for note in notes)])
