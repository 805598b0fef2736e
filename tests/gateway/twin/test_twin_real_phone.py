"""A phone's fall: its offset shows, and what grows with the speed is no quadratic drag."""

import numpy as np
import pytest

from tests.benchmarks.real_phone import BEGINNING_S, fall, left_g, read


def test_fall_shows_the_offset() -> None:
    since_s, force_g = fall()
    offset_g = force_g[since_s < BEGINNING_S].mean(axis=0)
    rest_g = read("phone_at_rest.txt")[:, 1:].mean(axis=0)
    assert offset_g == pytest.approx([-0.0935, 0.0413, -0.0252], abs=5e-4)
    assert np.linalg.norm(rest_g) == pytest.approx(0.9937, abs=1e-4)
    assert np.linalg.norm(rest_g - offset_g) == pytest.approx(1.0150, abs=1e-3)


def test_quadratic_drag_does_not_explain_the_fall() -> None:
    since_s, force_g = fall()
    noise_g = force_g[since_s < BEGINNING_S].std(axis=0, ddof=1).max()
    quadratic_g, _ = left_g(since_s, force_g, 2)
    steeper_g, _ = left_g(since_s, force_g, 6)
    assert quadratic_g > 1.5 * noise_g > steeper_g
