"""What must be true of the load before its sensor is taken away or set to zero."""

import pytest

from gateway.recalibration.interlock import LOAD_HOLDS_S, MEMORY_S, STATIC_S, LoadInterlock, LoadState

S = 1_000_000_000


def watch_of(*stretches):
    """Verdicts twice a second over stretches of (verdict, seconds); the time at the end."""
    watch, now_ns = LoadInterlock(), 0
    for verdict, seconds in stretches:
        for _ in range(2 * seconds):
            now_ns += S // 2
            watch.verdict(verdict, now_ns)
    return watch, now_ns


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
def test_the_housing_stays_on_the_rope_while_the_load_moves(stretches, refused):
    watch, now_ns = watch_of(*stretches)
    why = watch.recalibration_refusal(confirmed=False, now_ns=now_ns)
    assert (why is None) if refused is None else refused in why
    assert watch.recalibration_refusal(confirmed=True, now_ns=now_ns) is None


def test_a_load_on_the_hook_is_no_matter_of_confirmation():
    watch, now_ns = watch_of(("static", 70))
    watch.load(LoadState(True, now_ns))
    assert "a load hangs" in watch.recalibration_refusal(confirmed=True, now_ns=now_ns)
    assert watch.recalibration_refusal(confirmed=True, now_ns=now_ns + round(LOAD_HOLDS_S * S)) is None
    watch.load(LoadState(False, now_ns))
    assert watch.recalibration_refusal(confirmed=False, now_ns=now_ns) is None


@pytest.mark.parametrize(
    ("stretches", "allowed"),
    [
        ([("static", int(STATIC_S) + 1)], True),
        ([("static", int(STATIC_S) - 2)], False),
        ([("swinging", 5), ("static", int(STATIC_S) + 1)], True),
        ([("static", 50), ("unknown", 1)], False),
        ([("quasi_static", 50)], False),
        ([("static", 50), ("quasi_static", 1), ("static", 10)], False),
        ([], False),
    ],
)
def test_only_a_load_that_hangs_still_is_a_plumb_line(stretches, allowed):
    watch, _ = watch_of(*stretches)
    assert (watch.zeroing_refusal() is None) == allowed


def test_what_was_seen_is_forgotten():
    watch, now_ns = watch_of(("static", 70))
    watch.forget()
    assert watch.zeroing_refusal() is not None
    assert watch.recalibration_refusal(confirmed=False, now_ns=now_ns) is not None
