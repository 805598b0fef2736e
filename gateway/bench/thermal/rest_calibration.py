"""Thermal coefficient from service: the magnitude at rest on the rope against temperature.

A housing that hangs at rest reads 1 g along the rope at any temperature. What changes is the sum of the offset and the scale of
the axis along the rope; no reading at rest distinguishes the two, or shows the offset of an axis across the rope. The model that
is learned this way is offered as a new record and comes into force only by a person's decision.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gateway.calibration.correction import ZERO_G_OFFSET_LIMIT_G_PER_K
from gateway.calibration.methods.calibration_fit import CalibrationFit, FitWarning, WarningKind
from gateway.calibration.offline.readings_file import FileReadings
from gateway.calibration.pose_method import THERMAL_REST
from gateway.calibration.poses.pose import RawReadings
from gateway.calibration.poses.windows import StillnessGate, Window, WindowSplitter
from gateway.calibration.record import CalibrationError, CalibrationRecord, NotDeterminedError
from gateway.calibration.thermal_model import AXES, AxisThermalModel, ThermalModel
from gateway.errors import InputError
from gateway.numerics.array import Array
from gateway.numerics.autocorrelation import correlation_sum
from gateway.numerics.stats import means_by_group, student_quantile

MIN_REST_RANGE_C = 5.0
"""Smallest range of the temperatures at rest, °C. Basis: a choice; a day outside has it, and 0.5 mg/°C show as 2.5 mg."""
BIN_C = 0.5
"""Width of the bins of temperature, °C. Basis: rests of different days share one, so that a slow change in time averages out."""
MIN_REST_BINS = 6
"""Least number of bins. Basis: a choice; three more than a parabola has coefficients."""
MAX_LEAN_RAD = np.radians(20.0)
"""Largest angle between the axis along the rope and the vertical, radians. Basis: a choice; a load hangs straighter, and a
housing off its rope leans by more."""
MAX_ERROR_G = 0.05
"""Largest deviation of |m| from 1 g that a temperature causes, g. Basis: a larger one is a motion."""


@dataclass(frozen=True, slots=True)
class RestCoefficient:
    """Change of the magnitude at rest with temperature."""

    axis: str
    """Axis of the sensor along the rope."""
    mg_per_c: float
    ci95: tuple[float, float]
    range_c: tuple[float, float]
    windows: int
    """Number of windows at rest."""


def learn_at_rest(files: Sequence[FileReadings], parent: CalibrationRecord) -> tuple[CalibrationFit, RestCoefficient]:
    """Return the parent's calibration with a model of the axis along the rope, and its coefficient.

    Raises `InputError` without temperatures, `CalibrationError` for a parent that has a model or another unit,
    `NotDeterminedError` for too little rest or too small a range of temperature.
    """
    if parent.thermal is not None:
        raise CalibrationError(f"record {parent.id} has a thermal model; give the record before it")
    temperature_c, corrected_g = _rests(files, parent)
    up = corrected_g.mean(axis=0)
    place = int(np.argmax(np.abs(up)))
    if np.abs(up[place]) < np.cos(MAX_LEAN_RAD) * np.linalg.norm(up):
        raise NotDeterminedError("no axis of the sensor lies along the rope; use ramps on the six faces")
    rests = np.column_stack([temperature_c, np.linalg.norm(corrected_g, axis=1) - 1])
    bins_c, error_g = means_by_group(np.floor(temperature_c / BIN_C), rests)[0].T
    if np.ptp(bins_c) < MIN_REST_RANGE_C or len(bins_c) < MIN_REST_BINS:
        raise NotDeterminedError(
            f"at rest the temperature varied by {np.ptp(temperature_c):.1f} °C; {MIN_REST_RANGE_C:.0f} °C or more are needed"
        )
    slope_g, u_slope_g, freedom = _straight_line(bins_c, error_g)
    half_mg = 1000 * u_slope_g * student_quantile(0.975, freedom)
    range_c = (float(bins_c[0]), float(bins_c[-1]))
    coefficient = RestCoefficient(
        AXES[place], 1000 * slope_g, (1000 * slope_g - half_mg, 1000 * slope_g + half_mg), range_c, len(temperature_c)
    )
    per_g = 1 / float(np.array(parent.correction_matrix)[place, place]) * float(np.sign(up[place]))
    model = _model(parent, place, slope_g * per_g, u_slope_g * per_g, range_c)
    return _with_model(parent, model, coefficient), coefficient


def _rests(files: Sequence[FileReadings], parent: CalibrationRecord) -> tuple[Array, Array]:
    """Return temperature and corrected mean of every still window, (w,) and (w, 3)."""
    matrix, offset = np.array(parent.correction_matrix), np.array(parent.offset, dtype=np.float64)
    temperatures, means = [], []
    for file in files:
        if file.unit != parent.unit:
            raise InputError(f"{file.path}: is in {file.unit}, record {parent.id} in {parent.unit}")
        if file.temperature_c is None:
            raise InputError(f"{file.path}: has no temperature; give recordings of a device that reports it")
        for window, temperature_c in _still_windows(file, 1 / float(np.abs(np.diag(matrix)).max())):
            corrected_g = matrix @ (window.mean - offset)
            if abs(float(np.linalg.norm(corrected_g)) - 1) < MAX_ERROR_G:
                temperatures.append(temperature_c)
                means.append(corrected_g)
    if not means:
        raise NotDeterminedError("no window at rest with a temperature in the recordings")
    return np.array(temperatures), np.array(means)


def _still_windows(file: FileReadings, units_per_g: float) -> list[tuple[Window, float]]:
    gate, found = StillnessGate(units_per_g), []
    for window in WindowSplitter().feed(RawReadings(file.time_s, file.raw)):
        inside = slice(*np.searchsorted(file.time_s, [window.start_s, window.end_s]))
        known_c = np.empty(0) if file.temperature_c is None else file.temperature_c[inside]
        known_c = known_c[~np.isnan(known_c)]
        if gate.is_still(window) and len(known_c):
            found.append((window, float(known_c.mean())))
    return found


def _straight_line(x: Array, y: Array) -> tuple[float, float, int]:
    """Return slope, its standard uncertainty with the correlation of the residual, and the effective degrees of freedom."""
    centred = x - x.mean()
    slope = float(centred @ y / (centred @ centred))
    residual = y - y.mean() - slope * centred
    correlation = max(1.0, correlation_sum(residual))
    freedom = len(x) - 2
    variance = float(residual @ residual) / freedom * correlation / float(centred @ centred)
    return slope, float(np.sqrt(variance)), max(int(freedom / correlation), 1)


def _model(
    parent: CalibrationRecord, place: int, slope: float, u_slope: float, range_c: tuple[float, float]
) -> ThermalModel:
    """Return the model; an axis across the rope keeps the limit of a data sheet as its uncertainty (GUM 4.3.7)."""
    per_g = 1 / np.abs(np.diag(np.array(parent.correction_matrix)))
    unknown = ZERO_G_OFFSET_LIMIT_G_PER_K / np.sqrt(3) * per_g
    known_c = None if parent.temperature_c is None else float(parent.temperature_c["mean"])
    middle_c = sum(range_c) / 2
    axes = {
        axis: AxisThermalModel(
            offset_per_c=[slope if number == place else 0.0],
            scale_per_c=[0.0],
            covariance=[[float(u_slope**2 if number == place else unknown[number] ** 2), 0.0], [0.0, 0.0]],
        )
        for number, axis in enumerate(AXES)
    }
    reference_c = middle_c if known_c is None else min(max(known_c, range_c[0]), range_c[1])
    return ThermalModel(source="rest", reference_c=reference_c, min_c=range_c[0], max_c=range_c[1], axes=axes)


def _with_model(parent: CalibrationRecord, model: ThermalModel, coefficient: RestCoefficient) -> CalibrationFit:
    x, y, z = parent.offset
    text = (
        f"learned at rest: axis {coefficient.axis} along the rope, {coefficient.mg_per_c:+.3f} mg/°C "
        f"[{coefficient.ci95[0]:+.3f}, {coefficient.ci95[1]:+.3f}], the sum of offset and scale; other axes were not measured"
    )
    return CalibrationFit(
        method=THERMAL_REST,
        offset=(x, y, z),
        correction_matrix=np.array(parent.correction_matrix),
        covariance=np.array(parent.covariance),
        prediction_interval_g=float(parent.prediction_interval_g),
        poses=(),
        temperature_c={"mean": model.reference_c, "min": model.min_c, "max": model.max_c},
        misalignment_deg={
            axis: [float(angle) for angle in angles] for axis, angles in (parent.misalignment_deg or {}).items()
        },
        residual_rms_g=float(parent.residual_rms_g or 0.0),
        condition_number=1.0,
        budget=tuple(entry.model_dump() for entry in parent.budget),
        warnings=(FitWarning(WarningKind.THERMAL, text),),
        thermal=model.model_dump(mode="json"),
    )
