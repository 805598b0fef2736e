"""Recordings simulated by the twin itself, with noise and known effects. The blind test uses another simulator."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.twin.model import EffectValues, Model, TwinRig
from gateway.twin.reconcile.data.data_checks import CheckedRecording
from gateway.twin.reconcile.data.observations import Observations, make_observations
from gateway.twin.simulator.simulator import Simulator

Array = NDArray[np.float64]
RATE_HZ = 20.0
RIG = TwinRig(
    length_m=8.0, position_m=4.0, gravity_m_s2=9.80665, noise_g=(5e-4,) * 3, sample_rate_hz=RATE_HZ, full_scale_g=2.0
)
INITIAL_STATES = {"log": (0.10, 0.04, -0.02, 0.05), "held_out": (-0.05, 0.08, 0.06, 0.01)}
DURATIONS_S = {"log": 60.0, "held_out": 36.0}


def swing(
    rig: TwinRig, effects: EffectValues, start: Sequence[float] | Array, time_s: Array, seed: int | None = 1
) -> Observations:
    """Return what a rig with these effects reads of a motion from this state, with noise; without where there is no seed."""
    simulator = Simulator(rig, sorted(effects))
    force_g = simulator.predict(simulator.values(start, effects), time_s)
    if seed is not None:
        force_g = force_g + np.array(rig.noise_g) * np.random.default_rng(seed).normal(size=force_g.shape)
    return make_observations(time_s, force_g, None, np.array(rig.noise_g))


def make_recording(effects: EffectValues, name: str = "log", memory: float = 0.0, seed: int = 1) -> Observations:
    """Return a recording with these effects; the noise is a process of first order with this memory."""
    rng = np.random.default_rng([seed, len(name)])
    time_s = np.arange(0, DURATIONS_S[name], 1 / RATE_HZ)
    simulator = Simulator(RIG, sorted(effects))
    force_g = simulator.predict(simulator.values([*INITIAL_STATES[name], 0.0], effects), time_s)
    noise = rng.normal(size=force_g.shape)
    for i in range(1, len(noise)):
        noise[i] = memory * noise[i - 1] + np.sqrt(1 - memory**2) * noise[i]
    return make_observations(time_s, force_g + np.array(RIG.noise_g) * noise, None, np.array(RIG.noise_g))


@pytest.fixture
def rig() -> TwinRig:
    return RIG


@pytest.fixture
def model() -> Model:
    return Model(RIG, {})


@pytest.fixture
def record() -> Callable[..., Observations]:
    return make_recording


@pytest.fixture
def loaded() -> Callable[..., CheckedRecording]:
    def make(effects: EffectValues, name: str = "log", memory: float = 0.0, seed: int = 1) -> CheckedRecording:
        observations = make_recording(effects, name, memory, seed)
        return CheckedRecording(observations, None, {"read": len(observations.time_s)}, observations.time_s)

    return make
