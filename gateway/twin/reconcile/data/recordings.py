"""The three parts of the data: what models are fitted to, what they are selected by, and what they are tested on."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.data.observations import Observations, slice_samples

HELD_OUT_SHARE = 1 / 3
"""Share at the end of the log that is held out where there is no second recording."""
LONGEST_BLOCK_S = 4.0
"""Longest block of the held-out recording: a good part of a crane's swing, within which residuals are correlated. Of a short
pendulum a block is one swing."""
TEST_EVERY = 3
"""Every third block serves the test, the others the selection: two thirds still show effects of a few per cent of the noise."""


@dataclass(frozen=True, slots=True)
class Recordings:
    """The log, to which models are fitted, and the held-out recording, of which every third block is the test part.

    The initial motion on the held-out recording is fitted to the selection blocks alone. The test blocks are predicted;
    no choice rests on them.
    """

    log: Observations
    held_out: Observations
    """At true times, where samples were lost."""
    held_out_as_stamped: Observations
    last_third: bool
    """The held-out recording is the end of the log, not a recording of its own."""
    block_s: float
    """Length of the blocks of the held-out recording."""

    @property
    def selection(self) -> Observations:
        """The held-out recording with the selection blocks in use."""
        return selection_part(self.held_out, self.block_s)

    @property
    def test(self) -> Observations:
        """The held-out recording with the test blocks in use."""
        return test_part(self.held_out, self.block_s)


def split_recordings(log: Observations, held_out: Observations | None, period_s: float) -> Recordings:
    """Split the data: the second recording is held out, or the end of the log; `period_s` of a small swing."""
    block_s = min(LONGEST_BLOCK_S, period_s)
    if held_out is not None:
        return Recordings(log, held_out, held_out, last_third=False, block_s=block_s)
    cut = int(len(log.time_s) * (1 - HELD_OUT_SHARE))
    end = slice_samples(log, cut, len(log.time_s))
    return Recordings(slice_samples(log, 0, cut), end, end, last_third=True, block_s=block_s)


def find_lack_of_test(recordings: Recordings) -> str | None:
    """Return why there is nothing to test a model on; None where there is."""
    if recordings.test.used.any():
        return None
    needed_s = (TEST_EVERY - 1) * recordings.block_s
    part = "the last third of the log" if recordings.last_third else "the held-out recording"
    return f"{part} lasts {recordings.held_out.duration_s:.3g} s, and more than {needed_s:.3g} s are needed to test a model on"


def selection_part(observations: Observations, block_s: float) -> Observations:
    """Use the blocks of a held-out recording by which models are selected."""
    return replace(observations, used=observations.used & ~_is_test(observations, block_s))


def test_part(observations: Observations, block_s: float) -> Observations:
    """Use the blocks of a held-out recording on which the selected model is tested."""
    return replace(observations, used=observations.used & _is_test(observations, block_s))


def _is_test(observations: Observations, block_s: float) -> NDArray[np.bool_]:
    block = np.floor((observations.time_s - observations.time_s[0]) / block_s).astype(np.int64)
    is_test: NDArray[np.bool_] = block % TEST_EVERY == TEST_EVERY - 1
    return is_test
