"""A single reading that has changed since the parent's session while the others have not: a face that lay wrong, or a slip."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gateway.calibration.methods.calibration_fit import OUTLIER
from gateway.calibration.methods.six_position import OUTLIER_SIGMA, PLACEMENT_U_DEG
from gateway.calibration.poses.faces import FACES
from gateway.calibration.poses.pose import Array

Poses = tuple[Mapping[str, Any], ...]
"""As a record has them."""


def changed_readings(new: Poses, old: Poses, placement_u_deg: float = PLACEMENT_U_DEG) -> list[str]:
    """Readings of faces that both sessions have, changed by more than two placements explain; the common drift apart.

    Within one session two opposite faces share their residual; an earlier session tells which of them it is.
    """
    before, after = _by_face(old), _by_face(new)
    faces = [face for face in FACES if face in before and face in after]
    if len(faces) < len(FACES):
        return []
    readings = np.array([after[face] for face in faces])
    moved = readings - np.array([before[face] for face in faces])
    scale = np.ptp(readings, axis=0) / 2
    moved_g = (moved - np.median(moved, axis=0)) / scale
    limit_g = OUTLIER_SIGMA * np.sqrt(2) * np.sin(np.radians(placement_u_deg))
    return [
        f"{OUTLIER} U_{'xyz'[axis]} with {faces[place]} up moved by {moved_g[place, axis] * 1000:+.1f} mg, the others did not"
        for place, axis in np.argwhere(np.abs(moved_g) > limit_g)
    ]


def _by_face(poses: Poses) -> dict[str, Array]:
    """Mean of the used poses of each face."""
    groups: dict[str, list[Any]] = {}
    for pose in poses:
        if pose.get("used") and pose.get("face"):
            groups.setdefault(pose["face"], []).append(pose["mean"])
    return {face: np.mean(means, axis=0) for face, means in groups.items()}
