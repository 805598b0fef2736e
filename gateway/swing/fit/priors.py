"""What is believed of every unknown before the data: priors of the motion, the housing's place and the sensor's errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.swing.model.motion import LN_LENGTH, STATES
from gateway.swing.model.spherical_pendulum import Real
from gateway.swing.rig import MountedHousing

STATE_PRIOR = (1.0, 1.0, 1.0, 1.0, 0.3, 0.3)
"""1 sigma of u, w/w0 and the pull: so wide that it only holds what the data cannot see (the azimuth at the hook)."""
DAMPING_PRIOR = 0.02
"""1 sigma of the damping ratio; cranes have some thousandths."""
DRAG_PRIOR, SPIN_PRIOR_1_S = 0.1, 0.1
SPEED_PRIOR_M_S = 0.7
"""1 sigma of a hoist's speed; cranes hoist at up to 1.2 m/s."""
POSITION_DOUBT = 0.1
"""1 sigma over the rope's length, where what is believed of the rig does not explain the data."""
OFFSET_DOUBT_G, SCALE_DOUBT, CROSS_AXIS_DOUBT = 0.02, 0.02, 0.02
ERRORS = 1 + 3 + 9
"""Position, zero-g offset x y z, error of the sensor's matrix row by row."""


@dataclass(frozen=True, slots=True)
class SensorModel:
    """How the housing departs from what is believed of it."""

    errors: Real
    """Position in m, zero-g offset in g (3), relative errors of the 3 x 3 matrix (9)."""

    @classmethod
    def ideal(cls) -> "SensorModel":
        """As believed."""
        return cls(np.zeros(ERRORS))

    @property
    def position_error_m(self) -> float:
        """By which the housing is farther from the pivot than believed."""
        return float(self.errors[0])

    def reads(self, ideal_g: Real) -> Real:
        """What comes out for specific force of shape (n, 3)."""
        matrix = np.eye(3) + self.errors[4:].reshape(3, 3)
        out: Real = ideal_g @ matrix.T + self.errors[1:4]
        return out

    def slopes(self, ideal_g: Real) -> Real:
        """Derivative of the reading by offset and matrix, shape (n, 3, 12)."""
        by_offset = np.broadcast_to(np.eye(3), (len(ideal_g), 3, 3))
        by_matrix = np.einsum("ij,nk->nijk", np.eye(3), ideal_g).reshape(len(ideal_g), 3, 9)
        return np.concatenate([by_offset, by_matrix], axis=-1)

    def moved(self, step: Real) -> "SensorModel":
        """After a step."""
        return SensorModel(self.errors + step)


@dataclass(frozen=True, slots=True)
class Prior:
    """Prior mean and standard deviation of the first state, the motion's parameters and the instrument's errors."""

    rig: MountedHousing
    mean: Real
    deviation: Real
    """0: exactly known, not fitted."""

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which unknowns are fitted."""
        return self.deviation > 0

    @property
    def information(self) -> Real:
        """1/variance of the free ones."""
        return self.deviation[self.free] ** -2.0

    @property
    def parameters(self) -> int:
        """How many parameters the motion has."""
        return len(self.mean) - STATES - ERRORS


def nominal_prior(rig: MountedHousing) -> Prior:
    """The rig as stated."""
    matrix = np.diag(rig.scale_u)
    matrix[2, :2] = rig.cross_axis_u  # x and y read of z what an offset reads already
    errors = np.array([rig.position_u_m, *rig.zero_g_offset_u_g, *matrix.ravel()])
    return _beliefs(rig, np.array([DAMPING_PRIOR]), errors)


def hoisting_prior(rig: MountedHousing, speeds: int) -> Prior:
    """The rig as stated, on a rope whose length changes by so many unknown speeds."""
    beliefs = nominal_prior(rig)
    place = STATES + LN_LENGTH + 2
    return Prior(
        rig,
        np.insert(beliefs.mean, place, np.zeros(speeds)),
        np.insert(beliefs.deviation, place, np.full(speeds, SPEED_PRIOR_M_S)),
    )


def relaxed_prior(rig: MountedHousing) -> Prior:
    """Everything that is stated of housing and sensor may be wrong, drag may be quadratic, the housing may turn."""
    matrix = np.full((3, 3), CROSS_AXIS_DOUBT)
    np.fill_diagonal(matrix, np.maximum(rig.scale_u, SCALE_DOUBT))
    offset = np.maximum(rig.zero_g_offset_u_g, OFFSET_DOUBT_G)
    position = max(rig.position_u_m, POSITION_DOUBT * rig.length_m)
    errors = np.array([position, *offset, *matrix.ravel()])
    return _beliefs(rig, np.array([DAMPING_PRIOR, DRAG_PRIOR, SPIN_PRIOR_1_S]), errors)


def _beliefs(rig: MountedHousing, damping_drag_spin: Real, errors: Real) -> Prior:
    length = np.sqrt(np.log1p(rig.length_u_rel**2))
    deviation = np.array([*STATE_PRIOR, length, *damping_drag_spin, *errors])
    mean = np.zeros(len(deviation))
    mean[STATES + LN_LENGTH] = np.log(rig.length_m)
    return Prior(rig, mean, deviation)
