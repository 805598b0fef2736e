"""The mounted housing as the estimator sees it, from the configuration and the calibration."""

import math
from dataclasses import replace

from gateway.calibration.correction import Correction
from gateway.configuration.model import Configuration
from gateway.swing.rig import MountedHousing

POSITION_U_M = 0.05
"""Standard uncertainty of the housing's position on the rope, measured with a tape. Basis: a choice; a tape measures to
millimetres, and the middle of a load is known to centimetres."""

MOUNT_U_RAD = 0.01
"""Standard uncertainty of the angle between the housing's z axis and the rope, clamped by eye, for the offline fit. Basis: by eye
an edge is parallel to a rope within one degree, uniformly distributed."""

SHORTEST_ROPE = 1.02
"""Shortest rope over the housing's distance above the load: the distance is measured, the rope's length is a belief. Basis: a
choice; above the error of the tape on a long rope, and below any rope that hangs above its housing."""


def mounted_housing(
    configuration: Configuration, correction: Correction, bandwidth_hz: float | None = None
) -> MountedHousing | None:
    """Return the rope and the housing as configured; None where the housing's position is not configured."""
    if configuration.housing_position_m is None:
        return None
    above_m = configuration.housing_above_load_m
    housing = MountedHousing(
        length_m=max(configuration.rope.length_m, SHORTEST_ROPE * (above_m or 0.0)),
        position_m=configuration.housing_position_m if above_m is None else None,
        above_load_m=above_m,
        position_u_m=POSITION_U_M,
        gravity_m_s2=configuration.site.local_gravity_m_s2,
    )
    return with_sensor(housing, correction, bandwidth_hz)


def with_sensor(housing: MountedHousing, correction: Correction, bandwidth_hz: float | None) -> MountedHousing:
    """Return the housing with the uncertainties of the calibration and the bandwidth of the sensor."""
    x, y, z = correction.u_zero_g_offset_g.tolist()
    sx, sy, sz = correction.u_scale_factor.tolist()
    return replace(
        housing,
        zero_g_offset_u_g=(x, y, z),
        scale_u=(sx, sy, sz),
        cross_axis_u=math.hypot(MOUNT_U_RAD, correction.u_cross_axis),
        bandwidth_hz=bandwidth_hz,
    )
