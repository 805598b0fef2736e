"""Sample blocks as an ADXL355 at rest gives them, and their messages."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import SampleBlock
from gateway import messages
from gateway.calibration.record import content_hash
from gateway.packing import pack
from tests.clocks import START_NS
from tests.gateway.recorded_crane import RecordedCrane, record_crane
from tests.gateway.restarted_crane import record_restarts

COUNTS_PER_G = 256_000.0
NOISE_COUNTS = 22.5e-6 * 500**0.5 * COUNTS_PER_G
"""ADXL355: 22.5 ug/rtHz over the 500 Hz below half of 1 kHz."""


def make_block(number: int = 0, length: int = 32, period_ns: float = 1_000_123.456, lost: int = 0) -> SampleBlock:
    """Block `number` of a run: counts of a resting ADXL355 with its noise, at 1 kHz unless told otherwise."""
    rng = np.random.default_rng(number)
    first = number * length
    return SampleBlock(
        time_ns=START_NS + round(first * period_ns) + np.rint(np.arange(length) * period_ns).astype(np.int64),
        raw=np.rint(rng.normal([1200, -3400, COUNTS_PER_G], NOISE_COUNTS, (length, 3))).astype(np.int32),
        temperature_c=25.0 + number / 64,
        lost=lost,
    )


def make_samples(number: int = 0, **block: Any) -> messages.Samples:
    """The message of block `number`."""
    made = make_block(number, **block)
    return pack(made, time_ns=int(made.time_ns[-1]), clock="synchronised", sequence=number, calibration_id="c-1")


def record_content(**changes: Any) -> dict[str, Any]:
    """Content of a calibration record of the device `part-7`, with its hash; keywords change fields."""
    covariance = np.zeros((12, 12))
    covariance[[9, 10, 11], [9, 10, 11]] = [1.0, 4.0, 9.0]  # counts squared
    covariance[0, 0] = (1e-6) ** 2
    content = {
        "format": 1,
        "id": "r1",
        "device_id": "part-7",
        "method": "six-position",
        "created_utc": "2026-01-01T00:00:00Z",
        "software": "0.1.0",
        "by": "bench",
        "parent": None,
        "unit": "counts",
        "offset": [10.0, -20.0, 30.0],
        "correction_matrix": [[1e-3, 1e-5, 0], [0, 1e-3, 0], [0, 0, 1.01e-3]],
        "covariance": covariance.tolist(),
        "prediction_interval_g": 0.003,
        "temperature_c": None,
        "warnings": ["kept though not modelled"],
    } | changes
    return content | {"sha256": content_hash(content)}


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> RecordedCrane:
    return record_crane(tmp_path_factory.mktemp("recorded"))


@pytest.fixture(scope="session")
def restarted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a gateway that was started again twice."""
    folder = tmp_path_factory.mktemp("restarted")
    record_restarts(folder)
    return folder
