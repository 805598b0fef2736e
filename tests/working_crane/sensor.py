"""From the specific force at the housing to the rows of a log: offset, scale, drift, noise, faults."""

import numpy as np
from numpy.typing import NDArray

from tests.blind.mechanics import Array
from tests.blind.sensor import STANDARD_GRAVITY_M_S2
from tests.working_crane.crane import Case, SensorErrors

VIBRATION_HZ = 13.0
"""Of the shaking that drives a clipped run."""


def readings(case: Case, time_s: Array, force_m_s2: Array) -> tuple[NDArray[np.intp], Array]:
    """Return the numbers of the rows that are not lost, and their readings in g."""
    sensor, rng = case.sensor, np.random.default_rng([case.seed, 2])
    reading = force_m_s2 / STANDARD_GRAVITY_M_S2 * sensor.scale + sensor.offset_g + _drift(sensor, time_s)
    kept = np.ones(len(time_s), dtype=bool)
    for fault in sensor.faults:
        part = (time_s - fault.start_s) / fault.duration_s
        inside = (part >= 0) & (part < 1)
        if fault.kind == "gap":
            kept &= ~inside
        elif fault.kind == "impact":
            reading += np.outer(np.where(inside, np.sin(np.pi * part), 0.0), fault.size_g)
        else:
            shaking = np.sin(2 * np.pi * VIBRATION_HZ * (time_s - fault.start_s) + 0.5)
            reading += np.outer(np.where(inside, shaking, 0.0), fault.size_g)
    reading += sensor.noise_g * rng.normal(size=reading.shape)
    if sensor.lost_fraction:
        kept &= rng.random(len(time_s)) >= sensor.lost_fraction
    rows = np.flatnonzero(kept)
    return rows, np.clip(reading, -sensor.full_scale_g, sensor.full_scale_g)[rows]


def _drift(sensor: SensorErrors, time_s: Array) -> Array:
    """Return the change of the offset: exponential, complete at the last sample."""
    warmed = 1 - np.exp(-time_s / sensor.drift_time_constant_s)
    return np.outer(warmed / warmed[-1], sensor.drift_g)
