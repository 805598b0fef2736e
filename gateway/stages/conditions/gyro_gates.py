"""The gates on angular rates, which show rotations of the housing that no force shows.

A load at rest does not rotate. In a free swing the housing rotates transversely to the rope no faster than the rope does, |n'|
<= w0 phi_max at the lowest point, and not at all about the rope, because of parallel transport.
"""

import numpy as np

from gateway.numerics.array import Array

ZERO_RATE_RAD_S = np.radians(2.0)
"""Largest reading of a usual gyroscope at rest. Basis: a choice; zero-rate outputs are compensated at rest, and a hand turns a
housing faster."""
RATE_MARGIN = 1.2
"""The housing may turn this many times faster than the rope at its fastest. Basis: a choice; the amplitude is an upper 95 % end,
and the rope's length is stated within some per cent."""


def turning_gates(rate_rad_s: Array, phi_max_rad: float | None, period_s: float | None) -> dict[str, bool]:
    """Return the gates on mean angular rates in the housing frame, shape (n, 3), of one window; true: passed.

    `phi_max_rad` and `period_s` are those of the swing, None where no swing is known.
    """
    across_rad_s = float(np.hypot(rate_rad_s[:, 0], rate_rad_s[:, 1]).max())
    along_rad_s = float(np.abs(rate_rad_s[:, 2]).max())
    gates = {
        "not_turning": max(across_rad_s, along_rad_s) < ZERO_RATE_RAD_S,
        "no_spin": along_rad_s < ZERO_RATE_RAD_S,
    }
    if phi_max_rad is not None and period_s is not None:
        fastest_rad_s = 2 * np.pi / period_s * phi_max_rad
        gates["rate_pendulum"] = across_rad_s < RATE_MARGIN * fastest_rad_s + ZERO_RATE_RAD_S
    return gates
