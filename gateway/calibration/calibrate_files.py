"""Calibration from files: feeds recordings to a procedure, as the gateway does with live readings, fits and reports.

The nominal sensitivity of a sensor is estimated from the readings, to within the tolerance of the pose finder. The report is the
text output of `plumbline calibrate`: poses, offsets, scale factors, misalignment, uncertainty budget.
"""

from collections.abc import Sequence

import numpy as np

from gateway.calibration.acceptance import Acceptance
from gateway.calibration.calibration_fit import CalibrationFit
from gateway.calibration.input_files import FileReadings
from gateway.calibration.pose import NominalSensitivity
from gateway.calibration.pose_finder import NORM_TOLERANCE, READINGS_PER_POSE
from gateway.calibration.pose_procedure import make_procedure
from gateway.calibration.record import CalibrationRecord, NotDeterminedError
from gateway.errors import InputError
from gateway.numerics.array import Array

AVERAGED_READINGS = 16
"""Number of readings that are averaged before their extremes are taken, so that noise and knocks do not count. Basis: a choice;
noise falls to a quarter, and a turned sensor stays for longer."""
EXTREME_QUANTILE = 0.01
"""Quantile of the averages that counts as their minimum, and one minus it as their maximum. Basis: a choice; knocks are rarer,
and a face is held for longer."""
MIN_HALF_RANGE_UNITS = 0.02
"""Half range, raw units, below which a sensor was not turned: noise alone. Basis: a choice; noise of any sensor is smaller in its
unit, and a turned one has 1 g or more."""
MAX_DIGITAL_ZERO_G = 0.5
"""Largest zero of a digital sensor, g; a larger one is that of an analogue sensor, in the middle of its supply voltage. Basis: a
choice; data sheets state less for digital sensors, and 1.5 V are several g."""
MAX_POSE_LINES = 40
"""More poses, as those of a rotation, are in the record alone. Basis: a choice; a screen or a page."""


def estimate_sensitivity(files: Sequence[FileReadings], units_per_g: float | None) -> NominalSensitivity:
    """Return nominal sensitivity and zero.

    Raises `NotDeterminedError` if the readings do not determine them, `InputError` for readings in g without gravity's magnitude.
    """
    nominal = _estimate_sensitivity(files, units_per_g)
    if files[0].unit == "g" and abs(nominal.units_per_g - 1) > NORM_TOLERANCE:
        raise InputError(
            f"{files[0].path}: gravity reads {nominal.units_per_g:.3g} g in it: the unit is another one than stated; correct the "
            "names of the columns, or give --unit (m/s2, mg, counts, V)"
        )
    return nominal


def _estimate_sensitivity(files: Sequence[FileReadings], units_per_g: float | None) -> NominalSensitivity:
    unit = files[0].unit
    means = np.concatenate([_block_means(one.raw) for one in files])
    norm = float(np.median(np.linalg.norm(means, axis=1)))
    if unit == "g" and abs(norm - 1) <= NORM_TOLERANCE:
        return NominalSensitivity(1.0)
    analogue = _estimate_from_extremes(means, units_per_g)
    if analogue is not None:
        zero_g = np.max(np.abs(analogue.zero)) / analogue.units_per_g
        if unit == "V" or zero_g > MAX_DIGITAL_ZERO_G:
            return analogue
    if unit == "V":
        raise NotDeterminedError(
            "the readings do not determine volts per g: every axis has to point up once and down once; take the missing poses"
        )
    return NominalSensitivity(units_per_g or norm)


def _block_means(raw: Array) -> Array:
    n_used = len(raw) // AVERAGED_READINGS * AVERAGED_READINGS
    return raw[:n_used].reshape(-1, AVERAGED_READINGS, 3).mean(axis=1) if n_used else raw


def _estimate_from_extremes(means: Array, units_per_g: float | None) -> NominalSensitivity | None:
    """Return the zero between the extremes of each axis, or at its median if the axis has one extreme only.

    None if an axis was not turned.
    """
    low, middle, high = np.quantile(means, [EXTREME_QUANTILE, 0.5, 1 - EXTREME_QUANTILE], axis=0)
    zero, half = (low + high) / 2, (high - low) / 2
    scale = units_per_g or float(half.max())
    least_half_range = (1 - NORM_TOLERANCE) * scale
    zero = np.where(half > least_half_range, zero, middle)
    if scale < MIN_HALF_RANGE_UNITS or np.any(np.maximum(high - zero, zero - low) < least_half_range):
        return None
    x, y, z = zero.tolist()
    return NominalSensitivity(scale, (x, y, z))


def calibrate_files(
    files: Sequence[FileReadings],
    method: str,
    units_per_g: float | None = None,
    parent: CalibrationRecord | None = None,
    **stated_u_deg: float,
) -> tuple[CalibrationFit, tuple[str, ...]]:
    """Find the poses in the files, each of which contains a session or one pose; return their fit and notes.

    The fit is in the unit of the files. `stated_u_deg` are the standard uncertainties that `make_procedure` takes.
    Raises `NotDeterminedError` if the poses do not determine the calibration, `InputError` for files in different units.
    """
    units = {one.unit for one in files}
    if len(units) > 1:
        raise InputError(f"the files are in {' and '.join(sorted(units))}; calibrate from one unit")
    nominal = estimate_sensitivity(files, units_per_g or files[0].units_per_g)
    procedure = make_procedure(method, nominal, parent=parent, **stated_u_deg)
    notes = (
        [f"readings taken to be in {files[0].unit}; --unit sets another unit"] if not files[0].unit_is_stated else []
    )
    for one in files:
        n_before = len(procedure.progress().poses)
        for readings in one.blocks():
            procedure.feed(readings)
        procedure.end_segment()  # the end of a file ends a pose
        if one.n_skipped:
            notes.append(f"{one.path}: {one.n_skipped} rows could not be used")
        if len(procedure.progress().poses) == n_before:
            notes.append(f"{one.path}: no new pose found in it ({procedure.progress().text})")
    n_poses = len(procedure.progress().poses)
    if n_poses < procedure.rests:
        notes.append(
            f"{n_poses} of {procedure.rests} rests are used, at most {READINGS_PER_POSE} readings of each; the others were "
            "turned by less than 5 degrees, were no new pose, or moved before their mean was known"
        )
    try:
        return procedure.finish(), tuple(notes)
    except NotDeterminedError as error:
        where = str(files[0].path) if len(files) == 1 else f"{len(files)} files"
        raise NotDeterminedError("; ".join([f"{n_poses} poses in {where}: {error}", *notes])) from error


def format_report(record: CalibrationRecord, acceptance: Acceptance, notes: tuple[str, ...]) -> str:
    """Return the report as several lines of text."""
    return "\n".join(
        [
            f"{record.method} of {record.device_id}, {record.created_utc} by {record.by}, raw input in {record.unit}",
            f"record {record.id}",
            "",
            *_pose_lines(record),
            "",
            *_axis_lines(record),
            "",
            *_budget_lines(record),
            "",
            f"residual {_format_mg(record.residual_rms_g)} rms, condition number {record.condition_number:.3g}, "
            f"|m| at rest within 1 +- {record.prediction_interval_g:.4f}",
            *_temperature_lines(record),
            *(f"warning: {text}" for text in record.warnings),
            *(f"note: {text}" for text in notes),
            *(f"needs a reason: {text}" for text in acceptance.implausible),
            *(f"not acceptable: {text}" for text in acceptance.refused),
        ]
    )


def _pose_lines(record: CalibrationRecord) -> list[str]:
    if len(record.poses) > MAX_POSE_LINES:
        return [f"{len(record.poses)} poses, listed in the record"]
    lines = [f"{'pose':>4}  {'up':4} {'readings':>8}  {'mean':^38}  {'type A':>8}"]
    for number, pose in enumerate(record.poses, start=1):
        mean = " ".join(f"{value:12.6g}" for value in pose["mean"])
        used = "" if pose["used"] else "  not used"
        lines.append(f"{number:4}  {pose['face'] or '-':4} {pose['count']:8}  {mean}  {max(pose['type_a']):8.2g}{used}")
    return lines


def _axis_lines(record: CalibrationRecord) -> list[str]:
    sensitivity = np.linalg.inv(np.array(record.correction_matrix))
    u_scale, u_offset_g = record.u_scale_factor, record.u_zero_g_offset_g
    misalignment = record.misalignment_deg or {}
    lines = [f"axis  {'offset':>12}  {'u':>9}  {'per g':>12}  {'u':>8}  misalignment"]
    for place, axis in enumerate("xyz"):
        angles = ", ".join(f"{value:+.3f}" for value in misalignment.get(axis, ()))
        lines.append(
            f"{axis:4}  {record.offset[place]:12.6g}  {_format_mg(u_offset_g[place]):>9}  "
            f"{sensitivity[place, place]:12.6g}  {u_scale[place] * 100:6.3f} %  {angles} deg"
        )
    return lines


def _budget_lines(record: CalibrationRecord) -> list[str]:
    rows = [f"  {row.type}  {row.source:40} {_format_mg(row.u_g):>10}  {row.u_deg:.4f} deg" for row in record.budget]
    u_g = float(np.sqrt(sum(row.u_g**2 for row in record.budget)))
    u_deg = float(np.sqrt(sum(row.u_deg**2 for row in record.budget)))
    return ["standard uncertainty of a reading", *rows, f"     {'combined':40} {_format_mg(u_g):>10}  {u_deg:.4f} deg"]


def _temperature_lines(record: CalibrationRecord) -> list[str]:
    known = record.temperature_c
    return [] if known is None else [f"temperature {known['mean']:.1f} C, {known['min']:.1f} to {known['max']:.1f}"]


def _format_mg(value_g: float | None) -> str:
    return "unknown" if value_g is None else f"{value_g * 1000:.3f} mg"
