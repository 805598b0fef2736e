"""Faces of the sensor, and the directions into which a pose can be turned, in the sensor's axes."""

import numpy as np

from gateway.calibration.poses.pose import Face
from gateway.numerics.array import Array

FACES: tuple[Face, ...] = ("+x", "-x", "+y", "-y", "+z", "-z")
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
