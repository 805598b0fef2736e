"""Double pendulums: the initial guess and the fit of a second mode, and what is not a second mode."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.pendulum.double_pendulum import modes
from gateway.numerics.spectrum import find_machine_line
from gateway.twin.effects.guess_context import GuessContext, guess_double_pendulum, guess_vibration
from gateway.twin.effects.parameter import Values
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.reconcile.data.data_checks import find_fault
from gateway.twin.reconcile.data.observations import LARGE_AMPLITUDE_RAD, Observations, make_observations
from gateway.twin.reconcile.fit.fit_context import FitContext
from gateway.twin.simulator.simulator import Simulator
from tests.gateway.twin.reconcile.conftest import RATE_HZ, swing
from tests.gateway.twin.swings import Array

HOOK = {"rigging_length_m": 2.4, "hook_mass_ratio": 0.11}
RIGGING_TILTS = {"faint": (0.01, 0.0, 0.0, 0.0), "strong": (0.12, 0.05, 0.0, 0.0)}
"""Initial tilts and rates of the rigging relative to the rope, by the strength of the fast mode."""


def modes_hz(length_m: float, rigging_m: Array | float, hook_mass_ratio: Array | float) -> tuple[Array, Array]:
    """Return the frequencies of the slow and the fast mode of a double pendulum of this whole length."""
    rigging, ratio = np.asarray(rigging_m, dtype=float), np.asarray(hook_mass_ratio, dtype=float)
    slow, fast = modes(length_m - rigging, rigging, ratio, 9.80665)
    return slow.rate / (2 * np.pi), fast.rate / (2 * np.pi)


def guess_context(rig: TwinRig, observations: Observations, residual_g: NDArray[np.float64]) -> GuessContext:
    o = observations
    return GuessContext(rig.length_m, rig.gravity_m_s2, o.time_s, o.force_g, o.noise_g, residual_g)


@pytest.fixture
def double_pendulum(rig: TwinRig) -> Callable[..., Observations]:
    """Return a function that records a double pendulum whose fast mode is faint or strong."""

    def make(
        strength: str, rope: tuple[float, ...] = (0.10, 0.04, -0.02, 0.05), duration_s: float = 60.0
    ) -> Observations:
        start = [*rope, 0.0, *(np.array(rope) + RIGGING_TILTS[strength])]
        return swing(rig, {"double_pendulum": HOOK}, start, np.arange(0, duration_s, 1 / RATE_HZ))

    return make


@pytest.mark.slow
def test_a_cutoff_stands_by_its_inverse_in_which_derivatives_are_taken(rig: TwinRig) -> None:
    simulator, time_s = Simulator(rig, ["lowpass_lag"]), np.arange(0, 6, 0.05)
    n_states = simulator.n_initial_states
    lag: EffectValues = {"lowpass_lag": {"cutoff_hz": 0.5, "began_g": (0.1, 0.2, 0.3)}}
    values = simulator.values([0.1, 0.04, -0.02, 0.05, 0.0], lag)
    derivatives = simulator.linearise(values, time_s).jacobian

    assert values[n_states:] == pytest.approx([2.0, 0.1, 0.2, 0.3], rel=1e-12)
    assert simulator.effects(values)["lowpass_lag"]["cutoff_hz"] == pytest.approx(0.5, rel=1e-12)
    for i in range(n_states, len(values)):
        step = 1e-6 * np.eye(len(values))[i]
        ahead, behind = (simulator.predict(values + sign * step, time_s) for sign in (1, -1))
        np.testing.assert_allclose(derivatives[..., i], (ahead - behind) / 2e-6, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("strength", ["faint", "strong"])
def test_fast_mode_is_found_whichever_mode_is_the_stronger(
    rig: TwinRig, double_pendulum: Callable[..., Observations], strength: str
) -> None:
    observations = double_pendulum(strength)
    starts = guess_double_pendulum(guess_context(rig, observations, observations.force_g))
    fast_hz = [
        modes_hz(rig.length_m, np.array(v["rigging_length_m"]), np.array(v["hook_mass_ratio"]))[1] for v in starts
    ]
    true_hz = modes_hz(rig.length_m, np.array(HOOK["rigging_length_m"]), np.array(HOOK["hook_mass_ratio"]))[1]

    assert len(starts) > 1
    assert np.median(fast_hz) == pytest.approx(true_hz, rel=0.03)


def test_single_pendulum_has_no_second_mode(rig: TwinRig, record: Callable[..., Observations]) -> None:
    observations = record({"viscous_damping": {"damping_ratio": 0.01}})

    assert guess_double_pendulum(guess_context(rig, observations, observations.force_g)) == []


@pytest.mark.slow
def test_fit_converges_along_the_valley_of_rigging_length_and_hook_mass(
    rig: TwinRig, double_pendulum: Callable[..., Observations]
) -> None:
    context = FitContext(rig, {}, double_pendulum("strong", duration_s=24.0), lambda: None)
    fast_hz = modes_hz(rig.length_m, np.array(HOOK["rigging_length_m"]), np.array(HOOK["hook_mass_ratio"]))[1]
    guesses = []
    for rigging_m in (1.6, 2.2, 3.2):
        ratio = np.geomspace(0.02, 1, 500)
        off_hz = modes_hz(rig.length_m, np.full_like(ratio, rigging_m), ratio)[1] - fast_hz
        values = {"rigging_length_m": rigging_m, "hook_mass_ratio": float(ratio[np.argmin(np.abs(off_hz))])}
        guesses.append({"double_pendulum": values})
    fit = context.fit(context.best_of_guesses(guesses))

    deviation = np.sqrt(np.diag(fit.covariance()))[-2:]
    assert fit.chi2 == pytest.approx(context.log.n_values, rel=0.06)
    np.testing.assert_array_less(np.abs(fit.values[-2:] - list(HOOK.values())), 4 * deviation)


def test_dominant_second_mode_is_not_reported_as_a_wrong_rig(
    rig: TwinRig, double_pendulum: Callable[..., Observations]
) -> None:
    observations = double_pendulum("strong", rope=(0.01, 0.0, 0.0, 0.005))
    lateral = np.abs(np.fft.rfft(observations.force_g[:, :2], axis=0)).sum(axis=1)
    main_hz = np.fft.rfftfreq(len(observations.time_s), 1 / RATE_HZ)[1 + np.argmax(lateral[1:])]

    assert main_hz > 3 * np.sqrt(rig.gravity_m_s2 / rig.length_m) / (2 * np.pi)
    assert find_fault(observations.time_s, observations.force_g, rig) is None


def test_flank_of_a_slower_line_is_not_taken_for_machine_vibration(rig: TwinRig) -> None:
    time_s = np.arange(0, 60, 1 / RATE_HZ)
    noise_g = np.array(rig.noise_g)
    noise = noise_g * np.random.default_rng(1).normal(size=(len(time_s), 3))
    bounce = np.outer(np.exp(-time_s / 15) * np.sin(2 * np.pi * 2.046 * time_s), [0.0, 0.0, 0.04])
    shaking = np.outer(np.sin(2 * np.pi * 8.3 * time_s), [0.002, 0.001, 0.0])
    found = find_machine_line(time_s, noise + shaking, noise_g)

    assert find_machine_line(time_s, noise + bounce, noise_g) is None
    assert found is not None
    assert found.frequency_hz == pytest.approx(8.3, abs=1e-3)


def test_overtone_of_a_second_mode_is_not_taken_for_machine_vibration(rig: TwinRig) -> None:
    time_s = np.arange(0, 60, 1 / RATE_HZ)
    noise_g = np.array(rig.noise_g)

    def found(line_hz: float, left_of_main_g: float = 0.0) -> Sequence[Values]:
        readings_g = noise_g * np.random.default_rng(1).normal(size=(len(time_s), 3)) + [0.0, 0.0, 1.0]
        for hz, size_g in ((0.16, 0.05), (1.31, 0.2), (line_hz, 0.004)):
            readings_g[:, 0] += size_g * np.sin(2 * np.pi * hz * time_s)
        observations = make_observations(time_s, readings_g, None, noise_g)
        left_g = noise_g * np.random.default_rng(2).normal(size=(len(time_s), 3))
        for hz, size_g in ((1.31, left_of_main_g), (line_hz, 0.004)):
            left_g[:, 0] += size_g * np.sin(2 * np.pi * hz * time_s)
        return guess_vibration(guess_context(rig, observations, left_g))

    assert found(3 * 1.31) == []
    assert found(3 * 1.31 + 0.2, left_of_main_g=0.1) == []
    assert found(8.3, left_of_main_g=0.1)[0]["frequency_hz"] == pytest.approx(8.3, abs=1e-3)
    assert found(3 * 1.31 + 0.2)[0]["frequency_hz"] == pytest.approx(3 * 1.31 + 0.2, abs=1e-3)


def test_bouncing_load_is_not_taken_for_a_large_swing(rig: TwinRig) -> None:
    time_s, size = np.arange(0, 60, 1 / RATE_HZ), np.array(rig.noise_g)
    bounce, slow = 0.14 * np.exp(-time_s / 16) * np.cos(2 * np.pi * 2.05 * time_s), 2 * np.pi * 0.176 * time_s
    bouncing = make_observations(
        time_s, np.stack([0.05 * np.sin(slow), 0.02 * np.cos(slow), 1 + bounce], axis=1), None, size
    )
    swing = np.stack([0.25 * np.cos(slow), 0 * slow, 0.97 - 0.13 * np.cos(2 * slow)], axis=1)

    assert bouncing.amplitude_rad > LARGE_AMPLITUDE_RAD
    assert not bouncing.has_large_amplitude
    assert make_observations(time_s, swing, None, size).has_large_amplitude
