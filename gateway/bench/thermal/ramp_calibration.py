"""Thermal calibration from ramps on all six faces: a calibration at a reference temperature, and its thermal model."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from gateway.bench.thermal.datasheet_limits import (
    DatasheetLimits,
    Verdict,
    judge_interval,
    judge_value,
    overall,
)
from gateway.bench.thermal.ramp import Ramp, read_ramp
from gateway.bench.thermal.ramp_regression import AxisRegression, fit_ramps
from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.methods.six_position import PLACEMENT_U_DEG, fit_six_positions
from gateway.calibration.offline.calibrate_files import estimate_sensitivity
from gateway.calibration.offline.readings_file import FileReadings
from gateway.calibration.pose_method import THERMAL
from gateway.calibration.poses.faces import FACES
from gateway.calibration.record import NotDeterminedError
from gateway.calibration.thermal_model import AXES, AxisThermalModel, ThermalModel
from gateway.errors import InputError

USUAL_REFERENCE_C = 25.0
"""Temperature at which data sheets state offset and sensitivity, °C. Definition: of data sheets."""


@dataclass(frozen=True, slots=True)
class MeasuredCoefficient:
    """The mean slope of a quantity over the range, with its 95 % interval."""

    value: float
    ci95: tuple[float, float]
    limit: float | None
    verdict: Verdict | None
    is_quadratic: bool
    """Whether the model has a square."""


@dataclass(frozen=True, slots=True)
class AxisSummary:
    """Thermal behaviour of one axis."""

    axis: str
    offset_mg_per_c: MeasuredCoefficient
    sensitivity_percent_per_c: MeasuredCoefficient
    zero_g: float
    """Reading at zero g at the reference temperature, raw units."""
    zero_g_verdict: Verdict | None
    sensitivity: float
    """Raw units per g at the reference temperature."""
    sensitivity_verdict: Verdict | None
    verdict: Verdict | None
    """The worst of the four."""


@dataclass(frozen=True, slots=True)
class ThermalCalibration:
    """Result of a thermal calibration."""

    fit: CalibrationFit
    unit: str
    summary: tuple[AxisSummary, ...]
    range_c: tuple[float, float]
    """Range of temperature that all ramps share, °C."""
    ramps: tuple[Ramp, ...]


def calibrate_ramps(
    files: Sequence[FileReadings],
    *,
    units_per_g: float | None = None,
    reference_c: float | None = None,
    placement_u_deg: float = PLACEMENT_U_DEG,
    limits: DatasheetLimits | None = None,
) -> ThermalCalibration:
    """Fit ramps, one recording per attitude, all six faces among them.

    Without `reference_c` it is 25 °C, or the middle of the range that all ramps share. Raises `NotDeterminedError` if the ramps
    do not determine the model, `InputError` for files that do not fit together.
    """
    units = {file.unit for file in files}
    if len(units) > 1:
        raise InputError(f"the files are in {' and '.join(sorted(units))}; calibrate from one unit")
    nominal = estimate_sensitivity(files, units_per_g or files[0].units_per_g)
    ramps = [read_ramp(file, nominal) for file in files]
    low_c, high_c = _shared_range(ramps)
    reference_c = _reference(reference_c, low_c, high_c)
    regression = fit_ramps(ramps, reference_c)
    summary = tuple(
        _summarise(axis, one, (low_c - reference_c, high_c - reference_c), limits, files[0].unit)
        for axis, one in enumerate(regression.axes)
    )
    model = ThermalModel(
        source="ramp",
        reference_c=reference_c,
        min_c=low_c,
        max_c=high_c,
        axes={axis: _axis_model(one) for axis, one in zip(AXES, regression.axes, strict=True)},
        summary=[asdict(entry) for entry in summary],
    )
    poses = tuple(ramp.pose_at(reference_c, regression.lag_s) for ramp in ramps)
    fit = replace(
        fit_six_positions(poses, placement_u_deg),
        method=THERMAL,
        thermal=model.model_dump(mode="json"),
        temperature_c={"mean": reference_c, "min": low_c, "max": high_c},
    )
    return ThermalCalibration(fit, files[0].unit, summary, (low_c, high_c), tuple(ramps))


def _shared_range(ramps: Sequence[Ramp]) -> tuple[float, float]:
    """Return the range of temperature that the ramps share. Raises `NotDeterminedError` for a missing face, or for no range."""
    present = {ramp.face for ramp in ramps}
    if missing := [face for face in FACES if face not in present]:
        raise NotDeterminedError(f"no ramp with {', '.join(missing)} up; take one ramp on each of the six faces")
    low_c = max(float(ramp.temperature_c.min()) for ramp in ramps)
    high_c = min(float(ramp.temperature_c.max()) for ramp in ramps)
    if high_c <= low_c:
        raise NotDeterminedError("the ramps share no range of temperature; take all of them over the same range")
    return low_c, high_c


def _reference(wanted_c: float | None, low_c: float, high_c: float) -> float:
    if wanted_c is None:
        return USUAL_REFERENCE_C if low_c <= USUAL_REFERENCE_C <= high_c else (low_c + high_c) / 2
    if not low_c <= wanted_c <= high_c:
        raise InputError(f"--reference-c {wanted_c:g} lies outside the ramps, {low_c:.1f} to {high_c:.1f} °C")
    return wanted_c


def _axis_model(regression: AxisRegression) -> AxisThermalModel:
    """Return the model of an axis, with the change of the sensitivity relative to that at the reference."""
    n_offset, scale = len(regression.offset), regression.sensitivity[0]
    kept = [*range(1, n_offset), *range(n_offset + 1, len(regression.covariance))]
    factor = np.array([1.0] * (n_offset - 1) + [1 / scale] * (len(kept) - n_offset + 1))
    covariance = regression.covariance[np.ix_(kept, kept)] * np.outer(factor, factor)
    return AxisThermalModel(
        offset_per_c=regression.offset[1:].tolist(),
        scale_per_c=(regression.sensitivity[1:] / scale).tolist(),
        covariance=covariance.tolist(),
    )


def _summarise(
    axis: int, regression: AxisRegression, ends_c: tuple[float, float], limits: DatasheetLimits | None, unit: str
) -> AxisSummary:
    n_offset, scale = len(regression.offset), float(regression.sensitivity[0])
    stated = limits if limits is not None and limits.unit == unit else None
    u = np.sqrt(np.diag(regression.covariance))
    zero_g_verdict = judge_value(
        float(regression.offset[0]),
        float(u[0]),
        None if stated is None or stated.zero_g is None else stated.zero_g[axis],
    )
    sensitivity_verdict = judge_value(scale, float(u[n_offset]), None if stated is None else stated.sensitivity)
    offset = _mean_slope(
        regression, slice(0, n_offset), ends_c, 1000 / scale, None if limits is None else limits.offset_mg_per_c
    )
    sensitivity = _mean_slope(
        regression,
        slice(n_offset, None),
        ends_c,
        100 / scale,
        None if limits is None else limits.sensitivity_percent_per_c,
    )
    return AxisSummary(
        axis=AXES[axis],
        offset_mg_per_c=offset,
        sensitivity_percent_per_c=sensitivity,
        zero_g=float(regression.offset[0]),
        zero_g_verdict=zero_g_verdict,
        sensitivity=scale,
        sensitivity_verdict=sensitivity_verdict,
        verdict=overall([offset.verdict, sensitivity.verdict, zero_g_verdict, sensitivity_verdict]),
    )


def _mean_slope(
    regression: AxisRegression, part: slice, ends_c: tuple[float, float], factor: float, limit: float | None
) -> MeasuredCoefficient:
    """Return the slope between the ends of the range: of T by one, of its square by the sum of the ends."""
    coefficients = np.concatenate([regression.offset, regression.sensitivity])[part]
    row = np.zeros(len(regression.covariance))
    row[part] = [0.0, 1.0, sum(ends_c)][: len(coefficients)]
    value = factor * float(row[part] @ coefficients)
    half = regression.coverage_factor(row) * abs(factor) * float(np.sqrt(row @ regression.covariance @ row))
    interval = (value - half, value + half)
    return MeasuredCoefficient(value, interval, limit, judge_interval(*interval, limit), len(coefficients) == 3)
