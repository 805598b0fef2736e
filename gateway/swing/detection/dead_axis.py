"""Detection of an axis that shows nothing while the others swing: it is broken, or the housing is elsewhere than stated.

For a free pendulum the three axes are related at every instant and azimuth. With X the complex amplitudes of the load across the
rope, x and y read -(1 - rho) X at f, and z reads -(rho/2 + 1/4) X . X at 2 f. A swing along x leaves y silent and satisfies this;
a broken y does not, unless the housing's place is changed to fit it.
"""

from dataclasses import dataclass

import numpy as np

from devices.pendulum.small_swing import small_swing_period_s
from gateway.numerics.array import Array
from gateway.swing.data.bins import Bins
from gateway.swing.fit.harmonics import Harmonics, find_harmonics
from gateway.swing.rig import MountedHousing

NOISE_SIGMA = 5.0
"""Standard uncertainties up to which an amplitude is noise,"""
SILENT_SHARE = 0.02
"""or this part of what the other axes ask for."""
MIN_ASYMMETRY, APART_SIGMA = 0.04, 3.0
"""Relative difference between the two sides, and standard uncertainties of it, from which on they do not belong together."""
MAX_UNEXPLAINED_SHARE = 0.12
"""By harmonics: in a driven stretch nothing can be said."""
MAX_NOISE_SHARE = 0.5
"""Rms of the noise over that of the readings, beyond which nothing can be said. Basis: a rope that rings after a drive leaves 1
to 1.7 times as much as there is, and live axes were called dead in it; a swing of a degree has 0.4."""
PERIOD_LENGTH_U_REL = 0.005
"""Relative standard uncertainty of a rope's length by the period, where no pendulum fits."""
WINDOW_PERIODS = 3.0
MAX_SEEN_RHO = 0.95
"""Largest position over the length at which x and y are judged: nearer to the load they show too little of any swing."""
MIN_ACTIVITY = 0.05
"""Part of the liveliest axis' scatter, from which on x or y is surely not silent."""


@dataclass(frozen=True, slots=True)
class DeadAxis:
    """What follows from an axis that shows nothing of the swing."""

    fault: str | None = None
    """The other axes show that it should: why the window cannot be used."""
    angle_u_rel: float = 0.0
    """Relative uncertainty of the angle where the other axes cannot decide whether it is broken."""


def check_axes_in_window(bins: Bins, noise_g: Array, rig: MountedHousing, length_m: float) -> DeadAxis:
    """Check a window of a few swings on a rope of this length, which follows from the period."""
    scatter_g = bins.force_g.std(axis=0)
    if scatter_g.min() > MIN_ACTIVITY * scatter_g.max() and scatter_g[2] > 2 * noise_g[2] / np.sqrt(bins.count.mean()):
        return DeadAxis()
    return compare_axes(find_harmonics(bins, noise_g, rig), rig, length_m)


def check_axes(bins: Bins, noise_g: Array, rig: MountedHousing, length_m: float) -> DeadAxis:
    """Check a whole recording: a fault is one of more than half of its windows."""
    period_s = small_swing_period_s(length_m, rig.gravity_m_s2)
    edges_s = np.arange(bins.time_s[0], bins.time_s[-1] - period_s, WINDOW_PERIODS * period_s)
    windows = [bins.select((bins.time_s >= a) & (bins.time_s < a + WINDOW_PERIODS * period_s)) for a in edges_s]
    found = [check_axes_in_window(window, noise_g, rig, length_m) for window in windows if len(window) > 0]
    if not found:
        return DeadAxis()
    faults = [each.fault for each in found if each.fault is not None]
    if 2 * len(faults) > len(found):
        return DeadAxis(faults[0])
    return DeadAxis(angle_u_rel=float(np.median([each.angle_u_rel for each in found])))


def compare_axes(harmonics: Harmonics, rig: MountedHousing, length_m: float) -> DeadAxis:
    """Check the harmonics of a window of a few swings on a rope of this length."""
    sides = _AmplitudeComparison.of(harmonics, rig, length_m)
    if sides is None:
        return DeadAxis()
    size, u_g = np.abs(harmonics.amplitude_g), harmonics.u_g
    expected_xy_g = np.sqrt(sides.largest * sides.transverse_gain)
    expected_g = np.array([expected_xy_g, expected_xy_g, sides.largest * sides.axial_gain])
    silent = size < np.maximum(NOISE_SIGMA * u_g, SILENT_SHARE * expected_g)
    z_is_smaller = abs(sides.square_of_z) < abs(sides.square_of_xy)
    dead = "z" * bool(silent[2]) if z_is_smaller else " or ".join(np.array(["x", "y"])[silent[:2]])
    if not dead:
        return DeadAxis()
    if sides.differ:
        return DeadAxis(
            f"{dead} shows nothing of the swing that the other axes show: a dead axis, or the housing is not where stated"
        )
    return DeadAxis() if z_is_smaller else DeadAxis(angle_u_rel=sides.difference / (2 * sides.largest))


def contradiction_u_rel(harmonics: Harmonics, rig: MountedHousing, length_m: float) -> float:
    """Return half the relative difference of the angles by x and y and by z, 0 where the axes agree."""
    sides = _AmplitudeComparison.of(harmonics, rig, length_m)
    return sides.difference / (2 * sides.largest) if sides is not None and sides.differ else 0.0


@dataclass(frozen=True, slots=True)
class _AmplitudeComparison:
    """The square of the load's complex amplitude by x and y and by z."""

    square_of_xy: complex
    square_of_z: complex
    axial_gain: float
    transverse_gain: float
    u: float
    """Standard uncertainty of their difference."""

    @classmethod
    def of(cls, harmonics: Harmonics, rig: MountedHousing, length_m: float) -> "_AmplitudeComparison | None":
        """Return both sides; None where nothing can be said."""
        rho = rig.rho_at(length_m)
        is_clear = harmonics.unexplained <= MAX_UNEXPLAINED_SHARE and harmonics.noise_share <= MAX_NOISE_SHARE
        if not is_clear or rho > MAX_SEEN_RHO:
            return None
        size, u_g = np.abs(harmonics.amplitude_g), harmonics.u_g
        axial_gain, transverse_gain = rho / 2 + 0.25, (1 - rho) ** 2
        square_of_xy = complex((harmonics.amplitude_g[:2] ** 2).sum()) / transverse_gain
        square_of_z = -complex(harmonics.amplitude_g[2]) / axial_gain
        u = np.hypot(u_g[2] / axial_gain, 2 * size[:2].max() * u_g[:2].max() / transverse_gain)
        u_rho = rig.position_u_m / length_m + PERIOD_LENGTH_U_REL * rho
        u += max(abs(square_of_xy), abs(square_of_z)) * u_rho * (2 / (1 - rho) + 0.5 / axial_gain)
        return cls(square_of_xy, square_of_z, axial_gain, transverse_gain, float(u))

    @property
    def largest(self) -> float:
        return max(abs(self.square_of_xy), abs(self.square_of_z))

    @property
    def difference(self) -> float:
        return abs(self.square_of_xy - self.square_of_z)

    @property
    def differ(self) -> bool:
        """The two do not belong together."""
        return self.difference > MIN_ASYMMETRY * self.largest + self.largest**2 / 2 + APART_SIGMA * self.u
