"""Calibration of an installed housing: its recordings reduced, compared with its record and its rig, and a record offered.

What swings and rests cannot tell apart is compared as the sum that it is. A record is offered where an interval is narrower than
the parent's; nothing uses it until a person puts it in force.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from devices.axes_map import SAME_AXES
from gateway.bench.installed.free_motion import WINDOW_PERIODS, FreeMotionFinder, FreeWindow
from gateway.bench.installed.installed_fit import DAY_S, MIN_DAYS, InstalledFit, fit_installed
from gateway.calibration.calibration_fit import (
    CalibrationFit,
    Contribution,
    FitWarning,
    misalignment_deg,
    prediction_interval_g,
    uncertainty_budget,
)
from gateway.calibration.correction import Correction, correction_for
from gateway.calibration.methods.zeroing import PLUMB_U_DEG
from gateway.calibration.record import INSTALLED, CalibrationRecord, NotDeterminedError
from gateway.configuration.model import PLACED_FROM_LOAD, Configuration
from gateway.errors import InputError
from gateway.measurement.recording_files import common_configuration
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.pipeline.force_stage import find_clipped
from gateway.pipeline.rig import BESIDE_U_M, configured_housing
from gateway.recording.reading.sample_calibration import recorded_configuration
from gateway.recording.reading.samples import SampleReader
from gateway.recording.reading.timeline import ReportProgress, open_timeline
from gateway.swing.rig import MountedHousing

AGREEMENT = 1.5
"""Difference over the half of both intervals together up to which values agree. Basis: three standard deviations; one of fourteen
rows of a sound sensor is beyond in 25 sessions."""
LENGTH_U_REL = 0.025
"""Standard uncertainty of a stated rope length, relative. Basis: a choice; a twentieth is a wrong rope or another load."""
MAX_SCALE_ERROR, MAX_PLACE_SHARE = 0.15, 0.25
"""Error of a scale factor, and of the place over the rope's length, beyond which no rope moves the housing. Basis: a housing on a
spreader reads as one on a rope with the scale factor of another part."""
MIN_LEVEL_G = 0.8
"""Least mean along the rope. Basis: a calibrated axis that hangs reads 1 g; less is another axis."""
OFFERED = ("scale_x", "scale_y", "offset_x_g", "offset_y_g")
"""Definition: rows that a record can state."""
NOT_IDENTIFIABLE = (
    "not identifiable on the rope: a turn of the housing about the rope (a move in a known direction shows it); offset apart "
    "from scale along the rope, and the scale across apart from half of that along it (another attitude); a steady lean, as by "
    "wind from one side, apart from mount and offset (calm, or the housing turned by half a turn); the mass of the rope"
)


@dataclass(frozen=True, slots=True)
class Row:
    """A parameter, in its unit, as found and as the parent or the rig states it."""

    name: str
    unit: str
    value: float
    half: float
    """Half of the 95 % interval."""
    stated: float
    stated_half: float
    basis: str

    @property
    def agrees(self) -> bool:
        """Whether the difference is no more than both intervals allow."""
        return abs(self.value - self.stated) <= AGREEMENT * float(np.hypot(self.half, self.stated_half))

    @property
    def improves(self) -> bool:
        """Whether the interval is narrower than the parent's."""
        return self.half < self.stated_half


@dataclass(frozen=True, slots=True)
class InstalledCalibration:
    """The comparison, and what may be offered."""

    rows: dict[str, Row]
    offer: CalibrationFit | None
    """None: nothing is known better than by the parent, or the place or the rope contradict the rig."""
    swings: int
    rests: int
    days: int

    @property
    def is_contradicted(self) -> bool:
        """Whether a row does not agree."""
        return not all(row.agrees for row in self.rows.values())


def read_windows(
    paths: Sequence[Path], parent: CalibrationRecord, report: ReportProgress
) -> tuple[list[FreeWindow], MountedHousing, Correction]:
    """Return the free swings and rests of recordings of one gateway in bounded memory, by the parent's correction.

    Raises `RecordingError`, `InputError` where the rig is not stated, changes or is no single rope, `CalibrationError` for the
    record of another device.
    """
    reader = SampleReader(open_timeline(paths))
    finder: FreeMotionFinder | None = None
    windows: list[FreeWindow] = []
    total, done = len(reader.timeline.segments), 0
    for recording in reader.recordings():
        if finder is None:
            configuration = recorded_configuration(reader.files[0])
            axes = SAME_AXES if configuration is None else configuration.device.axes
            correction = correction_for(reader.device, axes, parent)
            housing = _housing(configuration, correction, reader)
            finder = FreeMotionFinder(housing)
        if len(reader.files) != done:
            done = len(reader.files)
            report(done / total)
        force_g = correction.apply(recording.raw, recording.temperature_c)
        force_g[find_clipped(recording.raw, recording.saturated, None)] = np.nan
        windows += finder.feed(recording.time_s, force_g)
    common_configuration(reader.files, same_rig=True)
    return windows, housing, correction


def _housing(configuration: Configuration | None, correction: Correction, reader: SampleReader) -> MountedHousing:
    path = reader.files[0].path
    housing = None
    if configuration is not None:
        housing = configured_housing(configuration, correction, reader.device.bandwidth_hz)
    if configuration is None or housing is None:
        raise InputError(f"{path}: does not state where the housing is on the rope; set housing.above_load_m")
    if housing.mounted_on in PLACED_FROM_LOAD:
        raise InputError(
            f"{path}: the housing is on {housing.mounted_on}; only one on a single rope is calibrated by its swings"
        )
    return replace(housing, mount_u_rad=math.radians(configuration.housing.mount_u_deg))


def calibrate_installed(
    windows: Sequence[FreeWindow], parent: CalibrationRecord, housing: MountedHousing, correction: Correction
) -> InstalledCalibration:
    """Return what the windows, in order of time, say of a sensor with the parent's correction in a housing placed so.

    Raises `NotDeterminedError` for too few swings, and where no single rope moves the housing.
    """
    swings = sum(window.is_swing for window in windows)
    days = len({window.middle_s // DAY_S for window in windows if window.is_swing})
    if days < MIN_DAYS:
        raise NotDeterminedError(
            f"{swings} free swings of {WINDOW_PERIODS:.0f} periods on {days} days; {MIN_DAYS} days or more are needed; "
            "with a wrong rope.length_m or housing.above_load_m, and on a spreader no motion reads as a swing"
        )
    level_g = float(np.median([window.mean_g[0, 2] for window in windows]))
    if level_g < MIN_LEVEL_G:
        raise InputError(
            f"along the rope the parent's correction reads {level_g:.2f} g; check device.axes_map and --parent"
        )
    fit = fit_installed(windows, housing)
    shown = [abs(fit.estimates[name].value) for name in ("scale_x", "scale_y") if name in fit.estimates]
    place = fit.estimates.get("place_m")
    far = place is not None and abs(place.value) > MAX_PLACE_SHARE * housing.length_m
    if far or max(shown, default=0.0) > MAX_SCALE_ERROR:
        raise NotDeterminedError(
            "no housing on a single rope swings so: the forces fit a scale factor or a place that is far off; check "
            "housing.mounted_on (a spreader?), housing.above_load_m and --parent"
        )
    rows = _rows(fit, parent, housing, correction, swings)
    trusted = all(rows[name].agrees for name in ("place_m", "length_m") if name in rows)
    better = [name for name in OFFERED if name in rows and rows[name].improves]
    offer = _offer(parent, rows, better, housing_rotation_of(correction, parent)) if trusted and better else None
    return InstalledCalibration(rows, offer, swings, len(windows) - swings, days)


def _rows(
    fit: InstalledFit, parent: CalibrationRecord, housing: MountedHousing, correction: Correction, swings: int
) -> dict[str, Row]:
    """Return the rows by name. Where the mean lean is taken as zero, a rope is plumb as well as in zeroing (type B)."""
    u_offset_g = np.abs(housing_rotation_of(correction, parent)) @ parent.u_zero_g_offset_g
    u_rest_g, u_scale, mount = correction.u_zero_g_offset_g, correction.u_scale_factor, housing.mount_u_rad or 0.0
    u_along_g = float(np.hypot(u_offset_g[2], u_scale[2]))
    from_load = housing.above_load_m is not None
    place_m = float((housing.above_load_m if from_load else housing.position_m) or 0.0)
    length_m, lever = float(np.median(fit.length_m)), fit.lever
    lean_rad = math.radians(PLUMB_U_DEG) / lever
    beside_rad = BESIDE_U_M / (lever * length_m)
    u_offset_b, u_mount_b = math.hypot(lean_rad * (1 - lever), beside_rad), math.hypot(lean_rad, beside_rad)
    table = {
        "place_m": (
            "housing above the load" if from_load else "housing from the pivot",
            "m",
            1,
            housing.position_u_m,
            0.0,
        ),
        "scale_x": ("scale x less half of z", "%", 100, math.hypot(u_scale[0], u_scale[2] / 2), 0.0),
        "scale_y": ("scale y less half of z", "%", 100, math.hypot(u_scale[1], u_scale[2] / 2), 0.0),
        "scale_y_over_x": ("scale y less that of x", "%", 100, math.hypot(u_scale[0], u_scale[1]), 0.0),
        "along_g": ("offset z plus scale z", "mg", 1e3, u_along_g, 0.0),
    }
    for k, axis in enumerate("xy"):
        about = "yx"[k]
        u_sum_g = math.hypot(float(u_rest_g[k]), mount)
        u_windless = math.hypot(float(u_rest_g[k]), mount * (1 - lever), beside_rad * lever)
        table |= {
            f"across_{axis}_g": (f"offset {axis}, mount and mean lean", "mg", 1e3, u_sum_g, 0.0),
            f"windless_{axis}_g": (f"offset {axis} and {1 - lever:.2f} of the mount", "mg", 1e3, u_windless, 0.0),
            f"offset_{axis}_g": (f"offset {axis}, if the mean lean is 0", "mg", 1e3, float(u_offset_g[k]), u_offset_b),
            f"mount_about_{about}_rad": (
                f"mount about {about}, if the mean lean is 0", "deg", math.degrees(1), mount, u_mount_b,
            ),
        }  # fmt: skip
    rows = {
        name: Row(
            text, unit, factor * estimate.value + (place_m if name == "place_m" else 0.0),
            factor * math.hypot(estimate.half, NORMAL_975 * u_b), place_m if name == "place_m" else 0.0,
            factor * NORMAL_975 * u_stated, f"{swings} swings, {fit.rests} rests, {estimate.days} days",
        )
        for name, (text, unit, factor, u_stated, u_b) in table.items()
        if (estimate := fit.estimates.get(name)) is not None
    }  # fmt: skip
    half_m = float(np.abs(fit.length_m - length_m).max())
    stated_half_m = NORMAL_975 * LENGTH_U_REL * housing.length_m
    name = "rope by the period, all swings"
    return rows | {"length_m": Row(name, "m", length_m, half_m, housing.length_m, stated_half_m, f"{swings} swings")}


def housing_rotation_of(correction: Correction, parent: CalibrationRecord) -> Array:
    """Return the rotation from the sensor's to the housing's axes, (3, 3), a signed permutation."""
    return np.rint(correction.gain @ np.linalg.inv(np.array(parent.correction_matrix)))


def _offer(parent: CalibrationRecord, rows: dict[str, Row], better: Sequence[str], rotation: Array) -> CalibrationFit:
    """Return the parent's calibration with what is known better, whose uncertainty takes the place of the parent's."""
    matrix, offset = np.array(parent.correction_matrix), np.array(parent.offset, dtype=np.float64)
    covariance, measured = np.array(parent.covariance), np.zeros((12, 12))
    for name in better:
        kind, axis = name.split("_")[:2]
        sensor = int(np.argmax(np.abs(rotation["xyz".index(axis)])))
        sign, u = float(rotation["xyz".index(axis), sensor]), rows[name].half / NORMAL_975
        place = 4 * sensor if kind == "scale" else 9 + sensor
        covariance[place] = covariance[:, place] = 0.0
        if kind == "scale":
            matrix[sensor] *= 1 - rows[name].value / 100
            measured[place, place] = (u / 100 * matrix[sensor, sensor]) ** 2
        else:
            units_per_g = 1 / float(matrix[sensor, sensor])
            offset[sensor] += sign * units_per_g * rows[name].value / 1000
            measured[place, place] = (units_per_g * u / 1000) ** 2
    contributions = (
        Contribution(f"record {parent.id}", "B", covariance),
        Contribution("swings and rests in service", "A", measured),
    )
    text = "; ".join(
        f"{rows[name].name} {rows[name].value:+.2f} ± {rows[name].half:.2f} {rows[name].unit}" for name in better
    )
    x, y, z = offset.tolist()
    total = covariance + measured
    return CalibrationFit(
        method=INSTALLED,
        offset=(x, y, z),
        correction_matrix=matrix,
        covariance=total,
        prediction_interval_g=max(float(parent.prediction_interval_g), prediction_interval_g(matrix, total, 0.0)),
        poses=(),
        temperature_c=parent.temperature_c,
        misalignment_deg=misalignment_deg(np.asarray(np.linalg.inv(matrix))),
        residual_rms_g=float(parent.residual_rms_g or 0.0),
        condition_number=1.0,
        budget=uncertainty_budget(matrix, contributions),
        warnings=(FitWarning(f"in service: {text}; the rest is the parent's"),),
        thermal=parent.thermal,
    )


def format_installed(found: InstalledCalibration, parent_id: str) -> str:
    """Return the table and what it means as several lines of text."""
    lines = [f"{'parameter':34} {'found, 95 % interval':>24}  {'record or rig':>22}  agree  from"]
    for row in found.rows.values():
        value, stated = (
            f"{number:+.3f} ± {half:.3f} {row.unit}"
            for number, half in ((row.value, row.half), (row.stated, row.stated_half))
        )
        lines.append(f"{row.name:34} {value:>24}  {stated:>22}  {'yes' if row.agrees else 'NO':5}  {row.basis}")
    if found.is_contradicted:
        names = ", ".join(row.name for row in found.rows.values() if not row.agrees)
        verdict = f"record {parent_id} or the rig is contradicted: {names}; correct the rig, or calibrate in poses"
    else:
        verdict = f"record {parent_id} is confirmed within these intervals"
    return "\n".join([*lines, "", verdict, NOT_IDENTIFIABLE])
