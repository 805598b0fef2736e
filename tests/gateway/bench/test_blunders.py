"""One session of every blunder, and of every method done well, through the command line."""

import pytest

from tests.gateway.bench.blunders.campaign import BLUNDERS, SOUND, Blunder, run

SHOWN_NOWHERE = {"the camera turned by a quarter", "a reflection beside the spot", "one ramp in °F"}
"""Blunders that some sessions do not show, by `docs/evidence/blunders.md`."""


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
