"""What the motion filter knows before the first reading."""

from dataclasses import dataclass

import numpy as np

from gateway.motion.hypotheses import (
    GUST_RATE_1_S,
    GUST_SIGMA,
    INITIAL_WEIGHTS,
    IS_DRIVEN,
    IS_GUST,
    IS_HOISTING,
    N_HYPOTHESES,
    PIVOT_RATE_1_S,
    PIVOT_SIGMA,
)
from gateway.motion.mixing import Mixture
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    DAMPING,
    GRAVITY,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    INPUT,
    INPUT_RATE,
    LN_LENGTH,
    MOUNT,
    N_STATES,
    OFFSET,
    PLACE,
    RATE,
    SIDE_FORCE,
    SPIN,
)
from gateway.swing.rig import MountedHousing

INITIAL_ANGLE_RAD = 0.12
"""Standard deviation of each component of the rope's angle before the first reading: 7 degrees."""
SIDE_FORCE_U = 3e-3
"""Standard uncertainty of each component of a steady side force over the weight. Basis: leans of 0.2 degrees by a breeze."""
DAMPING_RATIO, DAMPING_RATIO_U = 0.005, 0.005
"""Damping ratio of a load on a rope before it is measured."""
SMALLEST_OFFSET_U_G = 3e-4
"""Standard uncertainty of an offset that is stated as exact."""
SPIN_U_1_S = 0.01
"""Standard deviation of the housing's rate about the rope, 1/s."""


@dataclass(frozen=True, slots=True)
class Constants:
    """What is known of the crane before the first reading; standard uncertainties are 1 sigma."""

    length_m: float
    length_u_rel: float
    place_m: float
    place_u_m: float
    offset_u_g: tuple[float, float, float]
    mount_u_rad: float


def constants_of(rig: MountedHousing, mount_u_rad: float) -> Constants:
    """Return what is known of crane and sensor; `mount_u_rad`: of the housing's z axis against the rope."""
    x, y, z = (max(SMALLEST_OFFSET_U_G, u_g) for u_g in rig.zero_g_offset_u_g)
    place_m = rig.above_load_m if rig.above_load_m is not None else rig.position_m
    return Constants(
        length_m=rig.length_m,
        length_u_rel=rig.length_u_rel,
        place_m=float(place_m or 0.0),
        place_u_m=rig.position_u_m,
        offset_u_g=(x, y, float(np.hypot(z, rig.scale_u[2]))),
        mount_u_rad=mount_u_rad,
    )


def initial_mixture(gravity_m_s2: float, constants: Constants) -> Mixture:
    """Return what is known before the first reading."""
    omega = np.sqrt(gravity_m_s2 / constants.length_m)
    state = np.zeros((N_HYPOTHESES, N_STATES))
    state[:, LN_LENGTH] = np.log(constants.length_m)
    state[:, DAMPING] = 2 * DAMPING_RATIO * omega
    state[:, PLACE] = constants.place_m
    sigma = np.zeros((N_HYPOTHESES, N_STATES))
    sigma[:, GRAVITY], sigma[:, RATE] = INITIAL_ANGLE_RAD, INITIAL_ANGLE_RAD * omega
    sigma[:, SIDE_FORCE] = SIDE_FORCE_U
    sigma[:, OFFSET] = np.hypot(constants.offset_u_g[:2], constants.mount_u_rad)
    sigma[:, MOUNT] = constants.mount_u_rad
    sigma[:, AXIAL_OFFSET] = constants.offset_u_g[2]
    sigma[:, LN_LENGTH], sigma[:, PLACE] = constants.length_u_rel, constants.place_u_m
    sigma[:, SPIN] = SPIN_U_1_S
    sigma[:, DAMPING] = 2 * DAMPING_RATIO_U * omega
    sigma[IS_DRIVEN, INPUT] = PIVOT_SIGMA
    sigma[IS_DRIVEN, INPUT_RATE] = PIVOT_RATE_1_S * PIVOT_SIGMA
    sigma[IS_GUST, INPUT], sigma[IS_GUST, INPUT_RATE] = GUST_SIGMA, GUST_RATE_1_S * GUST_SIGMA
    sigma[IS_HOISTING, HOIST_SPEED], sigma[IS_HOISTING, HOIST_ACCELERATION] = 0.3, 0.1
    covariance = np.zeros((N_HYPOTHESES, N_STATES, N_STATES))
    covariance.reshape(N_HYPOTHESES, -1)[:, :: N_STATES + 1] = sigma**2
    for i in (0, 1):
        offset, mount = OFFSET.start + i, MOUNT.start + i
        covariance[:, offset, mount] = covariance[:, mount, offset] = constants.mount_u_rad**2
    return Mixture(state, covariance, INITIAL_WEIGHTS)
