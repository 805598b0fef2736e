"""The motion of the rope over a whole recording: at each time from the readings before and after it."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.motion.binning import ForceBin
from gateway.motion.estimate import MotionState
from gateway.motion.filter_history import (
    KEPT_GRAVITY,
    KEPT_HOIST_SPEED,
    KEPT_INPUT,
    KEPT_LN_LENGTH,
    KEPT_RATE,
    KEPT_SIDE_FORCE,
    FilterHistory,
    MixtureSeries,
    stack,
)
from gateway.motion.gyro_reading import GyroPrior
from gateway.motion.history import MotionHistory
from gateway.motion.hypotheses import IS_DRIVEN, IS_GUST, IS_HOISTING, PIVOT_SIGN
from gateway.motion.motion_state import LIKELY, REST_RAD, SIGNIFICANT, SLOWEST_HOIST_M_S
from gateway.motion.motion_tracker import LARGEST_U_RAD, LONGEST_GAP_S
from gateway.motion.recording_bins import bin_recording
from gateway.motion.rope_model import LARGEST_ANGLE_RAD
from gateway.motion.two_filter import combine, evidence_gain
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.swing.model.sensor_lowpass import delay_s
from gateway.swing.rig import MountedHousing

LONGEST_GAP_PERIODS = 8.0
"""A longer gap divides the recording: beyond it the phase of the swing is not known."""
BLOCK_BINS, LOOKAHEAD_BINS = 3000, 900
"""Bins that are smoothed at once, and later ones from which the backward run begins. Basis: bounds the memory; what comes more
than some periods later tells nothing about the motion."""
SETTLING_BINS = 300
"""First bins that are run through forward and backward before the smoothing."""
COMBINED_BINS = 200
"""Bins whose forward and backward states are combined at once. Basis: bounds the memory."""


def smooth_motion(
    time_s: Array,
    force_g: Array,
    rig: MountedHousing,
    mount_u_rad: float,
    noise_g: float | None = None,
    is_clipped: NDArray[np.bool_] | None = None,
    rate_rad_s: Array | None = None,
    gyro: GyroPrior | None = None,
) -> MotionHistory:
    """Return the motion over a recording.

    `time_s`, shape (n,), rising; `force_g`, shape (n, 3): specific force in the housing frame. Rows with NaN are left out.
    `mount_u_rad`: standard uncertainty of the housing's z axis against the rope; `noise_g`: stated, 1 sigma per sample.
    `rate_rad_s`, shape (n, 3): angular rates in the housing frame, NaN where a sample has none; `gyro`: what is known of the
    gyroscope; None without one.
    """
    is_usable = np.isfinite(force_g).all(axis=1)
    clipped = np.zeros(len(time_s), dtype=bool) if is_clipped is None else is_clipped
    time_s, force_g, clipped = time_s[is_usable] - delay_s(rig.bandwidth_hz), force_g[is_usable], clipped[is_usable]
    longest_gap_s = min(LONGEST_GAP_PERIODS * rig.small_swing_period_s, LONGEST_GAP_S)
    bounds = [0, *(np.flatnonzero(np.diff(time_s) > longest_gap_s) + 1).tolist(), len(time_s)]
    histories = []
    for start, stop in pairwise(bounds):
        smoother = _Smoother(rig, mount_u_rad, noise_g, gyro)
        rates = None if rate_rad_s is None or gyro is None else rate_rad_s[is_usable][start:stop]
        histories += smoother.smooth(time_s[start:stop], force_g[start:stop], clipped[start:stop], rates)
    return MotionHistory.join(histories)


class _Smoother:
    """Smooths a recording without long gaps, block by block."""

    def __init__(
        self, rig: MountedHousing, mount_u_rad: float, noise_g: float | None, gyro: GyroPrior | None = None
    ) -> None:
        self._rig, self._mount_u_rad, self._noise_g, self._gyro = rig, mount_u_rad, noise_g, gyro
        self._forward = self._new_run()

    def smooth(
        self, time_s: Array, force_g: Array, is_clipped: NDArray[np.bool_], rate_rad_s: Array | None = None
    ) -> list[MotionHistory]:
        bins = bin_recording(time_s, force_g, is_clipped, self._forward.bin_s, rate_rad_s)
        self._forward = self._settled_run(bins[:SETTLING_BINS])
        histories, done = [], 0
        for taken, one in enumerate(bins, start=1):
            self._forward.take(one)
            if taken - done == BLOCK_BINS + LOOKAHEAD_BINS or taken == len(bins):
                end = taken if taken == len(bins) else done + BLOCK_BINS
                histories.append(self._smooth_block(bins[done:taken], end - done, done))
                del self._forward.mixtures[: end - done], self._forward.log_evidence[: end - done]
                done = end
        return histories

    def _new_run(self, *, is_backward: bool = False, turned: FilterHistory | None = None) -> FilterHistory:
        return FilterHistory(
            self._rig,
            mount_u_rad=self._mount_u_rad,
            noise_g=self._noise_g,
            gyro=self._gyro,
            is_backward=is_backward,
            turned=turned,
        )

    def _settled_run(self, bins: list[ForceBin]) -> FilterHistory:
        """Return a run that knows at its first bin what the first ones say; the errors of a cold start are gone then."""
        forward = self._new_run()
        for one in bins:
            forward.take(one)
        backward = self._new_run(is_backward=True, turned=forward)
        for one in reversed(bins):
            backward.take(one)
        return self._new_run(turned=backward)

    def _smooth_block(self, bins: list[ForceBin], count: int, bins_before: int) -> MotionHistory:
        """Return the motion at the first bins of a block from all of them and those before the block."""
        backward = self._new_run(is_backward=True, turned=self._forward)
        for one in reversed(bins):
            backward.take(one)
        time_s = np.array([one.time_s for one in bins])
        later = backward.mixtures[::-1]
        gain = evidence_gain(np.array(self._forward.log_evidence), np.array(backward.log_evidence[::-1]))
        histories = []
        for begin in range(0, count, COMBINED_BINS):
            end = min(begin + COMBINED_BINS, count)
            place = np.arange(begin, end, dtype=np.float64)
            series = combine(
                stack(self._forward.mixtures[begin:end]),
                stack(later[begin:end]),
                self._forward.prior(),
                bins_before + place + 1,
                len(bins) - place,
                gain[begin:end],
            )
            histories.append(_describe(time_s[begin:end], series, self._rig))
        return MotionHistory.join(histories)


def _describe(time_s: Array, series: MixtureSeries, rig: MountedHousing) -> MotionHistory:
    mean, covariance = _moments(series)
    u, w = mean[:, KEPT_GRAVITY], mean[:, KEPT_RATE]
    sine = np.minimum(np.hypot(u[:, 0], u[:, 1]), 1.0)
    towards = u / np.maximum(sine, 1e-9)[:, None]
    angle_rad, u_rad = np.arcsin(sine), _angle_u_rad(sine, towards, covariance[:, KEPT_GRAVITY, KEPT_GRAVITY])
    is_known = (u_rad < LARGEST_U_RAD) & (angle_rad + NORMAL_975 * u_rad < LARGEST_ANGLE_RAD)

    def known(values: Array) -> Array:
        found: Array = np.where(is_known, values, np.nan)
        return found

    pivot_u = np.sqrt(0.5 * np.trace(covariance[:, KEPT_INPUT, KEPT_INPUT], axis1=1, axis2=2))
    length_m = np.exp(mean[:, KEPT_LN_LENGTH])
    return MotionHistory(
        time_s=time_s,
        angle_rad=known(angle_rad),
        u_rad=known(u_rad),
        azimuth_rad=known(np.arctan2(-u[:, 1], -u[:, 0])),
        rate_rad_s=known(-(towards * w).sum(axis=1)),
        pivot_acceleration_m_s2=mean[:, KEPT_INPUT] * rig.gravity_m_s2,
        pivot_acceleration_u_m_s2=pivot_u * rig.gravity_m_s2,
        hoist_m_s=mean[:, KEPT_HOIST_SPEED],
        hoist_u_m_s=np.sqrt(covariance[:, KEPT_HOIST_SPEED, KEPT_HOIST_SPEED]),
        length_m=length_m,
        length_u_m=length_m * np.sqrt(covariance[:, KEPT_LN_LENGTH, KEPT_LN_LENGTH]),
        probabilities=series.weight,
        state=_states(series.weight, mean, covariance, is_known, np.sqrt(rig.gravity_m_s2 / length_m)),
    )


def _moments(series: MixtureSeries) -> tuple[Array, Array]:
    """Return mean and covariance over the hypotheses, the input being the pivot's acceleration, shapes (n, k) and (n, k, k)."""
    k = series.state.shape[-1]
    factor = np.ones((len(PIVOT_SIGN), k))
    factor[:, KEPT_INPUT] = PIVOT_SIGN[:, None]
    state = series.state * factor
    mean = np.einsum("nm,nmi->ni", series.weight, state)
    deviation = state - mean[:, None]
    covariance = np.einsum("nm,nmij->nij", series.weight, series.covariance * factor[:, :, None] * factor[:, None, :])
    return mean, covariance + np.einsum("nm,nmi,nmj->nij", series.weight, deviation, deviation)


def _angle_u_rad(sine: Array, towards: Array, covariance: Array) -> Array:
    """Return the angle's standard uncertainty: along the direction of the angle, or where that is not known the total."""
    along = np.einsum("ni,nij,nj->n", towards, covariance, towards)
    total = np.trace(covariance, axis1=1, axis2=2)
    share = sine**2 / (sine**2 + total)
    found: Array = np.sqrt(share * along + (1 - share) * total)
    return found


def _states(
    weight: Array, mean: Array, covariance: Array, is_known: NDArray[np.bool_], rate_1_s: Array
) -> tuple[MotionState, ...]:
    """Return what crane and load do at each bin, by the rules of the live tracker."""
    speed_m_s, speed_u_m_s = mean[:, KEPT_HOIST_SPEED], np.sqrt(covariance[:, KEPT_HOIST_SPEED, KEPT_HOIST_SPEED])
    hoists = np.abs(speed_m_s) > np.maximum(SIGNIFICANT * speed_u_m_s, SLOWEST_HOIST_M_S)
    displacement = mean[:, KEPT_GRAVITY] + mean[:, KEPT_SIDE_FORCE]
    speed = mean[:, KEPT_RATE] / rate_1_s[:, None]
    first, second = displacement @ [1, 1j], speed @ [1, 1j]
    amplitude = 0.5 * (np.abs(first - 1j * second) + np.abs(first + 1j * second))
    u_amplitude = np.sqrt(np.trace(covariance[:, KEPT_GRAVITY, KEPT_GRAVITY], axis1=1, axis2=2))
    named = np.select(
        [
            ~is_known,
            weight[:, IS_DRIVEN].sum(axis=1) > LIKELY,
            (weight[:, IS_HOISTING].sum(axis=1) > LIKELY) & hoists,
            weight[:, IS_GUST].sum(axis=1) > LIKELY,
            amplitude < np.maximum(REST_RAD, SIGNIFICANT * u_amplitude),
        ],
        ["unknown", "driven", "hoisting", "wind", "rest"],
        "free",
    )
    states: tuple[MotionState, ...] = tuple(named.tolist())
    return states
