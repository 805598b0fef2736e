"""The campaigns of the bench methods, shortened: blunders through the command line, and intervals over planted sessions."""

import numpy as np
import pytest

from tests.gateway.bench.blunders.campaign import BLUNDERS, SOUND, Blunder, run
from tests.gateway.bench.intervals.__main__ import KINDS

SHOWN_NOWHERE = {"the camera turned by a quarter", "a reflection beside the spot", "one ramp in °F"}
"""Blunders that some sessions do not show, by `docs/evidence/blunders.md`."""
SESSIONS = {"ramps of 120 s": 3, "ramps of 1500 s": 3, "steps": 3, "at rest": 3, "installed": 6, "laser": 4}
SESSIONS |= {"single parameter": 60, "girder": 60, "alignment": 60}
"""Sessions of each kind by its method, which its name begins with; 10 of the others."""
METHODS = {
    kind.split(", ")[0]: [each for each in KINDS if each.split(", ")[0] == kind.split(", ")[0]] for kind in KINDS
}


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
@pytest.mark.parametrize("method", METHODS)
def test_95_of_100_intervals_hold(method: str) -> None:
    """Fewer than 95 % less four standard deviations of a share are no chance: of each kind, and of all of a method."""
    seeds = range(1000, 1000 + SESSIONS.get(method, 10))
    hits = {kind: np.concatenate([KINDS[kind](seed) for seed in seeds]) for kind in METHODS[method]}
    for name, found in {**hits, method: np.concatenate([*hits.values()])}.items():
        assert found.mean() >= 0.95 - 4 * np.sqrt(0.95 * 0.05 / found.size), name
