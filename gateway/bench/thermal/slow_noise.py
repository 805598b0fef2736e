"""Least squares under white noise, flicker and drift in time, their variances estimated from the recordings themselves.

Each recording is cut into blocks of equally many readings, which carry equal information. The reading of a block at time t is

    constant of the recording + row . coefficients + white + flicker + drift t

with white noise, flicker (a spectrum of 1/f) and drift independent between recordings. Their ratios are common to all axes: six
attitudes determine two slopes by six, and the rest shows by how much recordings differ beyond their noise. The ratios are found
by restricted likelihood (Patterson and Thompson 1971), the coefficients by generalised least squares. A variance has the
degrees of freedom that its scatter over the possible ratios leaves it.
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
MIN_PROBABILITY = 1e-3
"""Least probability of ratios that are kept. Basis: a choice; below it the degrees of freedom do not change."""
System = tuple[Array, Array, Array]
"""Design, (recordings, blocks, p), readings, (recordings, blocks), and what is known of the coefficients, (p,)."""


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
    possible: tuple[tuple[float, Array], ...]
    """Covariances of the coefficients by the ratios that may be, with their probabilities; none where the ratios are known."""

    def freedom_of(self, row: Array) -> float:
        """Return the degrees of freedom of the variance of row . values: of the blocks, and of the ratios (GUM G.3)."""
        variances = np.array([row @ covariance @ row for _, covariance in self.possible])
        share = np.array([probability for probability, _ in self.possible])
        mean = float(share @ variances)
        scatter = float(share @ np.square(variances / mean - 1)) if mean > 0 else 0.0
        return 1 / (scatter / 2 + 1 / self.freedom)

    def coverage_factor(self, row: Array) -> float:
        """Return the factor of a two-sided 95 % interval of row . values."""
        return student_quantile(0.975, max(self.freedom_of(row), 1.0))


def block_means(values: Array, blocks: int) -> Array:
    """Return the means of consecutive rows (n, k) in blocks of equally many, (blocks, k)."""
    starts = np.arange(blocks) * len(values) // blocks
    return np.asarray(np.add.reduceat(values, starts, axis=0) / np.diff(starts, append=len(values))[:, None])


class RecordingNoise:
    """The noise of recordings whose blocks lie at the same places of -1/2 to 1/2 of their duration, shape (blocks,)."""

    def __init__(
        self, place: Array, ratios: NoiseRatios, possible: Sequence[tuple[float, "RecordingNoise"]] = ()
    ) -> None:
        """`possible`: the noises by other ratios that may be, with their probabilities."""
        apart = np.abs(np.subtract.outer(place, place))
        times = np.geomspace(1 / len(place), 1.0, FLICKER_TIMES)
        correlation = np.mean([np.exp(-apart / time) for time in times], axis=0)
        lower = np.linalg.cholesky(
            np.eye(len(place)) + ratios.flicker * correlation + ratios.drift * np.outer(place, place)
        )
        self._place, self._ratios, self._possible = place, ratios, possible
        self._whitener = np.linalg.inv(lower)
        constant = self._whitener.sum(axis=1)
        self._free = self._whitener - np.outer(constant, constant @ self._whitener) / (constant @ constant)
        self.log_determinant = 2 * float(np.log(np.diag(lower)).sum() + np.log(np.linalg.norm(constant)))
        """Of the covariance, and of the information on the constant of a recording."""

    @property
    def information(self) -> Array:
        """Inverse of the covariance of the blocks of a recording with its constant taken out, shape (blocks, blocks)."""
        return np.asarray(self._free.T @ self._free)

    def residual(self, design: Array, reading: Array, precision: Array) -> Array:
        """Return the residuals of `solve`, made white and their constants taken out."""
        known = np.diag(np.sqrt(precision))[precision > 0]
        free = np.vstack([(self._free @ design).reshape(-1, design.shape[2]), known])
        answer = np.concatenate([(reading @ self._free.T).ravel(), np.zeros(len(known))])
        coefficients = np.linalg.solve(free.T @ free, free.T @ answer)
        return np.asarray(answer - free @ coefficients)

    def solve(self, design: Array, reading: Array, precision: Array) -> RecordingCoefficients:
        """Return the coefficients for a design (recordings, blocks, p) and readings (recordings, blocks).

        `precision`, (p,), is what is known of the coefficients beforehand: the white variance of a block over that of a
        coefficient about 0.
        """
        recordings, _, size = design.shape
        before = np.hstack([np.zeros((size, recordings)), np.diag(np.sqrt(precision))])
        whitened = np.vstack([self._whiten(design), before])
        answer = np.concatenate([(reading @ self._whitener.T).ravel(), np.zeros(size)])
        orthogonal, upper = np.linalg.qr(whitened)
        inverse = np.linalg.inv(upper)
        values = inverse @ (orthogonal.T @ answer)
        residual = answer - whitened @ values
        freedom = reading.size + int(np.count_nonzero(precision)) - len(values)
        sigma = float(np.linalg.norm(residual)) / np.sqrt(freedom)
        line = np.kron(np.eye(recordings), (self._whitener @ self._place)[:, None])
        return RecordingCoefficients(
            values=values,
            covariance=inverse @ inverse.T * sigma**2,
            residual=residual,
            sigma=max(sigma, np.finfo(float).tiny),
            drift=sigma * float(np.sqrt(self._ratios.drift)),
            drift_root=inverse @ (orthogonal[: reading.size].T @ line) * sigma * np.sqrt(self._ratios.drift),
            freedom=freedom,
            possible=tuple(
                (probability, noise.solve(design, reading, precision).covariance)
                for probability, noise in self._possible
            ),
        )

    def _whiten(self, design: Array) -> Array:
        """Return the whitened design, a constant of each recording in front, (recordings x blocks, recordings + p)."""
        constants = np.kron(np.eye(len(design)), self._whitener.sum(axis=1)[:, None])
        return np.hstack([constants, (self._whitener @ design).reshape(len(constants), -1)])


class NoiseGrid:
    """The ratios that may be, for recordings whose blocks lie at the same places, shape (blocks,)."""

    def __init__(self, place: Array, *, has_drift: bool = True) -> None:
        self._place = place
        self._ratios = list(product(RATIOS, RATIOS if has_drift else (0.0,)))
        self._noises = [RecordingNoise(place, NoiseRatios(*ratios)) for ratios in self._ratios]
        self._information = np.array([noise.information for noise in self._noises])
        self._log_determinant = np.array([noise.log_determinant for noise in self._noises])
        none = np.array([(flicker == 0) + (drift == 0) for flicker, drift in self._ratios])
        before = (len(RATIOS) // 2) ** none.astype(np.float64)
        self._log_before = np.log(before / before.sum())

    def estimate(self, axes: Sequence[System]) -> tuple[RecordingNoise, float]:
        """Return the noise that the axes show, and the logarithm of their evidence.

        The noise is the mean of the ratios, weighted by their restricted likelihood. None is as likely beforehand as half of the
        others together. The most likely ratios alone would often be zero where a few recordings do not show a drift that they
        have.
        """
        likelihood = self._log_before + sum(self._likelihood(*axis) for axis in axes)
        largest = float(likelihood.max())
        weight = np.exp(likelihood - largest)
        evidence = largest + float(np.log(weight.sum()))
        weight /= weight.sum()
        flicker, drift = (weight @ np.array(self._ratios)).tolist()
        possible = [each for each in zip(weight.tolist(), self._noises, strict=True) if each[0] > MIN_PROBABILITY]
        return RecordingNoise(self._place, NoiseRatios(flicker, drift), possible), evidence

    def _likelihood(self, design: Array, reading: Array, precision: Array) -> Array:
        """Return the restricted logarithmic likelihood of an axis at each of the ratios, its white variance integrated out."""
        recordings, blocks, size = design.shape
        system = np.concatenate([design, reading[..., None]], axis=2)
        flat = system.transpose(1, 0, 2).reshape(blocks, -1)
        seen = (self._information @ flat).reshape(len(self._information), -1, size + 1)
        gram = seen.transpose(0, 2, 1) @ flat.reshape(-1, size + 1)
        gram += np.diag(np.append(precision, 0.0) + np.finfo(float).tiny)
        diagonal = np.log(np.diagonal(np.linalg.cholesky(gram), axis1=1, axis2=2))
        known = precision > 0
        freedom = recordings * (blocks - 1) - int(np.count_nonzero(~known))
        logs = freedom * diagonal[:, -1] + diagonal[:, :-1].sum(axis=1) - 0.5 * float(np.log(precision[known]).sum())
        return np.asarray(-0.5 * recordings * self._log_determinant - logs)
