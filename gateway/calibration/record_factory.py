"""Makes a record from a fit: person, time and device, the id and the hash."""

import re
from typing import Any

from gateway.calibration.methods.calibration_fit import CalibrationFit
from gateway.calibration.record import CalibrationRecord, content_hash


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
