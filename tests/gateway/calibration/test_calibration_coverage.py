"""A short, seeded form of the campaign in tests/benchmarks/calibration.py: whole sessions, from counts to intervals."""

import numpy as np
import pytest

from tests.benchmarks.calibration import coverage, relative_tilt_errors_deg
from tests.benchmarks.calibration_sessions import ADXL345, ADXL355, Part


@pytest.mark.slow
@pytest.mark.parametrize("part", [ADXL345, ADXL355], ids=lambda part: part.name)
@pytest.mark.parametrize("method", ["six-position", "norm-fit"])
def test_injected_errors_are_recovered_within_their_stated_intervals(method: str, part: Part) -> None:
    share = coverage(method, part, sessions=80, seed=11)
    assert 0.93 <= share.mean() <= 0.97
    assert share.min() > 0.85  # 80 sessions: four standard deviations below 0.95


@pytest.mark.slow
def test_one_degree_of_placement_costs_six_positions_tenths_of_a_degree_and_the_norm_fit_nothing() -> None:
    six = np.median(relative_tilt_errors_deg("six-position", 1.0, 40))
    norm = relative_tilt_errors_deg("norm-fit", 1.0, 40)
    assert 0.1 < six < 0.2
    assert norm.max() < 0.001
