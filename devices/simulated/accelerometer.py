"""The simulated accelerometer: the errors of a MEMS sensor, with the figures of an ADXL355.

The errors of its factory calibration record are as large as the uncertainty that it states.
"""

import hashlib
import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_COUNT = 2**19 - 1
"""Largest value of 20 bits in two's complement. Definition: of the part."""
UNITS_PER_G_AT_2_G = 256000.0
"""Data sheet of the ADXL355."""
NOISE_DENSITY_G_PER_RT_HZ = 25e-6
"""Basis: a tenth more than the data sheet of an ADXL355 states (22.5e-6)."""
ZERO_G_OFFSET_LIMIT_G = 0.075
"""Data sheet of the ADXL355."""
DATASHEET_ZERO_G_OFFSET_G_PER_K = 0.15e-3
"""Data sheet of the ADXL355."""
DATASHEET_SCALE_FACTOR_PER_K = 1e-4
"""Data sheet of the ADXL355."""
U_OFFSET_G = 0.3e-3
"""Standard uncertainty of each axis' zero-g offset after a good calibration. Basis: a choice; what six positions on a good plate
reach."""
U_SCALE = 2e-4
"""Basis: a choice; as for the offsets, relative to 1 g."""
U_CROSS_AXIS = 1e-4
"""Basis: a choice; as for the offsets, less by the means of pairs."""
PREDICTION_COVERAGE_FACTOR = 3.0
"""Coverage factor of the prediction interval. Basis: large that a sensor at rest is seldom refused."""


@dataclass(frozen=True, slots=True)
class Ambient:
    """Temperature at the sensor, which varies slowly as a sine."""

    mean_c: float = 25.0
    amplitude_c: float = 0.0
    period_s: float = 1800.0
    phase_rad: float = 0.0

    def temperature_c(self, time_s: Array) -> Array:
        """Return the temperature at times (n,)."""
        turn = np.mod(time_s, self.period_s) / self.period_s
        return self.mean_c + self.amplitude_c * np.sin(2 * np.pi * turn + self.phase_rad)


@dataclass(frozen=True, slots=True)
class InjectedErrors:
    """The sensor's errors in its own axes: the true values for a calibration."""

    zero_g_offset_g: Array
    """At `reference_temperature_c`, shape (3,)."""
    scale_factor_error: Array
    """Relative, shape (3,)."""
    cross_axis_sensitivity: Array
    """Row: the axis that reads; column: the axis that acts; zero diagonal, shape (3, 3)."""
    zero_g_offset_g_per_c: Array
    """Temperature coefficient, shape (3,)."""
    reference_temperature_c: float
    sensor_from_housing: Array
    """R_sensor_from_housing: how the sensor is mounted, shape (3, 3)."""

    @property
    def gain(self) -> Array:
        """Reading per specific force, both in g and in the sensor's axes, shape (3, 3)."""
        return np.eye(3) + np.diag(self.scale_factor_error) + self.cross_axis_sensitivity


def typical_ambient(random: np.random.Generator) -> Ambient:
    """Draw the temperature of half an hour at a machine in a hall."""
    return Ambient(
        mean_c=random.uniform(15.0, 30.0),
        amplitude_c=random.uniform(1.0, 2.0),
        phase_rad=random.uniform(-np.pi, np.pi),
    )


def no_errors() -> InjectedErrors:
    """Return the errors of a perfect sensor in a perfect mount."""
    return InjectedErrors(np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros(3), 25.0, np.eye(3))


def typical_errors(random: np.random.Generator, reference_temperature_c: float) -> InjectedErrors:
    """Draw the errors of a new sensor within the limits of its data sheet, in a perfect mount."""
    cross_axis = random.normal(0.0, 0.005, (3, 3))
    np.fill_diagonal(cross_axis, 0.0)
    return InjectedErrors(
        zero_g_offset_g=np.clip(random.normal(0.0, 0.025, 3), -ZERO_G_OFFSET_LIMIT_G, ZERO_G_OFFSET_LIMIT_G),
        scale_factor_error=random.normal(0.0, 0.008, 3),
        cross_axis_sensitivity=cross_axis,
        zero_g_offset_g_per_c=random.uniform(-80e-6, 80e-6, 3),
        reference_temperature_c=reference_temperature_c,
        sensor_from_housing=np.eye(3),
    )


@dataclass(frozen=True, slots=True)
class Accelerometer:
    """Converts specific force into counts."""

    errors: InjectedErrors
    odr_hz: float
    range_g: float = 2.0

    @property
    def units_per_g(self) -> float:
        """Nominal sensitivity in counts."""
        return UNITS_PER_G_AT_2_G * 2.0 / self.range_g

    @property
    def full_scale_g(self) -> float:
        """The largest reading; at or beyond it the sensor has clipped."""
        return MAX_COUNT / self.units_per_g

    @property
    def saturation_counts(self) -> tuple[int, int]:
        """Lowest and highest reading."""
        return -MAX_COUNT - 1, MAX_COUNT

    @property
    def noise_g(self) -> float:
        """Noise, 1 sigma per sample and axis: white up to half the output data rate."""
        return float(NOISE_DENSITY_G_PER_RT_HZ * np.sqrt(self.odr_hz / 2))

    def counts(self, force_g: Array, temperature_c: Array, random: np.random.Generator) -> NDArray[np.int32]:
        """Return readings, shape (n, 3), for specific force in the housing's axes, shape (n, 3), at temperatures (n,)."""
        errors = self.errors
        reading_g = np.einsum("ij,nj->ni", errors.gain @ errors.sensor_from_housing, force_g)
        warmer_c = (temperature_c - errors.reference_temperature_c)[:, None]
        reading_g = reading_g + errors.zero_g_offset_g + errors.zero_g_offset_g_per_c * warmer_c
        reading_g = reading_g + self.noise_g * random.standard_normal(force_g.shape)
        reading = np.rint(reading_g * self.units_per_g)
        counts: NDArray[np.int32] = np.clip(reading, -MAX_COUNT - 1, MAX_COUNT).astype(np.int32)
        return counts


def factory_calibration(device_id: str, part: Accelerometer, random: np.random.Generator) -> dict[str, Any]:
    """Return a calibration record (format 1) whose errors are drawn from its own covariance."""
    u_matrix = np.where(np.eye(3) > 0, U_SCALE, U_CROSS_AXIS) / part.units_per_g
    u_offset = np.full(3, U_OFFSET_G * part.units_per_g)
    matrix = np.linalg.inv(part.errors.gain) / part.units_per_g + u_matrix * random.standard_normal((3, 3))
    offset = part.errors.zero_g_offset_g * part.units_per_g + u_offset * random.standard_normal(3)
    temperature_c = part.errors.reference_temperature_c
    record: dict[str, Any] = {
        "format": 1,
        "id": f"factory-{device_id}-{part.range_g:g}g",
        "device_id": device_id,
        "method": "factory",
        "created_utc": "2025-01-01T00:00:00Z",
        "software": "plumbline simulated crane",
        "by": "factory",
        "parent": None,
        "unit": "counts",
        "offset": offset.tolist(),
        "correction_matrix": matrix.tolist(),
        "covariance": np.diag(np.concatenate([u_matrix.ravel(), u_offset]) ** 2).tolist(),
        "prediction_interval_g": PREDICTION_COVERAGE_FACTOR
        * float(np.sqrt(U_OFFSET_G**2 + U_SCALE**2 + part.noise_g**2)),
        "temperature_c": {"mean": temperature_c, "min": temperature_c - 0.5, "max": temperature_c + 0.5},
        "thermal": None,
        "poses": [],
        "misalignment_deg": None,
        "residual_rms_g": part.noise_g,
        "condition_number": 1.0,
        "budget": [],
        "warnings": [],
    }
    canonical = json.dumps(record, sort_keys=True, separators=(",", ":"))
    return {**record, "sha256": hashlib.sha256(canonical.encode()).hexdigest()}
