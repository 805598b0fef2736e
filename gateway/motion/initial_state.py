"""What the motion filter knows before the first reading."""

import math
from dataclasses import dataclass

import numpy as np

from gateway.motion.disturbances import HOIST_JERK_SIGMA_M_S2, STILL_ACCELERATION_M_S2
from gateway.motion.hypotheses import (
    CHANGING,
    IS_HOISTING,
    N_HYPOTHESES,
    PIVOT_LEVEL,
    PIVOT_LEVELS,
    WINCH_LEVEL,
    WIND_LEVEL,
    WIND_LEVELS,
    initial_weights,
)
from gateway.motion.mixture import Mixture
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    DAMPING,
    GRAVITY,
    GUST,
    HEAVE,
    HEAVE_RATE,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    LEVER,
    LN_LENGTH,
    MOUNT,
    N_STATES,
    OFFSET,
    PIVOT,
    PIVOT_RATE,
    PLACE,
    RATE,
    SIDE_FORCE,
    SPIN,
    STIFFNESS,
)
from gateway.swing.rig import MountedHousing

INITIAL_ANGLE_RAD = 0.12
"""Standard deviation of each component of the rope's angle before the first reading: 7 degrees."""
DAMPING_RATIO, DAMPING_RATIO_U = 0.005, 0.005
"""Damping ratio of a load on a rope before it is measured."""
SMALLEST_OFFSET_U_G = 3e-4
"""Standard uncertainty of an offset that is stated as exact."""
SPIN_U_1_S = 0.01
"""Standard deviation of the housing's rate about the rope, 1/s."""
HOIST_SPEED_U_M_S, STILL_SPEED_U_M_S = 0.3, 2e-3
"""Standard deviation of the speed of a winch that runs, and of one that rests."""
LENGTH_U_REL = 0.1
"""Largest relative standard uncertainty of the rope's length. Basis: riggers state it to 5 %; slings and blocks add to it. A
length stated less certainly is found by the swing's period all the same."""
PLACE_U_REL, PLACE_U_PER_LENGTH = 0.03, 0.02
"""Standard uncertainty of the housing's place, as a share of its distance and of the rope's length. Basis: a tape and a load
whose centre is estimated; ropes that converge, whose load swings as one on a shorter rope does (14.6 m of 16.1 m on a container
crane), so that the distance to the load that a swing shows is shorter than the tape's by the difference."""
LEVER_U_M = 0.02
"""Standard uncertainty of the accelerometer's place beside the rope's axis, per direction, where it is not stated."""
STIFFNESS_U = 0.03
"""Standard deviation of the relative difference of the stiffness in two directions. Basis: two falls fixed at both ends, 0.1."""
SPREADER_TILT, SPREADER_TILT_U, SPREADER_TILT_DIFFERENCE_U = 0.2, 0.08, 0.05
"""Tilt of a spreader per angle of its ropes, its standard deviation, and that of its difference in two directions. Basis: 0.13 to
0.27 on container cranes."""


@dataclass(frozen=True, slots=True)
class Constants:
    """What is known of the crane before the first reading; standard uncertainties are 1 sigma."""

    length_m: float
    length_u_rel: float
    place_m: float
    place_u_m: float
    offset_u_g: tuple[float, float, float]
    mount_u_rad: float
    lever_u_m: float = LEVER_U_M


def constants_of(rig: MountedHousing, mount_u_rad: float) -> Constants:
    """Return what is known of crane and sensor; `mount_u_rad`: of the housing's z axis against the rope."""
    x, y, z = (max(SMALLEST_OFFSET_U_G, u_g) for u_g in rig.zero_g_offset_u_g)
    place_m = float(rig.above_load_m if rig.above_load_m is not None else rig.position_m or 0.0)
    return Constants(
        length_m=rig.length_m,
        length_u_rel=min(rig.length_u_rel, LENGTH_U_REL),
        place_m=place_m,
        place_u_m=math.hypot(rig.position_u_m, PLACE_U_REL * place_m, PLACE_U_PER_LENGTH * rig.length_m),
        offset_u_g=(x, y, math.hypot(z, rig.scale_u[2])),
        mount_u_rad=mount_u_rad,
        lever_u_m=max(LEVER_U_M, rig.beside_u_m),
    )


def initial_mixture(
    gravity_m_s2: float, constants: Constants, *, on_spreader: bool = False, floats: bool = False
) -> Mixture:
    """Return what is known before the first reading; `floats`: of a crane on a floating base."""
    omega = math.sqrt(gravity_m_s2 / constants.length_m)
    state = np.zeros((N_HYPOTHESES, N_STATES))
    state[:, LN_LENGTH] = math.log(constants.length_m)
    state[:, DAMPING] = 2 * DAMPING_RATIO * omega
    state[:, PLACE] = SPREADER_TILT if on_spreader else constants.place_m
    sigma = np.zeros((N_HYPOTHESES, N_STATES))
    sigma[:, GRAVITY], sigma[:, RATE] = INITIAL_ANGLE_RAD, INITIAL_ANGLE_RAD * omega
    sigma[:, OFFSET] = np.hypot(constants.offset_u_g[:2], constants.mount_u_rad)
    sigma[:, MOUNT], sigma[:, AXIAL_OFFSET] = constants.mount_u_rad, constants.offset_u_g[2]
    sigma[:, LN_LENGTH] = constants.length_u_rel
    sigma[:, PLACE] = SPREADER_TILT_U if on_spreader else constants.place_u_m
    sigma[:, LEVER] = SPREADER_TILT_DIFFERENCE_U if on_spreader else constants.lever_u_m
    sigma[:, STIFFNESS] = STIFFNESS_U
    sigma[:, SPIN], sigma[:, DAMPING] = SPIN_U_1_S, 2 * DAMPING_RATIO_U * omega
    for i in range(N_HYPOTHESES):
        pivot, wind = PIVOT_LEVELS[PIVOT_LEVEL[i]], WIND_LEVELS[WIND_LEVEL[i]]
        sigma[i, PIVOT], sigma[i, PIVOT_RATE] = pivot.sigma, pivot.rate_1_s * pivot.sigma
        sigma[i, HEAVE_RATE] = pivot.heave_rate_1_s * pivot.heave_sigma
        sigma[i, HEAVE], sigma[i, GUST], sigma[i, SIDE_FORCE] = pivot.heave_sigma, wind.sigma, wind.side_sigma
    sigma[:, HOIST_SPEED] = np.where(IS_HOISTING, HOIST_SPEED_U_M_S, STILL_SPEED_U_M_S)
    sigma[:, HOIST_ACCELERATION] = np.where(WINCH_LEVEL == CHANGING, HOIST_JERK_SIGMA_M_S2, STILL_ACCELERATION_M_S2)
    covariance = np.zeros((N_HYPOTHESES, N_STATES, N_STATES))
    covariance.reshape(N_HYPOTHESES, -1)[:, :: N_STATES + 1] = sigma**2
    for i in (0, 1):
        offset, mount = OFFSET.start + i, MOUNT.start + i
        covariance[:, offset, mount] = covariance[:, mount, offset] = constants.mount_u_rad**2
    return Mixture(state, covariance, initial_weights(floats=floats))
