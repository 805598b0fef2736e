"""A bound of the error while the crane drives: how well the angle can be known by anyone who is not told what the pivot does.

The equations of motion and of the reading are linearised along the true trajectory. The covariance of a recursive estimate
follows from them, with the priors of the filter for constants and initial motion and without process noise (posterior
Cramér-Rao bound, Tichavský et al. 1998, which is this covariance for a given trajectory). In a drive each bin has its own,
unknown acceleration of the pivot, in a gust its own force on the load: a variance without information that each bin brings anew.
It is known when the crane drives, when a gust blows, and what the hoist does.

A filter can be better than this where it rightly takes the acceleration of the pivot as smooth.
"""

import numpy as np

from gateway.motion.hypotheses import N_HYPOTHESES, MotionHypothesis
from gateway.motion.motion_filter import MotionFilter
from gateway.motion.rope_model import RopeModel
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    DAMPING,
    GRAVITY,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    INPUT,
    LN_LENGTH,
    MOUNT,
    N_STATES,
    OFFSET,
    PLACE,
    RATE,
    SIDE_FORCE,
)
from gateway.numerics.array import Array
from tests.benchmarks.motion_recordings import GRAVITY_M_S2, WorkRecording

BIN_S, SAMPLE_RATE_HZ = 0.1, 50.0
UNINFORMED_G = 1.0
"""Standard deviation of an acceleration over g of which nothing is known."""
FREE, DRIVEN, GUST = MotionHypothesis.FREE, MotionHypothesis.DRIVEN, MotionHypothesis.GUST

_PAIRS = (GRAVITY, RATE, SIDE_FORCE, OFFSET, MOUNT)
_STATES = [i for pair in _PAIRS for i in range(pair.start, pair.stop)]
_STATES += [AXIAL_OFFSET, LN_LENGTH, DAMPING, PLACE, INPUT.start, INPUT.start + 1]
_INPUTS = [len(_STATES) - 2, len(_STATES) - 1]


def bound_rad(recording: WorkRecording) -> tuple[Array, Array]:
    """Return time and the smallest standard deviation of the angle, for each bin."""
    model = RopeModel(GRAVITY_M_S2, is_clamped=True)
    time_s: Array = np.arange(recording.truth["time_s"][0], recording.truth["time_s"][-1], BIN_S)
    states, hypotheses = _trajectory(recording, time_s)
    covariance = _prior(recording, model)
    noise = np.eye(3) * recording.noise_g**2 / (BIN_S * SAMPLE_RATE_HZ)
    identity = np.eye(len(_STATES))
    sigma = []
    for x, hypothesis in zip(states, hypotheses, strict=True):
        everywhere = np.tile(x, (N_HYPOTHESES, 1))
        covariance[_INPUTS], covariance[:, _INPUTS] = 0.0, 0.0
        covariance[_INPUTS, _INPUTS] = UNINFORMED_G**2 if hypothesis != FREE else 0.0
        rate = BIN_S * model.rate(everywhere)[1][hypothesis][np.ix_(_STATES, _STATES)]
        transition = identity + rate + rate @ rate / 2
        covariance = transition @ covariance @ transition.T
        reading = model.reading(everywhere)[1][hypothesis][:, _STATES]
        cross = covariance @ reading.T
        gain = np.linalg.solve(reading @ cross + noise, cross.T).T
        kept = identity - gain @ reading
        covariance = kept @ covariance @ kept.T + gain @ noise @ gain.T
        towards = x[GRAVITY] / max(float(np.hypot(*x[GRAVITY])), 1e-9)
        sigma.append(np.sqrt(towards @ covariance[:2, :2] @ towards))
    return time_s, np.array(sigma)


def _trajectory(recording: WorkRecording, time_s: Array) -> tuple[Array, list[MotionHypothesis]]:
    """Return the true states, shape (bins, N_STATES), and what acts; the pivot's acceleration is left over by the motion."""
    turn = np.exp(1j * np.radians(recording.truth["azimuth_deg"]))
    across = -np.sin(np.radians(recording.truth["angle_deg"])) * turn
    u = np.interp(time_s, recording.truth["time_s"], across.real) + 1j * np.interp(
        time_s, recording.truth["time_s"], across.imag
    )
    w = -np.gradient(u, time_s) / np.sqrt(1 - np.abs(u) ** 2)
    length_m = recording.true("length_m", time_s)
    speed_m_s = np.gradient(length_m, time_s)
    manoeuvre = recording.manoeuvre(time_s)
    hypotheses = [(FREE, DRIVEN, FREE, DRIVEN, GUST)[place] for place in manoeuvre]
    force = (length_m * np.gradient(w, time_s) + 2 * speed_m_s * w) / GRAVITY_M_S2 - u
    states = np.zeros((len(time_s), N_STATES))
    for place, pair in ((GRAVITY, u), (RATE, w), (INPUT, np.array([0, -1, 0, -1, 1])[manoeuvre] * force)):
        states[:, place] = np.column_stack([pair.real, pair.imag])
    states[:, LN_LENGTH], states[:, PLACE] = np.log(length_m), recording.above_load_m
    states[:, HOIST_SPEED], states[:, HOIST_ACCELERATION] = speed_m_s, np.gradient(speed_m_s, time_s)
    return states, hypotheses


def _prior(recording: WorkRecording, model: RopeModel) -> Array:
    mixture = MotionFilter(model, recording.constants).mixture
    prior: Array = mixture.covariance[FREE][np.ix_(_STATES, _STATES)].copy()
    return prior
