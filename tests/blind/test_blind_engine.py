"""The second simulator against closed forms: period, decay, modes, the formulas at the turning points, the frame."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.blind.engine import simulate
from tests.blind.mechanics import Clamp, Hook, Mechanics, Release, Spring, Start
from tests.blind.mechanics_effects import coulomb_friction, quadratic_drag, viscous_damping
from tests.blind.scene import Effect, Rig, Scene, pulse
from tests.blind.sensor import Sensor

G = 9.80665
FREE = Mechanics(length_m=10.0, position_m=4.0, gravity_m_s2=G)
RATE = np.sqrt(G / 10.0)
RIG = Rig(length_m=10.0, position_m=4.0, noise_g=0.0003, amplitude_rad=0.15)
RIM = 0.0001
"""g: a third of the smallest noise that a case has."""


def planar(amplitude_rad: float, heading_rad: float = 0.0) -> Start:
    return Start((amplitude_rad, 0.0), (0.0, 0.0), heading_rad)


def zero_crossings(time_s: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    at = np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:]))
    return time_s[at] - values[at] * (time_s[at + 1] - time_s[at]) / (values[at + 1] - values[at])


@pytest.mark.slow
@pytest.mark.parametrize("amplitude_rad", [0.02, 0.1, 0.3])
def test_period_grows_with_the_amplitude_as_the_elliptic_integral_says(amplitude_rad: float) -> None:
    motion = simulate(FREE, planar(amplitude_rad), 60.0)
    crossings = zero_crossings(motion.time_s, motion.force_m_s2[:, 0])
    period_s = 2 * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    mean = (1.0, np.cos(amplitude_rad / 2))
    for _ in range(6):  # arithmetic-geometric mean
        mean = (sum(mean) / 2, np.sqrt(mean[0] * mean[1]))
    assert period_s == pytest.approx(2 * np.pi / RATE / mean[0], rel=3e-7)


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.2, 0.5, 0.9])
def test_ideal_swing_reads_what_the_formulas_say(rho: float) -> None:
    phi = 0.17
    motion = simulate(Mechanics(10.0, rho * 10, G), planar(phi, heading_rad=0.7), 14.0)
    across, axial = np.hypot(*motion.force_m_s2[:, :2].T) / G, motion.force_m_s2[:, 2] / G
    assert across.max() == pytest.approx((1 - rho) * np.sin(phi), abs=1e-8)
    assert axial.min() == pytest.approx(np.cos(phi), abs=1e-8)
    assert axial.max() == pytest.approx(1 + 2 * rho * (1 - np.cos(phi)), abs=1e-6)
    assert motion.angle_rad.max() == pytest.approx(phi, abs=1e-9)


def test_housing_does_not_turn_about_the_rope() -> None:
    """Going round a cone of angle phi, parallel transport turns the frame by 2 pi (1 - cos phi) against the meridian.

    A universal joint's frame would come back as it left: the reading would turn by whole turns only.
    """
    phi, length_m = 0.3, 10.0
    rate = np.sqrt(G / (length_m * np.cos(phi)))
    turn_s = 2 * np.pi / rate
    start = Start((phi, 0.0), (0.0, rate * np.tan(phi)), 0.0)
    motion = simulate(Mechanics(length_m, 4.0, G), start, 3 * turn_s + 0.01)
    azimuth = np.unwrap(np.arctan2(motion.force_m_s2[:, 1], motion.force_m_s2[:, 0]))
    turned = np.interp(3 * turn_s, motion.time_s, azimuth) - azimuth[0]
    assert np.ptp(motion.angle_rad) < 1e-6
    assert turned == pytest.approx(3 * 2 * np.pi * np.cos(phi), abs=1e-5)


@pytest.mark.slow
def test_spinning_housing_turns_the_reading_and_nothing_else() -> None:
    spinning = simulate(Mechanics(10.0, 4.0, G, spin_rad_s=0.05), planar(0.1), 30.0)
    still = simulate(FREE, planar(0.1), 30.0)
    across, expected = (m.force_m_s2[:, 0] + 1j * m.force_m_s2[:, 1] for m in (spinning, still))
    np.testing.assert_allclose(across, expected * np.exp(-0.05j * still.time_s), atol=1e-5 * G)
    np.testing.assert_allclose(spinning.force_m_s2[:, 2], still.force_m_s2[:, 2], atol=1e-5 * G)


def envelope(effect: Effect, duration_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    scene = effect.apply(Scene(FREE, planar(0.1), Sensor()), np.random.default_rng(0))
    motion = simulate(scene.mechanics, scene.start, duration_s)
    middle = motion.angle_rad[1:-1]
    peaks = np.flatnonzero((middle > motion.angle_rad[:-2]) & (middle >= motion.angle_rad[2:])) + 1
    return motion.time_s[peaks], motion.angle_rad[peaks]


@pytest.mark.slow
def test_decay_of_each_friction() -> None:
    rng = np.random.default_rng(1)
    viscous, drag, dry = (draw(rng, RIG, 1.0) for draw in (viscous_damping, quadratic_drag, coulomb_friction))
    time_s, amplitude = envelope(viscous, 100.0)
    np.testing.assert_allclose(amplitude, 0.1 * np.exp(-viscous.parameters["damping_ratio"] * RATE * time_s), rtol=1e-3)
    time_s, amplitude = envelope(drag, 100.0)
    slope = 4 / (3 * np.pi) * drag.parameters["drag_per_m"] * 10.0 * RATE
    np.testing.assert_allclose(1 / amplitude, 10 + slope * time_s, rtol=2e-3)
    time_s, amplitude = envelope(dry, 60.0)
    lost = 2 * dry.parameters["decel_m_s2"] / (np.pi * RATE * 10.0)  # of the angle, per second
    np.testing.assert_allclose(amplitude, 0.1 - lost * time_s, rtol=2e-3)


@pytest.mark.slow
def test_two_modes_of_a_hook_and_its_load() -> None:
    hook = Hook(rigging_length_m=3.0, mass_ratio=0.1)
    upper_m, mass = 7.0, 1 / 0.1
    whole = (1 + mass) * (1 / upper_m + 1 / 3.0)
    root = np.sqrt(whole**2 - 4 * (1 + mass) / (upper_m * 3.0))
    modes = np.sqrt(G / 2 * np.array([whole - root, whole + root]))
    start = Start((1e-4, 0.0), (0.0, 0.0), 0.0, rigging_tilt_rad=(2e-4, 0.0))
    motion = simulate(Mechanics(10.0, 4.0, G, hook=hook), start, 40.0)
    waves = np.cos(np.outer(motion.time_s, modes))
    rest = motion.force_m_s2[:, 0] - waves @ np.linalg.lstsq(waves, motion.force_m_s2[:, 0])[0]
    assert np.abs(rest).max() < 1e-4 * np.abs(motion.force_m_s2[:, 0]).max()


def test_stretching_rope_rings_at_its_frequency_and_dies_away() -> None:
    spring = Spring(frequency_hz=2.0, damping_ratio=0.01)
    motion = simulate(Mechanics(10.0, 4.0, G, spring=spring), Start((0, 0), (0, 0), 0.0, stretch_m=0.005), 10.0)
    rate = 4 * np.pi
    damped, fade = rate * np.sqrt(1 - 0.01**2), np.exp(-0.01 * rate * motion.time_s)
    waves = np.stack([fade * np.cos(damped * motion.time_s), fade * np.sin(damped * motion.time_s)], axis=1)
    axial = motion.force_m_s2[:, 2] - G
    fit = np.linalg.lstsq(waves, axial)[0]
    assert fit[0] == pytest.approx(0.005 * rate**2, rel=1e-3)
    assert np.abs(axial - waves @ fit).max() < RIM * G


@pytest.mark.slow
def test_stretching_rope_hangs_lower_by_its_sag() -> None:
    spring = Spring(frequency_hz=1.0, damping_ratio=0.3)
    motion = simulate(Mechanics(10.0, 4.0, G, spring=spring), planar(0.01), 40.0)
    crossings = zero_crossings(motion.time_s, motion.force_m_s2[:, 0])
    length_m = 10 + G / (2 * np.pi) ** 2
    assert np.diff(crossings).mean() == pytest.approx(np.pi * np.sqrt(length_m / G), rel=1e-4)


@pytest.mark.slow
def test_what_is_left_of_a_load_swings_on_with_another_length() -> None:
    release = Release(at_s=15.0, shift_m=0.5)
    motion = simulate(Mechanics(10.0, 4.0, G, release=release), planar(0.02), 60.0)
    for part, length_m in ((motion.time_s < 14.9, 10.0), (motion.time_s > 15.1, 10.5)):
        crossings = zero_crossings(motion.time_s[part], motion.force_m_s2[part, 0])
        assert np.diff(crossings).mean() == pytest.approx(np.pi * np.sqrt(length_m / G), rel=1e-4)
    steps = np.abs(np.diff(motion.angle_rad))
    assert steps.max() < 0.02 * RATE * 0.005 * 1.01  # the rope's own rate does not jump


@pytest.mark.slow
def test_hoisting_keeps_the_angular_momentum_of_the_load_and_the_period_follows() -> None:
    """Seen from the pivot at a small angle: A grows as L^(-3/4) when the rope shortens slowly."""
    length_speed = pulse(10.0, 40.0, 2.0)
    motion = simulate(Mechanics(10.0, 9.0, G, length_speed=(lambda t: -0.1 * length_speed(t),)), planar(0.02), 80.0)
    late = motion.time_s > 55
    crossings = zero_crossings(motion.time_s[late], motion.force_m_s2[late, 0])
    half_s = np.diff(crossings).mean()
    assert half_s == pytest.approx(np.pi / np.sqrt(G / 6.0), rel=2e-4)
    assert motion.angle_rad[late].max() == pytest.approx(0.02 * (10 / 6) ** 0.75, rel=0.02)


def test_pivot_that_moves_off_leaves_a_swing_about_the_new_vertical() -> None:
    """A load at rest below a pivot that accelerates by a swings between 0 and 2 a/g."""
    drive = pulse(0.0, 60.0)
    push = (lambda t: np.outer(0.05 * drive(t), [1.0, 0.0, 0.0]),)
    motion = simulate(Mechanics(10.0, 4.0, G, pivot_acceleration=push), Start((0, 0), (0, 0), 0.0), 20.0)
    assert motion.angle_rad.max() == pytest.approx(2 * np.arctan(0.05 / G), rel=1e-4)
    # Along the rope it reads the pull of the tilted gravity, at rest in the moving crane.
    lowest = np.argmin(np.abs(motion.angle_rad - np.arctan(0.05 / G)))
    assert motion.force_m_s2[lowest, 0] == pytest.approx(0.0, abs=RIM * G)


def test_steady_wind_leans_the_rope_and_reads_sideways() -> None:
    lean = 0.2 / G
    wind = (lambda t: np.outer(np.ones_like(t), [0.2, 0.0, 0.0]),)
    motion = simulate(Mechanics(10.0, 4.0, G, load_acceleration=wind), Start((np.arctan(lean), 0), (0, 0), 0.0), 20.0)
    np.testing.assert_allclose(motion.angle_rad, np.arctan(lean), atol=1e-8)
    across = np.hypot(*motion.force_m_s2[-1, :2])
    assert across == pytest.approx(G * np.sin(np.arctan(lean)), abs=1e-6)


def test_sensor_beside_the_rope_reads_its_tangential_acceleration() -> None:
    beside = simulate(replace(FREE, beside_m=(0.04, 0.0)), planar(0.2), 12.0)
    added = (beside.force_m_s2 - simulate(FREE, planar(0.2), 12.0).force_m_s2) / G
    assert added[0] == pytest.approx([0.0, 0.0, -0.04 / 10 * np.sin(0.2)], abs=1e-8)
    assert added[:, 0].min() == pytest.approx(-2 * 0.04 / 10 * (1 - np.cos(0.2)), abs=1e-7)


@pytest.mark.slow
def test_soft_clamp_turns_the_housing_by_its_compliance() -> None:
    """Rocking at w about an axis through the clamp, the housing hangs h/(2 h^2 w^2) further to the force than its rope."""
    rocking_hz, below_m, phi = 6.0, 0.05, 0.15
    clamp = Clamp(rocking_hz=(rocking_hz, rocking_hz), below_m=below_m)
    soft = simulate(replace(FREE, clamp=clamp), planar(phi), 12.0, 0.001)
    rigid = simulate(FREE, planar(phi), 12.0, 0.001)
    settled = soft.time_s > 1.0
    turned, across = (np.arctan2(each.force_m_s2[settled, 0], each.force_m_s2[settled, 2]) for each in (soft, rigid))
    compliance = 1 / (2 * below_m * (2 * np.pi * rocking_hz) ** 2)
    # the stiffness includes that of the weight, which the housing hangs below its clamp by
    expected = compliance / (1 + compliance * G) * rigid.force_m_s2[settled, 0]
    assert across - turned == pytest.approx(expected, abs=2e-4)


@pytest.mark.slow
def test_torsion_turns_the_housing_as_a_damped_oscillator() -> None:
    frequency_hz, damping_ratio = 0.1, 0.02
    clamp = Clamp(torsion_hz=frequency_hz, torsion_damping_ratio=damping_ratio)
    twisted = simulate(replace(FREE, clamp=clamp), replace(planar(0.15), twist_rad=0.2), 40.0)
    rigid = simulate(FREE, planar(0.15), 40.0)
    figure, turned = (each.force_m_s2[:, 0] + 1j * each.force_m_s2[:, 1] for each in (rigid, twisted))
    wide = np.abs(figure) > 0.3
    rate, damped = 2 * np.pi * frequency_hz, 2 * np.pi * frequency_hz * np.sqrt(1 - damping_ratio**2)
    sine = damping_ratio * rate / damped * np.sin(damped * rigid.time_s)
    angle = 0.2 * np.exp(-damping_ratio * rate * rigid.time_s) * (np.cos(damped * rigid.time_s) + sine)
    assert -np.angle(turned / figure)[wide] == pytest.approx(angle[wide], abs=1e-4)
