"""Temperature ramps: readings at rest in one attitude while the temperature changes, and the lag of the thermometer.

The element that measures and the thermometer beside it have not one temperature, one follows the other:

element = thermometer + lag d(thermometer)/dt          the thermometer follows the element
element = thermometer behind a low-pass of -lag        the element follows the thermometer
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gateway.calibration.input_files import FileReadings
from gateway.calibration.pose import Face, NominalSensitivity, Pose, find_face
from gateway.calibration.record import NotDeterminedError
from gateway.errors import InputError
from gateway.numerics.array import Array
from gateway.numerics.stats import means_by_group

AVERAGE_S = 0.5
"""Duration of an average, s; 20 Hz were averaged to 2 Hz (Sawicki and Walendziuk 2016, sec. 3)."""
PRIOR_LAG_S = 5.0
"""Standard uncertainty of the lag before anything is measured, s. Basis: a choice; packages follow the air within seconds, a lag
of a minute shows in any ramp, and ramps that do not show one keep their temperatures."""
LAG_STEP_S = 0.25
"""Step of the derivative by the lag, s. Basis: a choice; half an average."""
LAG_ITERATIONS = 5
"""Gauss-Newton steps of the lag. Basis: a choice; three settle it to a hundredth of its uncertainty."""
MEMORY_LAGS = 20.0
"""Length of the memory of a low-pass in its time constants. Basis: a choice; what is older counts by 2e-9."""
MIN_RAMP_C = 10.0
"""Smallest range of a ramp, °C. Basis: at 0.1 mg/°C the offset changes by 1 mg."""
MIN_RAMP_AVERAGES = 24
"""Least number of averages of a ramp. Basis: a choice; a curvature and the scatter show."""
MAX_JUMP_G = 0.010
"""Largest jump between the means of `JUMP_AVERAGES` before and after a moment, g, from the ramp's own parabola; beyond it the
sensor was moved. Basis: half a degree across the vertical; what a lag of seconds leaves of a parabola is smaller and slow."""
JUMP_AVERAGES = 4
"""Number of averages on either side of a jump: 2 s. Basis: a choice; noise falls to a half, and a temperature hardly changes."""


def element_c(time_s: Array, thermometer_c: Array, lag_s: float) -> Array:
    """Return the temperature of the element, °C, shape (n,), from averages at even times, both shape (n,)."""
    if lag_s >= 0:
        return np.asarray(thermometer_c + lag_s * np.gradient(thermometer_c, time_s))
    step_s = float(np.median(np.diff(time_s)))
    keep = float(np.exp(step_s / lag_s))
    now = 1 + (1 - keep) * lag_s / step_s  # a low-pass that is exact for a line between the averages
    length = min(len(time_s) - 1, round(MEMORY_LAGS * -lag_s / step_s) + 1)
    kernel = np.concatenate([[now], (1 - now) * (1 - keep) * keep ** np.arange(length)])
    at_start_c = thermometer_c[0] - (thermometer_c[1] - thermometer_c[0]) / 2  # in balance before the first reading
    before = np.full(len(kernel) - 1, at_start_c)
    return np.convolve(np.concatenate([before, thermometer_c]), kernel / kernel.sum(), "valid")


def fit_lag(residuals: Callable[[float], Array], lag_s: float) -> tuple[float, float, float]:
    """Return the lag, its standard uncertainty and the logarithm of its evidence over that at this lag, by Gauss-Newton.

    `residuals` returns those of all axes at a lag, white, shape (axes, n). Whether there is a lag at all is as open beforehand as
    not: the result is the mean over both, weighted by their evidence, so that ramps that hardly show a lag do not shift the
    temperatures by its noise.
    """
    u_lag_s = PRIOR_LAG_S
    for _ in range(LAG_ITERATIONS):
        behind, ahead = residuals(lag_s - LAG_STEP_S), residuals(lag_s + LAG_STEP_S)
        sigma = np.maximum(np.sqrt(np.mean(behind**2, axis=1, keepdims=True)), np.finfo(float).tiny)
        slope = ((ahead - behind) / sigma).ravel() / (2 * LAG_STEP_S)
        u_lag_s = float(1 / np.sqrt(slope @ slope + PRIOR_LAG_S**-2))
        middle = float(slope @ ((ahead + behind) / sigma).ravel()) / 2
        lag_s -= u_lag_s**2 * (middle + lag_s * PRIOR_LAG_S**-2)
    odds = u_lag_s / PRIOR_LAG_S * np.exp(min((lag_s / u_lag_s) ** 2 / 2, 700.0))
    share = odds / (1 + odds)
    u_s = float(np.sqrt(share * u_lag_s**2 + share * (1 - share) * lag_s**2))
    return share * lag_s, u_s, share * float(np.log(u_lag_s / PRIOR_LAG_S))


@dataclass(frozen=True, slots=True)
class Ramp:
    """The means of a ramp over `AVERAGE_S`, n of them."""

    path: Path
    face: Face
    time_s: Array
    """Mean time of each average, shape (n,)."""
    temperature_c: Array
    """Mean temperature of each, °C, shape (n,)."""
    mean: Array
    """Mean readings, raw, shape (n, 3)."""
    noise: Array
    """Standard deviation of a reading within the averages, raw, shape (3,)."""
    count: int
    """Number of readings."""

    def pose_at(self, reference_c: float, lag_s: float) -> Pose:
        """Return the reading at the reference temperature, of the ramp's own parabola."""
        from_reference_c = element_c(self.time_s, self.temperature_c, lag_s) - reference_c
        coefficients, residual, u_unit = _parabola(from_reference_c, self.mean)
        sigma = np.sqrt((residual**2).sum(axis=0) / (len(residual) - 3))
        x, y, z = coefficients[0].tolist()
        ux, uy, uz = (u_unit * sigma).tolist()
        nx, ny, nz = self.noise.tolist()
        return Pose((x, y, z), (ux, uy, uz), self.count, self.face, temperature_c=reference_c, noise=(nx, ny, nz))


def read_ramp(readings: FileReadings, nominal: NominalSensitivity) -> Ramp:
    """Return the ramp of one recording.

    Raises `InputError` without temperatures, `NotDeterminedError` for a ramp that is too small, moves or lies on no face.
    """
    path = readings.path
    if readings.temperature_c is None or np.isnan(readings.temperature_c).all():
        raise InputError(
            f"{path}: has no temperature; a ramp needs the column temperature_c, or an .mcap whose device reports it"
        )
    known = ~np.isnan(readings.temperature_c)
    time_s, raw, temperature_c = readings.time_s[known], readings.raw[known], readings.temperature_c[known]
    group = np.floor((time_s - time_s[0]) / AVERAGE_S)
    averages, scatter = means_by_group(group, np.column_stack([time_s, temperature_c, raw]))
    mean_c, means, noise = averages[:, 1], averages[:, 2:], scatter[2:]
    if np.ptp(mean_c) < MIN_RAMP_C or len(means) < MIN_RAMP_AVERAGES:
        raise NotDeterminedError(
            f"{path}: the temperature changes by {np.ptp(mean_c):.1f} °C in {np.ptp(averages[:, 0]):.0f} s; a ramp needs "
            f"{MIN_RAMP_C:.0f} °C or more in {MIN_RAMP_AVERAGES * AVERAGE_S:.0f} s or more"
        )
    face = find_face(nominal.in_g(means.mean(axis=0)))
    if face is None:
        raise NotDeterminedError(f"{path}: lies on no face; a ramp needs one axis up or down throughout")
    _, residual, _ = _parabola(mean_c - mean_c.mean(), means)
    sums = np.cumsum(np.vstack([np.zeros(3), residual]), axis=0)
    means_of = (sums[JUMP_AVERAGES:] - sums[:-JUMP_AVERAGES]) / JUMP_AVERAGES
    jump_g = float(np.max(np.abs(means_of[JUMP_AVERAGES:] - means_of[:-JUMP_AVERAGES]))) / nominal.units_per_g
    if jump_g > MAX_JUMP_G + 6 * float(noise.max()) / nominal.units_per_g:
        raise NotDeterminedError(
            f"{path}: the readings jump by {jump_g * 1000:.0f} mg in the ramp: the sensor was moved"
        )
    return Ramp(path, face, averages[:, 0], mean_c, means, noise, len(raw))


def _parabola(from_reference_c: Array, means: Array) -> tuple[Array, Array, float]:
    """Return coefficients (3, 3), residuals (n, 3) and the uncertainty of the constant over that of an average."""
    design = np.column_stack([from_reference_c**power for power in range(3)])
    coefficients = np.asarray(np.linalg.lstsq(design, means, rcond=None)[0], dtype=np.float64)
    u_unit = float(np.sqrt(np.linalg.inv(design.T @ design)[0, 0]))
    return coefficients, means - design @ coefficients, u_unit
