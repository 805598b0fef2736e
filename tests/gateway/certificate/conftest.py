"""Records with poses whose residuals, budget and drift are known."""

from typing import Any

import numpy as np
import pytest

from gateway.calibration.record import CalibrationRecord, content_hash

UNITS_PER_G = 256_000.0
SENSITIVITY = UNITS_PER_G * np.array([[1.02, 0.004, -0.003], [0.002, 0.99, 0.006], [-0.005, 0.003, 1.013]])
OFFSET = np.array([7680.0, -5120.0, 11520.0])
FACES = {"+x": 0, "-x": 0, "+y": 1, "-y": 1, "+z": 2, "-z": 2}
U_OFFSET, U_ENTRY = 50.0, 1e-9


def poses(count: int, seed: int = 1) -> list[dict[str, Any]]:
    """Resting poses in all directions with 0.1 mg of noise in each mean; six of them are the faces."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    if count == 6:
        directions = np.array([np.eye(3)[axis] * (1 if face[0] == "+" else -1) for face, axis in FACES.items()])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return [
        {
            "mean": (SENSITIVITY @ direction + OFFSET + rng.normal(0, 1e-4 * UNITS_PER_G, 3)).tolist(),
            "type_a": [1e-4 * UNITS_PER_G] * 3,
            "count": 300,
            "face": face,
            "used": True,
        }
        for direction, face in zip(directions, list(FACES) if count == 6 else [None] * count, strict=True)
    ]


def sealed(content: dict[str, Any]) -> CalibrationRecord:
    return CalibrationRecord.model_validate(content | {"sha256": content_hash(content)})


def make_record(**changes: Any) -> CalibrationRecord:
    covariance = np.diag([U_ENTRY**2] * 9 + [U_OFFSET**2] * 3)
    return sealed(
        {
            "format": 1,
            "id": "20260402T091241Z-1d27e79c",
            "device_id": "adxl355-0x1d-label7",
            "method": "norm-fit",
            "created_utc": "2026-04-02T09:12:41Z",
            "software": "0.1.0",
            "by": "A. Rigger",
            "parent": None,
            "unit": "counts",
            "offset": OFFSET.tolist(),
            "correction_matrix": np.linalg.inv(SENSITIVITY).tolist(),
            "covariance": covariance.tolist(),
            "prediction_interval_g": 0.0031,
            "temperature_c": {"mean": 21.6, "min": 20.9, "max": 22.3},
            "poses": poses(12),
            "misalignment_deg": {"x": [1.318, -1.579], "y": [0.533, -3.211], "z": [1.065, -3.218]},
            "residual_rms_g": 0.0001,
            "condition_number": 2.1,
            "budget": [
                {"source": "noise of the pose means", "type": "A", "u_g": 0.0003, "u_deg": 0.017},
                {"source": "placement of the faces", "type": "B", "u_g": 0.0004, "u_deg": 0.023},
            ],
            "warnings": [],
        }
        | changes
    )


@pytest.fixture
def drifted() -> tuple[CalibrationRecord, CalibrationRecord]:
    """A record and its parent, made 91 days before: z offset +4 mg since, x scale +0.2 %."""
    parent = make_record(id="parent-1", created_utc="2026-01-01T09:12:41Z")
    sensitivity = SENSITIVITY.copy()
    sensitivity[:, 0] *= 1.002
    offset = OFFSET + SENSITIVITY @ np.array([0, 0, 0.004])
    record = make_record(
        parent="parent-1", offset=offset.tolist(), correction_matrix=np.linalg.inv(sensitivity).tolist()
    )
    return record, parent


@pytest.fixture
def worst_record() -> CalibrationRecord:
    """As long and as wide as a record of unknown origin can be."""
    return make_record(
        id="W" * 400,
        by="W" * 400,
        method="W" * 400,
        software="W" * 400,
        reason="W" * 400,
        parent="W" * 400,
        created_utc="2026-04-02T09:12:41.123456789+00:00",
        poses=poses(40),
        budget=[{"source": "W" * 400, "type": "B", "u_g": 0.001 * row, "u_deg": 0.01 * row} for row in range(30)],
        warnings=["W" * 2000] * 30,
    )
