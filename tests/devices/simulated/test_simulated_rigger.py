"""The simulated rigger: the housing shows gravity along the requested face, moves in between, and hangs still afterwards."""

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.simulated.device import PLACEMENT_RAD, REST_S, SHAKE_G, TURN_S, Rigger, SimulatedCrane
from tests.clocks import SleeplessClock

FACES = [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, -1.0), (0.6, 0.0, 0.8)]


@pytest.fixture
def rigger() -> Rigger:
    return Rigger(np.random.default_rng(1))


def test_gravity_points_along_each_face_after_the_turn(rigger: Rigger) -> None:
    for turn, face in enumerate(FACES):
        start_s = 10.0 * turn
        rigger.turn(np.array(face), start_s)
        resting_g = rigger.specific_force_g(start_s + TURN_S + np.linspace(0.0, 5.0, 20))
        assert np.ptp(resting_g, axis=0) == pytest.approx(0.0, abs=1e-12)
        assert np.linalg.norm(resting_g[0]) == pytest.approx(1.0, abs=1e-12)
        assert np.arccos(resting_g[0] @ face) < 5 * PLACEMENT_RAD


def test_the_turn_is_continuous_even_to_the_opposite_face(rigger: Rigger) -> None:
    rigger.turn(np.array([1.0, 0.0, 0.0]), 0.0)
    rigger.turn(np.array([-1.0, 0.0, 0.0]), 10.0)
    moving_g = rigger.specific_force_g(np.linspace(10.0, 10.0 + TURN_S, 400))
    step_g = np.linalg.norm(np.diff(moving_g, axis=0), axis=1)
    assert step_g.max() < 10 * SHAKE_G
    assert moving_g[0] @ moving_g[-1] < -0.8


@pytest.mark.slow
def test_the_load_hangs_still_after_the_housing_was_hung_back() -> None:
    clock = SleeplessClock()
    crane = SimulatedCrane(odr_hz=100.0, block_samples=10, length_m=12.0, position_m=9.0, clock=clock)
    crane.open()
    crane.turn_housing((1.0, 0.0, 0.0))
    raw = _read(crane, 5.0) / crane.part.units_per_g
    assert raw[-1] == pytest.approx([1.0, 0.0, 0.0], abs=0.15)  # with the errors of an uncalibrated sensor
    crane.hang_housing()
    resting = _read(crane, REST_S - 1.0) / crane.part.units_per_g
    assert resting[100:].std(axis=0).max() < 2 * crane.part.noise_g
    swinging = _read(crane, 20.0) / crane.part.units_per_g
    assert swinging.std(axis=0).max() > 3 * crane.part.noise_g


def _read(crane: SimulatedCrane, duration_s: float) -> NDArray[np.float64]:
    blocks: list[NDArray[np.float64]] = []
    wanted = duration_s * crane.part.odr_hz
    while sum(len(raw) for raw in blocks) < wanted:
        block = crane.read()
        if block is not None:
            blocks.append(block.raw.astype(np.float64))
    return np.concatenate(blocks)
