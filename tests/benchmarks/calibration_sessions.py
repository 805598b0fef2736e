"""Calibration sessions of a sensor with injected errors, as a rigger makes them: turn, rest, turn, rest."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gateway.calibration.methods.experiment_design import next_direction
from gateway.calibration.pose import RawReadings
from gateway.numerics.array import Array

RATE_HZ = 100.0
TURN_S = 0.8
REST_S = 3.8


@dataclass(frozen=True, slots=True)
class Part:
    """A sensor by its data sheet, at 100 Hz."""

    name: str
    units_per_g: float
    noise_g: tuple[float, float, float]


ADXL345 = Part("ADXL345", 256.0, (290e-6 * 50**0.5, 290e-6 * 50**0.5, 430e-6 * 50**0.5))
ADXL355 = Part("ADXL355", 256_000.0, (22.5e-6 * 50**0.5,) * 3)


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """Errors of a sensor: reading_g = gain @ force_g + offset_g."""

    gain: Array
    offset_g: Array

    def matrix(self, part: Part) -> Array:
        """Return the correction matrix that a calibration should find, g per raw unit."""
        return np.asarray(np.linalg.inv(self.gain) / part.units_per_g)

    def symmetric_matrix(self, part: Part) -> Array:
        """Return that matrix in the frame of the norm fit: the symmetric factor of its polar decomposition."""
        values, vectors = np.linalg.eigh(np.linalg.inv(self.gain @ self.gain.T))
        return np.asarray((vectors * np.sqrt(values)) @ vectors.T / part.units_per_g)


def draw_errors(
    random: np.random.Generator, offset_g: float = 0.05, scale: float = 0.03, cross_axis: float = 0.02
) -> SensorErrors:
    """Return errors of these sizes with random signs."""

    def sign(*shape: int) -> Array:
        return random.choice([-1.0, 1.0], shape)

    gain = np.eye(3) + np.diag(scale * sign(3)) + cross_axis * sign(3, 3) * (1 - np.eye(3))
    return SensorErrors(gain, offset_g * sign(3))


def place_faces(random: np.random.Generator, placement_deg: float) -> Array:
    """Return the six faces up in random order, each with a random placement error per direction (1 sigma), shape (6, 3)."""
    faces = random.permutation(np.vstack([np.eye(3), -np.eye(3)]))
    errors = np.radians(placement_deg) * random.standard_normal((6, 3))
    return unit(faces + errors * (faces == 0))


def misplaced_faces(random: np.random.Generator, placement_deg: float) -> Array:
    """Return the six faces up, each off by exactly this angle in a random direction, shape (6, 3)."""
    azimuth = random.uniform(-np.pi, np.pi, 6)
    errors = np.tan(np.radians(placement_deg)) * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    poses = np.vstack([np.eye(3), -np.eye(3)])
    for place in range(6):
        poses[place, np.flatnonzero(poses[place] == 0)] = errors[place]
    return unit(poses)


def requested_poses(random: np.random.Generator, count: int = 12, by_hand_deg: float = 5.0) -> Array:
    """Return the poses that the norm fit requests, held by hand, shape (count, 3)."""
    up = np.empty((0, 3))
    for _ in range(count):
        up = np.vstack([up, next_direction(up)])
    return unit(up + np.radians(by_hand_deg) * random.standard_normal(up.shape))


def unit(vectors: Array) -> Array:
    """Return the vectors scaled to length 1, shape (n, 3)."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def specific_force(random: np.random.Generator, poses: Array, rest_s: float = REST_S) -> Array:
    """Return the specific force while the poses are taken one after the other, g, shape (n, 3)."""
    turning, resting = round(TURN_S * RATE_HZ), round(rest_s * RATE_HZ)
    parts, before = [], poses[-1]
    for pose in poses:
        share = np.linspace(0, 1, turning)[:, None]
        shaken = 0.2 * random.standard_normal((turning, 3))
        parts += [(1 - share) * before + share * pose + shaken, np.tile(pose, (resting, 1))]
        before = pose
    return np.vstack(parts)


def to_counts(random: np.random.Generator, part: Part, errors: SensorErrors, force_g: Array) -> Array:
    """Return the reading in whole counts, shape (n, 3)."""
    reading_g = (
        force_g @ errors.gain.T + errors.offset_g + np.array(part.noise_g) * random.standard_normal(force_g.shape)
    )
    return np.rint(reading_g * part.units_per_g)


def split_blocks(raw: Array, size: int = 256, temperature_c: float | None = None) -> Iterator[RawReadings]:
    """Yield the readings in blocks of this size."""
    time_s = np.arange(len(raw)) / RATE_HZ
    for start in range(0, len(raw), size):
        yield RawReadings(time_s[start : start + size], raw[start : start + size], temperature_c)
