"""The sensor's noise, measured from a recording whose rig states none."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.measurement.source import Source
from gateway.numerics.stats import robust_sigma
from gateway.twin.model import DEFAULT_NOISE_G, Model
from gateway.twin.reconcile.data.artefact_detectors import detect_quantisation_step
from gateway.twin.reconcile.data.observations import unmeasured_axes

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
