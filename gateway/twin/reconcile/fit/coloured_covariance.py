"""The covariance of fitted values under coloured noise, by the spectrum of the residual where the values show.

An estimate is a sum over the residual, theta = N^-1 J^T r, so its variance is N^-1 (sum of J(f)^2 S(f)) N^-1 with the
spectral density S of the noise: the sandwich with the long-run variance of the scores (Newey and West 1987), here by the
discrete cosine transform, which slow noise does not leak out of (Müller 2007; Lazarus et al. 2018).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.fit_result import Fit
from gateway.twin.reconcile.fit.noise_density import noise_density

Array = NDArray[np.float64]
MIN_SHARE = 1e-4
"""Share of the variance of a value, under white noise, below which the density at a frequency is not asked for."""


def coloured_covariance(fit: Fit, observations: Observations) -> Array:
    """Return the covariance of the free values, shape (k, k): 1.96 roots of its diagonal are their 95 % intervals.

    What the fit itself takes from the residual at the frequencies of its values is given back. The stated noise is the least.
    """
    white = fit.covariance()
    spectrum = dct(fit.jacobian[..., fit.free], axis=0, norm="ortho")  # (frequencies, 3, k)
    power = dct(observations.residual_sigma(fit.force_g), axis=0, norm="ortho") ** 2
    gains = spectrum @ white
    left = np.maximum(float(observations.used.mean()) - np.einsum("fak,fak->fa", gains, spectrum), 0.0)
    variances = gains**2
    total = variances.sum(axis=(0, 1))
    shares = variances / np.where(total > 0, total, 1.0)
    density = np.ones_like(power)
    for axis in range(density.shape[1]):
        bins = np.flatnonzero(shares[:, axis].max(axis=1) > MIN_SHARE)
        density[bins, axis] = noise_density(power[:, axis], left[:, axis], bins)
    covariance: Array = np.einsum("fa,fak,fal->kl", density, gains, gains)
    return covariance
