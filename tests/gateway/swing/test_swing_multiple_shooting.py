"""Multiple shooting: condensed derivatives against differences of the whole motion, gaps, propagation."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.swing.fit.multiple_shooting import linearise_segments, take_step
from gateway.swing.model.motion import N_BASE_PARAMETERS, N_STATES, PendulumMotion, ShootingGrid
from gateway.swing.model.rope_spline import SplineGrid
from gateway.swing.model.spherical_pendulum import ForceField, TrajectoryInput, integrate, propagate

PERIOD_S = 6.0
GRAVITY_M_S2 = 9.80665
LENGTH_M = GRAVITY_M_S2 * (PERIOD_S / (2 * np.pi)) ** 2
AT_S = np.linspace(0.3, 9.8, 40)
STEP = 1e-5
START = np.array([[0.11 + 0.02j], [0.03 - 0.05j], [0.01 + 0.005j]])


def motion_of(parameters: NDArray[np.float64] | list[float], splines: SplineGrid | None = None) -> PendulumMotion:
    """Ten seconds of a swing, its nodes integrated from the first: no gaps."""
    grid = ShootingGrid.covering(0.0, 10.0, PERIOD_S)
    first = PendulumMotion(grid, START, np.asarray(parameters), GRAVITY_M_S2, splines)
    states = first.propagated(START[:, 0], 0.0, grid.step_s, round((grid.end_s - grid.start_s) / grid.step_s))
    per_segment = round(grid.segment_s / grid.step_s)
    return replace(first, nodes=states[:-1:per_segment].T)


def motions() -> dict[str, PendulumMotion]:
    splines = SplineGrid.covering(2.0, 7.0, 0.7)
    speeds = 0.4 * np.random.default_rng(2).normal(size=splines.count)
    return {
        "a rope that keeps its length": motion_of([np.log(LENGTH_M), 0.004]),
        "a rope that moves": motion_of([np.log(LENGTH_M), 0.004, *speeds], splines),
    }


@pytest.mark.slow
@pytest.mark.parametrize("what", ["a rope that keeps its length", "a rope that moves"])
def test_condensed_derivatives_agree_with_differences_of_the_whole_motion(what: str) -> None:
    motion = motions()[what]
    linearised = linearise_segments(motion)
    times = motion.grid.locate(AT_S)
    u = linearised.states(times)[:, 0]

    jacobian, shift = linearised.condense(np.stack([u.real, u.imag], axis=1), times)

    assert np.abs(shift).max() < 1e-9
    for number in range(len(motion.parameters)):
        parameters = motion.parameters.copy()
        parameters[number] += STEP
        other = motion_of(parameters, motion.splines)
        change = (linearise_segments(other).states(other.grid.locate(AT_S)) - linearised.states(times))[:, 0, 0] / STEP
        expected = np.stack([change.real, change.imag], axis=1)
        assert jacobian[..., N_STATES + number] == pytest.approx(expected, abs=2e-4 + 1e-3 * np.abs(expected).max())


def test_a_step_of_the_unknowns_closes_the_gaps_between_segments() -> None:
    motion = motions()["a rope that moves"]
    nodes = motion.nodes.copy()
    nodes[0, 5] += 0.001
    linearised = linearise_segments(replace(motion, nodes=nodes))

    closed = take_step(linearised, np.zeros(linearised.n_unknowns), 1.0)

    assert closed.nodes == pytest.approx(motion.nodes, abs=1e-5)


def test_splines_outside_a_segment_add_no_variants_to_it() -> None:
    """A long hoist has as many unknowns as splines, but no more variants than a short one."""
    short, long = (SplineGrid.covering(1.0, end_s, 0.7) for end_s in (3.0, 9.0))
    variants = [
        linearise_segments(
            motion_of([np.log(LENGTH_M), 0.0, *np.full(splines.count, 0.1)], splines)
        ).trajectory.state.shape[-1]
        for splines in (short, long)
    ]

    assert variants[0] == variants[1] < 1 + N_STATES + N_BASE_PARAMETERS + long.count


def test_propagation_of_one_motion_agrees_with_the_integration_of_arrays() -> None:
    stiffness, lengthening = np.linspace(1.0, 0.8, 41), np.linspace(0.0, 0.05, 41)
    for field in (
        ForceField(1.0, 0.01),
        ForceField(1.0, 0.01, 0.03, 0.05),
        TrajectoryInput(stiffness, 0.01, lengthening),
    ):
        in_arrays = integrate(START, field, 0.1, 20).state[..., 0]

        first, second, third = (complex(each) for each in START[:, 0])
        in_numbers = propagate((first, second, third), field, 0.1, 20)

        assert np.array(in_numbers) == pytest.approx(in_arrays, abs=1e-14)
