"""Feeds recordings to a procedure, as the gateway does with live readings, and fits them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.methods.norm_fit import FRAME_U_DEG
from gateway.calibration.methods.six_position import PLACEMENT_U_DEG
from gateway.calibration.offline.estimate_sensitivity import estimate_sensitivity
from gateway.calibration.offline.readings_file import FileReadings
from gateway.calibration.pose_plans import make_procedure
from gateway.calibration.pose_procedure import PoseProcedure
from gateway.calibration.poses.pose import NominalSensitivity, RawReadings
from gateway.calibration.poses.pose_finder import READINGS_PER_POSE
from gateway.calibration.record import CalibrationRecord, NotDeterminedError
from gateway.errors import InputError

FED_READINGS = 64
"""Number of readings that are fed at once. Basis: the result does not depend on it."""


@dataclass(frozen=True, slots=True)
class CalibrateOptions:
    """Options of an offline calibration."""

    method: str
    units_per_g: float | None = None
    placement_u_deg: float = PLACEMENT_U_DEG
    frame_u_deg: float = FRAME_U_DEG
    parent: CalibrationRecord | None = None


@dataclass(frozen=True, slots=True)
class OfflineCalibration:
    """Result of an offline calibration."""

    fit: CalibrationFit
    unit: str
    nominal: NominalSensitivity
    notes: tuple[str, ...]


def calibrate_files(files: Sequence[FileReadings], options: CalibrateOptions) -> OfflineCalibration:
    """Find the poses in the files, each of which contains a session or one pose, and fit them.

    Raises `NotDeterminedError` if the poses do not determine the calibration, `InputError` for files in different units.
    """
    units = {one.unit for one in files}
    if len(units) > 1:
        raise InputError(f"the files are in {' and '.join(sorted(units))}; calibrate from one unit")
    nominal = estimate_sensitivity(files, options.units_per_g or files[0].units_per_g)
    procedure = make_procedure(
        options.method,
        nominal,
        placement_u_deg=options.placement_u_deg,
        frame_u_deg=options.frame_u_deg,
        parent=options.parent,
    )
    notes = (
        [f"readings taken to be in {files[0].unit}; --unit sets another unit"] if not files[0].unit_is_stated else []
    )
    for one in files:
        n_before = len(procedure.progress().poses)
        _feed_file(procedure, one)
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
        fit = procedure.finish()
    except NotDeterminedError as error:
        where = str(files[0].path) if len(files) == 1 else f"{len(files)} files"
        raise NotDeterminedError("; ".join([f"{n_poses} poses in {where}: {error}", *notes])) from error
    return OfflineCalibration(fit, files[0].unit, nominal, tuple(notes))


def _feed_file(procedure: PoseProcedure, readings: FileReadings) -> None:
    """Feed all readings of a file in blocks; the end of the file ends a pose."""
    for start in range(0, len(readings.time_s), FED_READINGS):
        part = slice(start, start + FED_READINGS)
        procedure.feed(RawReadings(readings.time_s[part], readings.raw[part], _mean_temperature_c(readings, part)))
    procedure.end_segment()


def _mean_temperature_c(readings: FileReadings, part: slice) -> float | None:
    if readings.temperature_c is None or np.all(np.isnan(readings.temperature_c[part])):
        return None
    return float(np.nanmean(readings.temperature_c[part]))
