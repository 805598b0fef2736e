"""What the configuration and the calibration say of the housing on its rope."""

from gateway.calibration.correction import Correction
from gateway.configuration.model import Configuration
from gateway.stages.swing.rig import MountedHousing

POSITION_U_M = 0.05
"""Standard uncertainty of the housing's place on the rope, as measured with a tape."""


def mounted_housing(configuration: Configuration, correction: Correction) -> MountedHousing | None:
    """What is believed of the rope and the housing; None when nobody said where the housing is."""
    if configuration.housing_position_m is None:
        return None
    above_m = configuration.housing_above_load_m
    x, y, z = correction.u_zero_g_offset_g.tolist()
    sx, sy, sz = correction.u_scale_factor.tolist()
    return MountedHousing(
        length_m=configuration.rope.length_m,
        position_m=configuration.housing_position_m if above_m is None else None,
        above_load_m=above_m,
        position_u_m=POSITION_U_M,
        gravity_m_s2=configuration.site.local_gravity_m_s2,
        zero_g_offset_u_g=(x, y, z),
        scale_u=(sx, sy, sz),
    )
