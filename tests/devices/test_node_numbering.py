"""Sequence numbers: gaps, repetitions, wrap-around, and a node that starts again."""

import pytest

from devices.node_numbering import Placement, SampleSequence

SECOND_NS = 1_000_000_000


@pytest.fixture
def sequence() -> SampleSequence:
    sequence = SampleSequence(16, 100.0)
    assert sequence.place(65_000, 10, 0).restarted
    return sequence


def place(sequence: SampleSequence, first: int, read_s: float, count: int = 10) -> Placement:
    return sequence.place(first % 65536, count, round(read_s * SECOND_NS))


def test_numbers_wrap_around(sequence: SampleSequence) -> None:
    for k in range(1, 200):
        assert place(sequence, 65_000 + 10 * k, 0.1 * k) == Placement(0, 0, False)


def test_a_gap_is_counted_also_across_the_wrap(sequence: SampleSequence) -> None:
    assert place(sequence, 65_000 + 1_010, 10.1).lost == 1_000
    assert place(sequence, 65_000 + 1_020, 10.2).lost == 0


def test_a_frame_that_comes_twice_is_repeated(sequence: SampleSequence) -> None:
    place(sequence, 65_010, 0.1)
    assert place(sequence, 65_010, 0.11).repeated == 10
    assert place(sequence, 65_000, 0.12).repeated == 10
    assert place(sequence, 65_015, 0.2) == Placement(lost=0, repeated=5, restarted=False)
    assert place(sequence, 65_025, 0.3) == Placement(0, 0, False)


def test_numbers_that_begin_anew_are_a_restart_at_once(sequence: SampleSequence) -> None:
    assert place(sequence, 0 + 40_000, 1.0).restarted  # far ahead or far behind: in no case a late frame
    assert place(sequence, 0, 2.0).restarted


def test_numbers_that_begin_anew_soon_after_the_start_are_a_restart_in_half_a_second(sequence: SampleSequence) -> None:
    """Only time tells them from late frames."""
    place(sequence, 65_010, 0.1)
    seen = [place(sequence, 64_500 + 10 * k, 1 + 0.1 * k) for k in range(8)]
    assert [placement.restarted for placement in seen] == [False] * 6 + [True, False]
    assert [placement.repeated for placement in seen] == [10] * 6 + [0, 0]


def test_a_jump_ahead_of_time_is_a_restart(sequence: SampleSequence) -> None:
    assert place(sequence, 65_000 + 10 + 210, 0.1).lost == 210  # within two seconds of slack
    assert place(sequence, 65_000 + 10 + 210 + 10 + 250, 0.2).restarted
