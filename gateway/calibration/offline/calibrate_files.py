"""Feeds recordings to a procedure as the gateway would, and makes the record."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.methods.norm_fit import FRAME_U_DEG
from gateway.calibration.methods.six_position import PLACEMENT_U_DEG
from gateway.calibration.offline.nominal_sensitivity import nominal_for
from gateway.calibration.offline.readings_file import Session, TableOptions, read_session
from gateway.calibration.poses.pose import RawReadings
from gateway.calibration.poses.pose_finder import NominalSensitivity
from gateway.calibration.procedures.pose_procedure import PoseProcedure
from gateway.calibration.procedures.procedure_factory import procedure_for
from gateway.calibration.record import CalibrationRecord, NotDeterminedError
from gateway.errors import InputError

BLOCK = 64
"""Readings at a time; the result does not hang on it."""


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """How to calibrate."""

    method: str
    units_per_g: float | None = None
    placement_u_deg: float = PLACEMENT_U_DEG
    frame_u_deg: float = FRAME_U_DEG
    parent: CalibrationRecord | None = None


@dataclass(frozen=True, slots=True)
class BenchResult:
    """What came of the files."""

    fit: CalibrationFit
    unit: str
    nominal: NominalSensitivity
    notes: tuple[str, ...]


def calibrate(paths: list[Path], tables: TableOptions, options: BenchOptions) -> BenchResult:
    """Find the poses in the files, each a session or one pose, and fit them.

    Raises `NotDeterminedError` where the poses do not determine the calibration, `RecordingError` or `InputError` for files
    that cannot be used.
    """
    sessions = [read_session(path, tables) for path in paths]
    units = {session.unit for session in sessions}
    if len(units) > 1:
        raise InputError(f"the files are in {' and '.join(sorted(units))}; calibrate from one unit")
    nominal = nominal_for(sessions, options.units_per_g)
    procedure = procedure_for(
        options.method,
        nominal,
        placement_u_deg=options.placement_u_deg,
        frame_u_deg=options.frame_u_deg,
        parent=options.parent,
    )
    notes = [f"taken as {sessions[0].unit}; --unit says otherwise"] if tables.unit is None else []
    for session in sessions:
        before = len(procedure.progress().poses)
        feed_session(procedure, session)
        if session.left_out:
            notes.append(f"{session.path}: {session.left_out} rows could not be used")
        if len(procedure.progress().poses) == before:
            notes.append(f"{session.path}: no new pose found in it ({procedure.progress().text})")
    try:
        fit = procedure.finish()
    except NotDeterminedError as error:
        poses = procedure.progress().poses
        text = f"{len(poses)} poses in {_files(paths)}: {error}"
        raise NotDeterminedError("; ".join([text, *notes])) from error
    return BenchResult(fit, sessions[0].unit, nominal, tuple(notes))


def feed_session(procedure: PoseProcedure, session: Session) -> None:
    """All readings of a file, in blocks; its end ends a pose."""
    for start in range(0, len(session.time_s), BLOCK):
        part = slice(start, start + BLOCK)
        procedure.feed(RawReadings(session.time_s[part], session.raw[part], _temperature(session, part)))
    procedure.cut()


def _temperature(session: Session, part: slice) -> float | None:
    if session.temperature_c is None or np.all(np.isnan(session.temperature_c[part])):
        return None
    return float(np.nanmean(session.temperature_c[part]))


def _files(paths: list[Path]) -> str:
    return str(paths[0]) if len(paths) == 1 else f"{len(paths)} files"
