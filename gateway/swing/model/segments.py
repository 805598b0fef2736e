"""What each segment of a motion follows, by unknowns of its own: few, whatever the number of the motion's.

A segment feels the rope's length at its start, the damping, and of a hoist's splines those that reach into it. All splines
before only made the length that it starts with.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.swing.model.motion import DAMPING, LN_LENGTH, PLAIN, STATES, STEPS_PER_SEGMENT, Instants, Motion, field_of
from gateway.swing.model.rope_spline import Rope
from gateway.swing.model.spherical_pendulum import Complex, ForceField, Real, TrajectoryInput

PERTURBATION = 1e-6


@dataclass(frozen=True, slots=True)
class Segments:
    """A motion's segments, unperturbed and under a perturbation of each of their own unknowns: the lanes, last dimension.

    A segment's own unknowns are its first state (STATES) and its own parameters: the motion's, or with a raster ln of the rope's
    length at the start, the damping in 1/s and the speeds of the splines near.
    """

    motion: Motion
    states: Complex
    """Shape (3, segments, lanes)."""
    parameters: Real
    """Shape (own, lanes); with a raster (segments, own, lanes)."""
    slope: Real
    """Derivative of the own parameters by the motion's, shape (segments, own, parameters)."""
    first: NDArray[np.intp] | None
    """With a raster: the first spline near each segment."""

    @classmethod
    def of(cls, motion: Motion) -> "Segments":
        """All of a motion's."""
        if motion.raster is None:
            count = len(motion.parameters)
            slope = np.broadcast_to(np.eye(count), (motion.grid.segments, count, count))
            return cls(motion, _states(motion, count), _perturbed(motion.parameters), slope, None)
        first, own, slope = _near(motion)
        return cls(motion, _states(motion, own.shape[1]), _perturbed(own), slope, first)

    def course(self) -> ForceField | TrajectoryInput:
        """What all follow side by side, at every half step."""
        if self.first is None:
            return field_of(self.parameters, self.motion.gravity_m_s2)
        grid = self.motion.grid
        halves_s = grid.starts_s + grid.step_s / 2 * np.arange(2 * STEPS_PER_SEGMENT + 1)[:, None]
        rope = self._rope(halves_s, self.first, self.parameters)
        damping_1_s = self.parameters[:, DAMPING]
        return TrajectoryInput(self.motion.gravity_m_s2 / rope.length_m, damping_1_s, rope.rate_m_s / rope.length_m)

    def field_at(self, instants: Instants) -> tuple[ForceField, Rope]:
        """What the motion follows, and the rope, shape (n, lanes)."""
        if self.first is None:
            return field_of(self.parameters, self.motion.gravity_m_s2), self._constant_length()
        own = self.parameters[instants.segment]
        rope = self._rope(instants.time_s, self.first[instants.segment], own)
        stiffness = self.motion.gravity_m_s2 / rope.length_m
        return ForceField(stiffness, own[:, DAMPING], lengthening_1_s=rope.rate_m_s / rope.length_m), rope

    def _constant_length(self) -> Rope:
        none = np.zeros(1)
        return Rope(np.exp(self.parameters[LN_LENGTH]), none, none)

    def _rope(self, time_s: Real, first: NDArray[np.intp], own: Real) -> Rope:
        if self.motion.raster is None:
            raise ValueError("a rope that keeps its length has no splines")
        length_m = np.exp(own[..., LN_LENGTH, :])
        return self.motion.raster.rope_near(time_s, first, length_m, own[..., PLAIN:, :])


def _near(motion: Motion) -> tuple[NDArray[np.intp], Real, Real]:
    """With a raster: the first spline near each segment, the own parameters, (segments, own), and their derivative."""
    raster, grid, speeds_m_s = motion.raster, motion.grid, motion.parameters[PLAIN:]
    if raster is None:
        raise ValueError("a rope that keeps its length has no splines")
    first, count = raster.near(grid.starts_s, grid.segment_s)
    near = first[:, None] + np.arange(count)
    past = np.arange(raster.count) < first[:, None]
    before_m = np.exp(motion.parameters[LN_LENGTH])
    length_m = before_m + raster.step_s * past @ speeds_m_s
    own = np.empty((grid.segments, PLAIN + count))
    with np.errstate(invalid="ignore", divide="ignore"):
        own[:, LN_LENGTH] = np.log(length_m)
    own[:, DAMPING] = motion.damping_1_s
    inside = (near >= 0) & (near < raster.count)
    own[:, PLAIN:] = np.where(inside, speeds_m_s[np.clip(near, 0, raster.count - 1)], 0.0)
    slope = np.zeros((grid.segments, PLAIN + count, len(motion.parameters)))
    slope[:, LN_LENGTH, LN_LENGTH] = before_m / length_m
    slope[:, LN_LENGTH, PLAIN:] = raster.step_s * past / length_m[:, None]
    slope[:, DAMPING, LN_LENGTH] = -motion.damping_1_s / 2
    slope[:, DAMPING, DAMPING] = 2 * np.sqrt(motion.gravity_m_s2 / before_m)
    segment, place = np.nonzero(inside)
    slope[segment, PLAIN + place, PLAIN + near[segment, place]] = 1.0
    return first, own, slope


def _perturbed(parameters: Real) -> Real:
    """Parameters, shape (..., own), in lanes: (..., own, 1 + STATES + own)."""
    own = parameters.shape[-1]
    lanes = np.repeat(parameters[..., None], 1 + STATES + own, axis=-1)
    places = np.arange(own)
    lanes[..., places, 1 + STATES + places] += PERTURBATION
    return lanes


def _states(motion: Motion, own: int) -> Complex:
    """The segments' first states in lanes, shape (3, segments, 1 + STATES + own)."""
    states = np.repeat(motion.nodes[..., None], 1 + STATES + own, axis=-1)
    unit = PERTURBATION * motion.unit[:, 0]
    for row in range(3):
        states[row, :, 1 + 2 * row] += unit[row]
        states[row, :, 2 + 2 * row] += 1j * unit[row]
    return states
