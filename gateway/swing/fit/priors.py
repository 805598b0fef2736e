"""Priors of all unknowns: the motion's first state, its parameters, the housing's position and the sensor's errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.swing.model.motion import LN_LENGTH, N_STATES
from gateway.swing.rig import MountedHousing

SWING_PRIOR_SIGMA = 1.0
"""Prior of u and w/w0, 1 sigma. Basis: wider than any swing in the model; it fixes only what no reading determines, such as the
azimuth of a housing at the hook."""
PULL_PRIOR_SIGMA = 0.3
"""Prior of the side pull over the weight, 1 sigma. Basis: a lean of 17 degrees, far more than wind or a skew pull causes."""
DAMPING_PRIOR_SIGMA = 0.02
"""Prior of the damping ratio, 1 sigma. Basis: cranes have some thousandths."""
SPEED_PRIOR_M_S = 0.7
"""Prior of a hoisting speed, 1 sigma. Basis: cranes hoist at up to 1.2 m/s."""
DRAG_PRIOR_SIGMA = 0.1
"""Prior of the drag coefficient q where it is fitted, 1 sigma. Basis: drag force per mass q |v| v/L of a container in air."""
SPIN_PRIOR_1_S = 0.1
"""Prior of the housing's spin where it is fitted, 1 sigma. Basis: a turn in one minute."""
POSITION_PRIOR_REL = 0.1
"""Prior of the position over the rope's length where the stated one does not explain the data, 1 sigma. Basis: a tape measure on
a rope of 10 m is not wrong by more than 1 m."""
SENSOR_PRIOR_REL = 0.02
"""Prior of offset (in g), scale and cross-axis errors where the stated ones do not explain the data, 1 sigma. Basis: limits of
uncalibrated parts in data sheets."""
N_SENSOR_ERRORS = 1 + 3 + 9
"""Definition: position, zero-g offset x y z, error of the sensor's matrix row by row."""


@dataclass(frozen=True, slots=True)
class SensorModel:
    """Deviations of housing and sensor from what is stated of them."""

    errors: Array
    """Position in m, zero-g offset in g (3), relative errors of the 3 x 3 matrix (9)."""

    @classmethod
    def ideal(cls) -> "SensorModel":
        """Return the sensor as stated."""
        return cls(np.zeros(N_SENSOR_ERRORS))

    @property
    def position_error_m(self) -> float:
        """Distance by which the housing is farther from the pivot than stated."""
        return float(self.errors[0])

    def read(self, ideal_g: Array) -> Array:
        """Return the readings for specific force of shape (n, 3)."""
        matrix = np.eye(3) + self.errors[4:].reshape(3, 3)
        readings_g: Array = ideal_g @ matrix.T + self.errors[1:4]
        return readings_g

    def jacobian(self, ideal_g: Array) -> Array:
        """Return the derivative of the readings by offset and matrix, shape (n, 3, 12)."""
        by_offset = np.broadcast_to(np.eye(3), (len(ideal_g), 3, 3))
        by_matrix = np.einsum("ij,nk->nijk", np.eye(3), ideal_g).reshape(len(ideal_g), 3, 9)
        return np.concatenate([by_offset, by_matrix], axis=-1)

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
    errors = np.array([rig.position_u_m, *rig.zero_g_offset_u_g, *matrix.ravel()])
    return _prior(rig, np.array([DAMPING_PRIOR_SIGMA]), errors)


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
    position = max(rig.position_u_m, POSITION_PRIOR_REL * rig.length_m)
    errors = np.array([position, *offset, *matrix.ravel()])
    return _prior(rig, np.array([DAMPING_PRIOR_SIGMA, DRAG_PRIOR_SIGMA, SPIN_PRIOR_1_S]), errors)


def _prior(rig: MountedHousing, damping_drag_spin: Array, errors: Array) -> Prior:
    state = [SWING_PRIOR_SIGMA] * 4 + [PULL_PRIOR_SIGMA] * 2
    ln_length = np.sqrt(np.log1p(rig.length_u_rel**2))
    sigma = np.array([*state, ln_length, *damping_drag_spin, *errors])
    mean = np.zeros(len(sigma))
    mean[N_STATES + LN_LENGTH] = np.log(rig.length_m)
    return Prior(rig, mean, sigma)
