"""The share of a fast oscillation in the rope's angle and in the reading."""

import math

from gateway.motion.estimate import FastOscillationShare
from gateway.motion.peaks import ellipse
from gateway.motion.state_vector import LINE, LINE_RATE, LN_LENGTH
from gateway.swing.rig import MountedHousing


def oscillation_share(rig: MountedHousing, line_rate_1_s: float | None, x: list[float]) -> FastOscillationShare | None:
    """Return the share by the mean state; `line_rate_1_s`: its angular frequency, None where there is none."""
    if line_rate_1_s is None:
        return None
    amplitude, _, _ = ellipse(complex(*x[LINE]), complex(*x[LINE_RATE]) / line_rate_1_s)
    length_m = math.exp(x[LN_LENGTH])
    rate_1_s = math.sqrt(rig.gravity_m_s2 / length_m)
    return FastOscillationShare(
        frequency_hz=line_rate_1_s / (2 * math.pi),
        reading_g=rig.position_at(length_m) / length_m * amplitude,
        angle_rad=amplitude * (rate_1_s / line_rate_1_s) ** 2,
    )
