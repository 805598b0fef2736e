"""The campaigns of the bench methods, shortened: blunders through the command line, and intervals over planted sessions."""

import numpy as np
import pytest

from tests.gateway.bench.blunders.campaign import BLUNDERS, SOUND, Blunder, run
from tests.gateway.bench.intervals.__main__ import KINDS

SHOWN_NOWHERE = {"the camera turned by a quarter", "a reflection beside the spot", "one ramp in °F"}
"""Blunders that some sessions do not show, by `docs/evidence/blunders.md`."""
SESSIONS = {"at rest": 8, "installed": 6, "laser": 4, "single": 60, "girder": 60, "alignment": 60}
"""Sessions by the beginning of a kind's name; 15 of the others."""


@pytest.mark.slow
@pytest.mark.parametrize("blunder", BLUNDERS, ids=lambda blunder: f"{blunder.method}: {blunder.text}")
def test_a_blunder_is_refused_or_flagged_with_the_right_suspicion(blunder: Blunder) -> None:
    answer = run(blunder.make, 1, blunder.method + blunder.text)
    assert answer.names(blunder.suspicion) or blunder.text in SHOWN_NOWHERE, answer.said or answer.line


@pytest.mark.slow
@pytest.mark.parametrize("name", SOUND)
def test_a_good_session_is_neither_refused_nor_flagged(name: str) -> None:
    answer = run(SOUND[name], 1, name)
    assert not answer.is_objection, answer.said


def test_there_are_sixty_blunders_or_more() -> None:
    assert len({(blunder.method, blunder.text) for blunder in BLUNDERS}) == len(BLUNDERS) >= 60


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_95_of_100_intervals_hold(kind: str) -> None:
    """Fewer than 95 % less four standard deviations of a share are no chance."""
    count = next((number for name, number in SESSIONS.items() if kind.startswith(name)), 15)
    hits = np.concatenate([KINDS[kind](seed) for seed in range(1000, 1000 + count)])
    assert hits.mean() >= 0.95 - 4 * np.sqrt(0.95 * 0.05 / hits.size)
