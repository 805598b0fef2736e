"""The gates of a condition: named tests of the last seconds, true where passed (Łuczak n.d., section 3).

The norm gate (Łuczak n.d., eq. 15) is necessary and not sufficient: there are constant accelerations that leave |m| = 1
(Łuczak n.d., Fig. 2), and no accelerometer can detect them. The gates on stillness, impact and consistency with a pendulum
exclude most other motions that it lets pass.
"""

from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array
from gateway.stages.conditions.gyro_gates import turning_gates
from gateway.stages.conditions.window import Bin, ConditionWindow
from gateway.stages.conditions.window_features import SMOOTHED_BINS, WindowFeatures, moving_average

FEWEST_BINS = 10
STEADY_BINS = 40
"""While it is not known whether the load swings, "steady" needs this many bins: a swing is still near its turning point."""
ROUGHEST_G = 0.1
"""Largest vibration with a reliable mean."""
IMPACT_G = 0.05
"""A sample at least this far from the mean of its bin is an impact,"""
CREST = 8.0
"""unless vibration scatters as much: the distance must exceed this many times the usual scatter of the window."""
LOST_SHARE = 0.1
WIDEST_RAD = np.radians(30.0)
"""Largest swing of a hanging load while the swing is not known."""
ENERGY_FLOOR_G, ENERGY_SHARE, ENERGY_SIGMA = 0.001, 0.1, 5.0
"""Allowed change of the amplitude, from position and rate at each time, within the window of a free swing."""
AXIAL_FLOOR_G, AXIAL_SHARE = 0.0015, 0.3
"""Allowed deviation of the force along the rope from that of the position in the swing."""
LARGEST_SEEN_RHO = 0.9
"""Nearer to the load the transverse force is too small to determine the position in the swing."""


@dataclass(frozen=True, slots=True)
class SwingContext:
    """The result of the swing stage for the same seconds."""

    swinging: bool | None
    phi_max_rad: float | None
    consistent: bool
    """A pendulum explains the motion."""
    rho: float | None = None
    """Position of the housing on the rope, by the period; None: as near to the load as possible."""
    period_s: float | None = None
    lean_g: tuple[float, float] = (0.0, 0.0)
    """Transverse force at the centre of the swing."""
    hoisting: bool = False
    """The rope's length certainly changes; the pendulum that explains the motion includes this."""


def evaluate_gates(
    features: WindowFeatures,
    window: ConditionWindow,
    swing: SwingContext,
    noise_g: float | None,
    permissible_norm_error_g: float,
) -> dict[str, bool]:
    """Return all gates of the window; `noise_g` is None where the device does not state it."""
    return {
        "enough_data": True,
        **_sample_gates(features),
        **_motion_gates(features, window.memory, swing, noise_g, permissible_norm_error_g),
        **_rotation_gates(features.bins, swing),
    }


def _sample_gates(features: WindowFeatures) -> dict[str, bool]:
    """Return the gates on the samples within the bins."""
    bins = features.bins
    return {
        "complete": sum(b.missing for b in bins) <= LOST_SHARE * sum(b.count for b in bins),
        "not_clipped": not any(b.clipped for b in bins),
        "no_impact": max(b.peak_g for b in bins) < _impact_g(features),
        "axes_alive": bool(np.all(np.abs(features.means_g).max(axis=0) > 0)),
        "quiet": not features.rough,
        "not_shaken": features.scatter_g < ROUGHEST_G,
    }


def _motion_gates(
    features: WindowFeatures,
    memory: list[Bin],
    swing: SwingContext,
    noise_g: float | None,
    permissible_norm_error_g: float,
) -> dict[str, bool]:
    """Return the gates on the means of the bins."""
    norms = np.linalg.norm(features.smoothed_g, axis=1)
    impact_g = _impact_g(features)
    calm = [b for b in memory if not b.clipped and b.peak_g < impact_g]
    enough = swing.swinging is False or len(memory) >= STEADY_BINS
    widest_rad = WIDEST_RAD if swing.phi_max_rad is None else swing.phi_max_rad
    span = 1 - np.cos(widest_rad)
    rho = 1.0 if swing.rho is None else swing.rho
    free = bool(swing.swinging) and swing.consistent and not swing.hoisting
    lowest, highest = 1 - span - permissible_norm_error_g, 1 + 2 * rho * span + permissible_norm_error_g
    return {
        "still": features.still,
        "steady": enough and len(calm) >= FEWEST_BINS and WindowFeatures.at(calm, noise_g).still,
        "norm_static": bool(np.all(np.abs(norms - 1) < permissible_norm_error_g)),
        "norm_pendulum": bool(np.all(norms > lowest) and np.all(norms < highest)),
        "energy": not free or _energy_gate(features.bins, features.means_g, swing),
        "axial": not free or _axial_gate(features.means_g, swing),
        "rope_keeps_length": not swing.hoisting or features.still,
        "pendulum": free,
    }


def _rotation_gates(bins: list[Bin], swing: SwingContext) -> dict[str, bool]:
    """Return the gates on the angular rates; none without a gyroscope."""
    rates = [b.rate_rad_s for b in bins if b.rate_rad_s is not None]
    return turning_gates(np.array(rates), swing.phi_max_rad, swing.period_s) if rates else {}


def _impact_g(features: WindowFeatures) -> float:
    return max(IMPACT_G, CREST * features.scatter_g) + 6 * features.noise_g


def _energy_gate(bins: list[Bin], means: Array, swing: SwingContext) -> bool:
    """Return whether the amplitude sqrt(f^2 + (f'/w)^2) is constant, as in every free swing, planar or not."""
    if swing.period_s is None:
        return True
    spacing_s = (bins[-1].time_s - bins[0].time_s) / (len(bins) - 1)
    half = SMOOTHED_BINS // 2
    lags = np.arange(-half, half + 1)
    transverse = means[:, :2] - swing.lean_g
    n = len(transverse) - 2 * half
    rate = sum(lag * transverse[half + lag : half + lag + n] for lag in lags) / (spacing_s * (lags**2).sum())
    position = moving_average(means, SMOOTHED_BINS)[:, :2] - swing.lean_g
    radian_s = swing.period_s / (2 * np.pi)
    amplitude_g = np.sqrt((position**2 + (rate * radian_s) ** 2).sum(axis=1))
    u_mean_g = min(b.scatter_g for b in bins) / np.sqrt(np.mean([b.count for b in bins]))
    u_rate_g = radian_s * u_mean_g / (spacing_s * np.sqrt((lags**2).sum()))
    return bool(np.ptp(amplitude_g) < ENERGY_FLOOR_G + ENERGY_SHARE * amplitude_g.max() + ENERGY_SIGMA * u_rate_g)


def _axial_gate(means: Array, swing: SwingContext) -> bool:
    """Return whether the force along the rope follows the position: f_z = const - (1/2 + rho) phi^2, phi = f_t/(1 - rho)."""
    if swing.rho is None or swing.rho > LARGEST_SEEN_RHO:
        return True
    position_g = moving_average(means, SMOOTHED_BINS)
    square = ((position_g[:, :2] - swing.lean_g) ** 2).sum(axis=1) / (1 - swing.rho) ** 2
    expected_g = -(0.5 + swing.rho) * square
    return bool(np.ptp(position_g[:, 2] - expected_g) < AXIAL_FLOOR_G + AXIAL_SHARE * np.ptp(expected_g))
