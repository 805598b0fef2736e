"""Multiple shooting with condensing (Bock 1981): all segments are integrated at once, their first states are eliminated.

Each segment is linearised in its own unknowns. The chain of segments then gives every quantity as a linear function of the
motion's unknowns, the first state and the parameters, plus a shift that closes the gaps between the segments.
"""

from dataclasses import dataclass, replace

import numpy as np

from gateway.numerics.array import Array
from gateway.swing.model.motion import N_STATES, STEPS_PER_SEGMENT, GridTimes, PendulumMotion
from gateway.swing.model.segments import DIFFERENCE_STEP, PerturbedSegments
from gateway.swing.model.spherical_pendulum import ComplexArray, SwingTrajectory, integrate, interpolate

MAX_AZIMUTH_STEP_RAD = 1.0
"""Largest turn of the swing's azimuth in one step. Basis: guards the linearisation; the tests converge with any value near it."""
Swing = tuple[ComplexArray, ComplexArray]
"""Displacement about the equilibrium and rate over w0 at the nodes, both dimensionless."""


@dataclass(frozen=True, slots=True)
class LinearisedMotion:
    """A motion integrated over all segments in all variants, and the condensed derivatives of its segments."""

    segments: PerturbedSegments
    trajectory: SwingTrajectory
    """Last dimensions: segments, variants (unperturbed first)."""
    condensed: Array
    """Derivative of each segment's own unknowns by the motion's, and in the last column the shift that closes the gaps:
    shape (segments, N_STATES + own, unknowns + 1)."""

    @property
    def motion(self) -> PendulumMotion:
        """The motion."""
        return self.segments.motion

    @property
    def n_unknowns(self) -> int:
        """Number of unknowns: the first state and the parameters."""
        return N_STATES + len(self.motion.parameters)

    def states(self, times: GridTimes) -> ComplexArray:
        """Return states, shape (n, 3, variants)."""
        return interpolate(self.trajectory, times.step, times.fraction, times.segment)

    def condense(self, variants: Array, times: GridTimes) -> tuple[Array, Array]:
        """Return derivatives by the unknowns, (n, ..., unknowns), and shifts, (n, ...), of quantities (n, ..., variants)."""
        jacobian = (variants[..., 1:] - variants[..., :1]) / DIFFERENCE_STEP
        condensed: Array = jacobian @ self.condensed[times.segment]
        return condensed[..., :-1], condensed[..., -1]


def linearise_segments(motion: PendulumMotion) -> LinearisedMotion:
    """Integrate every segment in every variant and condense."""
    segments, grid = PerturbedSegments.of_motion(motion), motion.grid
    trajectory = integrate(segments.states, segments.trajectory_input(), grid.step_s, STEPS_PER_SEGMENT)
    ends = _dimensionless(trajectory.state[-1], motion)
    jacobian = (ends[..., 1:] - ends[..., :1]) / DIFFERENCE_STEP
    gaps = ends[:-1, :, 0] - _dimensionless(motion.nodes[:, 1:, None], motion)[..., 0]
    unknowns = N_STATES + len(motion.parameters)
    condensed = np.zeros((grid.segments, jacobian.shape[-1], unknowns + 1))
    condensed[0, :N_STATES, :N_STATES] = np.eye(N_STATES)
    condensed[:, N_STATES:, N_STATES:unknowns] = segments.parameter_jacobian
    for k in range(grid.segments - 1):
        np.dot(jacobian[k], condensed[k], out=condensed[k + 1, :N_STATES])
        condensed[k + 1, :N_STATES, unknowns] += gaps[k]
    return LinearisedMotion(segments, trajectory, condensed)


def take_step(linearised: LinearisedMotion, step: Array, fraction: float) -> PendulumMotion:
    """Return the motion after a fraction of a Gauss-Newton step of the unknowns, shape (unknowns,).

    The part of the step that turns the swing about the vertical is done as a rotation. Near the hook the azimuth is hardly
    observable and steps in it are large; along the tangent they would enlarge the swing.
    """
    motion = linearised.motion
    (displacement, rate), (displacement_step, rate_step), pull_step = _node_steps(linearised, step, fraction)
    angle = _azimuth_step((displacement, rate), (displacement_step, rate_step))
    turn = np.exp(1j * angle)
    pull = motion.nodes[2] + pull_step
    q = turn * (displacement + displacement_step - 1j * angle * displacement) - pull
    w = turn * (rate + rate_step - 1j * angle * rate) * motion.grid.rate_1_s
    return replace(motion, nodes=np.stack([q, w, pull]), parameters=motion.parameters + fraction * step[N_STATES:])


def relative_step_size(linearised: LinearisedMotion, step: Array) -> float:
    """Return the largest change of the swing by a whole step relative to the swing's size, rotations left out."""
    (displacement, rate), (displacement_step, rate_step), _ = _node_steps(linearised, step, 1.0)
    angle = _azimuth_step((displacement, rate), (displacement_step, rate_step))
    change = max(
        float(np.abs(displacement_step - 1j * angle * displacement).max()),
        float(np.abs(rate_step - 1j * angle * rate).max()),
    )
    return change / max(float(np.abs(displacement).max()), float(np.abs(rate).max()), 1e-3)


def _node_steps(linearised: LinearisedMotion, step: Array, fraction: float) -> tuple[Swing, Swing, ComplexArray]:
    """Return the swing at the nodes, its change by a fraction of a step, and the change of the side pull."""
    nodes, rate_1_s = linearised.motion.nodes, linearised.motion.grid.rate_1_s
    change = fraction * (linearised.condensed[:, :N_STATES] @ np.append(step, 1.0))
    q_step, rate_step, pull_step = (change[:, 0::2] + 1j * change[:, 1::2]).T
    return (nodes[0] + nodes[2], nodes[1] / rate_1_s), (q_step + pull_step, rate_step), pull_step


def _azimuth_step(swing: Swing, change: Swing) -> Array:
    """Return the angle about the vertical by which a change turns the swing, shape (segments,)."""
    size = np.abs(swing[0]) ** 2 + np.abs(swing[1]) ** 2
    across = (np.conj(swing[0]) * change[0] + np.conj(swing[1]) * change[1]).imag
    angle: Array = np.clip(across / np.maximum(size, 1e-12), -MAX_AZIMUTH_STEP_RAD, MAX_AZIMUTH_STEP_RAD)
    return angle


def _dimensionless(states: ComplexArray, motion: PendulumMotion) -> Array:
    """Return states of shape (3, segments, ...) as real, dimensionless (segments, N_STATES, ...)."""
    scaled = (states / motion.state_scale[..., None]).swapaxes(0, 1)
    reals = np.empty((len(scaled), N_STATES, *states.shape[2:]))
    reals[:, 0::2], reals[:, 1::2] = scaled.real, scaled.imag
    return reals
