"""A bound of the error of the angle: how well anyone can know it who is not told what pivot, wind and winch do.

The equations of motion and of the reading are linearised along the true trajectory. The covariance of a recursive estimate
follows from them, with the priors of the filter for constants and initial motion and without process noise (posterior
Cramér-Rao bound, Tichavský et al. 1998, which is this covariance for a given trajectory). In a drive each bin has its own,
unknown acceleration of the pivot, in a gust its own force on the load, in a hoist its own acceleration of the winch, on a moving
base horizontal and vertical ones of a known size: a variance that each bin brings anew. It is known when these act, that the
accelerometer is on the rope's axis and that the rope is as stiff in all directions.

A filter can be better than this where it rightly takes the acceleration of the pivot as smooth.
"""

from dataclasses import dataclass

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
    HEAVE,
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
BASE_G, BASE_HEAVE_G = 0.02, 0.008
"""Standard deviations of the accelerations of a moving base over g, in each bin anew, as the filter's levels have them."""
GYRO_NOISE_RAD_S_PER_ROOT_HZ, GYRO_BIAS_U_RAD_S = np.radians(0.01), np.radians(5.0) / 3**0.5
"""Of a gyroscope like an MPU-9250."""
_FREE = int(np.flatnonzero(IS_FREE)[0])

_PAIRS = (GRAVITY, RATE, PIVOT, GUST, SIDE_FORCE, OFFSET, MOUNT)
_SINGLE = (HEAVE, HOIST_SPEED, HOIST_ACCELERATION, AXIAL_OFFSET, LN_LENGTH, DAMPING, PLACE)
_STATES = [i for pair in _PAIRS for i in indices(pair)] + list(_SINGLE)
_PIVOT, _FORCE = ([_STATES.index(i) for i in indices(pair)] for pair in (PIVOT, GUST))
_HEAVE, _WINCH_SPEED, _WINCH = (_STATES.index(i) for i in (HEAVE, HOIST_SPEED, HOIST_ACCELERATION))
_RATE = [_STATES.index(i) for i in indices(RATE)]
_MOVES = np.array([i < N_MOVING for i in _STATES])
_OF_HOUSING = [i for pair in (OFFSET, MOUNT) for i in indices(pair)] + [AXIAL_OFFSET, PLACE]
"""Constants that each housing has for itself."""
_HOUSING = [_STATES.index(i) for i in _OF_HOUSING]
_N = len(_STATES)
_SECOND, _BIAS = slice(_N, _N + len(_HOUSING)), slice(_N + len(_HOUSING), _N + len(_HOUSING) + 2)
_N_ALL = _BIAS.stop


@dataclass(frozen=True, slots=True)
class Instruments:
    """What reads beside the accelerometer of the housing."""

    has_gyro: bool = False
    second_above_load_m: float | None = None
    """Place of the accelerometer of a second housing on the same rope."""


def bound_rad(
    recording: WorkRecording, instruments: Instruments = Instruments(), *, has_moving_base: bool = False
) -> tuple[Array, Array]:
    """Return time and the smallest standard deviation of the angle, for each bin."""
    model = RopeModel(GRAVITY_M_S2, recording.believed_length_m, is_clamped=True)
    time_s: Array = np.arange(recording.truth["time_s"][0], recording.truth["time_s"][-1], BIN_S)
    driven, hoisting, gust = (recording.true(name, time_s) > 0.5 for name in ("driven", "hoisting", "gust"))
    states = _trajectory(recording, time_s, driven | has_moving_base, gust)
    covariance = _prior(recording, model)
    noise = _noise(recording, instruments)
    identity = np.eye(_N_ALL)
    sigma = []
    for x, drives, hoists, blows in zip(states, driven, hoisting, gust, strict=True):
        everywhere = np.tile(x, (N_HYPOTHESES, 1))
        _renew(covariance, _PIVOT, UNINFORMED_G if drives else BASE_G * has_moving_base)
        _renew(covariance, _FORCE, UNINFORMED_G if blows else 0.0)
        _renew(covariance, [_HEAVE], BASE_HEAVE_G * has_moving_base)
        _renew(covariance, [_WINCH], UNINFORMED_G * GRAVITY_M_S2 if hoists else 0.0)
        if not hoists:
            _renew(covariance, [_WINCH_SPEED], 0.0)
        rate = np.zeros((_N_ALL, _N_ALL))
        by_state = model.rate(everywhere)[1][_FREE][np.ix_(np.array(_STATES)[_MOVES], _STATES)]
        rate[:_N, :_N][_MOVES] = BIN_S * by_state
        transition = identity + rate + rate @ rate / 2
        covariance = transition @ covariance @ transition.T
        reading = _reading(model, everywhere, instruments)
        cross = covariance @ reading.T
        gain = np.linalg.solve(reading @ cross + noise, cross.T).T
        kept = identity - gain @ reading
        covariance = kept @ covariance @ kept.T + gain @ noise @ gain.T
        towards = x[GRAVITY] / max(float(np.hypot(*x[GRAVITY])), 1e-9)
        sigma.append(np.sqrt(towards @ covariance[:2, :2] @ towards))
    return time_s, np.array(sigma)


def _renew(covariance: Array, places: list[int], sigma: float) -> None:
    """Forget what is known of states, in place: they have this standard deviation from now on."""
    covariance[places], covariance[:, places] = 0.0, 0.0
    covariance[places, places] = sigma**2


def _reading(model: RopeModel, x: Array, instruments: Instruments) -> Array:
    """Return the derivative of all readings by the state."""
    first = np.zeros((3, _N_ALL))
    first[:, :_N] = model.reading(x)[1][_FREE][:, _STATES]
    rows = [first]
    if instruments.second_above_load_m is not None:
        there = x.copy()
        there[:, PLACE] = instruments.second_above_load_m
        second = np.zeros((3, _N_ALL))
        second[:, :_N] = model.reading(there)[1][_FREE][:, _STATES]
        second[:, _SECOND], second[:, _HOUSING] = second[:, _HOUSING], 0.0
        rows.append(second)
    if instruments.has_gyro:
        turning = np.zeros((2, _N_ALL))
        turning[:, _RATE] = turning[:, _BIAS] = np.eye(2)
        rows.append(turning)
    return np.concatenate(rows)


def _noise(recording: WorkRecording, instruments: Instruments) -> Array:
    """Return the covariance of the readings of one bin."""
    housings = 1 if instruments.second_above_load_m is None else 2
    of_force = [recording.noise_g**2 / (BIN_S * SAMPLE_RATE_HZ)] * 3 * housings
    of_rate = [GYRO_NOISE_RAD_S_PER_ROOT_HZ**2 / (2 * BIN_S)] * 2 if instruments.has_gyro else []
    return np.diag([*of_force, *of_rate])


def _trajectory(recording: WorkRecording, time_s: Array, driven: NDArray[np.bool_], gust: NDArray[np.bool_]) -> Array:
    """Return the true states, shape (bins, N_STATES); the pivot's acceleration is left over by the motion."""
    turn = np.exp(1j * np.radians(recording.truth["azimuth_deg"]))
    across = -np.sin(np.radians(recording.truth["angle_deg"])) * turn
    u = np.interp(time_s, recording.truth["time_s"], across.real) + 1j * np.interp(
        time_s, recording.truth["time_s"], across.imag
    )
    w = -np.gradient(u, time_s) / np.sqrt(1 - np.abs(u) ** 2)
    length_m = recording.true("length_m", time_s)
    speed_m_s = np.gradient(length_m, time_s)
    force = (length_m * np.gradient(w, time_s) + 2 * speed_m_s * w) / GRAVITY_M_S2 - u
    states = np.zeros((len(time_s), N_STATES))
    for place, pair in (
        (GRAVITY, u),
        (RATE, w),
        (PIVOT, np.where(driven, -force, 0.0)),
        (GUST, np.where(gust & ~driven, force, 0.0)),
    ):
        states[:, place] = np.column_stack([pair.real, pair.imag])
    states[:, LN_LENGTH], states[:, PLACE] = np.log(length_m), recording.above_load_m
    states[:, HOIST_SPEED], states[:, HOIST_ACCELERATION] = speed_m_s, np.gradient(speed_m_s, time_s)
    return states


def _prior(recording: WorkRecording, model: RopeModel) -> Array:
    """Return the covariance before the first reading; a second housing is as uncertain as the first one."""
    mixture = MotionFilter(model, recording.constants).mixture
    prior = np.zeros((_N_ALL, _N_ALL))
    prior[:_N, :_N] = mixture.covariance[_FREE][np.ix_(_STATES, _STATES)]
    prior[_SECOND, _SECOND] = prior[np.ix_(_HOUSING, _HOUSING)]
    prior[_BIAS, _BIAS] = np.eye(2) * GYRO_BIAS_U_RAD_S**2
    return prior
