"""Thermal calibration from ramps on all six faces: a calibration at a reference temperature, its thermal model, and verdicts.

The verdicts are by limits of data sheets at 25 °C and over temperature. The first four parts are those of Sawicki and Walendziuk
2016, Tables 1 to 6. Table 3 prints the zero-g limits of x and y of the ADXL335 for its z axis too; Table 1 has the wider ones of
the data sheet. Table 2 prints the sensitivity of the MPU-9255 as 16.384 LSB/g; it is 16384. Table 6 leaves out its limit of
1.5 mg/°C, which Table 2 has.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np

from gateway.bench.thermal.ramp import Ramp, read_ramp
from gateway.bench.thermal.ramp_regression import AxisRegression, Cause, RampRegression, fit_ramps
from gateway.calibration.calibrate_files import estimate_sensitivity
from gateway.calibration.calibration_fit import CalibrationFit, FitWarning
from gateway.calibration.input_files import FileReadings
from gateway.calibration.methods.six_position import fit_six_positions
from gateway.calibration.pose import FACES
from gateway.calibration.record import THERMAL, NotDeterminedError
from gateway.calibration.thermal_model import AXES, AxisThermalModel, ThermalModel
from gateway.errors import InputError

Verdict = Literal["within", "exceeds", "undecided"]
Limits = tuple[float, float]
MAX_DRIFT_G = 0.002
"""Largest drift in time over a ramp, g. Basis: a choice; three times what a hysteresis of 0.5 mg shows as, and a sixth of what a
ramp in °F differs by at 0.5 mg/°C."""
USUAL_REFERENCE_C = 25.0
"""Temperature at which data sheets state offset and sensitivity, °C. Definition: of data sheets."""


@dataclass(frozen=True, slots=True)
class DatasheetLimits:
    """Limits of a part; None: the data sheet states none."""

    part: str
    offset_mg_per_c: float | None
    """Largest change of the zero-g offset with temperature, mg/°C."""
    sensitivity_percent_per_c: float | None
    """Largest change of the sensitivity with temperature, %/°C."""
    unit: Literal["V", "counts"] | None = None
    """Unit of the limits below."""
    sensitivity: Limits | None = None
    """Smallest and largest sensitivity at 25 °C, per g."""
    zero_g: tuple[Limits, Limits, Limits] | None = None
    """Smallest and largest zero-g offset at 25 °C of x, y and z."""


LIMITS_BY_PART = {
    limits.part: limits
    for limits in (
        DatasheetLimits("ADXL335", 1.0, 0.010, "V", (0.270, 0.330), ((1.35, 1.65), (1.35, 1.65), (1.2, 1.8))),
        DatasheetLimits("ADXL327", 1.0, 0.010, "V", (0.378, 0.462), ((1.3, 1.7), (1.3, 1.7), (1.3, 1.7))),
        DatasheetLimits("LIS344ALH", 0.4, 0.010, "V", (0.570, 0.630), ((1.425, 1.575),) * 3),
        DatasheetLimits(
            "MPU-9255", 1.5, 0.026, "counts", None, ((-983.0, 983.0), (-983.0, 983.0), (-1311.0, 1311.0))
        ),  # 60 mg and 80 mg at 16384 LSB/g
        DatasheetLimits("ADXL355", 0.15, 0.01),
    )
}
"""Known parts by name, with the limits of their data sheets."""


def judge_interval(low: float, high: float, limits: Limits | None) -> Verdict | None:
    """Return whether a 95 % interval lies within two limits, outside of them, or on one; None without limits."""
    if limits is None:
        return None
    if limits[0] <= low and high <= limits[1]:
        return "within"
    return "exceeds" if high < limits[0] or low > limits[1] else "undecided"


def overall(verdicts: list[Verdict | None]) -> Verdict | None:
    """Return the worst of several verdicts; None where there is none."""
    given = [verdict for verdict in verdicts if verdict is not None]
    return next((verdict for verdict in ("exceeds", "undecided", "within") if verdict in given), None)


@dataclass(frozen=True, slots=True)
class MeasuredCoefficient:
    """The mean slope of a quantity over the range, with its 95 % interval."""

    value: float
    ci95: tuple[float, float]
    limit: float | None
    verdict: Verdict | None
    is_quadratic: bool
    """Whether the model has a square."""
    dominated_by: Cause
    """What contributes most to its uncertainty."""


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
        fit_six_positions(poses),
        method=THERMAL,
        thermal=model.model_dump(mode="json"),
        temperature_c={"mean": reference_c, "min": low_c, "max": high_c},
    )
    if worst := _find_disagreement(ramps, regression):
        fit = replace(fit, warnings=(*fit.warnings, worst))
    return ThermalCalibration(fit, files[0].unit, summary, (low_c, high_c), tuple(ramps))


def _find_disagreement(ramps: Sequence[Ramp], regression: RampRegression) -> FitWarning | None:
    """Return a warning if the ramps do not have one coefficient: the drift between them is larger than that of any part."""
    axis = max(range(3), key=lambda place: regression.axes[place].drift_g)
    drift_g = regression.axes[axis].drift_g
    if drift_g < MAX_DRIFT_G:
        return None
    slopes = [np.polyfit(ramp.temperature_c, ramp.mean[:, axis], 1)[0] for ramp in ramps]
    worst = ramps[int(np.argmax(np.abs(slopes - np.median(slopes))))]
    text = (
        f"the ramps disagree by {1000 * drift_g:.1f} mg in {AXES[axis]}, {worst.path} most: its temperatures are in another unit "
        "(°F), its sensor is another one or has slipped; take it again"
    )
    return FitWarning(text, is_outlier=True)


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
    zero_g, u_zero_g, u_scale = float(regression.offset[0]), float(u[0]), float(u[n_offset])
    zero_g_limits = None if stated is None or stated.zero_g is None else stated.zero_g[axis]
    zero_g_verdict = judge_interval(zero_g - 2 * u_zero_g, zero_g + 2 * u_zero_g, zero_g_limits)
    scale_limits = None if stated is None else stated.sensitivity
    sensitivity_verdict = judge_interval(scale - 2 * u_scale, scale + 2 * u_scale, scale_limits)
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
        zero_g=zero_g,
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
    verdict = judge_interval(*interval, None if limit is None else (-limit, limit))
    return MeasuredCoefficient(value, interval, limit, verdict, len(coefficients) == 3, regression.dominant(row))
