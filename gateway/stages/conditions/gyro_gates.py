"""What a gyroscope adds to the condition: how the housing turns, which forces alone do not show.

A load at rest turns about nothing. On a free swing the housing turns across the rope no faster than the rope does,
|n'| <= w0 phi_max at the lowest point, and not at all about the rope: it is carried along by parallel transport.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ZERO_RATE_RAD_S = np.radians(2.0)
"""What a usual gyroscope reads of no turning at all."""
FASTER = 1.2
"""Times the rope's largest rate, before the housing turns faster than its swing."""


def turning_gates(rate_rad_s: Array, phi_max_rad: float | None, period_s: float | None) -> dict[str, bool]:
    """Gates on mean angular rates in the housing frame, shape (n, 3), of one window; true where met.

    `phi_max_rad` and `period_s` are the swing's, None where no swing is known.
    """
    across_rad_s = float(np.hypot(rate_rad_s[:, 0], rate_rad_s[:, 1]).max())
    along_rad_s = float(np.abs(rate_rad_s[:, 2]).max())
    gates = {
        "not_turning": max(across_rad_s, along_rad_s) < ZERO_RATE_RAD_S,
        "no_spin": along_rad_s < ZERO_RATE_RAD_S,
    }
    if phi_max_rad is not None and period_s is not None:
        fastest_rad_s = 2 * np.pi / period_s * phi_max_rad
        gates["rate_pendulum"] = across_rad_s < FASTER * fastest_rad_s + ZERO_RATE_RAD_S
    return gates
