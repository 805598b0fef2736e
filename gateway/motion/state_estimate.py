"""The motion in the words of an estimate, from mean and covariance of the state; live and over a recording by the same rules."""

import cmath
import math
from dataclasses import dataclass

import numpy as np

from gateway.motion.description import motion_state
from gateway.motion.estimate import FastOscillationShare, MotionEstimate, PeakEstimate
from gateway.motion.peaks import SwingPhase, ellipse, next_peak
from gateway.motion.rope_model import LARGEST_ANGLE_RAD
from gateway.motion.state_vector import (
    GRAVITY,
    GUST,
    HOIST_SPEED,
    LINE,
    LINE_RATE,
    LN_LENGTH,
    MOUNT,
    N_STATES,
    PIVOT,
    RATE,
    SIDE_FORCE,
    STIFFNESS,
)
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975

LARGEST_U_RAD = math.radians(5.0)
"""Standard uncertainty from which on an angle counts as not known."""
SMALLEST_SHARE_RAD = math.radians(0.01)
"""Share of a fast oscillation in the rope's angle from which on it is named. Basis: a drive's jerk has less."""


@dataclass(frozen=True, slots=True)
class Described:
    """The state over all hypotheses and candidates at one time."""

    mean: Array
    """Shape (n,)."""
    covariance: Array
    """Shape (n, n)."""
    weight: Array
    """Of the hypotheses, shape (m,)."""
    line_rate_1_s: float | None = None
    """Angular frequency of the fast oscillation; None: there is none."""


@dataclass(frozen=True, slots=True)
class Angle:
    """The rope's angle, rad, with its standard uncertainty."""

    angle_rad: float
    u_rad: float
    direction: complex
    """Unit vector of gravity's transverse component."""

    @property
    def is_known(self) -> bool:
        """Whether the interval is narrow enough and within the equations."""
        return self.u_rad < LARGEST_U_RAD and self.angle_rad + NORMAL_975 * self.u_rad < LARGEST_ANGLE_RAD

    @classmethod
    def of(cls, u: complex, covariance: Array) -> "Angle":
        """Return the angle for gravity's transverse component with its covariance, shape (2, 2)."""
        sine = min(abs(u), 1.0)
        direction = u / max(sine, 1e-9)
        x, y = direction.real, direction.imag
        (xx, xy), (_, yy) = covariance.tolist()
        along, total = xx * x * x + 2 * xy * x * y + yy * y * y, xx + yy
        share = sine**2 / (sine**2 + total)
        return cls(math.asin(sine), math.sqrt(max(share * along + (1 - share) * total, 0.0)), direction)


def swing_phase(state: Described, gravity_m_s2: float, ahead_s: float, *, gust_lasts: bool = True) -> SwingPhase:
    """Return the motion at a time after that of the state: a harmonic swing about where pivot and forces let the load hang.

    `gust_lasts`: the force from that time on has the present gust in it, else the steady wind alone.
    """
    rate_1_s = math.sqrt(gravity_m_s2 / math.exp(state.mean[LN_LENGTH]))
    cosine, sine = math.cos(rate_1_s * ahead_s), math.sin(rate_1_s * ahead_s)
    carry = np.zeros((4, 2, N_STATES))
    for i, sign in ((PIVOT, 1.0), (GUST, -1.0), (SIDE_FORCE, -1.0)):
        carry[0, :, i], carry[1, :, i] = sign * (1 - cosine) * _PAIR, -sign * rate_1_s * sine * _PAIR
    carry[0, :, GRAVITY], carry[0, :, RATE] = cosine * _PAIR, -sine / rate_1_s * _PAIR
    carry[1, :, GRAVITY], carry[1, :, RATE] = rate_1_s * sine * _PAIR, cosine * _PAIR
    carry[2, :, SIDE_FORCE] = carry[3, :, PIVOT] = _PAIR
    if gust_lasts:
        carry[2, :, GUST] = _PAIR
    transition = carry.reshape(8, N_STATES)
    covariance = state.covariance[:N_STATES, :N_STATES]
    return SwingPhase(transition @ state.mean[:N_STATES], transition @ covariance @ transition.T, rate_1_s)


def describe(
    state: Described, gravity_m_s2: float, now_s: float, ahead_s: float, largest: PeakEstimate | None
) -> MotionEstimate:
    """Return the motion `ahead_s` after the state's time, at `now_s`; `largest`: angle of the last period so far."""
    mean, g = state.mean.tolist(), gravity_m_s2
    sigma = np.sqrt(np.diagonal(state.covariance)).tolist()
    phase = swing_phase(state, g, ahead_s)
    u, w, pushing, pivot = (complex(x, y) for x, y in phase.mean.reshape(4, 2).tolist())
    side, length_m = complex(*mean[SIDE_FORCE]), math.exp(mean[LN_LENGTH])
    angle = Angle.of(u, phase.covariance[:2, :2])
    total = float(np.trace(phase.covariance[:2, :2]))
    major, minor, direction = ellipse(u + pushing, -w / phase.rate_1_s)
    known = angle.is_known
    now = PeakEstimate(angle_rad=angle.angle_rad, u_rad=angle.u_rad, in_s=0.0)
    if largest is None or largest.angle_rad < now.angle_rad:
        largest = now
    return MotionEstimate(
        time_s=now_s,
        state=motion_state(state.weight, major, math.sqrt(total), mean[HOIST_SPEED], sigma[HOIST_SPEED])
        if known
        else "unknown",
        angle_rad=angle.angle_rad if known else None,
        u_rad=angle.u_rad if known else None,
        azimuth_rad=cmath.phase(-u) if known else None,
        rate_rad_s=-(angle.direction * w.conjugate()).real if known else None,
        pivot_acceleration_m_s2=(pivot.real * g, pivot.imag * g),
        pivot_acceleration_u_m_s2=math.hypot(*sigma[PIVOT]) / math.sqrt(2) * g,
        push=abs(pushing),
        push_u=math.hypot(*sigma[GUST]) / math.sqrt(2),
        hoist_m_s=mean[HOIST_SPEED],
        hoist_u_m_s=sigma[HOIST_SPEED],
        probabilities=tuple(state.weight.tolist()),
        next_peak=next_peak(phase, is_driven=True) if known else None,
        next_peak_if_coasting=next_peak(swing_phase(state, g, ahead_s, gust_lasts=False), is_driven=False)
        if known
        else None,
        last_peak=largest if known else None,
        amplitude_rad=2 * math.asin(min(major / 2, 1.0)),
        minor_amplitude_rad=2 * math.asin(min(minor / 2, 1.0)),
        major_azimuth_rad=direction,
        lean_rad=math.asin(min(abs(side), 1.0)),
        lean_u_rad=math.hypot(*sigma[SIDE_FORCE]) / math.sqrt(2),
        lean_azimuth_rad=cmath.phase(side),
        period_s=2 * math.pi / (phase.rate_1_s * math.sqrt(1 + _stiffness_along(mean[STIFFNESS], direction))),
        length_m=length_m,
        length_u_m=length_m * sigma[LN_LENGTH],
        fast_oscillation=_fast_oscillation(state, phase.rate_1_s),
        mount_rad=math.hypot(*mean[MOUNT]),
        mount_u_rad=math.hypot(*sigma[MOUNT]) / math.sqrt(2),
    )


def _stiffness_along(difference: list[float], azimuth_rad: float) -> float:
    """Return the relative difference of the stiffness in a direction: what a planar swing cannot tell from a shorter rope."""
    along, diagonal = difference
    return along * math.cos(2 * azimuth_rad) + diagonal * math.sin(2 * azimuth_rad)


def _fast_oscillation(state: Described, swing_rate_1_s: float) -> FastOscillationShare | None:
    """Return the oscillation with the share that it has in the angle if a force on the load causes it."""
    omega = state.line_rate_1_s
    if omega is None:
        return None
    amplitude_g, _, _ = ellipse(complex(*state.mean[LINE]), complex(*state.mean[LINE_RATE]) / omega)
    angle_rad = amplitude_g * (swing_rate_1_s / omega) ** 2
    if angle_rad < SMALLEST_SHARE_RAD:
        return None
    return FastOscillationShare(frequency_hz=omega / (2 * math.pi), reading_g=amplitude_g, angle_rad=angle_rad)


_PAIR = np.eye(2)
