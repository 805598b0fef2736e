"""Whether a calibration is good enough to be put in force, and whether it is a plausible successor of the one before."""

from dataclasses import dataclass, field

import numpy as np

from gateway.calibration.methods.calibration_fit import OUTLIER, CalibrationFit
from gateway.calibration.methods.face_outliers import changed_readings
from gateway.calibration.poses.pose import Array
from gateway.calibration.record import CalibrationRecord

COVERAGE = 3.0


@dataclass(frozen=True, slots=True)
class Limits:
    """What a record must meet, and how far a sensor may have moved since its parent without a reason."""

    residual_rms_g: float = 0.010
    """0.6 degrees: the faces did not lie, or the sensor did not rest."""
    condition_number: float = 30.0
    prediction_interval_g: float = 0.10
    """Beyond it a reading at rest tells nothing of the condition."""
    offset_change_g: float = 0.020
    """1.1 degrees; 4.5 years moved 0.86 (000 eq. 21)."""
    scale_change: float = 0.010
    turn_deg: float = 2.0
    """Of the sensor in its housing."""


@dataclass(frozen=True, slots=True)
class Acceptance:
    """The judge's word."""

    refusals: tuple[str, ...] = ()
    """Limits that are not met: no reason helps."""
    needs_reason: tuple[str, ...] = ()
    """What a person must explain before it is put in force."""
    notes: tuple[str, ...] = field(default=())


def judge(
    new: CalibrationFit | CalibrationRecord, parent: CalibrationRecord | None, limits: Limits | None = None
) -> Acceptance:
    """Judge a fit or a record against the limits and against its parent, None where there is none."""
    limits = limits or Limits()
    needs_reason = [text for text in new.warnings if text.startswith(OUTLIER)]
    notes = [text for text in new.warnings if not text.startswith(OUTLIER)]
    if parent is not None:
        needs_reason += _comparison_text(new, parent, limits)
        needs_reason += changed_readings(_poses(new), tuple(parent.poses))
        notes.append(_change_text(new, parent))
    return Acceptance(tuple(_refusals(new, limits)), tuple(needs_reason), tuple(notes))


def _refusals(new: CalibrationFit | CalibrationRecord, limits: Limits) -> list[str]:
    measured = [
        ("residual", new.residual_rms_g, limits.residual_rms_g, "g"),
        ("condition number", new.condition_number, limits.condition_number, ""),
        ("prediction interval", new.prediction_interval_g, limits.prediction_interval_g, "g"),
    ]
    refusals = [
        f"{name} {value:.3g} {unit}".rstrip() + f" is above the limit of {limit:g}; take the poses again"
        for name, value, limit, unit in measured
        if value is not None and value > limit
    ]
    if not _is_covariance(np.array(new.covariance, dtype=np.float64)):
        refusals.append("its covariance has negative variances: the poses do not determine it")
    return refusals


def _is_covariance(covariance: Array) -> bool:
    """Positive semidefinite, after scaling: the matrix's entries and the offset differ by many orders."""
    scale = np.sqrt(np.clip(np.diag(covariance), 0, None))
    scale[scale == 0] = 1.0
    return bool(np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() > -1e-6)


@dataclass(frozen=True, slots=True)
class Change:
    """Of a sensor between two records, both in its own axes."""

    offset_g: Array
    """Shape (3,)."""
    scale: Array
    """Relative, shape (3,)."""
    turn_deg: float


def change(new: CalibrationFit | CalibrationRecord, parent: CalibrationRecord) -> Change:
    """What has changed since the parent."""
    matrix, old = (
        np.array(new.correction_matrix, dtype=np.float64),
        np.array(parent.correction_matrix, dtype=np.float64),
    )
    ratio = old @ np.linalg.inv(matrix)  # of the sensitivities: the new over the old
    turned = (ratio - ratio.T) / 2
    return Change(
        offset_g=old @ np.subtract(new.offset, parent.offset),
        scale=np.diag(ratio) - 1,
        turn_deg=float(np.degrees(np.linalg.norm(turned) / np.sqrt(2))),
    )


def _comparison_text(new: CalibrationFit | CalibrationRecord, parent: CalibrationRecord, limits: Limits) -> list[str]:
    seen = change(new, parent)
    found = []
    for axis, moved_g, scale in zip("xyz", seen.offset_g, seen.scale, strict=True):
        if abs(moved_g) > limits.offset_change_g:
            found.append(f"offset {axis} has moved by {moved_g * 1000:+.1f} mg since {parent.id}")
        if abs(scale) > limits.scale_change:
            found.append(f"scale {axis} has changed by {scale * 100:+.2f} % since {parent.id}")
    if seen.turn_deg > limits.turn_deg:
        found.append(f"the sensor is turned by {seen.turn_deg:.1f} deg in its housing since {parent.id}")
    return found


def _change_text(new: CalibrationFit | CalibrationRecord, parent: CalibrationRecord) -> str:
    seen = change(new, parent)
    offsets = ", ".join(f"{value * 1000:+.2f}" for value in seen.offset_g)
    scales = ", ".join(f"{value * 100:+.3f}" for value in seen.scale)
    return f"since {parent.id}: offset {offsets} mg, scale {scales} %, turned {seen.turn_deg:.3f} deg"


def _poses(new: CalibrationFit | CalibrationRecord) -> tuple[dict[str, object], ...]:
    if isinstance(new, CalibrationFit):
        return tuple(pose.as_json() for pose in new.poses)
    return tuple(new.poses)
