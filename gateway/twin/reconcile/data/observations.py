"""The samples that a model is fitted to: times, specific forces, their noise, which count, how wide they show the swing; and the
three parts of the data: what models are fitted to, what they are selected by, and what they are tested on.

Of long recordings several samples become their mean, as far as a search can afford them: a swing and the modes of a crane are
slow against the rate of a sensor. The mean of k samples lies x'' T² (k² - 1)/24 beside the middle one (T: sample interval); the
second difference of the means tells x'', so that the swing keeps its size.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import period_ratio
from gateway.numerics.foreign_readings import MIN_SPIKE_SIGMA
from gateway.numerics.spectrum import periodogram
from gateway.numerics.stats import normal_quantile, robust_sigma, smallest_steps

Array = NDArray[np.float64]
LARGE_AMPLITUDE_RAD = 0.45
"""Amplitude beyond which a fit needs initial conditions from the samples: one that starts at rest does not converge."""
ASKEW_RAD = 0.17
"""Angle of the mean reading to the z axis from which the housing hangs askew: beyond the lean of a load in a strong wind."""
INITIAL_SHARE = 0.25
"""Share of the recording, from its start, that determines the amplitude. A short share shows a swing that decays; an event that
sets a load at rest in motion usually comes later."""
AXIAL_QUANTILE = 0.02
"""Quantile of the axial reading that stands for its value at the turning points, without the outliers of the noise."""
HALF_FREQUENCY_TOLERANCE = 0.4
"""Relative tolerance within which the swing's frequency is half that of the axial reading."""
TREND_DEGREE = 3
"""Degree of the polynomial that is taken off readings before their line is sought."""
MIN_SWING_POWER_SHARE = 0.1
"""Least share of the lateral power at the swing's frequency."""
SAME_FREQUENCY_RATIO = 1.15
"""Ratio of two frequencies up to which they are the same line."""
NEIGHBOUR_RATIO = 2.0
"""Ratio of frequencies within which a line is compared with its neighbours."""
MIN_LINE_TO_NEIGHBOURS = 30.0
"""Power over the median around it from which an axial line is a swing: noise alone gets there once in 10^9 frequencies."""
MIN_LINE_SHARE = 0.01
"""Power relative to the strongest line from which one may be the swing's: a bounce or a second mode may be stronger."""
MIN_RELATIVE_FREQUENCY = 0.2
"""Lowest frequency that counts, relative to the line's: slower is a drift."""
MIN_RISE_TO_FALL = 1.5
"""Rise of the axial reading above 1 g over its fall below, from which it is that of a swing: 2 rho for a housing at rho."""
MAX_TEMPERATURE_DEGREE = 6
"""Degree of the polynomial that stands for the temperature."""
SAMPLES_PER_DEGREE = 50
"""Samples that one degree of it needs; more smooth the noise of the thermometer."""


def make_upright(force_g: Array) -> Array:
    """Return samples (n, 3) in axes whose z is the mean reading, where the housing hangs well askew; else the samples themselves.

    A load at rest would read 1 g along z then. The axes are turned about the line at right angles to both (Rodrigues).
    """
    used = force_g[np.isfinite(force_g).all(axis=1)]
    mean = used.mean(axis=0) / max(float(np.linalg.norm(used.mean(axis=0))), 1e-9)
    if mean[2] > np.cos(ASKEW_RAD) or mean[2] < 0:
        return force_g
    x, y, z = mean
    skew = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    upright: Array = force_g @ (np.eye(3) + skew + skew @ skew / (1 + z)).T
    return upright


def local_amplitude_rad(force_g: Array) -> float:
    """Return the amplitude of a swing in samples (n, 3) of about a period or more."""
    return float(np.arccos(np.clip(float(np.quantile(force_g[:, 2], AXIAL_QUANTILE)), -1.0, 1.0)))


def has_axial_reading_of_swing(time_s: Array, force_g: Array) -> bool:
    """Return whether the axial reading is that of a swing, and not of a load that bounces on the rope.

    The rope force of a swing has two minima per period, so the lateral readings have a line at half its frequency. Near the load,
    where they show no swing, the rope force rises twice as far above 1 g as it falls below, whereas a bounce is symmetric.
    """
    low_g, high_g = np.quantile(force_g[_is_initial(time_s), 2], [AXIAL_QUANTILE, 1 - AXIAL_QUANTILE])
    return _has_lateral_line(time_s, force_g) or bool(high_g - 1 > MIN_RISE_TO_FALL * (1 - low_g) > 0)


def has_axial_swing(time_s: Array, force_g: Array, small_swing_period_s: float) -> bool:
    """Return whether the axial reading has a line at twice the frequency of a swing with this period and its amplitude.

    It is strong beside the other lines of that reading, and stands out from the frequencies around it.
    """
    twice_hz = 2 / (small_swing_period_s * period_ratio(local_amplitude_rad(force_g)))
    windowed = (force_g - force_g.mean(axis=0)) * np.hanning(len(force_g))[:, None]
    frequency_hz, power = periodogram(time_s, windowed)
    band = frequency_hz > MIN_RELATIVE_FREQUENCY * twice_hz
    ratio, axial = np.abs(np.log(frequency_hz[band] / twice_hz)), power[band, 2]
    at_line, around = ratio < np.log(SAME_FREQUENCY_RATIO), ratio < np.log(NEIGHBOUR_RATIO)
    if not at_line.any():
        return False
    line = float(axial[at_line].max())
    return line > MIN_LINE_SHARE * axial.max() and line > MIN_LINE_TO_NEIGHBOURS * float(
        np.median(axial[around & ~at_line])
    )


def _has_lateral_line(time_s: Array, force_g: Array) -> bool:
    initial, initial_s = force_g[_is_initial(time_s)], time_s[_is_initial(time_s)]
    # The axial reading of a swing that decays has a trend that may exceed its line.
    trend = np.polynomial.polynomial.polyvander(initial_s / max(float(initial_s[-1]), 1e-9), TREND_DEGREE)
    level = initial - trend @ np.linalg.lstsq(trend, initial, rcond=None)[0]
    _, power = periodogram(initial_s, level * np.hanning(len(initial))[:, None])
    half = np.argmax(power[:, 2]) / 2
    near = slice(int((1 - HALF_FREQUENCY_TOLERANCE) * half), int((1 + HALF_FREQUENCY_TOLERANCE) * half) + 1)
    lateral = power[:, :2].sum(axis=1)
    return bool(lateral[near].sum() > MIN_SWING_POWER_SHARE * lateral.sum())


def _is_initial(time_s: Array) -> NDArray[np.bool_]:
    return time_s <= INITIAL_SHARE * float(time_s[-1] - time_s[0])


@dataclass(frozen=True)
class Observations:
    """The n samples of a recording. It has no slots, so that properties of the samples can be cached."""

    time_s: Array
    """Since the first sample, increasing, shape (n,)."""
    force_g: Array
    """Specific force in the housing frame, shape (n, 3)."""
    temperature_c: Array | None
    """Smoothed, shape (n,)."""
    noise_g: Array
    """1-sigma per sample and axis, shape (3,)."""
    used: NDArray[np.bool_]
    """False for spikes, which count nowhere, shape (n,)."""
    offset_s: float = 0.0
    """Time of the first sample in the recording of which this is a slice."""

    @cached_property
    def n_values(self) -> int:
        """Number of values that count: one for each sample used and each axis that was measured."""
        return int((~unmeasured_axes(self.force_g)).sum()) * int(self.used.sum())

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def interval_s(self) -> float:
        """Median interval between samples."""
        return float(np.median(np.diff(self.time_s)))

    @cached_property
    def amplitude_rad(self) -> float:
        """Amplitude at the start of the recording: at a turning point the rope carries cos(amplitude) of the weight.

        This holds wherever the housing is on the rope. Where no first sample counts, because the crane works, all others tell.
        """
        initial = self.used & _is_initial(self.time_s)
        return local_amplitude_rad(make_upright(self.force_g)[initial if initial.any() else self.used])

    @cached_property
    def has_large_amplitude(self) -> bool:
        """Whether only the right model follows the swing as one trajectory; never true of a load that bounces."""
        return self.amplitude_rad > LARGE_AMPLITUDE_RAD and has_axial_reading_of_swing(
            self.time_s, make_upright(self.force_g)
        )

    @property
    def per_sigma(self) -> Array:
        """One over the noise, 0 where a sample does not count, shape (n, 3)."""
        return self.used[:, None] / self.noise_g

    def residual_sigma(self, simulated_g: Array) -> Array:
        """Return (measured - simulated)/noise, 0 where a sample does not count, shape (n, 3)."""
        return (self.force_g - simulated_g) / self.noise_g * self.used[:, None]

    def chi2(self, simulated_g: Array) -> float:
        """Return the sum of the squared residual in sigma."""
        return float((self.residual_sigma(simulated_g) ** 2).sum())

    def reduced_chi2(self, simulated_g: Array) -> float:
        """Return chi-square per value that counts; 1 is noise alone."""
        return self.chi2(simulated_g) / self.n_values


def unmeasured_axes(force_g: Array) -> NDArray[np.bool_]:
    """Return which axes of readings (n, 3) read zero throughout: a table of two axes has no third, shape (3,)."""
    is_zero = (force_g == 0).all(axis=0)
    unmeasured: NDArray[np.bool_] = is_zero & ~is_zero.all()
    return unmeasured


def slice_samples(observations: Observations, first: int, last: int) -> Observations:
    """Return the samples from `first` to before `last`, with times from the first of them."""
    chosen = slice(first, last)
    temperature_c = observations.temperature_c
    return Observations(
        observations.time_s[chosen] - observations.time_s[first],
        observations.force_g[chosen],
        None if temperature_c is None else temperature_c[chosen],
        observations.noise_g,
        observations.used[chosen],
        observations.offset_s + float(observations.time_s[first]),
    )


def make_observations(time_s: Array, force_g: Array, temperature_c: Array | None, noise_g: Array) -> Observations:
    """Return the observations of increasing, finite samples (n >= 8)."""
    elapsed_s = time_s - time_s[0]
    smoothed_c = None if temperature_c is None else smooth_temperature(elapsed_s, temperature_c)
    return Observations(elapsed_s, force_g, smoothed_c, noise_g, ~detect_spikes(force_g))


def smooth_temperature(time_s: Array, temperature_c: Array) -> Array:
    """Return a polynomial through the temperatures: a housing warms slowly, what is fast is the noise of the thermometer."""
    known = np.isfinite(temperature_c)
    degree = min(MAX_TEMPERATURE_DEGREE, int(known.sum()) // SAMPLES_PER_DEGREE)
    polynomial = np.polynomial.Polynomial.fit(time_s[known], temperature_c[known], degree)
    return np.asarray(polynomial(time_s), dtype=np.float64)


def detect_spikes(force_g: Array) -> NDArray[np.bool_]:
    """Return which samples (n, 3) are far from the mean of their neighbours, shape (n,).

    The first and the last sample are compared with the mean of the four next to them.
    """
    neighbours = np.empty_like(force_g)
    neighbours[1:-1] = (force_g[:-2] + force_g[2:]) / 2
    neighbours[0], neighbours[-1] = force_g[1:5].mean(axis=0), force_g[-5:-1].mean(axis=0)
    distance = np.abs(force_g - neighbours)
    # Quantised or saturated readings mostly equal their neighbours; the median alone would be zero.
    sigma = np.maximum(robust_sigma(distance), np.quantile(distance, 0.98, axis=0) / normal_quantile(0.99)) + 1e-12
    limit = np.maximum(MIN_SPIKE_SIGMA * sigma, 1.5 * smallest_steps(force_g))  # a change by one step is no spike
    spikes: NDArray[np.bool_] = np.any(distance > limit, axis=1)
    spikes[0] = True  # the first sample after a start is often a stale one
    return spikes


HELD_OUT_SHARE = 1 / 3
"""Share at the end of the log that is held out where there is no second recording."""
LONGEST_BLOCK_S = 4.0
"""Longest block of the held-out recording: a good part of a crane's swing, within which residuals are correlated. Of a short
pendulum a block is one swing."""
TEST_EVERY = 3
"""Every third block serves the test, the others the selection: two thirds still show effects of a few per cent of the noise."""
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
        return part_of(self.held_out, self.block_s, is_test=False)

    @property
    def test(self) -> Observations:
        """The held-out recording with the test blocks in use."""
        return part_of(self.held_out, self.block_s, is_test=True)


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


def part_of(held_out: Observations, block_s: float, *, is_test: bool) -> Observations:
    """Use the blocks of a held-out recording on which the selected model is tested, or the others, by which it is selected."""
    block = np.floor((held_out.time_s - held_out.time_s[0]) / block_s).astype(np.int64)
    return replace(held_out, used=held_out.used & ((block % TEST_EVERY == TEST_EVERY - 1) == is_test))


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
    lost = (1 - 1 / count**2) / 24  # of the curvature; giving it back adds a little noise
    time_s = (weight * observations.time_s[around]).sum(axis=1)
    time_s[0] = observations.time_s[0]
    complete = share >= MIN_USED_SHARE
    complete[0] = False
    used = np.zeros_like(complete)
    used[1:-1] = complete[:-2] & complete[1:-1] & complete[2:]
    temperature_c = observations.temperature_c
    return Observations(
        time_s,
        force_g - lost * curvature_g,
        None if temperature_c is None else temperature_c[centres],
        observations.noise_g * float(np.sqrt(((1 + 2 * lost) ** 2 + 2 * lost**2) / count)),
        used,
        observations.offset_s,
    )
