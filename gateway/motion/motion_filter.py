"""The motion filter: an interacting-multiple-model extended Kalman filter of the motion of rope, load and crane.

It is bounded in memory and in cost per update. What is constant (offsets, place, stiffness) is constant for a time only: it
returns to what was stated, so that no misfit drives it away for good and none is certain for ever.
"""

import math
from functools import lru_cache

import numpy as np

from gateway.motion.disturbances import DisturbanceStep
from gateway.motion.fast_oscillation import FastOscillation
from gateway.motion.gyro_reading import BIAS_WALK_RAD_S, GyroPrior, expected_rate, rate_variance, with_gyro_states
from gateway.motion.hypotheses import (
    BOUNCE_RATE_1_S,
    IS_FLOATING,
    N_HYPOTHESES,
    WIND_LEVEL,
    WIND_LEVELS,
    releases,
    stops,
)
from gateway.motion.initial_state import Constants, initial_mixture
from gateway.motion.mixture import Ending, Mixture, Renewal, exchange
from gateway.motion.rope_model import RopeModel, axial_curvature
from gateway.motion.state_vector import (
    GUST,
    GYRO_BIAS,
    HEAVE,
    HEAVE_RATE,
    HOIST_ACCELERATION,
    HOIST_SPEED,
    LINE,
    LINE_RATE,
    LN_LENGTH,
    N_MOVING,
    N_STATES,
    PIVOT,
    PIVOT_RATE,
    PIVOT_VELOCITY,
    PLACE,
    RATE,
    SIDE_FORCE,
    SPIN,
    indices,
)
from gateway.motion.stated_values import CONSTANTS, N_STATED, RETURN_EVERY_S, StatedValues
from gateway.motion.step_record import StepRecord, kept_transition
from gateway.numerics.array import Array

FORCE_NOISE = 3e-5
"""Root of the noise density of unmodelled forces on the load per weight, 1/sqrt(Hz)."""
LENGTH_WALK = 1e-3
"""Random walk of ln L, 1/sqrt(s): slings that settle, a hoist too slow to be seen."""
SPIN_WALK_1_S = 0.003
"""Random walk of the housing's rate about the rope, 1/s/sqrt(s)."""
PIVOT_VELOCITY_WALK_M_S = 0.05
"""Random walk of the pivot's velocity, m/s/sqrt(s): a drive too gentle to be seen."""
BOUNCE_WALK = 0.5
"""Relative change of a load's bounce in a second. Basis: its frequency is known to a fifth."""
LINE_WALK, LINE_TIME_S = 0.5, 20.0
"""Relative change of a fast oscillation's amplitude in a second, and the time in which it dies away."""
READING_FLOOR_G = 5e-5
"""Smallest standard deviation of a bin's mean. Basis: what the equations of motion leave out."""
MODEL_SHARE = 0.003
"""Error of the equations as a share of the reading's deviation from rest. Basis: scale errors, a load that is no point."""
TEMPERING = 0.45
"""Exponent of the readings' likelihood by which hypotheses are weighed (Grünwald and van Ommen 2017); what is stated counts
whole. Basis: errors of the equations are not white, so that consecutive readings tell less apart than independent ones; with
0.6 the error on real cranes is a fiftieth smaller, and intervals hold less often."""
MISFIT_TIME_S, LARGEST_MISFIT = 0.8, 30.0
"""Time over which residuals beyond the expected count as noise of the reading, and the most that one of them counts, in expected
variances. Basis: a bounce at a brake lasts for a few bins; with 6 s the error of the angle is a tenth larger on 63
simulated cranes. An impact of one bin is no vibration."""
OUTLIER_SQUARED = 30.0
"""Normalised innovation squared under every hypothesis from which a bin counts as an outlier. Basis: chance exceeds it once in
7e5 bins."""
EXPECTED_SQUARED = 3.0
"""Definition: mean of the normalised innovation squared."""
PLACE_SHARE = 0.5
"""Share of the optimal correction of the housing's place that a reading makes (a partial update: Brink 2017), because what the
equations leave out is no news of a clamp. Basis: with the whole correction two gusts after a hoist move a place by five of its
uncertainties, and of the angle's intervals on the demonstration's cranes 94.0 % hold instead of 95.2; with 0.3 the error on
three of 27 real cranes is a tenth to a half larger."""
SMALLEST_WEIGHT = 1e-30
"""Keeps weights positive; a hypothesis revives by transitions from the others."""
STEP_RESOLUTION_S = 1e-3
"""Resolution of the time for which disturbances change within a step. Basis: bins of a stream differ by less."""
STOPPED_SPEED_M_S = 0.02
"""Standard deviation of the speed of a winch that has just stopped."""
_RELEASED, _LEVELS = releases()
_RELEASES = Renewal(_RELEASED, SIDE_FORCE, np.square([WIND_LEVELS[level].side_sigma for level in _LEVELS]))
"""The steady force by which ground or a snag hold a load ends when they let go of it."""
_STOPS = Ending(stops(), HOIST_SPEED, STOPPED_SPEED_M_S**2)
"""A winch rests once its speed is zero."""
_N_OBSERVED = 3 + N_STATED
_DIAGONAL = np.arange(_N_OBSERVED)


class MotionFilter:
    """Mean and covariance of the state under each hypothesis, and the hypotheses' weights."""

    def __init__(
        self, model: RopeModel, constants: Constants, gyro: GyroPrior | None = None, *, floats: bool = False
    ) -> None:
        """`gyro`: what is known of the gyroscope, for whose states the model has room; None: there is none.

        `floats`: the crane stands on a floating base.
        """
        self.model = model
        prior = initial_mixture(model.gravity_m_s2, constants, on_spreader=model.on_spreader, floats=floats)
        self.prior = prior if gyro is None else with_gyro_states(prior, gyro)
        self.mixture = self.prior
        self._stated = StatedValues(self.prior)
        self._least = np.minimum(prior.weight, SMALLEST_WEIGHT)
        """Smallest weight of each hypothesis."""
        self._line: FastOscillation | None = None
        """A fast oscillation that is part of the state."""
        self._step_s = 1.0
        self._since_return_s = 0.0
        self._misfit_g2 = np.zeros((N_HYPOTHESES, 3))
        """Variance of what the residuals of each hypothesis show beyond the expected."""
        self.squared_innovation = EXPECTED_SQUARED
        """Normalised, of the hypothesis that is most probable after the last reading."""
        self.log_evidence = 0.0
        """Logarithm of the probability density of the last reading, but for a constant."""

    @property
    def line_rate_1_s(self) -> float | None:
        """Angular frequency of a fast oscillation that is part of the state; None: there is none."""
        return None if self._line is None else self._line.rate_1_s

    @property
    def is_broken(self) -> bool:
        """It has lost its numbers; it must be made anew."""
        return not math.isfinite(float(self.mixture.weight.sum()))

    def predict(self, time_s: float) -> None:
        """Advance the motion by a time."""
        self._predict(time_s)

    def recorded_predict(self, time_s: float, at_s: float | None) -> StepRecord:
        """Advance the motion by a time; return the step for a smoother. `at_s`: the time before, None between two bins."""
        before = self.mixture
        mixed, transition, factor, exchanged = self._predict(time_s)
        return StepRecord.of(at_s, before, mixed, self.mixture, kept_transition(transition, factor), exchanged)

    def _predict(self, time_s: float) -> tuple[Mixture, Array, Array, Array]:
        """Advance the motion; return the mixture after the exchange of probability, the transition of the moving states, the
        factors of the others, and the probabilities of the exchange.
        """
        self._step_s = time_s
        step = _disturbance_step(round(time_s / STEP_RESOLUTION_S))
        mixed, share, exchanged = exchange(self.mixture, step.exchange, _STOPS, _RELEASES)
        self._misfit_g2 = share @ self._misfit_g2
        x, covariance = mixed.state.copy(), mixed.covariance.copy()
        transition = self._flow(x, time_s)
        _follow_levels(x, transition, step)
        self.model.keep_in_domain(x)
        _advance(covariance, transition)
        self._add_noise(covariance, x, step, time_s)
        if self._line is not None:
            _advance_line(x, covariance, self._line, time_s)
        factor = np.ones_like(x)
        self._since_return_s += time_s
        if self._since_return_s >= RETURN_EVERY_S:
            factor *= self._stated.draw_back(x, covariance, self._since_return_s)
            self._since_return_s = 0.0
        self.mixture = Mixture(x, covariance, mixed.weight)
        return mixed, transition, factor, exchanged

    def _flow(self, x: Array, time_s: float) -> Array:
        """Advance states in place by a Taylor step of fourth order; return that of the moving ones, shape (m, N_MOVING, n)."""
        rate, scaled = self.model.rate(x)
        rate *= time_s
        scaled *= time_s
        within = scaled[:, :, :N_MOVING]
        later = within @ (scaled / 24) + scaled / 6
        later = within @ later
        later += 0.5 * scaled
        x[:, :N_MOVING] += rate + np.matvec(later[:, :, :N_MOVING], rate)
        transition: Array = within @ later
        transition += scaled
        transition.reshape(len(x), -1)[:, :: x.shape[1] + 1] += 1.0
        return transition

    def _add_noise(self, covariance: Array, x: Array, step: DisturbanceStep, time_s: float) -> None:
        k = self.model.gravity_m_s2 * np.exp(-x[:, LN_LENGTH])
        noise = np.zeros((len(x), x.shape[1]))
        noise[:, RATE] = (FORCE_NOISE**2 * time_s * k**2)[:, None]
        noise[:, GUST] = step.gust_noise[:, None]
        noise[:, SIDE_FORCE] = (_SIDE_WALK_SQUARED * time_s)[:, None]
        noise[:, PIVOT_VELOCITY] = PIVOT_VELOCITY_WALK_M_S**2 * time_s
        noise[:, LN_LENGTH], noise[:, SPIN] = LENGTH_WALK**2 * time_s, SPIN_WALK_1_S**2 * time_s
        if x.shape[1] > N_STATES:
            noise[:, GYRO_BIAS] = BIAS_WALK_RAD_S**2 * time_s
        covariance.reshape(len(x), -1)[:, :: x.shape[1] + 1] += noise
        for i in (0, 1):
            pair = [PIVOT.start + i, PIVOT_RATE.start + i]
            covariance[:, pair[0] : pair[1] + 1 : 2, pair[0] : pair[1] + 1 : 2] += step.pivot_noise
        covariance[:, HOIST_SPEED : HOIST_ACCELERATION + 1, HOIST_SPEED : HOIST_ACCELERATION + 1] += step.hoist_noise
        covariance[:, HEAVE : HEAVE_RATE + 1, HEAVE : HEAVE_RATE + 1] += step.heave_noise
        bounce_squared = x[:, HEAVE] ** 2 + (x[:, HEAVE_RATE] / BOUNCE_RATE_1_S) ** 2
        walk = np.where(IS_FLOATING, 0.0, BOUNCE_WALK**2 * time_s * bounce_squared)
        covariance[:, HEAVE, HEAVE] += walk
        covariance[:, HEAVE_RATE, HEAVE_RATE] += walk * BOUNCE_RATE_1_S**2

    def update(self, reading_g: Array, sigma_g: Array) -> bool:
        """Take the mean reading of a bin, shape (3,), with its standard deviation; return whether it was an outlier.

        Where rounding has made a covariance impossible, the weights become NaN.
        """
        try:
            return self._update(reading_g, sigma_g)
        except np.linalg.LinAlgError:
            self._break()
            return True

    def _update(self, reading_g: Array, sigma_g: Array) -> bool:
        x, covariance = self.mixture.state, self.mixture.covariance
        expected, by_state, place_s2 = self.model.reading(x)
        bias, curvature = axial_curvature(covariance, place_s2)
        innovation = np.empty((len(x), _N_OBSERVED))
        innovation[:, :3] = reading_g - expected
        innovation[:, 2] -= bias
        innovation[:, 3:] = self._stated.innovation(x)
        jacobian = np.zeros((len(x), _N_OBSERVED, x.shape[1]))
        jacobian[:, :3] = by_state
        jacobian[:, 3:] = self._stated.jacobian
        noise = self._observation_noise(reading_g, sigma_g)
        noise[:, 2] += curvature

        cross = covariance @ jacobian.transpose(0, 2, 1)
        spread = jacobian @ cross
        spread[:, _DIAGONAL, _DIAGONAL] += noise
        information = np.linalg.inv(spread[:, :3, :3])
        weighted = np.matvec(information, innovation[:, :3])
        squared = np.vecdot(innovation[:, :3], weighted)
        smallest = float(squared.min())
        is_outlier = smallest > OUTLIER_SQUARED
        # What the update leaves of an innovation, R S^-1 v, has the covariance R S^-1 R.
        residual_g2 = np.square(noise[:, :3] * weighted)
        expected_g2 = np.square(noise[:, :3]) * information[:, _DIAGONAL[:3], _DIAGONAL[:3]]
        if is_outlier:
            places = _DIAGONAL[:3]
            spread[:, places, places] *= 1 + smallest / EXPECTED_SQUARED
        root = np.linalg.cholesky(spread)
        whitening = np.linalg.inv(root)
        white = np.matvec(whitening, innovation)
        gain = cross @ whitening.transpose(0, 2, 1)
        x, covariance = _corrected(x, covariance, gain, white)
        self.model.keep_in_domain(x)
        likelihood = -0.5 * np.square(white) - np.log(root[:, _DIAGONAL, _DIAGONAL])
        likelihood[:, 3:] += 0.5 * np.log(noise[:, 3:])  # what is stated has no units of its own
        likelihood[:, :3] *= TEMPERING
        weight, self.log_evidence = _weighed(np.log(self.mixture.weight) + likelihood.sum(axis=1), self._least)
        self.mixture = Mixture(x, covariance, weight)
        self.squared_innovation = float(squared[weight.argmax()])
        self._follow_misfit(residual_g2, expected_g2)
        return is_outlier

    def _observation_noise(self, reading_g: Array, sigma_g: Array) -> Array:
        """Return the variance of a bin's errors and of what is stated of speeds and length, shape (m, 7)."""
        noise = np.empty((N_HYPOTHESES, _N_OBSERVED))
        variance = np.square(sigma_g) + READING_FLOOR_G**2
        variance[:2] += MODEL_SHARE**2 * float(reading_g[0] ** 2 + reading_g[1] ** 2)
        variance[2] += (MODEL_SHARE * float(reading_g[2] - 1)) ** 2
        noise[:, :3] = variance + self._misfit_g2
        noise[:, 3:] = self._stated.noise(self._step_s)
        return noise

    def _follow_misfit(self, residual_g2: Array, expected_g2: Array) -> None:
        """Take residuals beyond the expected as noise of the reading, for each hypothesis by its own, shapes (m, 3).

        A disturbance that a hypothesis allows for leaves small residuals; one that it lacks costs it evidence from then on.
        """
        share = min(1.0, self._step_s / MISFIT_TIME_S)
        beyond_g2 = np.minimum(residual_g2, LARGEST_MISFIT * expected_g2) - expected_g2
        beyond_g2[:, :2] = beyond_g2[:, :2].mean(axis=1, keepdims=True)
        self._misfit_g2 = np.maximum(0.0, self._misfit_g2 + share * beyond_g2)

    def update_rate(self, rate_rad_s: Array, sigma_rad_s: Array) -> float:
        """Take the mean of the gyroscope's readings in a bin, shape (3,); an outlier is not used.

        Returns the normalised innovation squared under the hypothesis that explains it best. Rounding as in `update`.
        """
        try:
            return self._update_rate(rate_rad_s, sigma_rad_s)
        except np.linalg.LinAlgError:
            self._break()
            return np.inf

    def _update_rate(self, rate_rad_s: Array, sigma_rad_s: Array) -> float:
        x, covariance = self.mixture.state, self.mixture.covariance
        expected, jacobian = expected_rate(x)
        cross = covariance @ jacobian.transpose(0, 2, 1)
        spread = jacobian @ cross
        spread[:, _DIAGONAL[:3], _DIAGONAL[:3]] += rate_variance(rate_rad_s, x[:, GYRO_BIAS], sigma_rad_s)
        root = np.linalg.cholesky(spread)
        whitening = np.linalg.inv(root)
        white = np.matvec(whitening, rate_rad_s - expected)
        squared = np.vecdot(white, white)
        smallest = float(squared.min())
        if not smallest < OUTLIER_SQUARED:
            return smallest
        gain = cross @ whitening.transpose(0, 2, 1)
        x, covariance = _corrected(x, covariance, gain, white)
        self.model.keep_in_domain(x)
        log_density = -0.5 * squared - np.log(root[:, _DIAGONAL[:3], _DIAGONAL[:3]]).sum(axis=1)
        weight, log_evidence = _weighed(np.log(self.mixture.weight) + TEMPERING * log_density, self._least)
        self.log_evidence += log_evidence
        self.mixture = Mixture(x, covariance, weight)
        return smallest

    def _break(self) -> None:
        self.mixture = Mixture(self.mixture.state, self.mixture.covariance, np.full(N_HYPOTHESES, np.nan))

    def forget_motion(self) -> None:
        """Return to what was known of the motion before the first reading, but keep the constants; after a gap."""
        mean, covariance = self.mixture.moments()
        state, spread = self.prior.state.copy(), self.prior.covariance.copy()
        state[:, CONSTANTS] = mean[CONSTANTS]
        spread[:, CONSTANTS], spread[:, :, CONSTANTS] = 0.0, 0.0
        spread[np.ix_(range(N_HYPOTHESES), CONSTANTS, CONSTANTS)] = covariance[np.ix_(CONSTANTS, CONSTANTS)]
        state[:, LN_LENGTH] = mean[LN_LENGTH]
        self.mixture = Mixture(state, spread, self.prior.weight)
        self._line = None

    def widen(self, states: slice | int, u: float | Array) -> None:
        """Add an unknown change of states, standard uncertainty, as by a temperature."""
        covariance = self.mixture.covariance.copy()
        places = indices(states)
        covariance[:, places, places] += np.square(u)
        self.mixture = Mixture(self.mixture.state, covariance, self.mixture.weight)

    def follow_line(self, found: FastOscillation | None) -> None:
        """Make a fast oscillation of the reading part of the state, or change its frequency; None: remove it."""
        both = indices(slice(LINE.start, LINE_RATE.stop))
        if (found is None) != (self._line is None):
            state, covariance = self.mixture.state.copy(), self.mixture.covariance.copy()
            state[:, both], covariance[:, both], covariance[:, :, both] = 0.0, 0.0, 0.0
            if found is not None:
                spread = np.square([found.amplitude_g, found.amplitude_g * found.rate_1_s])
                covariance[:, both, both] = np.repeat(spread, 2)
            self.mixture = Mixture(state, covariance, self.mixture.weight)
        self._line = found


@lru_cache(maxsize=64)
def _disturbance_step(steps: int) -> DisturbanceStep:
    return DisturbanceStep.of(max(steps, 1) * STEP_RESOLUTION_S)


def _follow_levels(x: Array, transition: Array, step: DisturbanceStep) -> None:
    """Let the disturbances decay as their levels have it, in place."""
    for i in (0, 1):
        pair = slice(PIVOT.start + i, PIVOT_RATE.start + i + 1, 2)
        x[:, pair] = np.matvec(step.pivot, x[:, pair])
        transition[:, pair] = step.pivot @ transition[:, pair]
    hoist = slice(HOIST_SPEED, HOIST_ACCELERATION + 1)
    x[:, hoist] = np.matvec(step.hoist, x[:, hoist])
    transition[:, hoist] = step.hoist @ transition[:, hoist]
    heave = slice(HEAVE, HEAVE_RATE + 1)
    x[:, heave] = np.matvec(step.heave, x[:, heave])
    transition[:, heave] = step.heave @ transition[:, heave]
    x[:, GUST] *= step.gust[:, None]
    transition[:, GUST] *= step.gust[:, None, None]


def _advance_line(x: Array, covariance: Array, line: FastOscillation, time_s: float) -> None:
    """Turn the fast oscillation exactly, in place, because a step may be a large part of its period."""
    omega, decay = line.rate_1_s, math.exp(-time_s / LINE_TIME_S)
    sine, cosine = decay * math.sin(omega * time_s), decay * math.cos(omega * time_s)
    turn = np.kron(np.array([[cosine, sine / omega], [-omega * sine, cosine]]), np.eye(2))
    both = slice(LINE.start, LINE_RATE.stop)
    x[:, both] = x[:, both] @ turn.T
    covariance[:, both] = turn @ covariance[:, both]
    covariance[:, :, both] = covariance[:, :, both] @ turn.T
    variance = 0.5 * (LINE_WALK**2 + line.rate_u_1_s**2) * line.amplitude_g**2 * time_s
    places = indices(both)
    covariance[:, places, places] += np.repeat([variance, variance * omega**2], 2)


def _advance(covariance: Array, transition: Array) -> None:
    """Advance covariances, shape (m, n, n), in place by the transition of the moving states, shape (m, N_MOVING, n)."""
    rows = transition @ covariance
    block = rows @ transition.transpose(0, 2, 1)
    block += block.transpose(0, 2, 1)
    covariance[:, :N_MOVING, :N_MOVING] = 0.5 * block
    covariance[:, :N_MOVING, N_MOVING:] = rows[:, :, N_MOVING:]
    covariance[:, N_MOVING:, :N_MOVING] = rows[:, :, N_MOVING:].transpose(0, 2, 1)


def _corrected(x: Array, covariance: Array, gain: Array, white: Array) -> tuple[Array, Array]:
    """Return states and covariances after a reading: optimal, but for the place, which takes a part of its correction."""
    step = np.matvec(gain, white)
    step[:, PLACE] *= PLACE_SHARE
    # Safe without the Joseph form: over an hour the least eigenvalue of the correlations stays above 3e-4.
    covariance = covariance - gain @ gain.transpose(0, 2, 1)
    covariance[:, PLACE, PLACE] += (1 - PLACE_SHARE) ** 2 * np.vecdot(gain[:, PLACE], gain[:, PLACE])
    return x + step, covariance


def _weighed(log_weight: Array, least: Array) -> tuple[Array, float]:
    """Return the weights, which add up to 1 and have a least, and the logarithm of what they were divided by."""
    largest = float(log_weight.max())
    weight = np.exp(log_weight - largest)
    total = float(weight.sum())
    weight = np.maximum(weight / total, least)
    return weight / weight.sum(), largest + math.log(total)


_SIDE_WALK_SQUARED = np.square([WIND_LEVELS[level].side_walk for level in WIND_LEVEL])
