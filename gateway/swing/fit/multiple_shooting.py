"""A window cut into segments that are integrated side by side: how the motion answers to its first state and parameters.

Multiple shooting. The motion is known by its state at the start of every segment; one step of Gauss-Newton moves the first
state and the parameters, and lets the other states follow, closing the gaps between segments on the way (condensing). All
segments and all perturbations of them are one array, so that the cost hardly grows with the window, and a long window cannot
run away from its data as one long trajectory would.
"""

from dataclasses import dataclass, replace

import numpy as np

from gateway.swing.model.motion import STATES, STEPS_PER_SEGMENT, Instants, Motion
from gateway.swing.model.segments import PERTURBATION, Segments
from gateway.swing.model.spherical_pendulum import Complex, Path, Real, integrate, sample

LARGEST_TURN_RAD = 1.0
"""Of the swing's azimuth in one step."""


@dataclass(frozen=True, slots=True)
class SensitivityChain:
    """A motion integrated over all segments with all perturbations, and how each segment's own unknowns follow the motion's.

    The motion's unknowns are the first state (STATES) and its parameters; `unknowns` counts them.
    """

    segments: Segments
    path: Path
    """Last dimensions: segments, lanes (unperturbed first)."""
    follow: Real
    """Of each segment's own unknowns: derivative by the motion's, and last how far the chain of linearised segments puts them
    from where they are; shape (segments, STATES + own, unknowns + 1)."""

    @property
    def motion(self) -> Motion:
        """The motion."""
        return self.segments.motion

    @property
    def unknowns(self) -> int:
        """First state and parameters."""
        return STATES + len(self.motion.parameters)

    def states(self, instants: Instants) -> Complex:
        """States, shape (n, 3, lanes)."""
        return sample(self.path, instants.step, instants.fraction, instants.segment)

    def chain(self, local: Real, instants: Instants) -> tuple[Real, Real]:
        """Derivative by the unknowns, (n, ..., unknowns), and shift by the gaps, (n, ...), of quantities in all lanes."""
        slope = (local[..., 1:] - local[..., :1]) / PERTURBATION
        chained: Real = slope @ self.follow[instants.segment]
        return chained[..., :-1], chained[..., -1]


def linearise_segments(motion: Motion) -> SensitivityChain:
    """Integrate every segment under every perturbation."""
    segments, grid = Segments.of(motion), motion.grid
    path = integrate(segments.states, segments.course(), grid.step_s, STEPS_PER_SEGMENT)
    ends = _as_reals(path.state[-1], motion)
    slope = (ends[..., 1:] - ends[..., :1]) / PERTURBATION
    gaps = ends[:-1, :, 0] - _as_reals(motion.nodes[:, 1:, None], motion)[..., 0]
    unknowns = STATES + len(motion.parameters)
    follow = np.zeros((grid.segments, slope.shape[-1], unknowns + 1))
    follow[0, :STATES, :STATES] = np.eye(STATES)
    follow[:, STATES:, STATES:unknowns] = segments.slope
    for k in range(grid.segments - 1):
        np.dot(slope[k], follow[k], out=follow[k + 1, :STATES])
        follow[k + 1, :STATES, unknowns] += gaps[k]
    return SensitivityChain(segments, path, follow)


def moved(response: SensitivityChain, step: Real, share: float) -> Motion:
    """The motion after a `share` of a Gauss-Newton step of the unknowns, shape (unknowns,).

    What of the step turns the swing about the vertical is done as a turn: near the hook the azimuth is hardly seen and steps in
    it are large, and along the tangent they would make the swing larger.
    """
    motion = response.motion
    (about, rate), (by_about, by_rate), by_pull = _change(response, step, share)
    angle = _turning((about, rate), (by_about, by_rate))
    turn = np.exp(1j * angle)
    pull = motion.nodes[2] + by_pull
    u = turn * (about + by_about - 1j * angle * about) - pull
    w = turn * (rate + by_rate - 1j * angle * rate) * motion.grid.rate_1_s
    return replace(motion, nodes=np.stack([u, w, pull]), parameters=motion.parameters + share * step[STATES:])


def largest_change(response: SensitivityChain, step: Real) -> float:
    """How far a whole step moves the swing, relative to its size, turns about the vertical left out."""
    (about, rate), (by_about, by_rate), _ = _change(response, step, 1.0)
    angle = _turning((about, rate), (by_about, by_rate))
    moved_by = max(float(np.abs(by_about - 1j * angle * about).max()), float(np.abs(by_rate - 1j * angle * rate).max()))
    return moved_by / max(float(np.abs(about).max()), float(np.abs(rate).max()), 1e-3)


Pair = tuple[Complex, Complex]


def _change(response: SensitivityChain, step: Real, share: float) -> tuple[Pair, Pair, Complex]:
    """Swing about the equilibrium (u + l, w/w0) at the nodes, its change, and the change of the pull."""
    nodes, rate_1_s = response.motion.nodes, response.motion.grid.rate_1_s
    change = share * (response.follow[:, :STATES] @ np.append(step, 1.0))
    by_u, by_rate, by_pull = (change[:, 0::2] + 1j * change[:, 1::2]).T
    return (nodes[0] + nodes[2], nodes[1] / rate_1_s), (by_u + by_pull, by_rate), by_pull


def _turning(swing: Pair, change: Pair) -> Real:
    """The angle about the vertical that a change turns the swing by, shape (segments,)."""
    size = np.abs(swing[0]) ** 2 + np.abs(swing[1]) ** 2
    across = (np.conj(swing[0]) * change[0] + np.conj(swing[1]) * change[1]).imag
    angle: Real = np.clip(across / np.maximum(size, 1e-12), -LARGEST_TURN_RAD, LARGEST_TURN_RAD)
    return angle


def advanced(response: SensitivityChain, start_s: float, end_s: float) -> Motion:
    """The motion on the same raster with whole segments dropped before `start_s` and added up to `end_s`: cheap."""
    motion, grid = response.motion, response.motion.grid
    dropped = int(np.clip((start_s - grid.start_s) // grid.segment_s, 0, grid.segments - 1))
    segments = max(1, int(np.ceil((end_s - grid.start_s) / grid.segment_s - 1e-9)) - dropped)
    nodes = motion.nodes[:, dropped : dropped + segments]
    missing = segments - nodes.shape[1]
    if missing > 0:
        last = response.path.state[-1, :, -1, 0]
        path = motion.propagated(last, grid.end_s, grid.step_s, STEPS_PER_SEGMENT * (missing - 1))
        nodes = np.concatenate([nodes, path[::STEPS_PER_SEGMENT].T], axis=1)
    grid = replace(grid, start_s=grid.start_s + dropped * grid.segment_s, segments=segments)
    return replace(motion, grid=grid, nodes=nodes)


def _as_reals(states: Complex, motion: Motion) -> Real:
    """States of shape (3, segments, ...) as (segments, STATES, ...), free of dimension."""
    scaled = (states / motion.unit[..., None]).swapaxes(0, 1)
    reals = np.empty((len(scaled), STATES, *states.shape[2:]))
    reals[:, 0::2], reals[:, 1::2] = scaled.real, scaled.imag
    return reals
