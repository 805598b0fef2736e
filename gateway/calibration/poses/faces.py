"""Faces, directions and angles of resting poses, in the sensor's axes."""

import numpy as np

from gateway.calibration.poses.pose import Array, Face

FACES: tuple[Face, ...] = ("+x", "-x", "+y", "-y", "+z", "-z")
FACE_DIRECTIONS: dict[Face, Array] = {
    face: sign * np.eye(3)[axis]
    for axis, pair in enumerate((FACES[:2], FACES[2:4], FACES[4:]))
    for face, sign in zip(pair, (1, -1), strict=True)
}
"""Where up points in the sensor's axes."""
FACE_LIMIT_RAD = np.radians(20.0)
"""An axis this near the vertical makes a face: the largest zero-g offsets and mounting errors turn a reading by less."""


def face_of(direction: Array) -> Face | None:
    """The face whose axis is near the vertical, or None. `direction` as read, shape (3,), nearly in g."""
    length = float(np.linalg.norm(direction))
    face = max(FACES, key=lambda name: float(FACE_DIRECTIONS[name] @ direction))
    near = length > 0 and FACE_DIRECTIONS[face] @ direction >= np.cos(FACE_LIMIT_RAD) * length
    return face if near else None


def off_face_deg(direction: Array) -> float:
    """Angle to the nearest face, degrees."""
    cosine = np.max(np.abs(direction)) / np.linalg.norm(direction)
    return float(np.degrees(np.arccos(min(cosine, 1.0))))


def candidate_directions() -> Array:
    """The 26 directions that a rigger can be told: 6 faces, 12 edges, 8 corners; unit vectors, shape (26, 3)."""
    grid = np.array([(x, y, z) for x in (1, 0, -1) for y in (1, 0, -1) for z in (1, 0, -1) if (x, y, z) != (0, 0, 0)])
    ordered = grid[np.argsort(np.abs(grid).sum(axis=1), kind="stable")].astype(np.float64)
    return np.asarray(ordered / np.linalg.norm(ordered, axis=1, keepdims=True))


def direction_text(direction: Array) -> str:
    """How to turn the sensor so that up points there, for a person."""
    parts = [
        f"{'+' if value > 0 else '-'}{axis}" for axis, value in zip("xyz", direction, strict=True) if abs(value) > 0.3
    ]
    if len(parts) == 1:
        return f"{parts[0]} up"
    return f"up between {' and '.join(parts)}"
