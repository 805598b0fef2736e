"""From the specific force to the log: mount, offset, scale, noise, drift, vibration, impacts, steps, radio."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.blind.mechanics import Array
from tests.working_crane.real.rig import Disturbances

NOISE_G = (0.0001, 0.0002, 0.0004, 0.001)
OFFSET_G, SCALE, MOUNT_RAD = 0.0003, 0.0004, float(np.radians(0.05))
"""One sigma, per axis."""
FULL_SCALE_G = 2.0
BURST_SAMPLES = 8.0
"""Mean length of a burst of lost samples."""
DRIFT_S = 600.0
HARMONICS = (1.0, 0.5, 0.3)


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """Of one accelerometer."""

    noise_g: float
    offset_g: Array
    scale: Array
    mount_rad: Array
    """Turn about the housing's x and y axes that zeroing in place leaves."""


def draw_errors(rng: np.random.Generator) -> SensorErrors:
    """Draw an accelerometer."""
    mount = np.append(rng.normal(0, MOUNT_RAD, 2), 0.0)
    return SensorErrors(float(rng.choice(NOISE_G)), rng.normal(0, OFFSET_G, 3), 1 + rng.normal(0, SCALE, 3), mount)


def readings_g(
    force_g: Array, rest_g: Array, time_s: Array, errors: SensorErrors, given: Disturbances, rng: np.random.Generator
) -> Array:
    """Return what the sensor reads; the mount was zeroed at rest."""
    zeroed = force_g @ shortest_turn(rest_g / np.linalg.norm(rest_g)).T
    turned = zeroed @ rotation(errors.mount_rad).T
    if given.askew_deg:
        side = rng.uniform(0, 2 * np.pi)
        turned = turned @ rotation(np.radians(given.askew_deg) * np.array([np.cos(side), np.sin(side), 0.0])).T
    reading = turned * errors.scale + errors.offset_g
    if given.drift_g:
        direction = rng.normal(size=3)
        reading += np.outer(time_s / DRIFT_S, given.drift_g * direction / np.linalg.norm(direction))
    for start_s, duration_s, size_g in given.impacts:
        part = (time_s - start_s) / duration_s
        direction = rng.normal(size=3)
        shape = np.where((part >= 0) & (part < 1), np.sin(np.pi * part), 0.0)
        reading += np.outer(shape, size_g * direction / np.linalg.norm(direction))
    if given.vibration is not None:
        reading += _vibration(time_s, *given.vibration, rng)
    reading += errors.noise_g * rng.normal(size=reading.shape)
    if given.step_g is not None:
        reading = np.round(reading / given.step_g) * given.step_g
    return np.clip(reading, -FULL_SCALE_G, FULL_SCALE_G)


def _vibration(time_s: Array, frequency_hz: float, size_g: float, rng: np.random.Generator) -> Array:
    """Return the shaking of an engine whose speed wanders by some per cent, with harmonics, sampled as it is."""
    wander = np.cumsum(rng.normal(size=len(time_s))) * np.sqrt(time_s[1] - time_s[0])
    wander -= np.linspace(0, wander[-1], len(wander))
    speed = frequency_hz * (1 + 0.02 * wander / max(np.abs(wander).max(), 1e-9))
    phase = 2 * np.pi * np.cumsum(speed) * (time_s[1] - time_s[0])
    shaking = np.zeros((len(time_s), 3))
    for order, share in enumerate(HARMONICS, start=1):
        shaking += size_g * share * np.outer(np.sin(order * phase + rng.uniform(0, 6.28)), rng.uniform(-1, 1, 3))
    return shaking


def radio(time_s: Array, given: Disturbances, rng: np.random.Generator) -> tuple[NDArray[np.intp], Array]:
    """Return the numbers of the rows that arrive, and their time stamps in s."""
    rows = np.arange(len(time_s), dtype=np.intp)
    if given.radio is None:
        return rows, time_s
    lost_share, late_s = given.radio
    lost, is_lost = np.zeros(len(time_s), dtype=bool), False
    for row, chance in enumerate(rng.random(len(time_s))):
        is_lost = chance >= 1 / BURST_SAMPLES if is_lost else chance < lost_share / (1 - lost_share) / BURST_SAMPLES
        lost[row] = is_lost
    stamps = time_s + rng.exponential(late_s, len(time_s))
    ordered = np.maximum.accumulate(stamps[~lost]) + 1e-5 * np.arange(np.count_nonzero(~lost))
    return rows[~lost], ordered


def shortest_turn(vector: Array) -> Array:
    """Return the rotation that takes this unit vector to z."""
    axis = np.cross(vector, [0.0, 0.0, 1.0])
    sine = np.linalg.norm(axis)
    return np.eye(3) if sine < 1e-12 else rotation(axis / sine * np.arctan2(sine, vector[2]))


def rotation(turn_rad: Array) -> Array:
    """Return the rotation matrix of a rotation vector."""
    angle = float(np.linalg.norm(turn_rad))
    if angle == 0:
        return np.eye(3)
    x, y, z = turn_rad / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: Array = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turned
