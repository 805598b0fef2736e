"""Segments of a motion under perturbations of their own few unknowns; so derivatives cost the same for any number of unknowns.

A segment depends on its first state, on the rope's length at its start, on the damping, and on those splines of the rope's speed
that are not zero in it. All earlier splines only change the length with which it starts.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array
from gateway.swing.model.motion import (
    DAMPING,
    LN_LENGTH,
    N_BASE_PARAMETERS,
    N_STATES,
    STEPS_PER_SEGMENT,
    GridTimes,
    PendulumMotion,
    force_field,
)
from gateway.swing.model.rope_spline import RopeLengthSpline
from gateway.swing.model.spherical_pendulum import ComplexArray, ForceField, TrajectoryInput

DIFFERENCE_STEP = 1e-6
"""Step of the forward differences. Definition: its truncation and rounding errors are both some 1e-6 or less of a derivative."""


@dataclass(frozen=True, slots=True)
class PerturbedSegments:
    """Segments of a motion in variants, the last dimension: unperturbed, then with one unknown of the segment perturbed.

    Unknowns of a segment are its first state (N_STATES) and its own parameters: the motion's, or with splines ln of the rope's
    length at the start, the damping in 1/s and the speeds of the splines that are not zero in it.
    """

    motion: PendulumMotion
    states: ComplexArray
    """First states, shape (3, segments, variants)."""
    parameters: Array
    """Shape (own, variants); with splines (segments, own, variants)."""
    parameter_jacobian: Array
    """Derivative of the segments' own parameters by the motion's, shape (segments, own, parameters)."""
    first_spline: NDArray[np.intp] | None
    """With splines, the first one that is not zero in each segment."""

    @classmethod
    def of_motion(cls, motion: PendulumMotion) -> "PerturbedSegments":
        """Return all segments of a motion."""
        if motion.splines is None:
            count = len(motion.parameters)
            jacobian = np.broadcast_to(np.eye(count), (motion.grid.segments, count, count))
            return cls(motion, _perturbed_states(motion, count), _perturbed(motion.parameters), jacobian, None)
        first, own, jacobian = _local_parameters(motion)
        return cls(motion, _perturbed_states(motion, own.shape[1]), _perturbed(own), jacobian, first)

    def trajectory_input(self) -> ForceField | TrajectoryInput:
        """Return the coefficients of the equations of all segments side by side, at every half step."""
        if self.first_spline is None:
            return force_field(self.parameters, self.motion.gravity_m_s2)
        grid = self.motion.grid
        halves_s = grid.starts_s + grid.step_s / 2 * np.arange(2 * STEPS_PER_SEGMENT + 1)[:, None]
        rope = self._rope(halves_s, self.first_spline, self.parameters)
        damping_1_s = self.parameters[:, DAMPING]
        return TrajectoryInput(self.motion.gravity_m_s2 / rope.length_m, damping_1_s, rope.rate_m_s / rope.length_m)

    def field_at(self, times: GridTimes) -> tuple[ForceField, RopeLengthSpline]:
        """Return the coefficients of the equations, and the rope, at times: shape (n, variants)."""
        if self.first_spline is None:
            return force_field(self.parameters, self.motion.gravity_m_s2), self._constant_length()
        own = self.parameters[times.segment]
        rope = self._rope(times.time_s, self.first_spline[times.segment], own)
        stiffness = self.motion.gravity_m_s2 / rope.length_m
        return ForceField(stiffness, own[:, DAMPING], lengthening_1_s=rope.rate_m_s / rope.length_m), rope

    def _constant_length(self) -> RopeLengthSpline:
        zero = np.zeros(1)
        return RopeLengthSpline(np.exp(self.parameters[LN_LENGTH]), zero, zero)

    def _rope(self, time_s: Array, first: NDArray[np.intp], own: Array) -> RopeLengthSpline:
        if self.motion.splines is None:
            raise ValueError("a rope that keeps its length has no splines")
        length_m = np.exp(own[..., LN_LENGTH, :])
        return self.motion.splines.evaluate_local(time_s, first, length_m, own[..., N_BASE_PARAMETERS:, :])


def _local_parameters(motion: PendulumMotion) -> tuple[NDArray[np.intp], Array, Array]:
    """Return each segment's first spline, its own parameters (segments, own) and their derivative by the motion's."""
    splines, grid, speeds_m_s = motion.splines, motion.grid, motion.parameters[N_BASE_PARAMETERS:]
    if splines is None:
        raise ValueError("a rope that keeps its length has no splines")
    first, count = splines.local_splines(grid.starts_s, grid.segment_s)
    local = first[:, None] + np.arange(count)
    past = np.arange(splines.count) < first[:, None]
    initial_m = np.exp(motion.parameters[LN_LENGTH])
    length_m = initial_m + splines.step_s * past @ speeds_m_s
    own = np.empty((grid.segments, N_BASE_PARAMETERS + count))
    with np.errstate(invalid="ignore", divide="ignore"):
        own[:, LN_LENGTH] = np.log(length_m)
    own[:, DAMPING] = motion.damping_1_s
    inside = (local >= 0) & (local < splines.count)
    own[:, N_BASE_PARAMETERS:] = np.where(inside, speeds_m_s[np.clip(local, 0, splines.count - 1)], 0.0)
    jacobian = np.zeros((grid.segments, N_BASE_PARAMETERS + count, len(motion.parameters)))
    jacobian[:, LN_LENGTH, LN_LENGTH] = initial_m / length_m
    jacobian[:, LN_LENGTH, N_BASE_PARAMETERS:] = splines.step_s * past / length_m[:, None]
    jacobian[:, DAMPING, LN_LENGTH] = -motion.damping_1_s / 2
    jacobian[:, DAMPING, DAMPING] = 2 * np.sqrt(motion.gravity_m_s2 / initial_m)
    segment, place = np.nonzero(inside)
    jacobian[segment, N_BASE_PARAMETERS + place, N_BASE_PARAMETERS + local[segment, place]] = 1.0
    return first, own, jacobian


def _perturbed(parameters: Array) -> Array:
    """Return parameters of shape (..., own) in variants: (..., own, 1 + N_STATES + own)."""
    own = parameters.shape[-1]
    variants = np.repeat(parameters[..., None], 1 + N_STATES + own, axis=-1)
    places = np.arange(own)
    variants[..., places, 1 + N_STATES + places] += DIFFERENCE_STEP
    return variants


def _perturbed_states(motion: PendulumMotion, own: int) -> ComplexArray:
    """Return the first states of the segments in variants, shape (3, segments, 1 + N_STATES + own)."""
    states = np.repeat(motion.nodes[..., None], 1 + N_STATES + own, axis=-1)
    step = DIFFERENCE_STEP * motion.state_scale[:, 0]
    for row in range(3):
        states[row, :, 1 + 2 * row] += step[row]
        states[row, :, 2 + 2 * row] += 1j * step[row]
    return states
