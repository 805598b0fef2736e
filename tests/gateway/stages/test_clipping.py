"""Clipped samples are counted in counts and in g, either way up."""

from typing import Any

import numpy as np
import pytest

from gateway.stages.clipping import count_clipped


@pytest.mark.parametrize(("kind", "full_scale"), [(np.int32, 512_000), (np.float64, 2.0)])
def test_counts_samples_and_not_axes(kind: Any, full_scale: float) -> None:
    readings = np.zeros((5, 3), dtype=kind)
    assert count_clipped(readings, full_scale) == 0
    readings[1] = [full_scale, full_scale, 0]
    readings[3, 2] = -full_scale
    assert count_clipped(readings, full_scale) == 2
    assert count_clipped((0.99 * readings).astype(kind), full_scale) == 0
    assert count_clipped(readings, None) == 0
