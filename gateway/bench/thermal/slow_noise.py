"""Least squares under white noise, flicker and drift in time, their variances estimated from the recordings themselves.

Each recording is cut into blocks of equally many readings, which carry equal information. The reading of a block at time t is

    constant of the recording + row . coefficients + white + flicker + drift t

with white noise, flicker (a spectrum of 1/f) and drift independent between recordings. Their ratios are common to all axes: six
attitudes determine two slopes by six, and the rest shows by how much recordings differ beyond their noise. The ratios are found
by restricted likelihood (Patterson and Thompson 1971), the coefficients by generalised least squares.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from gateway.numerics.array import Array
from gateway.numerics.stats import student_quantile

FLICKER_TIMES = 6
"""Number of first-order processes whose sum is the flicker. Basis: a choice; about one per octave between block and recording."""
RATIOS = (0.0, *np.geomspace(0.03, 1000.0, 10).tolist())
"""Variances of flicker and of drift that may be, over the white variance of a block. Basis: below
the least neither shows in fifty blocks, beyond the largest there is no white noise, and neighbours are hardly told apart."""


@dataclass(frozen=True, slots=True)
class NoiseRatios:
    """Variances over that of the white noise of a block."""

    flicker: float = 0.0
    drift: float = 0.0
    """Of the change over a recording."""


@dataclass(frozen=True, slots=True)
class RecordingCoefficients:
    """RecordingCoefficients of one axis, p of them: the constants of the recordings first."""

    values: Array
    covariance: Array
    residual: Array
    """Of the blocks, made white, shape (recordings x blocks,)."""
    sigma: float
    """Standard deviation of the white noise of a block."""
    drift: float
    """Standard deviation of the drift over a recording."""
    drift_root: Array
    """Effect on the coefficients of one standard deviation of drift of each recording, shape (p, recordings)."""
    freedom: int
    """Degrees of freedom of the blocks."""
    drift_freedom: int
    """Degrees of freedom of the variance of drift."""

    def coverage_factor(self, row: Array) -> float:
        """Return the factor of a two-sided 95 % interval of row . values, by the Welch-Satterthwaite formula (GUM G.4.1)."""
        variance = float(row @ self.covariance @ row)
        share = min(float(np.sum((row @ self.drift_root) ** 2)) / variance, 1.0) if variance > 0 else 0.0
        freedom = 1 / (share**2 / self.drift_freedom + (1 - share) ** 2 / self.freedom)
        return student_quantile(0.975, max(freedom, 1.0))


def block_means(values: Array, blocks: int) -> Array:
    """Return the means of consecutive rows (n, k) in blocks of equally many, (blocks, k)."""
    starts = np.arange(blocks) * len(values) // blocks
    return np.asarray(np.add.reduceat(values, starts, axis=0) / np.diff(starts, append=len(values))[:, None])


class RecordingNoise:
    """The noise of recordings whose blocks lie at the same places of -1/2 to 1/2 of their duration, shape (blocks,)."""

    def __init__(self, place: Array, ratios: NoiseRatios) -> None:
        apart = np.abs(np.subtract.outer(place, place))
        times = np.geomspace(1 / len(place), 1.0, FLICKER_TIMES)
        correlation = np.mean([np.exp(-apart / time) for time in times], axis=0)
        lower = np.linalg.cholesky(
            np.eye(len(place)) + ratios.flicker * correlation + ratios.drift * np.outer(place, place)
        )
        self._place, self._ratios = place, ratios
        self._whitener = np.linalg.inv(lower)
        self._log_determinant = 2 * float(np.log(np.diag(lower)).sum())

    def likelihood(self, design: Array, reading: Array) -> float:
        """Return the restricted logarithmic likelihood of an axis, its white variance at the maximum."""
        whitened, answer = self._whiten(design), (reading @ self._whitener.T).ravel()
        system = np.column_stack([whitened, answer])
        gram = system.T @ system + np.finfo(float).tiny * np.eye(system.shape[1])
        diagonal = np.log(np.diag(np.linalg.cholesky(gram)))
        freedom = len(answer) - whitened.shape[1]
        logs = freedom * float(diagonal[-1]) + float(diagonal[:-1].sum())
        return float(-0.5 * len(design) * self._log_determinant - logs)

    def solve(self, design: Array, reading: Array, axes: int) -> RecordingCoefficients:
        """Return the coefficients for a design (recordings, blocks, p) and readings (recordings, blocks).

        `axes` is the number of axes that share the variance of drift.
        """
        recordings, _, size = design.shape
        whitened, answer = self._whiten(design), (reading @ self._whitener.T).ravel()
        orthogonal, upper = np.linalg.qr(whitened)
        inverse = np.linalg.inv(upper)
        values = inverse @ (orthogonal.T @ answer)
        residual = answer - whitened @ values
        freedom = len(answer) - len(values)
        sigma = float(np.linalg.norm(residual)) / np.sqrt(freedom)
        line = np.kron(np.eye(recordings), (self._whitener @ self._place)[:, None])
        return RecordingCoefficients(
            values=values,
            covariance=inverse @ inverse.T * sigma**2,
            residual=residual,
            sigma=max(sigma, np.finfo(float).tiny),
            drift=sigma * float(np.sqrt(self._ratios.drift)),
            drift_root=inverse @ (orthogonal.T @ line) * sigma * np.sqrt(self._ratios.drift),
            freedom=freedom,
            drift_freedom=max(axes * (recordings - size), 1),
        )

    def _whiten(self, design: Array) -> Array:
        """Return the whitened design, a constant of each recording in front, (recordings x blocks, recordings + p)."""
        constants = np.kron(np.eye(len(design)), self._whitener.sum(axis=1)[:, None])
        return np.hstack([constants, (self._whitener @ design).reshape(len(constants), -1)])


def estimate_noise(place: Array, axes: Sequence[tuple[Array, Array]], *, has_drift: bool = True) -> RecordingNoise:
    """Return the noise that the axes, designs with readings, show: the mean of the ratios, weighted by their likelihood.

    None is as likely beforehand as half of the others together. The most likely ratios alone would often be zero where a
    few recordings do not show a drift that they have.
    """
    tried = [NoiseRatios(*ratios) for ratios in product(RATIOS, RATIOS if has_drift else (0.0,))]
    noises = [RecordingNoise(place, ratios) for ratios in tried]
    likelihood = np.array([sum(noise.likelihood(*axis) for axis in axes) for noise in noises])
    before = [(len(RATIOS) // 2) ** ((ratios.flicker == 0) + (ratios.drift == 0)) for ratios in tried]
    weight = before * np.exp(likelihood - likelihood.max())
    flicker, drift = np.average([(ratios.flicker, ratios.drift) for ratios in tried], axis=0, weights=weight)
    return RecordingNoise(place, NoiseRatios(float(flicker), float(drift)))
