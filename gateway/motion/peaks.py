"""The coming maximum of the rope's angle, in closed form from the present motion.

In the chord coordinate 2 sin(phi/2) a planar swing of any size conserves s^2 + (w/w0)^2, so the amplitude is that of a harmonic
oscillation.
"""

from dataclasses import dataclass

import numpy as np

from gateway.motion.estimate import PeakEstimate
from gateway.numerics.array import Array

N_PHASES = 33
"""Phases at which half a swing is evaluated. Basis: the maximum between two of them is 0.1 % above the larger."""


@dataclass(frozen=True, slots=True)
class SwingPhase:
    """The motion that a prediction starts from; the four pairs are jointly Gaussian."""

    mean: Array
    """u, w, steady side force and the pivot's acceleration over g, shape (8,)."""
    covariance: Array
    """Shape (8, 8)."""
    rate_1_s: float
    """Angular frequency of a small swing."""


def next_peak(phase: SwingPhase, *, is_driven: bool) -> PeakEstimate:
    """Return the largest angle of the next half swing.

    `is_driven`: the pivot keeps its acceleration; else it coasts from now on.
    """
    u, w, side, pivot = phase.mean.reshape(4, 2)
    driven = float(is_driven)
    centre = driven * pivot - side
    cosine, sine = _COSINE, _SINE / phase.rate_1_s
    chord = u / np.sqrt(0.5 * (1 + np.sqrt(max(1 - float(u @ u), 0.0))))
    path = centre + np.multiply.outer(cosine, chord - centre) - np.multiply.outer(sine, w)
    squared = (path * path).sum(axis=1)
    at = int(squared.argmax())
    size = float(np.sqrt(squared[at]))
    direction = path[at] / max(size, 1e-9)
    factors = np.array([cosine[at], -sine[at], cosine[at] - 1, driven * (1 - cosine[at])])
    gradient = np.multiply.outer(factors, direction).ravel()
    variance = float(gradient @ phase.covariance @ gradient)
    return PeakEstimate(
        angle_rad=2 * float(np.arcsin(min(size / 2, 1.0))),
        u_rad=float(np.sqrt(max(variance, 0.0))),
        in_s=float(_ANGLE[at]) / phase.rate_1_s,
    )


def ellipse(chord: Array, rate_over_frequency: Array) -> tuple[float, float, float]:
    """Return semi-major axis, semi-minor axis and the major axis's direction of a harmonic motion in a plane.

    `chord`: displacement from the centre, `rate_over_frequency`: its rate over the angular frequency; both of shape (2,).
    """
    first, second = complex(*chord), complex(*rate_over_frequency)
    right, left = abs(first - 1j * second) / 2, abs(first + 1j * second) / 2
    direction = 0.5 * float(np.angle((first - 1j * second) * (first + 1j * second)))
    return right + left, abs(right - left), direction


_ANGLE = np.linspace(0.0, np.pi, N_PHASES)
_COSINE, _SINE = np.cos(_ANGLE), np.sin(_ANGLE)
