"""A resting pose: the mean of the readings in one attitude, with its uncertainty, and the face on which the sensor lies.

The uncertainty of the mean is of type A, with the correlation of readings in time, and of type B, by quantisation.

The angle between a resting pose and its face is found by the readings of the whole session. The nominal zero and sensitivity of
an uncalibrated sensor leave a direction uncertain by many degrees. The extremes of each axis (Łuczak et al. 2022, eq. 4 to 9)
leave it uncertain by cross-axis sensitivity and by the rotation of the sensor in its housing. A rotation is common to all
faces, so it is found and removed. All directions are in the sensor's axes.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from devices.conversion import force_g
from gateway.numerics.array import Array

Face = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
"""Sensor axis that points up."""
K_CORRELATED = 3.0
"""Standard deviations by which the scatter of window means must exceed that of uncorrelated readings, to count as correlation.
Basis: a choice; chance reaches it in 0.1 % of the rests."""
FACES: tuple[Face, ...] = get_args(Face)
FACE_DIRECTIONS: dict[Face, Array] = {
    face: sign * np.eye(3)[axis]
    for axis, pair in enumerate((FACES[:2], FACES[2:4], FACES[4:]))
    for face, sign in zip(pair, (1, -1), strict=True)
}
"""Unit vector to the vertical, upwards, for each face. Definition: unit vectors."""
FACE_TOLERANCE_RAD = np.radians(20.0)
"""Largest angle between an axis and the vertical at which the sensor lies on a face, radians.

The largest zero-g offsets and mounting errors of data sheets rotate a reading by less.
"""
NONZERO_COMPONENT = 0.3
"""Components of a candidate direction are 0, or at least 1/sqrt(3). Basis: this threshold separates them."""
MIN_UNBROKEN_REST_S = 30.0
"""Shortest rest without a break in which zeroing finds the vertical, s. Basis: two swings of a 50 m rope (14 s each)."""
MAX_FACE_ANGLE_DEG = 5.0
"""Largest angle between a face and the vertical, degrees. Basis: several times what a table or a cross-axis sensitivity
contributes."""
PLACEMENT_U_DEG = 0.1
"""Standard uncertainty of the placement of a face, per direction, degrees: a workshop's spirit level, a housing with dirt on its
faces. The machined cube on a levelled plate of Łuczak et al. 2022 is ten times better.
"""
ROTATION_ITERATIONS = 3
"""Repetitions of the choice of each face's nearest pose and of the common rotation, which depend on each other. Basis: a choice;
one changes the other only where a pose lies between two faces, and three cost nothing."""


@dataclass(frozen=True, slots=True)
class NominalSensitivity:
    """Nominal sensitivity and zero of a sensor, the same for all axes or by axis."""

    units_per_g: float
    zero: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Reading at zero g in raw units; half of the supply voltage for an analogue sensor."""

    def in_g(self, mean: Array | tuple[float, ...]) -> Array:
        """Return a reading in nominal g, shape (3,)."""
        return force_g(np.asarray(mean, dtype=np.float64), np.array(self.zero), self.units_per_g)


@dataclass(frozen=True, slots=True)
class RawReadings:
    """Readings as the device delivers them, in the sensor's axes."""

    time_s: Array
    """Time of each reading, rising, shape (n,)."""
    raw: Array
    """Readings in the unit of the record, shape (n, 3)."""
    temperature_c: float | None = None


@dataclass(frozen=True, slots=True)
class Pose:
    """The mean of the readings in one resting pose."""

    mean: tuple[float, float, float]
    type_a: tuple[float, float, float]
    """Standard uncertainty of each mean, type A (GUM 4.2)."""
    count: int
    """Number of readings."""
    face: Face | None
    """Face on which the sensor lies; None if no axis is near the vertical."""
    used: bool = True
    """Whether the fit uses the pose."""
    temperature_c: float | None = None
    noise: tuple[float, float, float] | None = None
    """Standard deviation of one reading; None: computed from `type_a` and `count`, as for uncorrelated readings."""
    step: float = 0.0
    """Quantisation step of the readings; 0 if they are not quantised."""

    @property
    def reading_sigma(self) -> Array:
        """Standard deviation of one reading, shape (3,)."""
        if self.noise is not None:
            return np.array(self.noise)
        return np.array([u * np.sqrt(self.count) for u in self.type_a])

    @property
    def quantisation_u(self) -> Array:
        """Standard uncertainty of each mean by quantisation, shape (3,)."""
        return quantisation_u(self.step, self.reading_sigma)

    def as_json(self) -> dict[str, Any]:
        """Return the pose as the calibration record stores it."""
        return {
            "mean": list(self.mean),
            "type_a": list(self.type_a),
            "count": self.count,
            "face": self.face,
            "used": self.used,
            "temperature_c": self.temperature_c,
            "noise": None if self.noise is None else list(self.noise),
            "step": self.step,
        }


def temperature_range(temperatures_c: Iterable[float | None]) -> dict[str, int | float] | None:
    """Return mean, minimum and maximum of the known temperatures, °C; None if no temperature was read."""
    known = [temperature_c for temperature_c in temperatures_c if temperature_c is not None]
    return {"mean": float(np.mean(known)), "min": min(known), "max": max(known)} if known else None


def correlation_factor(means: Array, counts: Array, sigma: Array) -> float:
    """Return the factor by which correlation enlarges the uncertainty of the mean, by batch means; 1 for uncorrelated readings.

    `means` of consecutive windows, shape (k, 3); number of readings in each, shape (k,); standard deviation of a reading
    within a window, shape (3,). The factor is 1 unless the scatter of the means is significant: the larger of the two estimates
    would on average overstate the uncertainty of white noise.
    """
    noisy = sigma > 0
    freedom = (len(means) - 1) * int(noisy.sum())
    if freedom < 1:
        return 1.0
    weights = counts[:, None]
    centre = (weights * means).sum(axis=0) / weights.sum()
    scatter = (weights * (means - centre) ** 2).sum(axis=0)
    ratio = float((scatter[noisy] / sigma[noisy] ** 2).sum()) / freedom
    return float(np.sqrt(ratio)) if ratio > 1 + K_CORRELATED * np.sqrt(2 / freedom) else 1.0


def quantisation_u(step: float, sigma: Array) -> Array:
    """Return the standard uncertainty of a mean of quantised readings, shape (3,), in the unit of `step`.

    Noise of standard deviation sigma dithers the quantiser: the remaining error of a mean is a sine of the value over the step
    with amplitude step/pi exp(-2 pi^2 (sigma/step)^2), its first harmonic. Without noise the error is rectangular.
    """
    if step <= 0:
        return np.zeros(3)
    dithered = np.exp(-2 * (np.pi * sigma / step) ** 2) / (np.pi * np.sqrt(2))
    return np.asarray(step * np.where(sigma > 0, dithered, 1 / np.sqrt(12)))


def find_face(direction: Array) -> Face | None:
    """Return the face whose axis is near the vertical, or None. `direction` is a reading in nominal g, shape (3,)."""
    length = float(np.linalg.norm(direction))
    face = max(FACES, key=lambda name: float(FACE_DIRECTIONS[name] @ direction))
    is_near = length > 0 and FACE_DIRECTIONS[face] @ direction >= np.cos(FACE_TOLERANCE_RAD) * length
    return face if is_near else None


def angle_to_face_deg(direction: Array) -> float:
    """Return the angle between a direction and the axis of the nearest face, degrees."""
    cosine = np.max(np.abs(direction)) / np.linalg.norm(direction)
    return float(np.degrees(np.arccos(min(cosine, 1.0))))


def candidate_directions() -> Array:
    """Return the 26 directions that can be described to a rigger: 6 faces, 12 edges, 8 corners; unit vectors (26, 3)."""
    grid = np.array([(x, y, z) for x in (1, 0, -1) for y in (1, 0, -1) for z in (1, 0, -1) if (x, y, z) != (0, 0, 0)])
    ordered = grid[np.argsort(np.abs(grid).sum(axis=1), kind="stable")].astype(np.float64)
    return np.asarray(ordered / np.linalg.norm(ordered, axis=1, keepdims=True))


def describe_direction(direction: Array) -> str:
    """Return how to turn the sensor so that this direction points up, for a person."""
    parts = [
        f"{'+' if value > 0 else '-'}{axis}"
        for axis, value in zip("xyz", direction, strict=True)
        if abs(value) > NONZERO_COMPONENT
    ]
    if len(parts) == 1:
        return f"{parts[0]} up"
    return f"up between {' and '.join(parts)}"


def without_tilted_poses(poses: tuple[Pose, ...]) -> tuple[Pose, ...]:
    """Return the poses, those tilted too far against their face without it and not used; unchanged while a face has no pose."""
    candidates = [place for place, pose in enumerate(poses) if pose.used and pose.face is not None]
    if {poses[place].face for place in candidates} != set(FACES):
        return poses
    angle_rad = face_angles_rad(tuple(poses[place] for place in candidates))
    tilted = {
        place for place, angle in zip(candidates, angle_rad, strict=True) if angle > np.radians(MAX_FACE_ANGLE_DEG)
    }
    return tuple(replace(pose, face=None, used=False) if place in tilted else pose for place, pose in enumerate(poses))


def face_angles_rad(poses: tuple[Pose, ...]) -> Array:
    """Return the angle between the face of each pose and the vertical, the rotation common to all faces removed, shape (p,).

    Every pose has a face, and every face has a pose.
    """
    up = np.array([FACE_DIRECTIONS[pose.face] for pose in poses if pose.face is not None])
    mean = np.array([pose.mean for pose in poses])
    highest, lowest = mean.max(axis=0), mean.min(axis=0)
    direction = (2 * mean - highest - lowest) / (highest - lowest)
    across = direction / (direction * up).sum(axis=1, keepdims=True) - up
    off = across
    for _ in range(ROTATION_ITERATIONS):
        nearest = [min(np.flatnonzero((up == face).all(axis=1)), key=lambda place: np.linalg.norm(off[place]))
                   for face in FACE_DIRECTIONS.values()]  # fmt: skip
        off = across - np.cross(_common_rotation(up[nearest], across[nearest]), up)
    return np.asarray(np.arctan(np.linalg.norm(off, axis=1)))


def _common_rotation(up: Array, across: Array) -> Array:
    """Return the rotation vector that most faces share: the median over those that show each component, shape (3,)."""
    turn = np.cross(up, across)
    return np.array([np.median(turn[up[:, axis] == 0, axis]) for axis in range(3)])
