"""Recordings of a simulated load on a rope: what is true of them is known."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from devices.pendulum import pendulum
from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2

GRAVITY_M_S2 = STANDARD_GRAVITY_M_S2


Array = NDArray[np.float64]


@dataclass(frozen=True)
class Recording:
    time_s: np.ndarray
    force_g: np.ndarray
    angle_rad: np.ndarray
    """True rope angle at the samples."""
    position_m: float
    length_m: float

    @property
    def phi_max_rad(self) -> float:
        return float(self.angle_rad.max())


Push = Callable[[float], tuple[float, float, float]]
"""Acceleration of the pivot in m/s^2 at a time."""


def simulate(
    *,
    rho: float = 0.5,
    amplitude_deg: float = 8.0,
    ellipticity: float = 0.0,
    azimuth_deg: float = 25.0,
    phase_rad: float = 0.4,
    length_m: float = 9.0,
    damping_ratio: float = 0.002,
    lean_deg: float = 0.0,
    lean_azimuth_deg: float = 70.0,
    duration_s: float = 60.0,
    rate_hz: float = 50.0,
    noise_g: float = 4e-4,
    push: Push | None = None,
    seed: int = 1,
) -> Recording:
    """A swing in the readings of a housing on its rope; the pivot may be pushed."""
    rate_1_s = np.sqrt(GRAVITY_M_S2 / length_m)
    lean = np.radians(lean_deg) * np.array([np.cos(np.radians(lean_azimuth_deg)), np.sin(np.radians(lean_azimuth_deg))])
    pull_m_s2 = GRAVITY_M_S2 * np.array([np.tan(lean[0]), np.tan(lean[1]), 0.0])
    turn = np.exp(1j * np.radians(azimuth_deg))
    a = np.radians(amplitude_deg)
    place = turn * (a * np.cos(phase_rad) + 1j * ellipticity * a * np.sin(phase_rad)) + complex(*lean)
    speed = turn * rate_1_s * (-a * np.sin(phase_rad) + 1j * ellipticity * a * np.cos(phase_rad))
    damping_1_s = 2 * damping_ratio * rate_1_s

    def pivot(time_s: float) -> Array:
        return np.zeros(3) if push is None else np.asarray(push(time_s), dtype=float)

    def rate(time_s: float, motion: Array) -> Array:
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


Simulate = Callable[..., Recording]


@pytest.fixture(scope="session")
def simulated() -> Simulate:
    """The function that makes a recording."""
    return simulate
