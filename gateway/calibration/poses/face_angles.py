"""Angles between resting poses and their faces, by the readings of the whole session.

The nominal zero and sensitivity of an uncalibrated sensor leave a direction uncertain by many degrees. The extremes of each axis
(Łuczak et al. 2022, eq. 4 to 9) leave it uncertain by cross-axis sensitivity and by the rotation of the sensor in its housing. A
rotation is common to all faces, so it is found and removed.
"""

from dataclasses import replace

import numpy as np

from gateway.calibration.poses.faces import FACE_DIRECTIONS, FACES
from gateway.calibration.poses.pose import Pose
from gateway.numerics.array import Array

MAX_FACE_ANGLE_DEG = 5.0
"""Largest angle between a face and the vertical, degrees. Basis: several times what a table or a cross-axis sensitivity
contributes."""
ROTATION_ITERATIONS = 3
"""Repetitions of the choice of each face's nearest pose and of the common rotation, which depend on each other. Basis: a choice;
one changes the other only where a pose lies between two faces, and three cost nothing."""


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
