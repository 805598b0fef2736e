"""Priors of all unknowns: the motion's first state, its parameters, the housing's position and the sensor's errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.swing.model.motion import DAMPING, LN_LENGTH, N_STATES
from gateway.swing.model.mount import rotation, rotation_derivatives
from gateway.swing.rig import MountedHousing

SWING_PRIOR_SIGMA = 1.0
"""Prior of u and w/w0, 1 sigma. Basis: wider than any swing in the model; it fixes only what no reading determines, such as the
azimuth of a housing at the hook."""
DAMPING_PRIOR_SIGMA = 0.02
"""Prior of the damping ratio, 1 sigma. Basis: cranes have some thousandths."""
SPEED_PRIOR_M_S = 0.7
"""Prior of a hoisting speed, 1 sigma. Basis: cranes hoist at up to 1.2 m/s."""
DRAG_PRIOR_SIGMA = 0.1
"""Prior of the drag coefficient d where it is fitted, 1 sigma. Basis: drag force per mass d |v| v/L of a container in air."""
FRICTION_PRIOR_RAD = 0.01
"""Prior of the angle at which dry friction holds the rope where it is fitted, 1 sigma. Basis: hinges and knots of small pendulums
hold some thousandths; a rope over a sheave less."""
SPIN_PRIOR_1_S = 0.1
"""Prior of the housing's spin where it is fitted, 1 sigma. Basis: a turn in one minute."""
POSITION_PRIOR_REL = 0.1
"""Prior of the position over the rope's length where the stated one does not explain the data, 1 sigma. Basis: a tape measure on
a rope of 10 m is not wrong by more than 1 m."""
SENSOR_PRIOR_REL = 0.02
"""Prior of offset (in g), scale and cross-axis errors where the stated ones do not explain the data, 1 sigma. Basis: limits of
uncalibrated parts in data sheets."""
N_SENSOR_ERRORS = 3 + 2 + 3 + 9
"""Definition: position along the rope, beside it in x and y, mount about x and y, zero-g offset x y z, error of the sensor's
matrix row by row."""
_MOUNT, _OFFSET = slice(3, 5), slice(5, 8)
"""Definition: places of the mount and of the offset in the errors."""


@dataclass(frozen=True, slots=True)
class SensorModel:
    """Deviations of housing and sensor from what is stated of them."""

    errors: Array
    """Position along the rope and beside it in m (3), angles of the mount in rad (2), zero-g offset in g (3), relative errors of
    the 3 x 3 matrix (9)."""

    @classmethod
    def ideal(cls) -> "SensorModel":
        """Return the sensor as stated."""
        return cls(np.zeros(N_SENSOR_ERRORS))

    @property
    def position_error_m(self) -> float:
        """Distance by which the housing is farther from the pivot than stated."""
        return float(self.errors[0])

    @property
    def beside_m(self) -> complex:
        """Place beside the rope, x + iy."""
        return complex(self.errors[1], self.errors[2])

    @property
    def response(self) -> Array:
        """Derivative of the readings by specific force in the rope's frame, shape (3, 3)."""
        response: Array = self._matrix @ rotation(self.errors[_MOUNT])
        return response

    @property
    def _matrix(self) -> Array:
        matrix: Array = np.eye(3) + self.errors[_OFFSET.stop :].reshape(3, 3)
        return matrix

    def read(self, ideal_g: Array) -> Array:
        """Return the readings for specific force of shape (n, 3)."""
        readings_g: Array = ideal_g @ self.response.T + self.errors[_OFFSET]
        return readings_g

    def jacobian(self, ideal_g: Array) -> Array:
        """Return the derivative of the readings by mount, offset and matrix, shape (n, 3, 14)."""
        by_mount = np.einsum("mij,nj->nim", self._matrix @ rotation_derivatives(self.errors[_MOUNT]), ideal_g)
        by_offset = np.broadcast_to(np.eye(3), (len(ideal_g), 3, 3))
        in_housing_g = ideal_g @ rotation(self.errors[_MOUNT]).T
        by_matrix = np.einsum("ij,nk->nijk", np.eye(3), in_housing_g).reshape(len(ideal_g), 3, 9)
        return np.concatenate([by_mount, by_offset, by_matrix], axis=-1)

    def stepped(self, step: Array) -> "SensorModel":
        """Return the sensor after a step of its errors."""
        return SensorModel(self.errors + step)


@dataclass(frozen=True, slots=True)
class Prior:
    """Prior mean and standard deviation of the first state, the motion's parameters and the sensor's errors."""

    rig: MountedHousing
    mean: Array
    sigma: Array
    """Zero: exactly known, not fitted."""

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which unknowns are fitted."""
        return self.sigma > 0

    @property
    def information(self) -> Array:
        """1/variance of the fitted unknowns."""
        return self.sigma[self.free] ** -2.0

    @property
    def n_parameters(self) -> int:
        """Number of parameters of the motion."""
        return len(self.mean) - N_STATES - N_SENSOR_ERRORS


def nominal_prior(rig: MountedHousing) -> Prior:
    """Return the prior with rig and sensor as stated."""
    matrix = np.diag(rig.scale_u)
    matrix[2, :2] = rig.cross_axis_u  # that x and y read z cannot be told from an offset
    return _prior(rig, np.array([DAMPING_PRIOR_SIGMA]), rig.position_u_m, rig.zero_g_offset_u_g, matrix)


def damped_prior(rig: MountedHousing) -> Prior:
    """Return the prior with rig and sensor as stated, with quadratic drag and dry friction."""
    nominal = nominal_prior(rig)
    place = N_STATES + DAMPING + 1
    mean = np.insert(nominal.mean, place, np.zeros(3))
    return Prior(rig, mean, np.insert(nominal.sigma, place, [DRAG_PRIOR_SIGMA, 0.0, FRICTION_PRIOR_RAD]))


def hoisting_prior(rig: MountedHousing, speeds: int) -> Prior:
    """Return the prior with rig and sensor as stated, on a rope whose length changes by unknown speeds of so many splines."""
    prior = nominal_prior(rig)
    place = N_STATES + LN_LENGTH + 2
    return Prior(
        rig,
        np.insert(prior.mean, place, np.zeros(speeds)),
        np.insert(prior.sigma, place, np.full(speeds, SPEED_PRIOR_M_S)),
    )


def relaxed_prior(rig: MountedHousing) -> Prior:
    """Return the prior with which every statement on housing and sensor may be wrong, with quadratic drag and a spin."""
    matrix = np.full((3, 3), SENSOR_PRIOR_REL)
    np.fill_diagonal(matrix, np.maximum(rig.scale_u, SENSOR_PRIOR_REL))
    offset = np.maximum(rig.zero_g_offset_u_g, SENSOR_PRIOR_REL)
    position_u_m = max(rig.position_u_m, POSITION_PRIOR_REL * rig.length_m)
    motion = np.array([DAMPING_PRIOR_SIGMA, DRAG_PRIOR_SIGMA, SPIN_PRIOR_1_S, FRICTION_PRIOR_RAD])
    return _prior(rig, motion, position_u_m, offset, matrix)


def _prior(
    rig: MountedHousing,
    motion: Array,
    position_u_m: float,
    offset_u_g: Array | tuple[float, float, float],
    matrix_u: Array,
) -> Prior:
    """Return the prior for standard uncertainties of damping and what follows it, of the housing and of the sensor."""
    state = [SWING_PRIOR_SIGMA] * 4 + [rig.pull_u] * 2
    ln_length = np.sqrt(np.log1p(rig.length_u_rel**2))
    place = [position_u_m, rig.beside_u_m, rig.beside_u_m]
    errors = [*place, *[rig.mount_u_rad or 0.0] * 2, *offset_u_g, *matrix_u.ravel()]
    sigma = np.array([*state, ln_length, *motion, *errors])
    mean = np.zeros(len(sigma))
    mean[N_STATES + LN_LENGTH] = np.log(rig.length_m)
    mean[len(sigma) - N_SENSOR_ERRORS :][_MOUNT] = rig.mount_rad
    return Prior(rig, mean, sigma)
