"""Initial guesses of the initial conditions of each segment, by a fit of that segment alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.data.observations import Observations
from gateway.twin.reconcile.fit.initial_states import harmonic_initial_states, initial_state_from_samples
from gateway.twin.reconcile.fit.multiple_shooting import LARGE_SWING_ITERATIONS, REFINEMENT_ITERATIONS, NormalEquations
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import HEADING, ROPE_RATES, ROPE_TILTS, rotation_about_vertical

Array = NDArray[np.float64]
LOCAL_DAMPING = 1e-4
"""Levenberg-Marquardt factor on the scaled diagonal, for segments that do not determine the whole initial state."""
MIN_LATERAL_GAIN = 0.1
"""Least |1 - p/L|, the lateral reading in g per unit of the tilt's sine, from which the lateral readings determine the state."""
UNKNOWN_LATERAL_GAIN = 0.02
"""|1 - p/L| up to which errors of length and position decide its sign."""
MAX_LOCAL_STEP = 0.7
"""Largest step of an angle, rad, and of a rate, rad/s; of the rope per angular frequency, if above 1."""
MIN_LOCAL_DAMPING = 1e-9
"""Least damping of a segment, after many steps that improve."""
MIN_AZIMUTH_INFORMATION = 30.0
"""Per square radian, from which the samples of a segment determine the azimuth: to 0.2 rad, and its sign beyond doubt."""
SMALL_ANGLE_RAD = 1e-4
"""Half the difference of two azimuths that gives a derivative."""
DAMPING_STEP = 10.0
"""Factor by which the damping of a segment falls after a step that improves, and rises after one that does not."""
MIN_LOCAL_DECREASE = 1e-3
"""Share of its chi-square that a further step of a segment must promise: the fit only has to start the next one."""
MIN_TOTAL_DECREASE = 0.01
"""Share of the chi-square of all segments that `CREEPING_STEPS` must take off: a model that cannot follow them creeps."""
CREEPING_STEPS = 4
"""Some steps only find the damping of a segment, and take nothing off."""


def segment_initial_conditions(
    simulator: Simulator, observations: Observations, effect_values: Array, first_samples: Sequence[int]
) -> Array:
    """Return an initial state for each segment from the samples of that segment alone, shape (segments, states).

    The samples of one segment do not determine its heading. It is set so that the headings of consecutive segments agree.
    """
    n_states, rig = simulator.n_initial_states, simulator.rig
    segments = _Segments(simulator, observations, effect_values, first_samples)
    if abs(1 - rig.position_m / rig.length_m) < MIN_LATERAL_GAIN:
        fitted = segments.fit_each(harmonic_initial_states(rig, observations, first_samples, n_states))
    elif observations.has_large_amplitude or any(EFFECTS[name].hides_small_motion for name in simulator.effect_names):
        fitted = segments.fit_each(initial_state_from_samples(rig, observations, first_samples, n_states))
    else:  # steps of its own for each segment end in another minimum of two bodies
        fitted = segments.refine_each(np.zeros((len(first_samples), n_states)))
    turned_rad = np.concatenate([[0.0], np.cumsum(fitted.ends[:-1, HEADING])])
    starts = rotate_about_vertical(fitted.initial_states, turned_rad, simulator.structure)
    ends = rotate_about_vertical(fitted.ends, turned_rad, simulator.structure)
    undetermined = fitted.azimuth_information(simulator.structure) < MIN_AZIMUTH_INFORMATION
    return _continue_azimuths(starts, ends, undetermined, simulator)


@dataclass(frozen=True, slots=True)
class _SegmentFits:
    """Segments that are fitted one by one, at their best initial states so far."""

    initial_states: Array
    """Shape (segments, states)."""
    ends: Array
    """State of each segment at its end, shape (segments, states)."""
    chi2: Array
    """Shape (segments,)."""
    equations: tuple[NormalEquations, ...]

    def azimuth_information(self, structure: ModelStructure) -> Array:
        """Return the increase of chi-square per square radian by which the azimuth of the swing is rotated, per segment."""
        small_rad = np.full(len(self.initial_states), SMALL_ANGLE_RAD)
        ahead, behind = (_rotate_azimuth(self.initial_states, sign * small_rad, structure) for sign in (1, -1))
        by_rad = (ahead - behind) / (2 * SMALL_ANGLE_RAD)
        return np.array([by @ each.normal @ by for by, each in zip(by_rad, self.equations, strict=True)])

    def better_of(self, other: "_SegmentFits") -> "_SegmentFits":
        """Return for each segment the better fit of two."""
        taken = other.chi2 < self.chi2
        equations = tuple(b if new else a for a, b, new in zip(self.equations, other.equations, taken, strict=True))
        return _SegmentFits(
            np.where(taken[:, None], other.initial_states, self.initial_states),
            np.where(taken[:, None], other.ends, self.ends),
            np.where(taken, other.chi2, self.chi2),
            equations,
        )


@dataclass(frozen=True, slots=True)
class _Segments:
    """The segments of a recording, and the model that each is to be fitted with."""

    simulator: Simulator
    observations: Observations
    effect_values: Array
    first_samples: Sequence[int]

    def refine_each(self, initial_states: Array) -> _SegmentFits:
        """Fit the initial state of each segment, in which the readings are nearly linear (Gauss-Newton)."""
        free = np.arange(self.simulator.n_initial_states) != HEADING
        fits = self._linearise(initial_states)
        for _ in range(REFINEMENT_ITERATIONS):
            steps = [each.step(free, LOCAL_DAMPING) for each in fits.equations]
            fits = self._linearise(fits.initial_states + np.clip(steps, -MAX_LOCAL_STEP, MAX_LOCAL_STEP))
        return fits

    def fit_each(self, initial_states: Array) -> _SegmentFits:
        """Fit the initial state of each segment by steps of its own, with its own damping (Levenberg-Marquardt)."""
        simulator = self.simulator
        free = np.arange(simulator.n_initial_states) != HEADING
        limit = np.full(simulator.n_initial_states, MAX_LOCAL_STEP)
        limit[ROPE_RATES] *= max(1.0, simulator.rig.small_swing_rate_1_s)
        fits = self._linearise(initial_states)
        damping = np.full(len(self.first_samples), LOCAL_DAMPING)
        totals = [fits.chi2.sum()]
        for _ in range(LARGE_SWING_ITERATIONS):
            steps = [each.step(free, factor) for each, factor in zip(fits.equations, damping, strict=True)]
            promised = np.array([step @ each.gradient for step, each in zip(steps, fits.equations, strict=True)])
            if not (promised > MIN_LOCAL_DECREASE * fits.chi2).any():
                break
            after = fits.better_of(self._linearise(fits.initial_states + np.clip(steps, -limit, limit)))
            improved = after.chi2 < fits.chi2
            damping = np.where(improved, np.maximum(damping / DAMPING_STEP, MIN_LOCAL_DAMPING), damping * DAMPING_STEP)
            fits = after
            totals.append(fits.chi2.sum())
            if len(totals) > CREEPING_STEPS and totals[-1] > (1 - MIN_TOTAL_DECREASE) * totals[-1 - CREEPING_STEPS]:
                break
        return fits

    @np.errstate(over="ignore", invalid="ignore")  # a step to a trajectory that diverges is not taken
    def _linearise(self, initial_states: Array) -> _SegmentFits:
        o, firsts = self.observations, self.first_samples
        batch = self.simulator.linearise_segments(initial_states, self.effect_values, o.time_s, firsts, o.temperature_c)
        residual, jacobian = o.residual_sigma(batch.force_g), batch.force_by_start * o.per_sigma[:, :, None]
        parts = list(pairwise([*firsts, len(residual)]))
        equations = tuple(NormalEquations.from_jacobian(jacobian[a:b], residual[a:b]) for a, b in parts)
        is_finite = np.array(
            [np.isfinite(each.normal).all() and np.isfinite(each.gradient).all() for each in equations]
        )
        chi2 = np.array([(residual[first:last] ** 2).sum() for first, last in parts])
        return _SegmentFits(initial_states, batch.ends, np.where(is_finite, chi2, np.inf), equations)


def _continue_azimuths(starts: Array, ends: Array, undetermined: NDArray[np.bool_], simulator: Simulator) -> Array:
    """Return the initial states with each azimuth that the samples do not determine such that the swing continues.

    At the load, the readings do not depend on the azimuth of the swing in the housing's axes.
    """
    before, after = (_horizontal(each, simulator.rig.small_swing_rate_1_s) for each in (ends[:-1], starts[1:]))
    turns_rad = np.zeros(len(starts))
    for i in np.flatnonzero(undetermined[1:]):
        turns_rad[i + 1] = turns_rad[i] + np.angle(np.conj(after[i]) @ before[i])
    return _rotate_azimuth(starts, turns_rad, simulator.structure)


def _horizontal(states: Array, small_swing_rate_1_s: float) -> NDArray[np.complex128]:
    """Return tilts, and rates per angular frequency of the swing, as x + iy, shape (segments, 2)."""
    tilts, rates = states[:, ROPE_TILTS], states[:, ROPE_RATES] / small_swing_rate_1_s
    return np.stack([tilts[:, 0] + 1j * tilts[:, 1], rates[:, 0] + 1j * rates[:, 1]], axis=1)


def rotate_about_vertical(initial_states: Array, angle_rad: Array, structure: ModelStructure) -> Array:
    """Return initial states (segments, states) in a world rotated about the vertical; they give the same samples."""
    rotated: Array = rotation_about_vertical(structure)(initial_states.T, angle_rad[None]).full().T
    return rotated


def hides_sign_of_swing(rig: TwinRig) -> bool:
    """Return whether the rig leaves open on which side of the load the housing is, and so to which side it swings."""
    return abs(1 - rig.position_m / rig.length_m) < UNKNOWN_LATERAL_GAIN


def reverse_swing(initial_states: Array, structure: ModelStructure) -> Array:
    """Return initial states (segments, states) of the opposite swing; at the load it gives the same samples."""
    return _rotate_azimuth(initial_states, np.full(len(initial_states), np.pi), structure)


def _rotate_azimuth(initial_states: Array, angle_rad: Array, structure: ModelStructure) -> Array:
    """Return initial states (segments, states) with the swing rotated about the vertical and the housing turned back."""
    rotated = rotate_about_vertical(initial_states, angle_rad, structure)
    rotated[:, HEADING] -= angle_rad
    return rotated
