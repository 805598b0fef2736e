"""Long recordings by fewer samples: each is the mean of several, as far as a search can afford them.

A swing and the modes of a crane are slow against the rate of a sensor. The mean of k samples lies x'' T² (k² - 1)/24 beside the
middle one (T: sample interval); the second difference of the means tells x'', so that the swing keeps its size.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.data.recordings import Recordings

Array = NDArray[np.float64]
AFFORDABLE_SAMPLES = 12_000
"""Samples of both parts that are used as they are: four minutes at 50 Hz, which a search takes some ten seconds for."""
LOWEST_RATE_HZ = 10.0
"""Rate of the means, which is not undercut: second modes and bounces of cranes reach 4 Hz."""
MIN_USED_SHARE = 0.75
"""Share of the samples of a mean that must count."""


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
