"""Outliers among the readings on the six faces: within one session, and against an earlier session."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gateway.calibration.methods.calibration_fit import FitWarning, WarningKind
from gateway.calibration.poses.faces import FACES
from gateway.calibration.poses.pose import Pose
from gateway.numerics.array import Array

K_OUTLIER = 5.0
"""Standard deviations by which an outlier deviates. Basis: a choice; noise reaches it once in 1.7 million readings, and a wrong
face deviates by more."""
MIN_OUTLIER_G = 1e-6
"""Least deviation of an outlier, g. Basis: above the rounding errors of a perfect fit."""

RecordPoses = tuple[Mapping[str, Any], ...]
"""Poses as a calibration record stores them."""


def find_outliers(poses: tuple[Pose, ...], residual_g: Array, u_g: Array) -> list[FitWarning]:
    """Return the readings that deviate from the fit by more than the placement explains.

    Residuals and their standard uncertainties, shape (p, 3), g. Two opposite faces share their residual, so both are named.
    """
    faces: dict[str, list[str]] = {}
    for pose, axis in np.argwhere(residual_g > np.maximum(K_OUTLIER * u_g, MIN_OUTLIER_G)):
        text = f"U_{'xyz'[axis]} stands {residual_g[pose, axis] * 1000:.1f} mg off the other positions"
        faces.setdefault(text, []).append(str(poses[pose].face))
    return [
        FitWarning(WarningKind.OUTLIER, f"{text} with {' or '.join(names)} up; lay that face again")
        for text, names in faces.items()
    ]


def find_changed_readings(new: RecordPoses, old: RecordPoses, placement_u_deg: float) -> list[FitWarning]:
    """Return the readings that changed between two sessions by more than two placements explain, the common drift removed.

    Within one session two opposite faces share their residual; the comparison with an earlier session shows which one is wrong.
    """
    before, after = _means_by_face(old), _means_by_face(new)
    faces = [face for face in FACES if face in before and face in after]
    if len(faces) < len(FACES):
        return []
    readings = np.array([after[face] for face in faces])
    change = readings - np.array([before[face] for face in faces])
    scale = np.ptp(readings, axis=0) / 2
    change_g = (change - np.median(change, axis=0)) / scale
    limit_g = K_OUTLIER * np.sqrt(2) * np.sin(np.radians(placement_u_deg))
    return [
        FitWarning(
            WarningKind.OUTLIER,
            f"U_{'xyz'[axis]} with {faces[place]} up moved by {change_g[place, axis] * 1000:+.1f} mg, the others did not",
        )
        for place, axis in np.argwhere(np.abs(change_g) > limit_g)
    ]


def _means_by_face(poses: RecordPoses) -> dict[str, Array]:
    """Return the mean of the used poses of each face."""
    groups: dict[str, list[Any]] = {}
    for pose in poses:
        if pose.get("used") and pose.get("face"):
            groups.setdefault(pose["face"], []).append(pose["mean"])
    return {face: np.mean(means, axis=0) for face, means in groups.items()}
