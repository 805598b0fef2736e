"""The interlock: what must be true of the load before its sensor is taken off the rope or zeroed."""

from collections.abc import Sequence

import pytest

from gateway.messages import Verdict
from gateway.recalibration.interlock import LOAD_SIGNAL_VALID_S, MEMORY_S, MIN_STATIC_S, LoadInterlock

Stretches = Sequence[tuple[Verdict, int]]

NS_PER_S = 1_000_000_000


def interlock_after(*stretches: tuple[Verdict, int]) -> tuple[LoadInterlock, int]:
    """Return an interlock after stretches of (verdict, seconds), with two verdicts per second, and the time at the end."""
    interlock, now_ns = LoadInterlock(), 0
    for verdict, seconds in stretches:
        for _ in range(2 * seconds):
            now_ns += NS_PER_S // 2
            interlock.add_verdict(verdict, now_ns)
    return interlock, now_ns


@pytest.mark.parametrize(
    ("stretches", "refused"),
    [
        ([("static", 70)], None),
        ([("quasi_static", 20), ("static", 5)], None),
        ([("swinging", 20), ("static", 30)], "has moved"),
        ([("disturbed", 1), ("static", 58)], "has moved"),
        ([("swinging", 20), ("static", int(MEMORY_S) + 1)], None),
        ([("unknown", 70)], "not known"),
        ([], "not known"),
    ],
)
def test_the_housing_stays_on_the_rope_while_the_load_moves(stretches: Stretches, refused: str | None) -> None:
    interlock, now_ns = interlock_after(*stretches)
    reason = interlock.recalibration_refusal(confirmed=False, now_ns=now_ns)
    assert refused is None if reason is None else refused is not None and refused in reason
    assert interlock.recalibration_refusal(confirmed=True, now_ns=now_ns) is None


def test_a_load_on_the_hook_refuses_a_recalibration_even_if_it_is_confirmed() -> None:
    interlock, now_ns = interlock_after(("static", 70))
    interlock.note_load(now_ns)
    assert "a load hangs" in str(interlock.recalibration_refusal(confirmed=True, now_ns=now_ns))
    assert (
        interlock.recalibration_refusal(confirmed=True, now_ns=now_ns + round(LOAD_SIGNAL_VALID_S * NS_PER_S)) is None
    )


@pytest.mark.parametrize(
    ("stretches", "allowed"),
    [
        ([("static", int(MIN_STATIC_S) + 1)], True),
        ([("static", int(MIN_STATIC_S) - 2)], False),
        ([("swinging", 5), ("static", int(MIN_STATIC_S) + 1)], True),
        ([("static", 50), ("unknown", 1)], False),
        ([("quasi_static", 50)], False),
        ([("static", 50), ("quasi_static", 1), ("static", 10)], False),
        ([], False),
    ],
)
def test_the_rope_is_a_plumb_line_only_while_the_load_hangs_still(stretches: Stretches, allowed: bool) -> None:
    interlock, _ = interlock_after(*stretches)
    assert (interlock.zeroing_refusal() is None) == allowed


def test_a_cleared_interlock_knows_nothing() -> None:
    interlock, now_ns = interlock_after(("static", 70))
    interlock.clear()
    assert interlock.zeroing_refusal() is not None
    assert interlock.recalibration_refusal(confirmed=False, now_ns=now_ns) is not None
