"""The coming maximum of the rope's angle, in closed form from the present motion.

In the chord coordinate 2 sin(phi/2) a planar swing of any size conserves s^2 + (w/w0)^2, so the amplitude is that of a harmonic
oscillation.
"""

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np

from gateway.motion.estimate import PeakEstimate
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975

N_HALF = 32
"""Steps in which half a swing is evaluated. Basis: the maximum between two of them is 0.1 % above the larger."""
EQUAL_SHARE = 1.001
"""Ratio of two peaks that are equal. Basis: that of the steps."""
ALIKE_SHARE = 1.05
"""Ratio of two peaks up to which the sooner is waited for. Basis: a choice; 0.3 degrees at the usual limit, which nobody sees."""


@dataclass(frozen=True, slots=True)
class SwingPhase:
    """The motion that a prediction starts from; the four pairs are jointly Gaussian."""

    mean: Array
    """u, w, force on the load and the pivot's acceleration over g, shape (8,)."""
    covariance: Array
    """Shape (8, 8)."""
    rate_1_s: float
    """Angular frequency of a small swing."""


def next_peak(phase: SwingPhase, *, is_driven: bool) -> PeakEstimate:
    """Return the largest angle of the next whole swing; of two that its uncertainty does not tell apart, the sooner.

    About a lean one turning point is farther from the vertical than the other. Where both are alike, the time is that of the
    sooner one: whoever waits for the later one meets a load that is as far out before. `is_driven`: the pivot keeps its
    acceleration; else it coasts from now on.
    """
    u, w, side, pivot = (complex(x, y) for x, y in phase.mean.reshape(4, 2).tolist())
    driven = float(is_driven)
    centre = driven * pivot - side
    chord = u / math.sqrt(0.5 * (1 + math.sqrt(max(1 - abs(u) ** 2, 0.0))))
    path = centre + (chord - centre) * _COSINE - (w / phase.rate_1_s) * _SINE
    sizes = np.abs(path)

    def peak_at(step: int) -> PeakEstimate:
        peak, cosine, sine = complex(path[step]), float(_COSINE[step]), float(_SINE[step]) / phase.rate_1_s
        direction = peak / max(abs(peak), 1e-9)
        factors = (cosine, -sine, cosine - 1, driven * (1 - cosine))
        gradient = np.array([factor * part for factor in factors for part in (direction.real, direction.imag)])
        return PeakEstimate(
            angle_rad=2 * math.asin(min(abs(peak) / 2, 1.0)),
            u_rad=math.sqrt(max(float(gradient @ phase.covariance @ gradient), 0.0)),
            in_s=float(_ANGLE[step]) / phase.rate_1_s,
        )

    sooner, largest = int(sizes[: N_HALF + 1].argmax()), int(sizes.argmax())
    found = peak_at(sooner)
    if sizes[largest] <= EQUAL_SHARE * sizes[sooner] + found.u_rad:
        return found
    is_alike = sizes[largest] <= ALIKE_SHARE * sizes[sooner] + NORMAL_975 * found.u_rad
    return replace(peak_at(largest), in_s=found.in_s) if is_alike else peak_at(largest)


def ellipse(chord: complex, rate_over_frequency: complex) -> tuple[float, float, float]:
    """Return semi-major axis, semi-minor axis and the major axis's direction of a harmonic motion in a plane.

    `chord`: displacement from the centre, x + iy; `rate_over_frequency`: its rate over the angular frequency.
    """
    right, left = chord - 1j * rate_over_frequency, chord + 1j * rate_over_frequency
    return (abs(right) + abs(left)) / 2, abs(abs(right) - abs(left)) / 2, 0.5 * cmath.phase(right * left)


_ANGLE = np.linspace(0.0, 2 * np.pi, 2 * N_HALF + 1)
_COSINE, _SINE = np.cos(_ANGLE), np.sin(_ANGLE)
