"""The motion filter: an interacting-multiple-model extended Kalman filter of the rope's motion.

It is bounded in memory and in cost per update, and it never starts anew because of what the crane does.
"""

from dataclasses import dataclass

import numpy as np

from gateway.motion.hypotheses import (
    GUST_RATE_1_S,
    GUST_SIGMA,
    HOIST_JERK,
    INITIAL_WEIGHTS,
    IS_DRIVEN,
    IS_GUST,
    IS_HOISTING,
    N_HYPOTHESES,
    PIVOT_RATE_1_S,
    PIVOT_SIGMA,
    MotionHypothesis,
    transitions,
)
from gateway.motion.mixing import SMALLEST_WEIGHT, Exchange, Mixture
from gateway.motion.rope_model import RopeModel, axial_curvature
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    DAMPING,
    GRAVITY,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    INPUT,
    INPUT_RATE,
    LINE,
    LINE_RATE,
    LN_LENGTH,
    MOUNT,
    N_STATES,
    OFFSET,
    PIVOT_VELOCITY,
    PLACE,
    RATE,
    SIDE_FORCE,
    SPIN,
)
from gateway.numerics.array import Array

INITIAL_ANGLE_RAD = 0.12
"""Standard deviation of each component of the rope's angle before the first reading: 7 degrees."""
SIDE_FORCE_U = 3e-3
"""Standard uncertainty of each component of a steady side force over the weight. Basis: leans of 0.2 degrees by a breeze."""
DAMPING_RATIO, DAMPING_RATIO_U = 0.005, 0.005
"""Damping ratio of a load on a rope before it is measured."""
FORCE_NOISE = 3e-5
"""Root of the noise density of unmodelled forces on the load per weight, 1/sqrt(Hz)."""
SIDE_FORCE_WALK = 3e-5
"""Random walk of the steady side force per weight, 1/sqrt(s): 0.01 degrees in a minute."""
OFFSET_WALK_G = 1e-6
"""Random walk of the offsets, g/sqrt(s). Basis: 0.15 mg/K and some kelvin per hour."""
LENGTH_WALK = 1e-5
"""Random walk of ln L while the rope is taken as constant, 1/sqrt(s)."""
READING_FLOOR_G = 3e-5
"""Smallest standard deviation of a bin's mean. Basis: what the equations of motion leave out."""
LINE_WALK = 1.0
"""Relative change of a fast oscillation's amplitude in a second."""
MODEL_SHARE, INPUT_SHARE = 0.003, 0.01
"""Error of the equations as a share of the reading's deviation from rest, and of the input. Basis: scale errors; a load that is
no point; a force that acts on the hook block and on the load."""
TEMPERING = 0.6
"""Exponent of the likelihood by which hypotheses are weighed (Grünwald and van Ommen 2017). Basis: errors of the equations are
not white, so that consecutive readings tell less apart than independent ones would."""
PIVOT_SPEED_M_S, HOIST_SPEED_M_S, SPEED_TIME_S = 1.5, 0.7, 20.0
"""Standard deviations of the speeds of pivot and hoist, and how long a speed lasts: a hypothesis that asks for much more loses
weight. Basis: cranes drive at up to 4 m/s and hoist at up to 1.2 m/s."""
SPIN_U_1_S, SPIN_WALK_1_S = 0.01, 0.003
"""Standard deviation of the housing's rate about the rope at the start, and its random walk, 1/s/sqrt(s)."""
SPIN_WITH_LINE = 4.0
"""That walk where a fast oscillation is seen: a hook block turns more easily than a load on a plain rope."""
INPUT_TIME_S = 3.0
"""How long an input lasts, which loses weight where it is much larger than its standard deviation."""
PIVOT_VELOCITY_WALK_M_S = 0.05
"""Random walk of the pivot's velocity, m/s/sqrt(s): a drive too gentle to be seen."""
OUTLIER_SQUARED = 60.0
"""Normalised innovation squared under every hypothesis from which a bin counts as an outlier. Basis: chance exceeds it once in
1e12 bins."""
SMALLEST_DETERMINANT = 1e-60
"""Of an innovation's covariance. Basis: rounding may leave one below 0 where a hypothesis has long been excluded."""
EXPECTED_SQUARED = 3.0
"""Definition: mean of the normalised innovation squared."""


@dataclass(frozen=True, slots=True)
class Constants:
    """What is known of the crane before the first reading; standard uncertainties are 1 sigma."""

    length_m: float
    length_u_rel: float
    place_m: float
    place_u_m: float
    offset_u_g: tuple[float, float, float]
    mount_u_rad: float


class MotionFilter:
    """Mean and covariance of the state under each hypothesis, and the hypotheses' weights."""

    def __init__(self, model: RopeModel, constants: Constants) -> None:
        self.model = model
        self._exchange = Exchange(transitions())
        self._noise = _process_noise()
        self.mixture = _initial_mixture(model, constants)
        self.line_rate_1_s: float | None = None
        """Angular frequency of a fast oscillation that is part of the state; None: there is none."""
        self._step_s = 0.0
        self.line_walk = 0.0
        """Root of the density with which the oscillation's amplitude changes, 1/sqrt(s)."""
        self.squared_innovation = EXPECTED_SQUARED
        """Normalised, of the most probable hypothesis, at the last update."""
        self.log_evidence = 0.0
        """Logarithm of the probability density of the last reading, but for a constant."""

    def predict(self, time_s: float) -> None:
        """Advance the motion by a time without a reading."""
        self._step_s = time_s
        mixture = self._exchange.after(self.mixture, time_s)
        x, covariance = mixture.state, mixture.covariance
        rate, jacobian = self.model.rate(x)
        scaled = jacobian * time_s
        half = scaled @ scaled * (1 / 6)
        half += 0.5 * scaled
        half += _IDENTITY  # I + A/2 + A^2/6
        transition = scaled @ half
        transition += _IDENTITY
        x = x + time_s * (half @ rate[:, :, None])[:, :, 0]
        if self.line_rate_1_s is not None:
            self._propagate_line(x, mixture.state, transition, time_s)
        else:
            x[:, LINE], x[:, LINE_RATE] = 0.0, 0.0
        self.model.keep_in_domain(x)
        covariance = transition @ covariance @ transition.transpose(0, 2, 1)
        k = self.model.gravity_m_s2 / np.exp(x[:, LN_LENGTH])
        noise = self._noise * time_s
        if self.line_rate_1_s is not None:
            noise[:, SPIN] *= SPIN_WITH_LINE**2
            noise[:, LINE_RATE] += (self.line_walk * self.line_rate_1_s) ** 2 * time_s
        noise[:, RATE] += ((FORCE_NOISE * k) ** 2 * time_s)[:, None]
        covariance.reshape(N_HYPOTHESES, -1)[:, :: N_STATES + 1] += noise
        self.mixture = Mixture(x, covariance, mixture.weight)

    def _propagate_line(self, x: Array, before: Array, transition: Array, time_s: float) -> None:
        """Advance the fast oscillation exactly, because a step may be a large part of its period."""
        omega = self.line_rate_1_s or 1.0
        sine, cosine = np.sin(omega * time_s), np.cos(omega * time_s)
        k = self.model.gravity_m_s2 / np.exp(before[:, LN_LENGTH])
        force, force_rate = before[:, LINE], before[:, LINE_RATE]
        x[:, LINE] = cosine * force + sine / omega * force_rate
        x[:, LINE_RATE] = -omega * sine * force + cosine * force_rate
        x[:, RATE] += k[:, None] * (sine / omega * force + (1 - cosine) / omega**2 * force_rate)
        for i in (0, 1):
            line, line_rate, rate = LINE.start + i, LINE_RATE.start + i, RATE.start + i
            transition[:, line, line] = transition[:, line_rate, line_rate] = cosine
            transition[:, line, line_rate], transition[:, line_rate, line] = sine / omega, -omega * sine
            transition[:, rate, line], transition[:, rate, line_rate] = k * sine / omega, k * (1 - cosine) / omega**2

    def update(self, reading_g: Array, sigma_g: Array) -> bool:
        """Take the mean reading of a bin, shape (3,), with its standard deviation; return whether it was an outlier."""
        x, covariance, weight = self.mixture.state, self.mixture.covariance, self.mixture.weight
        expected, jacobian, place_s2 = self.model.reading(x)
        bias, curvature = axial_curvature(covariance, place_s2)
        expected[:, 2] += bias
        cross = covariance @ jacobian.transpose(0, 2, 1)
        spread = jacobian @ cross
        spread[:, 2, 2] += curvature
        noise = _model_noise(x, reading_g, sigma_g)
        innovation = reading_g - expected
        squared, inverse, determinant = _likelihood(innovation, spread + noise)
        is_outlier = bool(squared.min() > OUTLIER_SQUARED)
        if is_outlier:
            noise = noise * (squared.min() / EXPECTED_SQUARED)
            squared, inverse, determinant = _likelihood(innovation, spread + noise)
        gain = cross @ inverse
        x = x + (gain @ innovation[:, :, None])[:, :, 0]
        self.model.keep_in_domain(x)
        covariance = _joseph(covariance, gain, jacobian, noise, curvature)
        log_density = -0.5 * (squared + np.log(np.maximum(determinant, SMALLEST_DETERMINANT)))
        log_density += _transverse_correction(innovation, spread + noise)
        log_weight = np.log(weight) + TEMPERING * (log_density - 0.5 * self._implausibility(x))
        largest = log_weight.max()
        weight = np.maximum(np.exp(log_weight - largest), SMALLEST_WEIGHT)
        self.log_evidence = float(largest + np.log(weight.sum()))
        self.mixture = Mixture(x, covariance, weight / weight.sum())
        best = int(weight.argmax())
        self.squared_innovation = float(squared[best])
        return is_outlier

    def _implausibility(self, x: Array) -> Array:
        """Return squared speeds and inputs over what cranes and gusts reach, as far as this update counts, shape (m,)."""
        pivot = (x[:, PIVOT_VELOCITY] ** 2).sum(axis=1) / PIVOT_SPEED_M_S**2
        speed = (pivot + x[:, HOIST_SPEED] ** 2 / HOIST_SPEED_M_S**2) / SPEED_TIME_S
        sigma = np.where(IS_DRIVEN, PIVOT_SIGMA, GUST_SIGMA)
        acting = (x[:, INPUT] ** 2).sum(axis=1) / sigma**2 / INPUT_TIME_S
        implausibility: Array = (speed + acting) * self._step_s
        return implausibility

    def widen_offset(self, u_g: Array) -> None:
        """Add an unknown change of the offsets, standard uncertainties of shape (3,), as by a temperature."""
        covariance = self.mixture.covariance.copy()
        places = [*range(OFFSET.start, OFFSET.stop), AXIAL_OFFSET]
        covariance[:, places, places] += u_g**2
        self.mixture = Mixture(self.mixture.state, covariance, self.mixture.weight)

    def begin_line(self, rate_1_s: float, amplitude: float) -> None:
        """Add a fast oscillation of a force to the state, or change its frequency."""
        if self.line_rate_1_s is None:
            covariance = self.mixture.covariance.copy()
            for states, sigma in ((LINE, amplitude), (LINE_RATE, amplitude * rate_1_s)):
                places = list(range(states.start, states.stop))
                covariance[:, places, places] = sigma**2
            self.mixture = Mixture(self.mixture.state, covariance, self.mixture.weight)
        self.line_rate_1_s, self.line_walk = rate_1_s, LINE_WALK * amplitude

    def end_line(self) -> None:
        """Remove the fast oscillation from the state."""
        state, covariance = self.mixture.state.copy(), self.mixture.covariance.copy()
        places = [*range(LINE.start, LINE_RATE.stop)]
        state[:, places] = 0.0
        covariance[:, places], covariance[:, :, places] = 0.0, 0.0
        self.mixture, self.line_rate_1_s = Mixture(state, covariance, self.mixture.weight), None


def _model_noise(x: Array, reading_g: Array, sigma_g: Array) -> Array:
    """Return the covariance of a reading's error, shape (m, 3, 3): its noise, and shares of what the equations simplify."""
    noise = np.zeros((len(x), 3, 3))
    acting = (x[:, INPUT] ** 2).sum(axis=1)
    transverse = np.square(sigma_g) + READING_FLOOR_G**2
    swinging = MODEL_SHARE**2 * (reading_g[0] ** 2 + reading_g[1] ** 2)
    for axis in (0, 1):
        noise[:, axis, axis] = transverse[axis] + swinging + INPUT_SHARE**2 * acting
    noise[:, 2, 2] = transverse[2] + (MODEL_SHARE * (reading_g[2] - 1)) ** 2
    return noise


def _likelihood(innovation: Array, spread: Array) -> tuple[Array, Array, Array]:
    """Return the normalised innovation squared, the inverse and the determinant of its covariance."""
    inverse: Array = np.asarray(np.linalg.inv(spread), dtype=np.float64)
    squared: Array = (innovation[:, None, :] @ inverse @ innovation[:, :, None])[:, 0, 0]
    determinant: Array = np.linalg.det(spread)
    return squared, inverse, determinant


def _transverse_correction(innovation: Array, spread: Array) -> Array:
    """Return what makes the transverse readings as probable under a drive as under a gust, shape (m,).

    Any transverse reading can be explained by either. Which of them has the narrower prior says nothing about the crane, and
    would decide within seconds; so the axial reading decides, and the size of the input.
    """
    a, b, c = spread[:, 0, 0], spread[:, 0, 1], spread[:, 1, 1]
    determinant = a * c - b * b
    x, y = innovation[:, 0], innovation[:, 1]
    squared = (c * x * x - 2 * b * x * y + a * y * y) / determinant
    log_density = -0.5 * (squared + np.log(np.maximum(determinant, SMALLEST_DETERMINANT)))
    correction = np.zeros(len(spread))
    for driven, gust in _ALIKE:
        largest = max(log_density[driven], log_density[gust])
        correction[driven], correction[gust] = largest - log_density[driven], largest - log_density[gust]
    return correction


def _joseph(covariance: Array, gain: Array, jacobian: Array, noise: Array, curvature: Array) -> Array:
    """Return the covariance after an update in the form that stays positive (Bucy and Joseph 1968)."""
    kept = _IDENTITY - gain @ jacobian
    reading = noise.copy()
    reading[:, 2, 2] += curvature
    updated: Array = kept @ covariance @ kept.transpose(0, 2, 1) + gain @ reading @ gain.transpose(0, 2, 1)
    return updated


def _initial_mixture(model: RopeModel, constants: Constants) -> Mixture:
    omega = np.sqrt(model.gravity_m_s2 / constants.length_m)
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


def _process_noise() -> Array:
    """Return the density of the process noise, shape (m, N_STATES), without that of unmodelled forces on the load."""
    noise = np.zeros((N_HYPOTHESES, N_STATES))
    noise[IS_DRIVEN, INPUT_RATE] = 4 * PIVOT_RATE_1_S**3 * PIVOT_SIGMA**2
    noise[IS_GUST, INPUT_RATE] = 4 * GUST_RATE_1_S**3 * GUST_SIGMA**2
    noise[:, SIDE_FORCE] = SIDE_FORCE_WALK**2
    noise[:, OFFSET] = noise[:, AXIAL_OFFSET] = OFFSET_WALK_G**2
    noise[:, LN_LENGTH] = LENGTH_WALK**2
    noise[:, SPIN] = SPIN_WALK_1_S**2
    noise[:, PIVOT_VELOCITY] = PIVOT_VELOCITY_WALK_M_S**2
    noise[IS_HOISTING, HOIST_ACCELERATION] = HOIST_JERK**2
    return noise


_IDENTITY = np.eye(N_STATES)
_ALIKE = tuple((int(h), int(h) + 1) for h in (MotionHypothesis.DRIVEN, MotionHypothesis.DRIVEN_HOISTING))
