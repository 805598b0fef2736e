"""The likelihood of a window: weighted residuals, beliefs as priors, Gauss-Newton to the most likely motion."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.swing.data.bins import Bins
from gateway.swing.fit.multiple_shooting import SensitivityChain, largest_change, linearise_segments, moved
from gateway.swing.fit.priors import Prior, SensorModel
from gateway.swing.model.motion import LN_LENGTH, STATES, Motion
from gateway.swing.model.rope_spline import Rope
from gateway.swing.model.spherical_pendulum import Real, SensorPlacement, position_jacobian, specific_force_g

CONVERGED, SETTLED = 0.01, 1.0
"""Fall of chi-square that a step may still promise when it is no longer taken, and when steps no longer keep the promise."""
STAGNANT = 0.05
"""Fall of chi-square by a step, below which steps do not keep their promise: the axes hardly see what they change."""
SLOW, UNEXPLAINED = 0.5, 10.0
"""Part of chi-square that a step leaves, and chi-square per reading, from which on steps are not on their way to an answer."""
LARGEST_SHARE_OF_MOTION = 0.5
LARGEST_LENGTH_STEP = 0.15


@dataclass(frozen=True, slots=True)
class Fit:
    """The most likely motion with everything that its uncertainty is made from."""

    response: SensitivityChain
    instrument: SensorModel
    beliefs: Prior
    jacobian: Real
    """Derivative of the bins' specific force in g by the free unknowns, shape (bins, 3, free)."""
    bins: Bins
    residual_g: Real
    """Measured minus predicted, shape (bins, 3)."""
    weight: Real
    """1/variance of the bins, shape (bins, 3)."""
    unknowns: Real
    """First state, the motion's parameters, the instrument's errors."""
    cost: float
    """Chi-square of the data and of the beliefs."""
    converged: bool
    iterations: int

    @property
    def motion(self) -> Motion:
        """The motion."""
        return self.response.motion

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which unknowns were fitted."""
        return self.beliefs.free


def maximum_a_posteriori(
    bins: Bins, weight: Real, motion: Motion, beliefs: Prior, iterations: int, instrument: SensorModel | None = None
) -> Fit | None:
    """Gauss-Newton from `motion`, whose grid must cover the bins; None when that leaves the model."""
    fit = linearised(bins, weight, motion, beliefs, instrument)
    return None if fit is None else improved(fit, iterations)


def linearised(
    bins: Bins, weight: Real, motion: Motion, beliefs: Prior, instrument: SensorModel | None = None
) -> Fit | None:
    """A motion held against the data: where Gauss-Newton begins."""
    return _linearised(bins, weight, motion, instrument or SensorModel.ideal(), beliefs, 0)


def improved(fit: Fit, iterations: int, hopeless: Callable[[Fit], bool] | None = None) -> Fit:
    """The fit after some more iterations of Gauss-Newton; it may not have converged.

    A step that makes things worse is tried again at half its length. `hopeless` is asked where two steps in a row have gained
    little though much is unexplained: what the pendulum explains is found in two or three.
    """
    best, share, slow = fit, 1.0, 0
    for iteration in range(1, iterations + 2):
        step, promised = _step(best)
        if promised < CONVERGED:
            return replace(best, converged=True)
        trial = _moved(best, step, share * _step_fraction(best.response, step), iteration)
        before = best.cost
        if trial is not None and trial.cost < before + CONVERGED:
            stagnant = promised < SETTLED and before - trial.cost < STAGNANT
            best, share = trial, min(1.0, 2 * share)
            if stagnant:
                return replace(best, converged=True)
        else:
            share /= 2
        slow = slow + 1 if iteration > 1 and best.cost > max(SLOW * before, UNEXPLAINED * best.weight.size) else 0
        if slow >= 2 and hopeless is not None and hopeless(best):
            return best
    return best


def _moved(fit: Fit, step: Real, taken: float, iteration: int) -> Fit | None:
    """After a share of a step."""
    motion = moved(fit.response, step[: fit.response.unknowns], taken)
    instrument = fit.instrument.moved(taken * step[fit.response.unknowns :])
    return _linearised(fit.bins, fit.weight, motion, instrument, fit.beliefs, iteration)


def reweighted(fit: Fit, weight: Real) -> Fit:
    """The same motion under other weights of the bins."""
    cost = _cost(fit.residual_g, weight, fit.unknowns, fit.beliefs)
    return replace(fit, weight=weight, cost=cost, converged=False)


def information(fit: Fit) -> Real:
    """The data's and the beliefs' information on the free unknowns, shape (free, free)."""
    return weighted_square(fit.jacobian, fit.weight) + np.diag(fit.beliefs.information)


def weighted_square(jacobian: Real, weight: Real) -> Real:
    """J^T W J of a jacobian of shape (bins, 3, free) and weights of shape (bins, 3)."""
    rows = (jacobian * np.sqrt(weight)[..., None]).reshape(-1, jacobian.shape[-1])
    square: Real = rows.T @ rows
    return square


def _linearised(
    bins: Bins, weight: Real, motion: Motion, instrument: SensorModel, beliefs: Prior, iteration: int
) -> Fit | None:
    response = linearise_segments(motion)
    if not (np.isfinite(response.path.state).all() and np.isfinite(response.follow).all()):
        return None
    instants = motion.grid.locate(bins.nodes_s().ravel())
    states = response.states(instants)
    field, rope = response.segments.field_at(instants)
    local = specific_force_g(states, field, _place(rope, motion, instrument, beliefs))
    by_motion, shift = response.chain(local, instants)
    by_position = position_jacobian(states[..., 0], field.unperturbed()) / beliefs.rig.gravity_m_s2
    ideal_g = _bin_mean(local[..., 0] + shift)
    by_all = np.concatenate(
        [_bin_mean(by_motion), _bin_mean(by_position)[..., None], instrument.slopes(ideal_g)], axis=-1
    )
    residual_g = bins.force_g - instrument.reads(ideal_g)
    unknowns = _unknowns(motion, instrument)
    return Fit(
        response=response,
        instrument=instrument,
        beliefs=beliefs,
        jacobian=by_all[..., beliefs.free],
        bins=bins,
        residual_g=residual_g,
        weight=weight,
        unknowns=unknowns,
        cost=_cost(residual_g, weight, unknowns, beliefs),
        converged=False,
        iterations=iteration,
    )


def _unknowns(motion: Motion, instrument: SensorModel) -> Real:
    first = motion.nodes[:, 0] / motion.unit[:, 0]
    return np.concatenate([first.view(np.float64), motion.parameters, instrument.errors])


def _cost(residual_g: Real, weight: Real, unknowns: Real, beliefs: Prior) -> float:
    departure = (unknowns - beliefs.mean)[beliefs.free]
    residual = residual_g.ravel()
    return float((weight.ravel() * residual) @ residual + beliefs.information @ departure**2)


def _place(rope: Rope, motion: Motion, instrument: SensorModel, beliefs: Prior) -> SensorPlacement:
    """Where the housing is in every lane; one clamped above the load goes with the rope."""
    rig, gravity_m_s2 = beliefs.rig, beliefs.rig.gravity_m_s2
    if rig.above_load_m is None:
        return SensorPlacement((float(rig.position_m or 0.0) + instrument.position_error_m) / gravity_m_s2)
    reach_m = np.maximum(rope.length_m - rig.above_load_m, 0.0) + instrument.position_error_m
    if motion.raster is None:
        return SensorPlacement(reach_m / gravity_m_s2)
    return SensorPlacement(reach_m / gravity_m_s2, rope.rate_m_s / gravity_m_s2, rope.acceleration_m_s2 / gravity_m_s2)


def _bin_mean(at_nodes: Real) -> Real:
    """Mean of the two halves, shape (2 n, ...) to (n, ...)."""
    mean: Real = at_nodes.reshape(2, -1, *at_nodes.shape[1:]).mean(axis=0)
    return mean


def _step(fit: Fit) -> tuple[Real, float]:
    """Step of all unknowns and the fall of chi-square that it promises."""
    gradient = (fit.weight * fit.residual_g).ravel() @ fit.jacobian.reshape(-1, fit.jacobian.shape[-1])
    gradient += fit.beliefs.information * (fit.beliefs.mean - fit.unknowns)[fit.free]
    step = np.zeros(len(fit.free))
    step[fit.free] = np.linalg.solve(information(fit), gradient)
    return step, float(gradient @ step[fit.free])


def _step_fraction(response: SensitivityChain, step: Real) -> float:
    """How much of a step is taken: it must not throw the motion or the length far from where it was linearised."""
    by_motion = LARGEST_SHARE_OF_MOTION / max(largest_change(response, step[: response.unknowns]), 1e-12)
    return min(1.0, by_motion, LARGEST_LENGTH_STEP / max(abs(float(step[STATES + LN_LENGTH])), 1e-12))
