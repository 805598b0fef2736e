"""What the samples alone show of their sensor, before any model is fitted: its noise, steps, limits and repeated readings."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from gateway.measurement.source import Source
from gateway.numerics.stats import robust_sigma
from gateway.twin.effects.sensor import SAME_READING_G
from gateway.twin.model import DEFAULT_NOISE_G, Model
from gateway.twin.reconcile.data.observations import Observations, unmeasured_axes

Array = NDArray[np.float64]
DIFFERENCE_ORDER = 6
"""Order of the differences that leave nothing of a swing in the upper half of the spectrum."""
LOWEST_SHARE = 0.5
"""Lowest frequency at which noise is measured, over the Nyquist frequency."""
OUTLIER_SIGMA = 6.0
"""Differences beyond this are left out: spikes, and steps across gaps."""
MIN_SAMPLES = 64
"""Fewest samples: 29 frequencies, whose median is known to 25 %."""
MIN_NOISE_G = 1e-4
"""Smallest noise that is believed, 6 millidegrees at the pivot: angles of an encoder, read as a sensor's, have next to none."""
MIN_SATURATED_SHARE = 0.004
"""Share of an axis' readings at exactly its extreme value; noise puts one there, a limit puts many."""
MIN_SATURATED_READINGS = 3
"""Readings of an axis at exactly its extreme value that chance can put there, in readings with six digits."""
MIN_NAMED_STEP_SIGMA = 2.0
"""Step over the noise from which it is an effect. Noise of half a step q dithers it: the mean of the readings follows the force
to exp(-2 pi^2 sigma^2/q^2)/pi = 0.2 % of a step, and the error is white noise of variance q^2/12, as if there were more of it."""
MIN_ON_LATTICE_SHARE = 0.98
"""Share of the readings that are multiples of a step, for the step to be real; spikes need not be."""


def measure_noise_g(force_g: Array) -> Array | None:
    """Return the white noise per sample and axis of evenly spaced samples (n, 3), 1 sigma, shape (3,); None with too few.

    It is the median of the spectral density between half the Nyquist frequency and that frequency, where lines of a machine are
    few. Spectral densities of noise are exponentially distributed, so their median is ln 2 of their mean. Spikes and gaps do
    not count.
    """
    if len(force_g) < MIN_SAMPLES:
        return None
    differences = np.diff(force_g, n=DIFFERENCE_ORDER, axis=0)
    spread_g = robust_sigma(differences)  # 0 where coarse steps make most of them equal: then all count
    differences[(np.abs(differences) > OUTLIER_SIGMA * spread_g) & (spread_g > 0)] = 0.0
    window = np.hanning(len(differences))[:, None]
    cycles = np.fft.rfftfreq(len(differences))
    upper = cycles >= LOWEST_SHARE / 2
    gain = (2 * np.sin(np.pi * cycles[upper])) ** (2 * DIFFERENCE_ORDER) * float((window**2).sum())
    density = np.abs(np.fft.rfft(differences * window, axis=0)[upper]) ** 2 / gain[:, None]
    found: Array = np.maximum(np.sqrt(np.median(density, axis=0) / np.log(2)), MIN_NOISE_G)
    return found


def with_measured_noise(model: Model, source: Source) -> tuple[Model, str | None]:
    """Return a model with the noise of a recording whose sensor's noise nobody states, and a remark on it.

    The error of coarse steps is left out: it is an effect of its own.
    """
    measured_g = None if source.noise_g is not None else measure_noise_g(source.force_g)
    if measured_g is None:
        return model, None
    step_g = detect_quantisation_step(source.force_g, measured_g)
    if step_g is not None:
        without_steps_g2 = np.maximum(measured_g**2 - step_g**2 / 12, 0.0)
        measured_g = np.maximum(np.sqrt(without_steps_g2), np.minimum(DEFAULT_NOISE_G, measured_g))
    unmeasured = unmeasured_axes(source.force_g)
    measured_g[unmeasured] = measured_g[~unmeasured].max(initial=MIN_NOISE_G)
    x, y, z = (float(each) for each in measured_g)
    remark = f"noise of x, y, z measured as {1e3 * x:.2g}, {1e3 * y:.2g}, {1e3 * z:.2g} mg, because the rig states none"
    return replace(model, rig=replace(model.rig, noise_g=(x, y, z))), remark


def detect_saturation(force_g: Array) -> float | None:
    """Return the level in g at which readings (n, 3) stop; None where they do not.

    A reading that a slow sensor repeats in all axes counts once. A level of 1 g is no limit: every sensor that hangs still reads
    it, and at the pivot no angle reads more.
    """
    fresh = np.concatenate([[True], np.any(np.diff(force_g, axis=0) != 0, axis=1)])
    readings_g = force_g[fresh]
    fewest = max(MIN_SATURATED_SHARE * len(readings_g), MIN_SATURATED_READINGS)
    levels = []
    for axis in readings_g.T:
        for signed in (axis, -axis):
            largest = float(signed.max())
            is_gravity = abs(largest - 1) < SAME_READING_G
            if largest > 0 and not is_gravity and np.count_nonzero(signed > largest - SAME_READING_G) > fewest:
                levels.append(largest)
    return max(levels, default=None)


def regular_reading_times(time_s: Array, rows_per_reading: float) -> Array:
    """Return the times of readings that a sensor takes at a steady rate, from the times (n,) of the first row that shows each.

    A row shows a reading up to one row late. Where the rate is steady a straight line through the times removes what changes of
    that delay; its mean is a shift of all times. The first reading was there before the first row. The times stay as they are
    where the others do not lie within a row of the line.
    """
    shown_s = time_s[1:]
    steps_s = np.diff(shown_s)
    interval_s = float(np.median(steps_s))
    interval_s = float(steps_s[np.rint(steps_s / interval_s) == 1].mean())  # across a gap the median would miscount
    number = np.concatenate([[0.0], np.cumsum(np.rint(steps_s / interval_s))])
    slope_s, start_s = np.polyfit(number, shown_s, 1)
    regular: Array = start_s + slope_s * np.concatenate([[-1.0], number])
    is_steady = np.abs(shown_s - regular[1:]).max() < slope_s / rows_per_reading and (np.diff(number) > 0).all()
    return regular if is_steady else time_s


def detect_quantisation_step(force_g: Array, noise_g: Array) -> float | None:
    """Return the step in g of which all readings (n, 3) are multiples; None where none is as large as the noise (3,).

    A smaller step does not show in the residual: its error has a variance of step^2/12.
    """
    differences = []
    for axis in force_g.T:
        values = np.unique(np.round(axis / SAME_READING_G) * SAME_READING_G)
        differences.append(np.diff(values))
    steps = np.concatenate(differences)
    steps = steps[steps > 2 * SAME_READING_G]
    if not len(steps):
        return None
    # The smallest differences are all one step, with the rounding of the written digits.
    step_g = float(np.median(steps[steps < 1.5 * steps.min()]))
    if step_g < float(np.min(noise_g)):
        return None
    step_g = _refine_step(step_g, force_g)
    off_lattice_g = np.abs(force_g / step_g - np.round(force_g / step_g)) * step_g
    return step_g if np.mean(off_lattice_g < 5 * SAME_READING_G) > MIN_ON_LATTICE_SHARE else None


def _refine_step(step_g: float, force_g: Array) -> float:
    """Return the step by least squares over small multiples first, so that no multiple is miscounted."""
    for largest_multiple in (4, 16, 64, 256, 1024, 8192):
        multiples = np.round(force_g / step_g)
        counted = (np.abs(multiples) <= largest_multiple) & (multiples != 0)
        if counted.any():
            step_g = float((force_g[counted] * multiples[counted]).sum() / (multiples[counted] ** 2).sum())
    return step_g


def constant_share(step_g: float, noise_g: Array) -> float:
    """Return the largest share of equal readings that quantisation of a constant with this noise (3,) can give."""
    return float(erf(step_g / 2 / (np.sqrt(2) * np.min(noise_g))))


def noise_with_quantisation_g(observations: Observations, step_g: float) -> Array:
    """Return the standard deviation of noise and quantisation error together, shape (3,)."""
    return np.sqrt(observations.noise_g**2 + step_g**2 / 12)


def quantised_mean_g(force_g: Array, step_g: float, noise_g: Array) -> Array:
    """Return the mean of quantised readings for forces (n, 3) with noise (3,) before the quantisation.

    It follows from the probabilities of the nearest step and two on either side.
    """
    nearest = np.round(force_g / step_g)
    mean = np.full_like(force_g, 2.0)
    for edge in (-1.5, -0.5, 0.5, 1.5):
        mean -= 0.5 * (1 + erf(((nearest + edge) * step_g - force_g) / (noise_g * np.sqrt(2))))
    return (nearest + mean) * step_g
