"""When no swing can be seen: how large one could be all the same."""

from dataclasses import replace

import numpy as np

from gateway.numerics.stats import NORMAL_975
from gateway.swing.data.bins import Bins
from gateway.swing.estimate import SwingEstimate
from gateway.swing.estimation.robust_fit import FitResult
from gateway.swing.fit.initial_guess import Harmonics
from gateway.swing.model.spherical_pendulum import Real
from gateway.swing.rig import MountedHousing

FAINTEST_GAIN = 40.0
"""Twice the log-likelihood that harmonics must gain to be called a swing: once in some 10^5 still windows noise does."""
WORTH_A_FIT = 9.0
"""The same of the axial force alone, from which on a pendulum is tried on a whole recording."""
FAINTEST_AXIAL_GAIN = 11.5
"""What the pendulum must then gain in the axial force: at rest with the housing at the load noise does twice in a thousand.

Between this and `FAINTEST_GAIN` the answer is an angle that may as well be smaller, down to none.
"""
BOUND_FACTOR = 2.5
"""Standard uncertainties added to an amplitude for its upper bound (of an ellipse, over all frequencies searched)."""
RESTLESS = 0.5
"""Unexplained by harmonics, rms over rms, from which on a small movement is not a swing."""
LARGEST_RESTLESS_RAD = np.radians(1.0)


def at_rest_estimate(
    bins: Bins, noise_g: Real, rig: MountedHousing, harmonics: Harmonics, from_s: float
) -> SwingEstimate:
    """The answer that nothing swings, with the lean and an upper bound of the rope's angle."""
    wander = _wander(bins, noise_g)
    swing_rad = _largest_swing_rad(harmonics, rig, wander)
    return _still(bins, noise_g, rig, harmonics.mean_g, from_s, swing_rad, np.sqrt(wander[:2]) * harmonics.u_g[:2])


def irregular_motion_estimate(bins: Bins, noise_g: Real, rig: MountedHousing, from_s: float) -> SwingEstimate | None:
    """The same for a rope that moves, though not as a load swings, where no instant shows more than a small angle; else None.

    A load that is driven reads more than its angle, so what any one bin departs from the mean bounds the angle.
    """
    mean_g = np.average(bins.force_g, axis=0, weights=bins.count)
    away_g = bins.force_g - mean_g
    rho = _possible_rho(rig)
    across = np.hypot(away_g[:, 0], away_g[:, 1]).max() / np.maximum(1 - rho, 1e-4)
    doubt_g = _doubt_of_z_g(rig)
    high_g, low_g = bins.force_g[:, 2].max() - 1 + doubt_g, 1 - bins.force_g[:, 2].min() + doubt_g
    along = np.sqrt(np.maximum(2 * low_g, high_g / np.maximum(rho, 1e-4)).clip(min=0.0))
    swing_rad = float(np.minimum(across, along).max())
    if swing_rad > LARGEST_RESTLESS_RAD:
        return None
    still = _still(bins, noise_g, rig, mean_g, from_s, swing_rad, away_g[:, :2].std(axis=0))
    return replace(still, reasons=("the rope moves, but not as a load swings",))


def _still(
    bins: Bins, noise_g: Real, rig: MountedHousing, mean_g: Real, from_s: float, swing_rad: float, u_mean_g: Real
) -> SwingEstimate:
    lean_rad = float(np.arctan2(np.hypot(mean_g[0], mean_g[1]), mean_g[2]))
    lean_u_rad = float(np.hypot(max(rig.zero_g_offset_u_g[:2]), u_mean_g.max()))
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
        lean_azimuth_rad=float(np.arctan2(mean_g[1], mean_g[0])),
        noise_g=(float(noise_g[0]), float(noise_g[1]), float(noise_g[2])),
    )


def upper_bound_amplitude(estimate: SwingEstimate, still: SwingEstimate) -> SwingEstimate:
    """A swing that hardly shows in the noise: its interval holds everything that standing still leaves possible too."""
    if estimate.coverage95_rad is None or still.coverage95_rad is None:
        return estimate
    high_rad = max(estimate.coverage95_rad[1], still.coverage95_rad[1])
    return replace(
        estimate,
        u_rad=max(estimate.u_rad or 0.0, high_rad / (2 * NORMAL_975)),
        coverage95_rad=(0.0, high_rad),
        reasons=(*estimate.reasons, "hardly told from noise: it may as well be smaller, down to none"),
    )


def gains(finding: FitResult) -> Real:
    """Twice the log-likelihood that the fit gains against standing still, shape (3,): by axis."""
    fit = finding.fit
    mean_g = np.average(fit.bins.force_g, axis=0, weights=fit.bins.count)
    still = (fit.weight * (fit.bins.force_g - mean_g) ** 2).sum(axis=0)
    swinging = (fit.weight * fit.residual_g**2).sum(axis=0)
    gained: Real = (still - swinging) / finding.claim.inflation
    return gained


def is_below_detection(finding: FitResult) -> bool:
    """Standing still would explain the window as well as the fit does."""
    return bool(gains(finding).sum() < FAINTEST_GAIN)


def _wander(bins: Bins, noise_g: Real) -> Real:
    """Variance of the bins over that of sensor noise, shape (3,), at least 1."""
    normalised = (bins.force_g - np.average(bins.force_g, axis=0, weights=bins.count)) * np.sqrt(bins.count)[:, None]
    wander: Real = np.maximum((normalised**2).mean(axis=0) / noise_g**2, 1.0)
    return wander


def _doubt_of_z_g(rig: MountedHousing) -> float:
    """By which z may be off at 1 g, two standard uncertainties."""
    return 2 * (rig.zero_g_offset_u_g[2] + rig.scale_u[2])


def _possible_rho(rig: MountedHousing) -> Real:
    """The housing's place over the rope's length, for every length that is believed possible."""
    doubt = 2 * rig.length_u_rel
    lengths_m = rig.length_m * np.array([1 + doubt, max(1 - doubt, 0.1)])
    ends = [rig.rho_at(float(length_m)) for length_m in lengths_m]
    slack = 2 * rig.position_u_m / lengths_m[1]
    rho: Real = np.linspace(max(min(ends) - slack, 0.0), min(max(ends) + slack, 1.0), 9)
    return rho


def _largest_swing_rad(harmonics: Harmonics, rig: MountedHousing, wander: Real) -> float:
    """The lesser of what the transverse axes and the axial one leave possible, for every rho that is believed possible."""
    rho = _possible_rho(rig)
    u_g = BOUND_FACTOR * np.sqrt(wander) * harmonics.u_g
    seen_g = np.abs(harmonics.amplitude_g) + u_g
    across = np.hypot(seen_g[0], seen_g[1]) / np.maximum(1 - rho, 1e-4)
    square = seen_g[2] / (rho / 2 + 0.25)
    mean_doubt_g = abs(np.linalg.norm(harmonics.mean_g) - 1.0) + _doubt_of_z_g(rig) + u_g[2]
    size = np.maximum(mean_doubt_g / np.maximum(np.abs(rho / 2 - 0.25), 1e-4), square)
    along = np.sqrt((square + size) / 2)
    return float(min(np.minimum(across, along).max(), np.pi / 2))
