"""The factory calibration record of the simulated sensor, with errors as large as the uncertainty that it states."""

import hashlib
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.simulated.accelerometer import Accelerometer

Array = NDArray[np.float64]

U_OFFSET_G = 0.3e-3
"""Standard uncertainty of each axis' zero-g offset after a good calibration. Basis: a choice; what six positions on a good plate
reach."""
U_SCALE = 2e-4
"""Basis: a choice; as for the offsets, relative to 1 g."""
U_CROSS_AXIS = 1e-4
"""Basis: a choice; as for the offsets, less by the means of pairs."""
PREDICTION_COVERAGE_FACTOR = 3.0
"""Coverage factor of the prediction interval. Basis: large that a sensor at rest is seldom refused."""


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
