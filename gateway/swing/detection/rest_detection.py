"""Detection of a load that does not swing, with an upper bound of the angle that it could have all the same."""

from dataclasses import replace

import numpy as np

from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.swing.data.bins import Bins
from gateway.swing.estimate import SwingEstimate
from gateway.swing.estimation.robust_fit import FitResult
from gateway.swing.fit.harmonics import Harmonics
from gateway.swing.rig import MountedHousing

MIN_GAIN = 40.0
"""Twice the log-likelihood that harmonics must gain to be called a swing: once in some 10^5 still windows noise does."""
MIN_FIT_GAIN = 9.0
"""Twice the log-likelihood by the axial force alone, from which on a pendulum is tried on a whole recording."""
MIN_AXIAL_GAIN = 11.5
"""Gain of that pendulum in the axial force, from which on it counts as a swing: at rest with the housing at the load noise does
twice in a thousand.

Between this and `MIN_GAIN` the answer is an angle that may as well be smaller, down to none.
"""
BOUND_FACTOR = 2.5
"""Standard uncertainties added to an amplitude for its upper bound (of an ellipse, over all frequencies searched)."""
MIN_UNEXPLAINED_RATIO = 0.5
"""Rms that harmonics leave unexplained over the rms, from which on a small movement is not a swing."""
MAX_IRREGULAR_RAD = np.radians(1.0)


def at_rest_estimate(
    bins: Bins, noise_g: Array, rig: MountedHousing, harmonics: Harmonics, from_s: float
) -> SwingEstimate:
    """Return the estimate that nothing swings, with the lean and an upper bound of the rope's angle."""
    excess = _excess_variance(bins, noise_g)
    swing_rad = _largest_swing_rad(harmonics, rig, excess)
    u_mean_g = np.sqrt(excess[:2]) * harmonics.u_g[:2]
    return _estimate_without_swing(bins, noise_g, rig, harmonics.mean_g, from_s, swing_rad, u_mean_g)


def irregular_motion_estimate(bins: Bins, noise_g: Array, rig: MountedHousing, from_s: float) -> SwingEstimate | None:
    """Return the same for a rope that moves by a small angle, though not as a load swings; None for a larger angle.

    A driven load reads more than its angle, so the deviation of any one bin from the mean bounds the angle.
    """
    mean_g = np.average(bins.force_g, axis=0, weights=bins.count)
    deviation_g = bins.force_g - mean_g
    rho = _possible_rho(rig)
    by_xy = np.hypot(deviation_g[:, 0], deviation_g[:, 1]).max() / np.maximum(1 - rho, 1e-4)
    u_z_g = _expanded_u_z_g(rig)
    high_g, low_g = bins.force_g[:, 2].max() - 1 + u_z_g, 1 - bins.force_g[:, 2].min() + u_z_g
    by_z = np.sqrt(np.maximum(2 * low_g, high_g / np.maximum(rho, 1e-4)).clip(min=0.0))
    swing_rad = float(np.minimum(by_xy, by_z).max())
    if swing_rad > MAX_IRREGULAR_RAD:
        return None
    u_mean_g = deviation_g[:, :2].std(axis=0)
    found = _estimate_without_swing(bins, noise_g, rig, mean_g, from_s, swing_rad, u_mean_g)
    return replace(found, reasons=("motion without a pendulum's period",))


def _estimate_without_swing(
    bins: Bins, noise_g: Array, rig: MountedHousing, mean_g: Array, from_s: float, swing_rad: float, u_mean_g: Array
) -> SwingEstimate:
    lean, mount_share_rad = _lean(mean_g, rig)
    lean_rad = float(np.arctan(np.hypot(*lean)))
    lean_u_rad = float(np.linalg.norm([max(rig.zero_g_offset_u_g[:2]), u_mean_g.max(), mount_share_rad]))
    return SwingEstimate(
        from_s=from_s,
        to_s=float(bins.time_s[-1] + bins.spread_s[-1]),
        swinging=False,
        coverage95_rad=(
            max(0.0, lean_rad - 2 * lean_u_rad - swing_rad),
            min(lean_rad + 2 * lean_u_rad + swing_rad, np.pi),
        ),
        lean_rad=lean_rad,
        lean_u_rad=lean_u_rad,
        lean_azimuth_rad=float(np.arctan2(lean[1], lean[0])),
        noise_g=(float(noise_g[0]), float(noise_g[1]), float(noise_g[2])),
    )


def _lean(mean_g: Array, rig: MountedHousing) -> tuple[Array, float]:
    """Return the side pull over the weight (2,) of the tilt that the mean shows, and its uncertainty by the mount's share."""
    mount_u_rad = rig.mount_u_rad or 0.0
    about_x_rad, about_y_rad = rig.mount_rad
    tilt = np.array([mean_g[0] / mean_g[2] - about_y_rad, mean_g[1] / mean_g[2] + about_x_rad])
    share = rig.pull_u**2 / (rig.pull_u**2 + mount_u_rad**2)
    return share * tilt, mount_u_rad * float(np.sqrt(share))


def upper_bound_amplitude(estimate: SwingEstimate, at_rest: SwingEstimate) -> SwingEstimate:
    """Return the estimate of a swing that hardly exceeds the noise: its interval includes all that a load at rest allows."""
    if estimate.coverage95_rad is None or at_rest.coverage95_rad is None:
        return estimate
    high_rad = max(estimate.coverage95_rad[1], at_rest.coverage95_rad[1])
    return replace(
        estimate,
        u_rad=max(estimate.u_rad or 0.0, high_rad / (2 * NORMAL_975)),
        coverage95_rad=(0.0, high_rad),
        reasons=(*estimate.reasons, "not significant against noise: the swing may be smaller, or none"),
    )


def likelihood_gains(result: FitResult) -> Array:
    """Return twice the gain in log-likelihood of a fit against a load at rest, shape (3,), by axis."""
    fit = result.fit
    mean_g = np.average(fit.bins.force_g, axis=0, weights=fit.bins.count)
    at_rest = (fit.weight * (fit.bins.force_g - mean_g) ** 2).sum(axis=0)
    swinging = (fit.weight * fit.residual_g**2).sum(axis=0)
    gains: Array = (at_rest - swinging) / result.uncertainty.variance_inflation
    return gains


def is_below_detection(result: FitResult) -> bool:
    """Return whether a load at rest would explain the window as well as the fit does."""
    return bool(likelihood_gains(result).sum() < MIN_GAIN)


def _excess_variance(bins: Bins, noise_g: Array) -> Array:
    """Return the variance of the bins over that by sensor noise, shape (3,), at least 1."""
    deviation_g = bins.force_g - np.average(bins.force_g, axis=0, weights=bins.count)
    normalised = deviation_g * np.sqrt(bins.count)[:, None]
    excess: Array = np.maximum((normalised**2).mean(axis=0) / noise_g**2, 1.0)
    return excess


def _expanded_u_z_g(rig: MountedHousing) -> float:
    """Return the expanded uncertainty (k = 2) of z at 1 g."""
    return 2 * (rig.zero_g_offset_u_g[2] + rig.scale_u[2])


def _possible_rho(rig: MountedHousing) -> Array:
    """Return values of rho for all lengths of the rope within their expanded uncertainty (k = 2), shape (9,)."""
    expanded = 2 * rig.length_u_rel
    lengths_m = rig.length_m * np.array([1 + expanded, max(1 - expanded, 0.1)])
    ends = [rig.rho_at(float(length_m)) for length_m in lengths_m]
    margin = 2 * rig.position_u_m / lengths_m[1]
    rho: Array = np.linspace(max(min(ends) - margin, 0.0), min(max(ends) + margin, 1.0), 9)
    return rho


def _largest_swing_rad(harmonics: Harmonics, rig: MountedHousing, excess: Array) -> float:
    """Return the smaller bound of those by the transverse axes and by the axial one, for the worst possible rho."""
    rho = _possible_rho(rig)
    u_g = BOUND_FACTOR * np.sqrt(excess) * harmonics.u_g
    bound_g = np.abs(harmonics.amplitude_g) + u_g
    by_xy = np.hypot(bound_g[0], bound_g[1]) / np.maximum(1 - rho, 1e-4)
    square = bound_g[2] / (rho / 2 + 0.25)
    mean_bound_g = abs(np.linalg.norm(harmonics.mean_g) - 1.0) + _expanded_u_z_g(rig) + u_g[2]
    size = np.maximum(mean_bound_g / np.maximum(np.abs(rho / 2 - 0.25), 1e-4), square)
    by_z = np.sqrt((square + size) / 2)
    return float(min(np.minimum(by_xy, by_z).max(), np.pi / 2))
