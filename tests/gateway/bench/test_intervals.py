"""Intervals of the bench methods over planted sessions of the second generator, some of each kind of the campaign."""

import numpy as np
import pytest

from tests.gateway.bench.intervals.__main__ import KINDS

SESSIONS = {"at rest": 8, "laser": 4, "single": 60, "girder": 60, "alignment": 60}
"""Sessions by the beginning of a kind's name; 15 of the others."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_95_of_100_intervals_hold(kind: str) -> None:
    """Fewer than 95 % less four standard deviations of a share are no chance."""
    count = next((number for name, number in SESSIONS.items() if kind.startswith(name)), 15)
    hits = np.array([KINDS[kind](seed) for seed in range(1000, 1000 + count)], dtype=float)
    assert hits.mean() >= 0.95 - 4 * np.sqrt(0.95 * 0.05 / hits.size)
