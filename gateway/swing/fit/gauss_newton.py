"""The most likely motion of a window (MAP): weighted residuals and priors, minimised by Gauss-Newton."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.swing.data.bins import Bins
from gateway.swing.fit.multiple_shooting import LinearisedMotion, linearise_segments, relative_step_size, take_step
from gateway.swing.fit.priors import Prior, SensorModel
from gateway.swing.model.motion import LN_LENGTH, N_STATES, PendulumMotion
from gateway.swing.model.rope_spline import RopeLengthSpline
from gateway.swing.model.spherical_pendulum import SensorPlacement, position_jacobian, specific_force_g

CONVERGED_CHI2_FALL, SETTLED_CHI2_FALL = 0.01, 1.0
"""Fall of chi-square that a step may still promise when it is no longer taken, and when steps no longer keep the promise."""
STAGNANT_CHI2_FALL = 0.05
"""Fall of chi-square by a step, below which steps do not keep their promise: the axes hardly see what they change."""
SLOW_CHI2_RATIO, UNEXPLAINED_CHI2 = 0.5, 10.0
"""Part of chi-square that a step leaves, and chi-square per reading, from which on steps are not on their way to an answer."""
MAX_SHARE_OF_MOTION = 0.5
MAX_LENGTH_STEP = 0.15
MAX_LENGTH_RATIO = 50.0
"""Largest ratio of the rope's length to the stated one, either way. Basis: more than any hoist; on a rope without length a
swing has no period, and a grid no end."""


@dataclass(frozen=True, slots=True)
class SwingFit:
    """The most likely motion, with all that its uncertainty is computed from."""

    linearised: LinearisedMotion
    sensor: SensorModel
    prior: Prior
    jacobian: Array
    """Derivative of the bins' specific force in g by the fitted unknowns, shape (bins, 3, free)."""
    bins: Bins
    residual_g: Array
    """Measured minus predicted, shape (bins, 3)."""
    weight: Array
    """1/variance of the bins, shape (bins, 3)."""
    unknowns: Array
    """First state, the motion's parameters, the sensor's errors."""
    cost: float
    """Chi-square of the data and of the prior."""
    converged: bool
    iterations: int

    @property
    def motion(self) -> PendulumMotion:
        """The motion."""
        return self.linearised.motion

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which unknowns were fitted."""
        return self.prior.free


def maximum_a_posteriori(
    bins: Bins, weight: Array, motion: PendulumMotion, prior: Prior, iterations: int, sensor: SensorModel | None = None
) -> SwingFit | None:
    """Fit from `motion`, whose grid must cover the bins; None where that leaves the model."""
    fit = linearise(bins, weight, motion, prior, sensor)
    return None if fit is None else iterate(fit, iterations)


def linearise(
    bins: Bins, weight: Array, motion: PendulumMotion, prior: Prior, sensor: SensorModel | None = None
) -> SwingFit | None:
    """Compare a motion with the data and linearise it: the starting point of Gauss-Newton; None outside the model."""
    return _linearise(bins, weight, motion, sensor or SensorModel.ideal(), prior, 0)


def iterate(fit: SwingFit, iterations: int, should_abandon: Callable[[SwingFit], bool] | None = None) -> SwingFit:
    """Return the fit after some iterations of Gauss-Newton; it may not have converged.

    A step that makes the fit worse is tried again at half its length. `should_abandon` is asked where two steps in a row have
    gained little and much is unexplained: what the pendulum explains is found in two or three steps.
    """
    best, fraction, slow = fit, 1.0, 0
    for iteration in range(1, iterations + 2):
        step, predicted_gain = _gauss_newton_step(best)
        if predicted_gain < CONVERGED_CHI2_FALL:
            return replace(best, converged=True)
        trial = _stepped(best, step, fraction * _step_fraction(best.linearised, step), iteration)
        before = best.cost
        if trial is not None and trial.cost < before + CONVERGED_CHI2_FALL:
            stagnant = predicted_gain < SETTLED_CHI2_FALL and before - trial.cost < STAGNANT_CHI2_FALL
            best, fraction = trial, min(1.0, 2 * fraction)
            if stagnant:
                return replace(best, converged=True)
        else:
            fraction /= 2
        slow = (
            slow + 1
            if iteration > 1 and best.cost > max(SLOW_CHI2_RATIO * before, UNEXPLAINED_CHI2 * best.weight.size)
            else 0
        )
        if slow >= 2 and should_abandon is not None and should_abandon(best):
            return best
    return best


def _stepped(fit: SwingFit, step: Array, fraction: float, iteration: int) -> SwingFit | None:
    n_unknowns = fit.linearised.n_unknowns
    motion = take_step(fit.linearised, step[:n_unknowns], fraction)
    sensor = fit.sensor.stepped(fraction * step[n_unknowns:])
    return _linearise(fit.bins, fit.weight, motion, sensor, fit.prior, iteration)


def reweight(fit: SwingFit, weight: Array) -> SwingFit:
    """Return the same motion with other weights of the bins."""
    cost = _cost(fit.residual_g, weight, fit.unknowns, fit.prior)
    return replace(fit, weight=weight, cost=cost, converged=False)


def information_matrix(fit: SwingFit) -> Array:
    """Return the information of data and prior on the fitted unknowns, shape (free, free)."""
    return weighted_square(fit.jacobian, fit.weight) + np.diag(fit.prior.information)


def weighted_square(jacobian: Array, weight: Array) -> Array:
    """Return J^T W J for a jacobian of shape (bins, 3, free) and weights of shape (bins, 3)."""
    rows = (jacobian * np.sqrt(weight)[..., None]).reshape(-1, jacobian.shape[-1])
    square: Array = rows.T @ rows
    return square


@np.errstate(over="ignore", invalid="ignore")  # a step to a motion that diverges is not taken
def _linearise(
    bins: Bins, weight: Array, motion: PendulumMotion, sensor: SensorModel, prior: Prior, iteration: int
) -> SwingFit | None:
    shortest_m, longest_m = motion.extreme_lengths_m
    stated_m = prior.rig.length_m
    if not (stated_m / MAX_LENGTH_RATIO < shortest_m and longest_m < stated_m * MAX_LENGTH_RATIO):
        return None
    linearised = linearise_segments(motion)
    if not (np.isfinite(linearised.trajectory.state).all() and np.isfinite(linearised.condensed).all()):
        return None
    times = motion.grid.locate(bins.quadrature_times_s().ravel())
    states = linearised.states(times)
    field, rope = linearised.segments.field_at(times)
    variants_g = specific_force_g(states, field, _placement(rope, motion, sensor, prior))
    by_motion, shift_g = linearised.condense(variants_g, times)
    by_position = position_jacobian(states[..., 0], field.unperturbed()) / prior.rig.gravity_m_s2
    ideal_g = _bin_mean(variants_g[..., 0] + shift_g)
    by_motion_and_place = np.concatenate([_bin_mean(by_motion), _bin_mean(by_position)], axis=-1)
    jacobian = np.concatenate([sensor.response @ by_motion_and_place, sensor.jacobian(ideal_g)], axis=-1)
    residual_g = bins.force_g - sensor.read(ideal_g)
    unknowns = _unknowns(motion, sensor)
    return SwingFit(
        linearised=linearised,
        sensor=sensor,
        prior=prior,
        jacobian=jacobian[..., prior.free],
        bins=bins,
        residual_g=residual_g,
        weight=weight,
        unknowns=unknowns,
        cost=_cost(residual_g, weight, unknowns, prior),
        converged=False,
        iterations=iteration,
    )


def _unknowns(motion: PendulumMotion, sensor: SensorModel) -> Array:
    first = motion.nodes[:, 0] / motion.state_scale[:, 0]
    return np.concatenate([first.view(np.float64), motion.parameters, sensor.errors])


def _cost(residual_g: Array, weight: Array, unknowns: Array, prior: Prior) -> float:
    deviation = (unknowns - prior.mean)[prior.free]
    residual = residual_g.ravel()
    return float((weight.ravel() * residual) @ residual + prior.information @ deviation**2)


def _placement(rope: RopeLengthSpline, motion: PendulumMotion, sensor: SensorModel, prior: Prior) -> SensorPlacement:
    """Return the place of the housing in every variant; one clamped above the load moves with the rope."""
    rig, gravity_m_s2 = prior.rig, prior.rig.gravity_m_s2
    beside_s2 = sensor.beside_m / gravity_m_s2
    if rig.above_load_m is None:
        position_s2 = (float(rig.position_m or 0.0) + sensor.position_error_m) / gravity_m_s2
        return SensorPlacement(position_s2, beside_s2=beside_s2)
    position_m = np.maximum(rope.length_m - rig.above_load_m, 0.0) + sensor.position_error_m
    if motion.splines is None:
        return SensorPlacement(position_m / gravity_m_s2, beside_s2=beside_s2)
    velocity_s, acceleration = rope.rate_m_s / gravity_m_s2, rope.acceleration_m_s2 / gravity_m_s2
    return SensorPlacement(position_m / gravity_m_s2, velocity_s, acceleration, beside_s2)


def _bin_mean(at_nodes: Array) -> Array:
    """Return the mean over the two quadrature times, shape (2 n, ...) to (n, ...)."""
    mean: Array = at_nodes.reshape(2, -1, *at_nodes.shape[1:]).mean(axis=0)
    return mean


def _gauss_newton_step(fit: SwingFit) -> tuple[Array, float]:
    """Return the step of all unknowns and the fall of chi-square that the linear model predicts."""
    gradient = (fit.weight * fit.residual_g).ravel() @ fit.jacobian.reshape(-1, fit.jacobian.shape[-1])
    gradient += fit.prior.information * (fit.prior.mean - fit.unknowns)[fit.free]
    step = np.zeros(len(fit.free))
    step[fit.free] = np.linalg.solve(information_matrix(fit), gradient)
    return step, float(gradient @ step[fit.free])


def _step_fraction(linearised: LinearisedMotion, step: Array) -> float:
    """Return the fraction of a step that stays where the linear model holds for the motion and for the length."""
    of_motion = MAX_SHARE_OF_MOTION / max(relative_step_size(linearised, step[: linearised.n_unknowns]), 1e-12)
    return min(1.0, of_motion, MAX_LENGTH_STEP / max(abs(float(step[N_STATES + LN_LENGTH])), 1e-12))
