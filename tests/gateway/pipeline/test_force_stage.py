"""Clipped samples are found in counts and in g, either way up, and as the device marks them."""

from typing import Any

import numpy as np
import pytest

from gateway.pipeline.force_stage import find_clipped


@pytest.mark.parametrize(("kind", "full_scale"), [(np.int32, 512_000), (np.float64, 2.0)])
def test_samples_and_not_axes_are_clipped(kind: Any, full_scale: float) -> None:
    readings = np.zeros((5, 3), dtype=kind)
    assert not find_clipped(readings, None, full_scale).any()
    readings[1] = [full_scale, full_scale, 0]
    readings[3, 2] = -full_scale
    assert find_clipped(readings, None, full_scale).tolist() == [False, True, False, True, False]
    assert not find_clipped((0.99 * readings).astype(kind), None, full_scale).any()
    assert not find_clipped(readings, None, None).any()


def test_the_marks_of_the_device_decide_where_there_are_any() -> None:
    readings = np.array([[2.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    marks = np.array([False, True])
    assert find_clipped(readings, marks, 2.0).tolist() == [False, True]
