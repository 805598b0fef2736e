"""Free swings between hands, found by the data alone."""

import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.swing.detection.free_swing import find_free_swing
from tests.gateway.swing.held_pendulum import HeldRecording, drawn_recordings, is_visible

SWINGS = Path(__file__).parents[2] / "data" / "swings"


def inside_periods(recording: HeldRecording) -> tuple[float, float]:
    """Return how far inside the true free swing begin and end of the longest interval are; negative where hands are inside."""
    found = find_free_swing(recording.time_s, recording.force_g).longest
    ends_s = found.from_s - recording.released_s, recording.caught_s - found.to_s
    return ends_s[0] / recording.period_s, ends_s[1] / recording.period_s


@pytest.mark.slow
def test_nine_in_ten_ends_of_free_swings_between_hands_are_found_within_half_a_period() -> None:
    recordings = [each for each in drawn_recordings(40, seed=11) if is_visible(each)]
    inside = np.array([inside_periods(recording) for recording in recordings])
    assert len(recordings) > 20
    assert (((inside >= -0.2) & (inside <= 0.5)).mean(axis=0) >= 0.9).all()


@pytest.mark.slow
def test_plain_free_swings_are_found_whole() -> None:
    assert all(
        find_free_swing(each.time_s, each.force_g).is_whole for each in drawn_recordings(10, seed=12, held=False)
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["swing_001", "swing_019"])
def test_recordings_of_an_independent_engine_without_hands_are_found_whole(name: str) -> None:
    with gzip.open(SWINGS / f"{name}.csv.gz", "rt") as file:
        rows = np.loadtxt(file, delimiter=",", skiprows=1)
    found = find_free_swing(rows[:, 0], rows[:, 1:4])
    assert found.is_whole
    assert found.longest.to_s == pytest.approx(rows[-1, 0], abs=0.5)


def without_samples(recording: HeldRecording, missing: NDArray[np.bool_]) -> HeldRecording:
    """Return a recording without some of its samples."""
    return replace(recording, time_s=recording.time_s[~missing], force_g=recording.force_g[~missing])


@pytest.mark.slow
def test_gaps_in_a_free_swing_show_no_hand() -> None:
    for recording in drawn_recordings(3, seed=12, held=False):
        periods = recording.time_s / recording.period_s
        pieces = without_samples(recording, periods % 4.2 > 3.6)
        assert find_free_swing(pieces.time_s, pieces.force_g).is_whole, recording.description


@pytest.mark.slow
def test_hands_are_found_beside_a_swing_with_a_gap() -> None:
    recordings = [each for each in drawn_recordings(4, seed=2) if is_visible(each)]
    for recording in recordings:
        middle_s = (recording.released_s + recording.caught_s) / 2
        pieces = without_samples(recording, np.abs(recording.time_s - middle_s) < 0.3 * recording.period_s)
        assert min(inside_periods(pieces)) > -0.2, recording.description


@pytest.mark.slow
def test_noise_and_rest_are_found_whole() -> None:
    rng = np.random.default_rng(3)
    still_g = np.array([0.1, 0.0, 1.0]) + rng.normal(0.0, 0.002, (3000, 3))
    found = find_free_swing(np.arange(3000) / 50, still_g)
    assert found.is_whole
    assert found.intervals[0].duration_s == pytest.approx(59.98)


def test_a_recording_of_a_few_samples_is_whole() -> None:
    assert find_free_swing(np.arange(5) / 50, np.ones((5, 3))).is_whole
    assert find_free_swing(np.empty(0), np.empty((0, 3))).is_whole
