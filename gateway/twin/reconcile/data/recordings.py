"""The three parts of the data: what models are fitted to, what they are selected by, and what they are tested on.

Of long recordings several samples become their mean, as far as a search can afford them: a swing and the modes of a crane are
slow against the rate of a sensor. The mean of k samples lies x'' T² (k² - 1)/24 beside the middle one (T: sample interval); the
second difference of the means tells x'', so that the swing keeps its size.
"""

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
Array = NDArray[np.float64]
AFFORDABLE_SAMPLES = 12_000
"""Samples of both parts that are used as they are: four minutes at 50 Hz, which a search takes some ten seconds for."""
LOWEST_RATE_HZ = 10.0
"""Rate of the means, which is not undercut: second modes and bounces of cranes reach 4 Hz."""
MIN_USED_SHARE = 0.75
"""Share of the samples of a mean that must count."""


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


def samples_per_mean(recordings: Recordings) -> int:
    """Return how many samples one mean is made of, an odd number; 1 where the recordings are short enough as they are."""
    log = recordings.log
    wanted = (len(log.time_s) + len(recordings.held_out.time_s)) / AFFORDABLE_SAMPLES
    allowed = 1 / (LOWEST_RATE_HZ * log.interval_s)
    half = max(0, min(int(np.ceil((wanted - 1) / 2)), int((allowed - 1) / 2)))
    return 2 * half + 1


def take_means(recordings: Recordings, count: int) -> Recordings:
    """Return the recordings by means of an odd number of samples."""
    if count == 1:
        return recordings
    return replace(
        recordings,
        log=_means(recordings.log, count),
        held_out=_means(recordings.held_out, count),
        held_out_as_stamped=_means(recordings.held_out_as_stamped, count),
    )


def _means(observations: Observations, count: int) -> Observations:
    """Return means about every `count`-th sample. One counts where its neighbours are complete as well.

    The first is not: half of its samples are missing.
    """
    half = count // 2
    centres = np.arange(0, len(observations.time_s) - half, count)
    around = np.maximum(centres[:, None] + np.arange(-half, half + 1), 0)
    weight = observations.used[around].astype(np.float64)
    share = weight.mean(axis=1)
    weight[share == 0] = 1.0  # such a mean counts nowhere
    weight /= weight.sum(axis=1, keepdims=True)
    force_g = np.einsum("ij,ijk->ik", weight, observations.force_g[around])
    curvature_g = np.zeros_like(force_g)
    curvature_g[1:-1] = force_g[:-2] - 2 * force_g[1:-1] + force_g[2:]
    lost_g = (1 - 1 / count**2) / 24 * curvature_g
    time_s = (weight * observations.time_s[around]).sum(axis=1)
    time_s[0] = observations.time_s[0]
    complete = share >= MIN_USED_SHARE
    complete[0] = False
    used = np.zeros_like(complete)
    used[1:-1] = complete[:-2] & complete[1:-1] & complete[2:]
    temperature_c = observations.temperature_c
    return Observations(
        time_s,
        force_g - lost_g,
        None if temperature_c is None else temperature_c[centres],
        observations.noise_g * _noise_ratio(count),
        used,
        observations.offset_s,
    )


def _noise_ratio(count: int) -> float:
    """Return the noise of a mean over that of a sample; the second difference adds a little."""
    share = (1 - 1 / count**2) / 24
    return float(np.sqrt(((1 + 2 * share) ** 2 + 2 * share**2) / count))
