"""Recordings of a simulated load on a rope: what is true of them is known."""

from dataclasses import dataclass

import numpy as np
import pytest

from devices.pendulum import pendulum
from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2

GRAVITY_M_S2 = STANDARD_GRAVITY_M_S2


@dataclass(frozen=True)
class Recording:
    time_s: np.ndarray
    force_g: np.ndarray
    angle_rad: np.ndarray
    """True rope angle at the samples."""
    position_m: float
    length_m: float

    @property
    def phi_max_rad(self):
        return float(self.angle_rad.max())


def simulate(
    *,
    rho=0.5,
    amplitude_deg=8.0,
    ellipticity=0.0,
    azimuth_deg=25.0,
    phase_rad=0.4,
    length_m=9.0,
    damping_ratio=0.002,
    lean_deg=0.0,
    lean_azimuth_deg=70.0,
    duration_s=60.0,
    rate_hz=50.0,
    noise_g=4e-4,
    push=None,
    seed=1,
):
    """`push(time_s)` gives an acceleration of the pivot in m/s^2, shape (3,)."""
    rate_1_s = np.sqrt(GRAVITY_M_S2 / length_m)
    lean = np.radians(lean_deg) * np.array([np.cos(np.radians(lean_azimuth_deg)), np.sin(np.radians(lean_azimuth_deg))])
    pull_m_s2 = GRAVITY_M_S2 * np.array([np.tan(lean[0]), np.tan(lean[1]), 0.0])
    turn = np.exp(1j * np.radians(azimuth_deg))
    a = np.radians(amplitude_deg)
    place = turn * (a * np.cos(phase_rad) + 1j * ellipticity * a * np.sin(phase_rad)) + complex(*lean)
    speed = turn * rate_1_s * (-a * np.sin(phase_rad) + 1j * ellipticity * a * np.cos(phase_rad))
    damping_1_s = 2 * damping_ratio * rate_1_s

    def pivot(time_s):
        return np.zeros(3) if push is None else np.asarray(push(time_s), dtype=float)

    def rate(time_s, motion):
        drive = np.array([0.0, 0.0, -GRAVITY_M_S2]) + pull_m_s2 - pivot(time_s) - damping_1_s * length_m * motion[1]
        return pendulum.motion_rate(motion, drive, length_m, 0.0)

    motion = pendulum.start_motion(place.real, place.imag, speed.real, speed.imag)
    step_s, position_m = 1 / rate_hz, rho * length_m
    time_s = np.arange(round(duration_s * rate_hz)) * step_s
    force = np.empty((len(time_s), 3))
    angle = np.empty(len(time_s))
    for i, now_s in enumerate(time_s):
        n_acceleration = rate(now_s, motion)[1]
        force[i] = pendulum.specific_force_m_s2(motion, n_acceleration, pivot(now_s), GRAVITY_M_S2, position_m)
        angle[i] = np.arccos(np.clip(-motion[0, 2], -1, 1))
        motion = pendulum.runge_kutta_step(rate, now_s, motion, step_s)
    noise = noise_g * np.random.default_rng(seed).normal(size=force.shape)
    return Recording(time_s, force / GRAVITY_M_S2 + noise, angle, position_m, length_m)


@pytest.fixture(scope="session")
def simulated():
    """The function that makes a recording."""
    return simulate
