"""An axis that stays silent while the others swing: broken, or the housing is elsewhere than stated.

For a free pendulum the three axes belong together at every instant and azimuth: with X the complex amplitudes of the load
across the rope, x and y read -(1 - rho) X at f0, and z reads -(rho/2 + 1/4) X . X at 2 f0. A swing along x leaves y silent and
keeps this; a broken y does not, unless the housing's place is changed to fit it.
"""

from dataclasses import dataclass

import numpy as np

from devices.pendulum.small_swing import small_swing_period_s
from gateway.swing.data.bins import Bins
from gateway.swing.fit.initial_guess import Harmonics, find_harmonics
from gateway.swing.model.spherical_pendulum import Real
from gateway.swing.rig import MountedHousing

SILENT = 5.0
"""Standard uncertainties up to which an amplitude is noise,"""
SILENT_SHARE = 0.02
"""or this part of what the other axes ask for."""
APART, APART_SIGMA = 0.04, 3.0
"""Relative difference between the two sides, and standard uncertainties of it, from which on they do not belong together."""
LARGEST_UNEXPLAINED = 0.12
"""By harmonics: in a driven stretch nothing can be said."""
LENGTH_U_REL = 0.005
"""Of a rope's length by the period, where no pendulum fits."""
WINDOW_PERIODS = 3.0
LARGEST_SEEN_RHO = 0.95
"""Nearer to the load x and y show too little of any swing."""
LIVELY = 0.05
"""Part of the liveliest axis' scatter, from which on x or y is surely not silent."""


@dataclass(frozen=True, slots=True)
class DeadAxis:
    """What follows from an axis that shows nothing of the swing."""

    fault: str | None = None
    """The others show that it should."""
    angle_u_rel: float = 0.0
    """Relative uncertainty of the angle while the others leave it open whether it is broken."""


def silence_in(bins: Bins, noise_g: Real, rig: MountedHousing, length_m: float) -> DeadAxis:
    """Of a stretch of a few swings, on a rope of this length by its period."""
    scatter_g = bins.force_g.std(axis=0)
    if scatter_g.min() > LIVELY * scatter_g.max() and scatter_g[2] > 2 * noise_g[2] / np.sqrt(bins.count.mean()):
        return DeadAxis()
    return _silence(find_harmonics(bins, noise_g, rig), rig, length_m)


def silence_of(bins: Bins, noise_g: Real, rig: MountedHousing, length_m: float) -> DeadAxis:
    """Of a whole recording: what more than half of its stretches say."""
    period_s = small_swing_period_s(length_m, rig.gravity_m_s2)
    edges_s = np.arange(bins.time_s[0], bins.time_s[-1] - period_s, WINDOW_PERIODS * period_s)
    stretches = [bins.select((bins.time_s >= a) & (bins.time_s < a + WINDOW_PERIODS * period_s)) for a in edges_s]
    found = [silence_in(stretch, noise_g, rig, length_m) for stretch in stretches if len(stretch) > 0]
    if not found:
        return DeadAxis()
    faults = [silence.fault for silence in found if silence.fault is not None]
    if 2 * len(faults) > len(found):
        return DeadAxis(faults[0])
    return DeadAxis(angle_u_rel=float(np.median([silence.angle_u_rel for silence in found])))


def _silence(harmonics: Harmonics, rig: MountedHousing, length_m: float) -> DeadAxis:
    rho = rig.rho_at(length_m)
    if harmonics.unexplained > LARGEST_UNEXPLAINED or rho > LARGEST_SEEN_RHO:
        return DeadAxis()
    size, u_g = np.abs(harmonics.amplitude_g), harmonics.u_g
    along, across = rho / 2 + 0.25, (1 - rho) ** 2
    by_xy = complex((harmonics.amplitude_g[:2] ** 2).sum()) / across
    by_z = -complex(harmonics.amplitude_g[2]) / along
    largest, apart = max(abs(by_xy), abs(by_z)), abs(by_xy - by_z)
    asked_across_g = np.sqrt(largest * across)
    silent = size < np.maximum(SILENT * u_g, SILENT_SHARE * np.array([asked_across_g, asked_across_g, largest * along]))
    u = np.hypot(u_g[2] / along, 2 * size[:2].max() * u_g[:2].max() / across)
    u_rho = rig.position_u_m / length_m + LENGTH_U_REL * rho
    u += largest * u_rho * (2 / (1 - rho) + 0.5 / along)
    z_lacks = abs(by_z) < abs(by_xy)
    broken = "z" * bool(silent[2]) if z_lacks else " or ".join(np.array(["x", "y"])[silent[:2]])
    if not broken:
        return DeadAxis()
    if apart > APART * largest + largest**2 / 2 + APART_SIGMA * u:
        return DeadAxis(
            f"{broken} shows nothing of the swing that the other axes show: a dead axis, or the housing is not where stated"
        )
    return DeadAxis() if z_lacks else DeadAxis(angle_u_rel=apart / (2 * largest))
