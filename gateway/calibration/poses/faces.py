"""Faces of the sensor, and the directions into which a pose can be turned, in the sensor's axes.

The angle between a resting pose and its face is found by the readings of the whole session. The nominal zero and sensitivity of
an uncalibrated sensor leave a direction uncertain by many degrees. The extremes of each axis (Łuczak et al. 2022, eq. 4 to 9)
leave it uncertain by cross-axis sensitivity and by the rotation of the sensor in its housing. A rotation is common to all
faces, so it is found and removed.
"""

from dataclasses import replace
from typing import get_args

import numpy as np

from gateway.calibration.poses.pose import Face, Pose
from gateway.numerics.array import Array

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
MAX_FACE_ANGLE_DEG = 5.0
"""Largest angle between a face and the vertical, degrees. Basis: several times what a table or a cross-axis sensitivity
contributes."""
ROTATION_ITERATIONS = 3
"""Repetitions of the choice of each face's nearest pose and of the common rotation, which depend on each other. Basis: a choice;
one changes the other only where a pose lies between two faces, and three cost nothing."""


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
