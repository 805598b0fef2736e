"""Intervals of the bench methods over sessions of the second generator, through the command line."""

import json
from pathlib import Path

import numpy as np
import pytest

from gateway.calibration.record import CalibrationRecord
from gateway.cli.main import main
from gateway.numerics.array import Array
from tests.gateway.bench.blunders.session import Session
from tests.gateway.bench.blunders.table import SOUND
from tests.gateway.bench.planted.workshop import draw_sensor

SESSIONS = 25


def scores(method: str, folder: Path, seed: int) -> Array:
    """Return errors of offset and scale of the axes over their standard uncertainties, of one planted session, (6,)."""
    random = np.random.default_rng([seed, len(method)])
    sensor = draw_sensor(random)
    out = folder / "record.json"
    out.unlink(missing_ok=True)  # a record is never written over
    assert main([*SOUND[method](Session(random, folder, sensor)), "--json", str(out)]) == 0
    record = CalibrationRecord.model_validate(json.loads(out.read_text()))
    matrix = np.array(record.correction_matrix)
    offset_g = matrix @ (np.array(record.offset) - sensor.offset_g)
    scale = np.diag(matrix @ sensor.axes) - 1
    return np.concatenate([offset_g / record.u_zero_g_offset_g, scale / record.u_scale_factor])


@pytest.mark.slow
@pytest.mark.parametrize("method", ["six-position", "norm-fit", "rotation"])
def test_95_of_100_intervals_of_offset_and_scale_hold(
    method: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = np.array([scores(method, tmp_path, seed) for seed in range(SESSIONS)])
    capsys.readouterr()
    assert np.mean(np.abs(found) < 1.96) >= 0.89  # 150 intervals: 95 % less three standard deviations of their mean
    assert np.abs(found).max() < 5
