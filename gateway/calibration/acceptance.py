"""Acceptance of a fit: whether it may come into force, is a plausible successor of its parent, and the record that it becomes."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from gateway.calibration.calibration_fit import K_OUTLIER, MAX_CONDITION_NUMBER, CalibrationFit, FitWarning
from gateway.calibration.drift.change import SensorChange, sensor_change
from gateway.calibration.pose import FACES, PLACEMENT_U_DEG
from gateway.calibration.record import CalibrationRecord, PoseMethod, content_hash
from gateway.calibration.thermal_model import correction_at, holds_at_c
from gateway.numerics.array import Array

RecordPoses = tuple[Mapping[str, Any], ...]
"""Poses as a calibration record stores them."""
MIN_EIGENVALUE = -1e-6
"""Least eigenvalue of a scaled covariance that is zero within rounding errors. Basis: a choice; far above rounding (1e-15), far
below a variance that matters."""

MAX_RESIDUAL_RMS_G = 0.010
"""Largest residual of a fit, g: 0.6 degrees. Basis: beyond it faces were misplaced or the sensor was not at rest."""
MAX_PREDICTION_INTERVAL_G = 0.10
"""Largest prediction interval, g. Basis: beyond it a reading at rest shows nothing of the condition."""
MAX_OFFSET_CHANGE_G = 0.020
"""Largest change of an offset since the parent without a reason, g: 1.1 degrees. Basis: in 4.5 years 0.86 degrees were measured
(Łuczak et al. 2022, eq. 21)."""
MAX_SCALE_CHANGE = 0.010
"""Largest relative change of a scale factor since the parent without a reason. Basis: a choice; 0.6 degrees at 1 g, as the
largest residual."""
MAX_ROTATION_DEG = 2.0
"""Largest rotation of the sensor in its housing since the parent without a reason, degrees. Basis: a choice; twice what data
sheets allow between axes and package."""


class Acceptance(BaseModel):
    """The decision on a fit. The journal and the audit store it under these names."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    refused: tuple[str, ...] = ()
    """Limits that are not met; no reason changes that."""
    implausible: tuple[str, ...] = ()
    """Findings for which a person must give a reason."""
    notes: tuple[str, ...] = ()
    """Warnings of the fit, and the change since the parent."""

    def refusal(self, reason: str) -> str | None:
        """Return why the record may not be put in force with this reason, or None."""
        if self.refused:
            return "; ".join(self.refused)
        if self.implausible and not reason.strip():
            return f"{'; '.join(self.implausible)}; give a reason"
        return None


def judge(fit: CalibrationFit, parent: CalibrationRecord | None) -> Acceptance:
    """Judge a fit by the limits and by its parent, None if there is none."""
    implausible = [warning.as_record_text() for warning in fit.warnings if warning.is_outlier]
    notes = [warning.as_record_text() for warning in fit.warnings if not warning.is_outlier]
    if parent is not None:
        change = change_since(fit, parent)
        implausible += _implausible_changes(change, parent.id)
        if fit.method != PoseMethod.NORM_FIT.value:  # its poses are held near a face, not laid on it
            poses = tuple(pose.as_json() for pose in fit.poses)
            changed = find_changed_readings(poses, tuple(parent.poses))
            implausible += [warning.as_record_text() for warning in changed]
        notes.append(_describe_change(change, parent.id))
    return Acceptance(refused=tuple(_refusals(fit)), implausible=tuple(implausible), notes=tuple(notes))


def change_since(fit: CalibrationFit, parent: CalibrationRecord) -> SensorChange:
    """Return the change of the sensor since the parent record."""
    matrix, offset = correction_at(parent, holds_at_c(fit.temperature_c, fit.thermal))
    return sensor_change(
        matrix=matrix,
        offset=offset,
        later_sensitivity=np.asarray(np.linalg.inv(fit.correction_matrix), dtype=np.float64),
        later_offset=np.array(fit.offset, dtype=np.float64),
    )


def find_changed_readings(new: RecordPoses, old: RecordPoses) -> list[FitWarning]:
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
    limit_g = K_OUTLIER * np.sqrt(2) * np.sin(np.radians(PLACEMENT_U_DEG))
    return [
        FitWarning(
            f"U_{'xyz'[axis]} with {faces[place]} up moved by {change_g[place, axis] * 1000:+.1f} mg, the others did not",
            is_outlier=True,
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


def _refusals(fit: CalibrationFit) -> list[str]:
    measured = [
        ("residual", fit.residual_rms_g, MAX_RESIDUAL_RMS_G, "g"),
        ("condition number", fit.condition_number, MAX_CONDITION_NUMBER, ""),
        ("prediction interval", fit.prediction_interval_g, MAX_PREDICTION_INTERVAL_G, "g"),
    ]
    refusals = [
        f"{name} {value:.3g} {unit}".rstrip() + f" is above the limit of {limit:g}; take the poses again"
        for name, value, limit, unit in measured
        if value > limit
    ]
    if not _is_covariance(fit.covariance):
        refusals.append("the covariance has negative variances: the poses do not determine the calibration")
    return refusals


def _is_covariance(covariance: Array) -> bool:
    """Return whether a matrix is positive semidefinite; it is scaled, because its entries differ by many orders of magnitude."""
    scale = np.sqrt(np.clip(np.diag(covariance), 0, None))
    scale[scale == 0] = 1.0
    return bool(np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() > MIN_EIGENVALUE)


def _implausible_changes(change: SensorChange, parent_id: str) -> list[str]:
    texts = []
    for axis, offset_g, scale in zip("xyz", change.offset_g, change.scale, strict=True):
        if abs(offset_g) > MAX_OFFSET_CHANGE_G:
            texts.append(f"offset {axis} has moved by {offset_g * 1000:+.1f} mg since {parent_id}")
        if abs(scale) > MAX_SCALE_CHANGE:
            texts.append(f"scale {axis} has changed by {scale * 100:+.2f} % since {parent_id}")
    rotation_deg = float(np.linalg.norm(change.rotation_deg))
    if rotation_deg > MAX_ROTATION_DEG:
        texts.append(f"the sensor is turned by {rotation_deg:.1f} deg in its housing since {parent_id}")
    return texts


def _describe_change(change: SensorChange, parent_id: str) -> str:
    offsets = ", ".join(f"{value * 1000:+.2f}" for value in change.offset_g)
    scales = ", ".join(f"{value * 100:+.3f}" for value in change.scale)
    rotation_deg = float(np.linalg.norm(change.rotation_deg))
    return f"since {parent_id}: offset {offsets} mg, scale {scales} %, turned {rotation_deg:.3f} deg"


def make_record(
    fit: CalibrationFit,
    *,
    device_id: str,
    unit: str,
    software: str,
    by: str,
    created_utc: str,
    parent: str | None,
    **extra: Any,
) -> CalibrationRecord:
    """Return the record of a fit. Its id sorts by time: `created_utc` without punctuation, then the start of the content's hash.

    `extra` contains further JSON fields, such as the id of the request. Raises pydantic's `ValidationError` if a record may not
    have such a value.
    """
    content = {
        "format": 1,
        "device_id": device_id,
        "method": fit.method,
        "created_utc": created_utc,
        "software": software,
        "by": by,
        "parent": parent,
        "unit": unit,
        **fit_as_json(fit),
        **extra,
    }
    return add_content_hash(content)


def fit_as_json(fit: CalibrationFit) -> dict[str, Any]:
    """Return the fields of a record that a fit determines."""
    return {
        "offset": list(fit.offset),
        "correction_matrix": fit.correction_matrix.tolist(),
        "covariance": fit.covariance.tolist(),
        "prediction_interval_g": fit.prediction_interval_g,
        "temperature_c": fit.temperature_c,
        "thermal": fit.thermal,
        "poses": [pose.as_json() for pose in fit.poses],
        "misalignment_deg": fit.misalignment_deg,
        "residual_rms_g": fit.residual_rms_g,
        "condition_number": fit.condition_number,
        "budget": list(fit.budget),
        "warnings": [warning.as_record_text() for warning in fit.warnings],
    }


def add_content_hash(content: dict[str, Any]) -> CalibrationRecord:
    """Return the record with this content, with its id and its hash."""
    content = {key: value for key, value in content.items() if key not in {"id", "sha256"}}
    stamp = re.sub(r"[^0-9TZ]", "", re.sub(r"\.\d+", "", content["created_utc"]).replace("+00:00", "Z"))
    content["id"] = f"{stamp}-{content_hash(content)[:8]}"
    return CalibrationRecord.model_validate(content | {"sha256": content_hash(content)})
