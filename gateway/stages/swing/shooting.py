"""A window cut into segments that are integrated side by side: how the motion answers to its first state and parameters.

Multiple shooting. The motion is known by its state at the start of every segment; one step of Gauss-Newton moves the first
state and the parameters, and lets the other states follow, closing the gaps between segments on the way (condensing). All
segments and all perturbations of them are one array, so that the cost hardly grows with the window, and a long window cannot
run away from its data as one long trajectory would.
"""

from dataclasses import dataclass, replace

import numpy as np

from gateway.stages.swing.model import Complex, Path, Real, integrate, sample
from gateway.stages.swing.motion import STATES, STEPS_PER_SEGMENT, Motion

PERTURBATION = 1e-6
LARGEST_TURN_RAD = 1.0
"""Of the swing's azimuth in one step."""


@dataclass(frozen=True, slots=True)
class Response:
    """A motion integrated over all segments with all perturbations, and how each segment's start follows the unknowns.

    The unknowns are the first state (STATES) and the motion's parameters; `unknowns` counts them.
    """

    motion: Motion
    path: Path
    """Last dimensions: segments, 1 + unknowns (unperturbed first)."""
    parameters: Real
    """Of each perturbation, shape (parameters, 1 + unknowns)."""
    follow: Real
    """Derivative of each segment's first state by the unknowns, shape (segments, STATES, unknowns)."""
    gap: Real
    """How far each segment's first state is from where the chain of linearised segments puts it, (segments, STATES)."""

    @property
    def unknowns(self) -> int:
        """First state and parameters."""
        return STATES + len(self.motion.parameters)

    def states(self, time_s: Real) -> Complex:
        """States at times, shape (n, 3, 1 + unknowns), with the local perturbations."""
        segment, step, fraction = self.motion.grid.locate(time_s)
        return sample(self.path, step, fraction, segment)

    def chain(self, local: Real, time_s: Real) -> tuple[Real, Real]:
        """Derivative by the unknowns, (n, ..., unknowns), and shift by the gaps, (n, ...), of quantities at times.

        `local` holds the quantities under all perturbations, shape (n, ..., 1 + unknowns).
        """
        segment, _, _ = self.motion.grid.locate(time_s)
        slope = (local[..., 1:] - local[..., :1]) / PERTURBATION
        by_state = slope[..., :STATES]
        by_unknown: Real = by_state @ self.follow[segment]
        by_unknown[..., STATES:] += slope[..., STATES:]
        shift = np.einsum("n...s,ns->n...", by_state, self.gap[segment])
        return by_unknown, shift


def respond(motion: Motion) -> Response:
    """Integrate every segment under every perturbation."""
    states, parameters = _perturbed(motion)
    grid = motion.grid
    starts_s = np.asarray(grid.start_s + grid.segment_s * np.arange(grid.segments), dtype=np.float64)
    course = motion.course(starts_s, grid.step_s, STEPS_PER_SEGMENT, parameters)
    path = integrate(states, course, grid.step_s, STEPS_PER_SEGMENT)
    ends = _as_reals(path.state[-1], motion)
    slope = (ends[..., 1:] - ends[..., :1]) / PERTURBATION
    starts = _as_reals(motion.nodes[..., None], motion)[..., 0]
    segments, unknowns = grid.segments, STATES + len(motion.parameters)
    follow = np.zeros((segments, STATES, unknowns))
    gap = np.zeros((segments, STATES))
    follow[0, :, :STATES] = np.eye(STATES)
    for k in range(segments - 1):
        follow[k + 1] = slope[k, :, :STATES] @ follow[k]
        follow[k + 1, :, STATES:] += slope[k, :, STATES:]
        gap[k + 1] = slope[k, :, :STATES] @ gap[k] + ends[k, :, 0] - starts[k + 1]
    return Response(motion, path, parameters, follow, gap)


def moved(response: Response, step: Real, share: float) -> Motion:
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


def largest_change(response: Response, step: Real) -> float:
    """How far a whole step moves the swing, relative to its size, turns about the vertical left out."""
    (about, rate), (by_about, by_rate), _ = _change(response, step, 1.0)
    angle = _turning((about, rate), (by_about, by_rate))
    moved_by = max(float(np.abs(by_about - 1j * angle * about).max()), float(np.abs(by_rate - 1j * angle * rate).max()))
    return moved_by / max(float(np.abs(about).max()), float(np.abs(rate).max()), 1e-3)


Pair = tuple[Complex, Complex]


def _change(response: Response, step: Real, share: float) -> tuple[Pair, Pair, Complex]:
    """Swing about the equilibrium (u + l, w/w0) at the nodes, its change, and the change of the pull."""
    nodes, rate_1_s = response.motion.nodes, response.motion.grid.rate_1_s
    change = share * (response.follow @ step + response.gap)
    by_u, by_rate, by_pull = (change[:, 0::2] + 1j * change[:, 1::2]).T
    return (nodes[0] + nodes[2], nodes[1] / rate_1_s), (by_u + by_pull, by_rate), by_pull


def _turning(swing: Pair, change: Pair) -> Real:
    """The angle about the vertical that a change turns the swing by, shape (segments,)."""
    size = np.abs(swing[0]) ** 2 + np.abs(swing[1]) ** 2
    across = (np.conj(swing[0]) * change[0] + np.conj(swing[1]) * change[1]).imag
    angle: Real = np.clip(across / np.maximum(size, 1e-12), -LARGEST_TURN_RAD, LARGEST_TURN_RAD)
    return angle


def advanced(response: Response, start_s: float, end_s: float) -> Motion:
    """The motion on the same raster with whole segments dropped before `start_s` and added up to `end_s`: cheap."""
    motion, grid = response.motion, response.motion.grid
    dropped = int(np.clip((start_s - grid.start_s) // grid.segment_s, 0, grid.segments - 1))
    segments = max(1, int(np.ceil((end_s - grid.start_s) / grid.segment_s - 1e-9)) - dropped)
    nodes = motion.nodes[:, dropped : dropped + segments]
    missing = segments - nodes.shape[1]
    if missing > 0:
        last = response.path.state[-1, :, -1, :1]
        path = motion.carried(last, grid.end_s, grid.step_s, STEPS_PER_SEGMENT * (missing - 1))
        nodes = np.concatenate([nodes, path[::STEPS_PER_SEGMENT].T], axis=1)
    grid = replace(grid, start_s=grid.start_s + dropped * grid.segment_s, segments=segments)
    return replace(motion, grid=grid, nodes=nodes)


def _perturbed(motion: Motion) -> tuple[Complex, Real]:
    """States of shape (3, segments, 1 + unknowns) and the parameters of each perturbation."""
    lanes = 1 + STATES + len(motion.parameters)
    states = np.repeat(motion.nodes[..., None], lanes, axis=-1)
    unit = PERTURBATION * motion.unit[:, 0]
    for row in range(3):
        states[row, :, 1 + 2 * row] += unit[row]
        states[row, :, 2 + 2 * row] += 1j * unit[row]
    parameters = np.repeat(motion.parameters[:, None], lanes, axis=1)
    for place in range(len(motion.parameters)):
        parameters[place, 1 + STATES + place] += PERTURBATION
    return states, parameters


def _as_reals(states: Complex, motion: Motion) -> Real:
    """States of shape (3, segments, ...) as (segments, STATES, ...), free of dimension."""
    scaled = states / motion.unit[..., None]
    parts = np.stack([scaled.real, scaled.imag], axis=1)
    return np.moveaxis(parts.reshape(STATES, *states.shape[1:]), 1, 0)
