"""Initial guess of a rope's mass from the ringing of its string mode."""

import numpy as np

from devices.pendulum.heavy_rope import HeavyRope
from devices.pendulum.small_swing import small_swing_rate_1_s
from gateway.numerics.spectrum import find_strongest_line, fit_sine_phasors
from gateway.twin.effects.guess_context import GuessContext

STRING_BAND = (4.5, 40.0)
"""Range of the string mode over the swing, above its strong harmonics. Basis: ropes of 0.6 and 0.007 of the load's mass."""
MAX_STRING_HZ = 8.0
RINGING_S = 20.0
"""Part of the recording in which the string mode is searched. Basis: a choice; it dies away in some seconds."""
MIN_STRING_POWER = 60.0
"""Power of the string mode's line over the noise floor around it."""
MAX_REMAINING = 0.6
"""Amplitude of the line in the last part of the recording over that in the first. Basis: a choice; above it is no free
vibration."""
MAX_MASS_RATIO = 1.5


def guess_mass_ratio(context: GuessContext) -> float | None:
    """Return the rope's mass over the load's that gives the string mode the frequency of the line that dies away."""
    across = context.residual_g * [1.0, 1.0, 0.0] / context.noise_g
    early, late = context.time_s < RINGING_S, context.time_s > context.duration_s - RINGING_S
    nominal_hz = small_swing_rate_1_s(context.length_m, context.gravity_m_s2) / (2 * np.pi)
    from_hz, to_hz = (each * nominal_hz for each in STRING_BAND)
    line = find_strongest_line(context.time_s[early], across[early], from_hz, min(to_hz, MAX_STRING_HZ))
    if line is None or float(line.power[:2].sum()) < MIN_STRING_POWER:
        return None
    first, last = (
        float(np.linalg.norm(fit_sine_phasors(context.time_s[part], across[part], line.frequency_hz)))
        for part in (early, late)
    )
    if last > MAX_REMAINING * first:
        return None
    ratio = 0.0
    for _ in range(20):  # the mode's rate times the root of the ratio is constant, but for a few per cent
        rope = HeavyRope(context.length_m, 0.0, max(ratio, 1e-3), 0.0, context.gravity_m_s2)
        ratio = rope.mass_ratio * (rope.string_rate / (2 * np.pi * line.frequency_hz)) ** 2
    return ratio if ratio < MAX_MASS_RATIO else None
