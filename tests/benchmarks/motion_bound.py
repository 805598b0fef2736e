"""A bound of the error while the crane drives: how well the angle can be known by anyone who is not told what the pivot does.

The equations of motion and of the reading are linearised along the true trajectory. The covariance of a recursive estimate
follows from them, with the priors of the filter for constants and initial motion and without process noise (posterior
Cramér-Rao bound, Tichavský et al. 1998, which is this covariance for a given trajectory). In a drive each bin has its own,
unknown acceleration of the pivot, in a gust its own force on the load: a variance without information that each bin brings anew.
It is known when the crane drives, when a gust blows, and what the hoist does, that the accelerometer is on the rope's axis and
that the rope is as stiff in all directions.

A filter can be better than this where it rightly takes the acceleration of the pivot as smooth.
"""

import numpy as np
from numpy.typing import NDArray

from gateway.motion.hypotheses import IS_FREE, N_HYPOTHESES
from gateway.motion.motion_filter import MotionFilter
from gateway.motion.rope_model import RopeModel
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    DAMPING,
    GRAVITY,
    GUST,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    LN_LENGTH,
    MOUNT,
    N_MOVING,
    N_STATES,
    OFFSET,
    PIVOT,
    PLACE,
    RATE,
    SIDE_FORCE,
    indices,
)
from gateway.numerics.array import Array
from tests.benchmarks.motion_recordings import GRAVITY_M_S2, WorkRecording

BIN_S, SAMPLE_RATE_HZ = 0.1, 50.0
UNINFORMED_G = 1.0
"""Standard deviation of an acceleration over g of which nothing is known."""
_FREE = int(np.flatnonzero(IS_FREE)[0])
_NOTHING, _DRIVE, _GUST = range(3)
_ACTING = np.array([_NOTHING, _DRIVE, _NOTHING, _DRIVE, _GUST])
"""What acts in each of `MANOEUVRES`."""

_PAIRS = (GRAVITY, RATE, PIVOT, GUST, SIDE_FORCE, OFFSET, MOUNT)
_STATES = [i for pair in _PAIRS for i in indices(pair)] + [AXIAL_OFFSET, LN_LENGTH, DAMPING, PLACE]
_PIVOT, _FORCE = ([_STATES.index(i) for i in indices(pair)] for pair in (PIVOT, GUST))
_INPUTS = [*_PIVOT, *_FORCE]
_MOVES = np.array([i < N_MOVING for i in _STATES])


def bound_rad(recording: WorkRecording) -> tuple[Array, Array]:
    """Return time and the smallest standard deviation of the angle, for each bin."""
    model = RopeModel(GRAVITY_M_S2, recording.believed_length_m, is_clamped=True)
    time_s: Array = np.arange(recording.truth["time_s"][0], recording.truth["time_s"][-1], BIN_S)
    states, acting = _trajectory(recording, time_s)
    covariance = _prior(recording, model)
    noise = np.eye(3) * recording.noise_g**2 / (BIN_S * SAMPLE_RATE_HZ)
    identity = np.eye(len(_STATES))
    sigma = []
    for x, acts in zip(states, acting, strict=True):
        everywhere = np.tile(x, (N_HYPOTHESES, 1))
        covariance[_INPUTS], covariance[:, _INPUTS] = 0.0, 0.0
        for each, uninformed in ((_PIVOT, acts == _DRIVE), (_FORCE, acts == _GUST)):
            covariance[each, each] = UNINFORMED_G**2 if uninformed else 0.0
        rate = np.zeros((len(_STATES), len(_STATES)))
        rate[_MOVES] = BIN_S * model.rate(everywhere)[1][_FREE][np.ix_(np.array(_STATES)[_MOVES], _STATES)]
        transition = identity + rate + rate @ rate / 2
        covariance = transition @ covariance @ transition.T
        reading = model.reading(everywhere)[1][_FREE][:, _STATES]
        cross = covariance @ reading.T
        gain = np.linalg.solve(reading @ cross + noise, cross.T).T
        kept = identity - gain @ reading
        covariance = kept @ covariance @ kept.T + gain @ noise @ gain.T
        towards = x[GRAVITY] / max(float(np.hypot(*x[GRAVITY])), 1e-9)
        sigma.append(np.sqrt(towards @ covariance[:2, :2] @ towards))
    return time_s, np.array(sigma)


def _trajectory(recording: WorkRecording, time_s: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the true states, shape (bins, N_STATES), and what acts; the pivot's acceleration is left over by the motion."""
    turn = np.exp(1j * np.radians(recording.truth["azimuth_deg"]))
    across = -np.sin(np.radians(recording.truth["angle_deg"])) * turn
    u = np.interp(time_s, recording.truth["time_s"], across.real) + 1j * np.interp(
        time_s, recording.truth["time_s"], across.imag
    )
    w = -np.gradient(u, time_s) / np.sqrt(1 - np.abs(u) ** 2)
    length_m = recording.true("length_m", time_s)
    speed_m_s = np.gradient(length_m, time_s)
    acting = _ACTING[recording.manoeuvre(time_s)]
    force = (length_m * np.gradient(w, time_s) + 2 * speed_m_s * w) / GRAVITY_M_S2 - u
    states = np.zeros((len(time_s), N_STATES))
    for place, pair in (
        (GRAVITY, u),
        (RATE, w),
        (PIVOT, np.where(acting == _DRIVE, -force, 0.0)),
        (GUST, np.where(acting == _GUST, force, 0.0)),
    ):
        states[:, place] = np.column_stack([pair.real, pair.imag])
    states[:, LN_LENGTH], states[:, PLACE] = np.log(length_m), recording.above_load_m
    states[:, HOIST_SPEED], states[:, HOIST_ACCELERATION] = speed_m_s, np.gradient(speed_m_s, time_s)
    return states, acting


def _prior(recording: WorkRecording, model: RopeModel) -> Array:
    mixture = MotionFilter(model, recording.constants).mixture
    prior: Array = mixture.covariance[_FREE][np.ix_(_STATES, _STATES)].copy()
    return prior
