"""The rope angle that a residual is equivalent to."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gateway.twin.model import TwinRig
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.report.gap import gap_content, part_rows, rope_angle_error
from tests.values import present

RIG = TwinRig(14.0, 5.0, 9.80665, (3e-4, 3e-4, 3e-4), 50.0, 2.0)
RNG = np.random.default_rng(3)
NOISE_G = 3e-4 * RNG.standard_normal((20_000, 3))


def free_swing_g(angle_rad: float, rig: TwinRig) -> np.ndarray:
    """Reading across the rope of a swing of this amplitude; what it reads along the rope does not count."""
    phase = np.arange(20_000) * 0.02
    across = (1 - rig.position_m / rig.length_m) * np.sin(angle_rad * np.cos(phase))
    return np.stack([0.6 * across, 0.8 * across, np.full(20_000, 0.3)], axis=1)


@pytest.mark.parametrize("position_m", [0.0, 5.0, 11.0])
def test_angle_of_a_planted_swing_error_is_recovered(position_m: float) -> None:
    rig = replace(RIG, position_m=position_m)
    found = rope_angle_error(free_swing_g(math.radians(0.5), rig) + NOISE_G, rig)
    assert found is not None
    rms_rad = math.radians(0.5) / math.sqrt(2)
    assert found.angle_rad == pytest.approx(rms_rad, rel=0.02)
    assert found.displacement_m == pytest.approx(14.0 * rms_rad, rel=0.02)
    assert not found.is_upper_bound


def test_noise_is_subtracted_before_the_conversion() -> None:
    small = free_swing_g(math.radians(0.05), RIG)
    noisy = rope_angle_error(small + NOISE_G, RIG)
    assert noisy is not None
    assert noisy.angle_rad == pytest.approx(math.radians(0.05) / math.sqrt(2), rel=0.05)


def test_noise_alone_gives_an_upper_bound_far_below_the_noise() -> None:
    found = rope_angle_error(NOISE_G, RIG)
    assert found is not None
    assert found.is_upper_bound
    assert 0 < found.angle_rad < 0.2 * 3e-4 / (1 - 5 / 14)


def test_angle_is_not_determined_where_the_housing_is_near_the_load() -> None:
    near = replace(RIG, position_m=13.0)
    assert rope_angle_error(NOISE_G, near) is None
    assert rope_angle_error(NOISE_G, replace(RIG, position_m=12.0)) is not None


def test_gap_is_stated_as_angle_and_displacement(make: Callable[..., Reconciliation]) -> None:
    fit, *_ = part_rows(present(make("named").comparison), RIG)
    assert "° → < 0.0" in fit.angle
    assert " cm → < " in fit.displacement
    degrees, centimetres = float(fit.angle.split("°")[0]), float(fit.displacement.split(" cm")[0])
    assert centimetres == pytest.approx(100 * 14.0 * math.radians(degrees), rel=0.05)


def test_gap_near_the_load_is_not_stated_as_an_angle(make: Callable[..., Reconciliation]) -> None:
    result = make("named", rig=replace(RIG, position_m=13.9))
    compared = present(result.comparison)
    rows = part_rows(compared, result.rig)
    assert {(row.angle, row.displacement) for row in rows} == {("not determined", "not determined")}
    assert not gap_content(result, compared)["shows_angle"]
