"""Results of the motion filter, in radians, seconds, metres and g; what is not known is None, and `reasons` say why."""

import math
from dataclasses import dataclass, replace
from typing import Literal

from gateway.messages.header import Reason

MotionState = Literal["rest", "free", "driven", "hoisting", "wind", "unknown"]
"""What the crane or the load does: the load rests or swings freely, the pivot accelerates, the rope's length changes, a gust
pushes the load; unknown: nothing can be said."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PeakEstimate:
    """A maximum of the rope's angle."""

    angle_rad: float
    u_rad: float
    in_s: float
    """Time from the estimate to the maximum; negative for a past one."""

    def upper_rad(self, coverage_factor: float) -> float:
        """Return the upper end of the coverage interval."""
        return self.angle_rad + coverage_factor * self.u_rad


@dataclass(frozen=True, slots=True, kw_only=True)
class FastOscillationShare:
    """A fast oscillation on top of the swing and what it does to the rope's angle."""

    frequency_hz: float
    reading_g: float
    """Amplitude in the transverse reading."""
    angle_rad: float
    """Amplitude of its share in the rope's angle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionEstimate:
    """The rope's motion at one time."""

    time_s: float
    state: MotionState
    angle_rad: float | None = None
    """Angle between rope and vertical."""
    u_rad: float | None = None
    azimuth_rad: float | None = None
    """Side to which the load hangs, in the housing frame, from x towards y."""
    rate_rad_s: float | None = None
    """Time derivative of the angle."""
    pivot_acceleration_m_s2: tuple[float, float] | None = None
    """Horizontal acceleration of the pivot, in the housing frame."""
    pivot_acceleration_u_m_s2: float | None = None
    push: float | None = None
    """Horizontal force of a gust on the load, over the weight."""
    push_u: float | None = None
    hoist_m_s: float | None = None
    """Rate of the rope's length, lowering positive."""
    hoist_u_m_s: float | None = None
    probabilities: tuple[float, ...] = ()
    """Of the hypotheses, in the order of `gateway.motion.hypotheses`."""
    next_peak: PeakEstimate | None = None
    """The largest angle of the next whole swing if the pivot keeps its present acceleration, and a gust its force."""
    next_peak_if_coasting: PeakEstimate | None = None
    """The same if both end now."""
    last_peak: PeakEstimate | None = None
    """The largest angle of the last period."""
    amplitude_rad: float | None = None
    """Semi-major axis of the swing about the lean if nothing acts from now on."""
    minor_amplitude_rad: float | None = None
    major_azimuth_rad: float | None = None
    """Direction of the major axis, in (-pi/2, pi/2]."""
    lean_rad: float | None = None
    lean_u_rad: float | None = None
    lean_azimuth_rad: float | None = None
    period_s: float | None = None
    """Of a small swing on the present rope."""
    length_m: float | None = None
    length_u_m: float | None = None
    fast_oscillation: FastOscillationShare | None = None
    mount_rad: float | None = None
    """Angle between the housing's z axis and the rope."""
    mount_u_rad: float | None = None
    reasons: tuple[Reason, ...] = ()

    @property
    def expected_peak(self) -> PeakEstimate | None:
        """The next maximum halfway between a pivot or gust that goes on and one that ends now: nobody knows which it does.

        Any maximum between both is as likely, and the uncertainty has that distribution in it (GUM 4.3.7, rectangular). What
        begins anew is in neither. Decisions rest on it. Basis: with the larger of both, 1.4 times as many trips on simulated
        cranes are without cause.
        """
        kept, coasting = self.next_peak, self.next_peak_if_coasting
        if kept is None or coasting is None:
            return kept or coasting
        larger = max(kept, coasting, key=lambda peak: peak.angle_rad)
        return replace(
            larger,
            angle_rad=(kept.angle_rad + coasting.angle_rad) / 2,
            u_rad=math.hypot((kept.u_rad + coasting.u_rad) / 2, (kept.angle_rad - coasting.angle_rad) / math.sqrt(12)),
        )
