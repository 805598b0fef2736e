"""How well a sensor measures small relative angles: what of its calibration enters, and what cancels.

An offset of the inward axis cancels in a difference. Scale factors of the inward and of the vertical axis, and the zero-g offset
of the vertical axis, multiply the angle (Zhu et al. 2020, eq. 10 and 11).
"""

import math

from gateway.calibration.correction import Correction
from gateway.calibration.record import CalibrationRecord
from gateway.numerics.array import Array

UNKNOWN_RELATIVE_U = 0.03
"""Relative standard uncertainty of an angle of a sensor without a calibration."""


def relative_u(u_zero_g_offset_g: Array, u_scale_factor: Array, inward: int, vertical: int = 2) -> float:
    """Return the relative standard uncertainty of a relative angle from the uncertainties by axis, shape (3,)."""
    return math.hypot(
        float(u_zero_g_offset_g[vertical]), float(u_scale_factor[inward]), float(u_scale_factor[vertical])
    )


def relative_u_of_correction(correction: Correction | None, recorded_error_g: float, inward: int) -> float:
    """Return it for a recording: by its correction, or by the permissible error of readings in g of unknown origin."""
    if correction is None:
        return recorded_error_g / math.sqrt(3)
    return relative_u(correction.u_zero_g_offset_g, correction.u_scale_factor, inward)


def relative_u_of_record(record: CalibrationRecord | None, inward: int) -> float:
    """Return it for the record in force of a live gateway; the axes map only changes the order of alike axes."""
    if record is None:
        return UNKNOWN_RELATIVE_U
    return relative_u(record.u_zero_g_offset_g, record.u_scale_factor, inward)
