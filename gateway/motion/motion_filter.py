"""The motion filter: an interacting-multiple-model extended Kalman filter of the rope's motion.

It is bounded in memory and in cost per update, and it never starts anew because of what the crane does.
"""

from dataclasses import replace

import numpy as np

from gateway.motion.gyro_reading import GyroPrior, expected_rate, gyro_noise, rate_variance, with_gyro_states
from gateway.motion.hypotheses import (
    GUST_RATE_1_S,
    GUST_SIGMA,
    HOIST_JERK,
    IS_DRIVEN,
    IS_GUST,
    IS_HOISTING,
    N_HYPOTHESES,
    N_INPUTS,
    PIVOT_RATE_1_S,
    PIVOT_SIGMA,
    transitions,
)
from gateway.motion.initial_state import Constants, initial_mixture
from gateway.motion.innovation import Innovation
from gateway.motion.mixing import SMALLEST_WEIGHT, Exchange, Mixture, revive
from gateway.motion.prediction import add_line, advance_covariance, taylor_step
from gateway.motion.rope_model import RopeModel, axial_curvature
from gateway.motion.state_vector import (
    AXIAL_OFFSET,
    GYRO_BIAS,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    INPUT,
    INPUT_RATE,
    LINE,
    LINE_RATE,
    LN_LENGTH,
    MOVING,
    N_STATES,
    OFFSET,
    PIVOT_VELOCITY,
    RATE,
    SIDE_FORCE,
    SPIN,
)
from gateway.numerics.array import Array

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
SPIN_WALK_1_S = 0.003
"""Random walk of the housing's rate about the rope, 1/s/sqrt(s)."""
SPIN_WITH_LINE = 4.0
"""That walk where a fast oscillation is seen: a hook block turns more easily than a load on a plain rope."""
INPUT_TIME_S = 3.0
"""How long an input lasts, which loses weight where it is much larger than its standard deviation."""
PIVOT_VELOCITY_WALK_M_S = 0.05
"""Random walk of the pivot's velocity, m/s/sqrt(s): a drive too gentle to be seen."""
OUTLIER_SQUARED = 60.0
"""Normalised innovation squared under every hypothesis from which a bin counts as an outlier. Basis: chance exceeds it once in
1e12 bins."""
EXPECTED_SQUARED = 3.0
"""Definition: mean of the normalised innovation squared."""


class MotionFilter:
    """Mean and covariance of the state under each hypothesis, and the hypotheses' weights."""

    def __init__(self, model: RopeModel, constants: Constants, gyro: GyroPrior | None = None) -> None:
        """`gyro`: what is known of the gyroscope, for whose states the model has room; None: there is none."""
        self.model = model
        prior, self._noise = initial_mixture(model.gravity_m_s2, constants), _process_noise()
        if gyro is not None:
            prior, self._noise = with_gyro_states(prior, gyro), gyro_noise(self._noise)
        self._exchange = Exchange(transitions(), prior.state.shape[1])
        self._prior = self.mixture = prior
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
        self.exchange(time_s)
        self.advance(time_s)

    def exchange(self, time_s: float) -> None:
        """Let the hypotheses exchange the probability of a time."""
        self.mixture = self._exchange.after(revive(self.mixture, self._prior), time_s)

    def advance(self, time_s: float) -> None:
        """Advance the motion under each hypothesis, in place."""
        self._step_s = time_s
        x, covariance = self.mixture.state, self.mixture.covariance
        rate, jacobian = self.model.rate(x)
        k = self.model.gravity_m_s2 * np.exp(-x[:, LN_LENGTH])
        noise = self._noise * time_s
        noise[:, RATE] += ((FORCE_NOISE**2 * time_s) * k**2)[:, None]
        if self.line_rate_1_s is None:
            x[:, LINE] = x[:, LINE_RATE] = 0.0
            transition = taylor_step(x, rate, jacobian, time_s, MOVING.stop)
        else:
            before = x.copy()
            transition = taylor_step(x, rate, jacobian, time_s, N_STATES)
            add_line(x, before, transition, k, self.line_rate_1_s, time_s)
            noise[:, SPIN] *= SPIN_WITH_LINE**2
            noise[:, LINE_RATE] += (self.line_walk * self.line_rate_1_s) ** 2 * time_s
        self.model.keep_in_domain(x)
        advance_covariance(covariance, transition)
        covariance.reshape(N_HYPOTHESES, -1)[:, :: x.shape[1] + 1] += noise

    def update(self, reading_g: Array, sigma_g: Array) -> bool:
        """Take the mean reading of a bin, shape (3,), with its standard deviation; return whether it was an outlier.

        Where rounding has made a covariance impossible, the weights become NaN.
        """
        try:
            return self._update(reading_g, sigma_g)
        except np.linalg.LinAlgError:
            self.mixture = replace(self.mixture, weight=np.full(N_HYPOTHESES, np.nan))
            return True

    def _update(self, reading_g: Array, sigma_g: Array) -> bool:
        x, covariance, weight = self.mixture.state, self.mixture.covariance, self.mixture.weight
        expected, jacobian, place_s2 = self.model.reading(x)
        bias, curvature = axial_curvature(covariance, place_s2)
        expected[:, 2] += bias
        cross = covariance @ jacobian.transpose(0, 2, 1)
        spread = jacobian @ cross
        spread[:, 2, 2] += curvature
        noise = _model_variance(x, reading_g, sigma_g)
        found = Innovation.of(reading_g - expected, spread, noise)
        smallest = float(found.squared.min())
        is_outlier = smallest > OUTLIER_SQUARED
        if is_outlier:
            found = Innovation.of(reading_g - expected, spread, noise * (smallest / EXPECTED_SQUARED))
        gain = cross @ found.whitening.transpose(0, 2, 1)
        x = x + np.matvec(gain, found.white)
        self.model.keep_in_domain(x)
        # Safe without the Joseph form: over an hour the least eigenvalue of the correlations stays above 3e-4.
        covariance = covariance - gain @ gain.transpose(0, 2, 1)
        log_density = found.log_density + _transverse_correction(found.transverse_log_density)
        log_weight = np.log(weight) + TEMPERING * (log_density - (0.5 * self._step_s) * _implausibility_1_s(x))
        weight, self.log_evidence = _weighed(log_weight)
        self.mixture = Mixture(x, covariance, weight)
        self.squared_innovation = float(found.squared[weight.argmax()])
        return is_outlier

    def update_rate(self, rate_rad_s: Array, sigma_rad_s: Array) -> float:
        """Take the mean of the gyroscope's readings in a bin, shape (3,); an outlier is not used.

        Returns the normalised innovation squared under the hypothesis that explains it best. Rounding as in `update`.
        """
        try:
            return self._update_rate(rate_rad_s, sigma_rad_s)
        except np.linalg.LinAlgError:
            self.mixture = replace(self.mixture, weight=np.full(N_HYPOTHESES, np.nan))
            return np.inf

    def _update_rate(self, rate_rad_s: Array, sigma_rad_s: Array) -> float:
        x, covariance = self.mixture.state, self.mixture.covariance
        expected, jacobian = expected_rate(x)
        cross = covariance @ jacobian.transpose(0, 2, 1)
        noise = rate_variance(rate_rad_s, x[:, GYRO_BIAS], sigma_rad_s)
        found = Innovation.of(rate_rad_s - expected, jacobian @ cross, noise)
        smallest = float(found.squared.min())
        if not smallest < OUTLIER_SQUARED:
            return smallest
        gain = cross @ found.whitening.transpose(0, 2, 1)
        x = x + np.matvec(gain, found.white)
        self.model.keep_in_domain(x)
        log_density = found.log_density + _transverse_correction(found.transverse_log_density)
        weight, log_evidence = _weighed(np.log(self.mixture.weight) + TEMPERING * log_density)
        self.log_evidence += log_evidence
        self.mixture = Mixture(x, covariance - gain @ gain.transpose(0, 2, 1), weight)
        return smallest

    def widen_gyro_bias(self, u_rad_s: float) -> None:
        """Add an unknown change of the gyroscope's bias, as by a temperature."""
        covariance = self.mixture.covariance.copy()
        places = list(range(GYRO_BIAS.start, GYRO_BIAS.stop))
        covariance[:, places, places] += u_rad_s**2
        self.mixture = replace(self.mixture, covariance=covariance)

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


def _weighed(log_weight: Array) -> tuple[Array, float]:
    """Return the weights, which add up to 1, and the logarithm of what they were divided by."""
    largest = float(log_weight.max())
    weight = np.maximum(np.exp(log_weight - largest), SMALLEST_WEIGHT)
    total = float(weight.sum())
    return weight / total, largest + float(np.log(total))


def _model_variance(x: Array, reading_g: Array, sigma_g: Array) -> Array:
    """Return the variance of a reading's error, shape (m, 3): its noise, and shares of what the equations simplify."""
    transverse = np.square(sigma_g) + READING_FLOOR_G**2
    transverse[:2] += MODEL_SHARE**2 * (reading_g[0] ** 2 + reading_g[1] ** 2)
    transverse[2] += (MODEL_SHARE * (reading_g[2] - 1)) ** 2
    acting = x[:, INPUT]
    variance: Array = transverse + np.vecdot(acting, acting)[:, None] * _INPUT_VARIANCE
    return variance


def _implausibility_1_s(x: Array) -> Array:
    """Return squared speeds and inputs over what cranes and gusts reach, over how long they last, shape (m,)."""
    found: Array = np.vecdot(np.square(x[:, :N_STATES]), _IMPLAUSIBLE)
    return found


def _transverse_correction(transverse_log_density: Array) -> Array:
    """Return what makes the transverse readings as probable under a drive as under a gust, shape (m,).

    Any transverse reading can be explained by either. Which of them has the narrower prior says nothing about the crane, and
    would decide within seconds; so the axial reading decides, and the size of the input.
    """
    alike = transverse_log_density.reshape(-1, N_INPUTS)[:, 1:]
    correction = np.zeros((len(alike), N_INPUTS))
    correction[:, 1:] = alike.max(axis=1, keepdims=True) - alike
    return correction.ravel()


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


def _implausible() -> Array:
    """Return the weight of each state's square in the implausibility, shape (m, N_STATES)."""
    found = np.zeros((N_HYPOTHESES, N_STATES))
    found[:, PIVOT_VELOCITY] = 1 / (PIVOT_SPEED_M_S**2 * SPEED_TIME_S)
    found[:, HOIST_SPEED] = 1 / (HOIST_SPEED_M_S**2 * SPEED_TIME_S)
    found[:, INPUT] = 1 / (np.where(IS_DRIVEN, PIVOT_SIGMA, GUST_SIGMA)[:, None] ** 2 * INPUT_TIME_S)
    return found


_INPUT_VARIANCE = np.array([INPUT_SHARE**2, INPUT_SHARE**2, 0.0])
_IMPLAUSIBLE = _implausible()
