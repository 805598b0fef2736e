"""Recordings of a simulated load on a rope: what is true of them is known."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from devices.pendulum import equations, pendulum
from devices.pendulum.equations import Vector, add, scale
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2

GRAVITY_M_S2 = STANDARD_GRAVITY_M_S2
Motion = tuple[Vector, Vector, Vector]
"""n, n' and the housing's x axis in floats, since thousands of small arrays take ten times as long."""


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
    pull_m_s2 = (GRAVITY_M_S2 * math.tan(lean[0]), GRAVITY_M_S2 * math.tan(lean[1]), -GRAVITY_M_S2)
    turn = np.exp(1j * np.radians(azimuth_deg))
    a = np.radians(amplitude_deg)
    place = turn * (a * np.cos(phase_rad) + 1j * ellipticity * a * np.sin(phase_rad)) + complex(*lean)
    speed = turn * rate_1_s * (-a * np.sin(phase_rad) + 1j * ellipticity * a * np.cos(phase_rad))
    damping_m_s = float(2 * damping_ratio * rate_1_s * length_m)

    def pivot(time_s: float) -> Vector:
        return (0.0, 0.0, 0.0) if push is None else push(time_s)

    def rate(time_s: float, motion: Motion) -> Motion:
        n, n_rate, x_axis = motion
        drive = add(add(pull_m_s2, scale(-1, pivot(time_s))), scale(-damping_m_s, n_rate))
        n_acceleration = equations.acceleration_of_direction(n, n_rate, drive, length_m, 0.0)
        return n_rate, n_acceleration, equations.transport_rate(n, n_rate, x_axis)

    n, n_rate, x_axis = pendulum.start_motion(place.real, place.imag, speed.real, speed.imag).tolist()
    motion: Motion = (tuple(n), tuple(n_rate), tuple(x_axis))
    step_s, position_m = 1 / rate_hz, rho * length_m
    time_s = np.arange(round(duration_s * rate_hz)) * step_s
    force, angle = [], []
    for now_s in time_s.tolist():
        k1 = rate(now_s, motion)
        in_world = equations.specific_force(*motion[:2], k1[1], pivot(now_s), GRAVITY_M_S2, position_m, 0.0, 0.0)
        force.append(equations.in_housing(motion[0], motion[2], in_world))
        angle.append(-motion[0][2])
        k2 = rate(now_s + step_s / 2, _moved(motion, step_s / 2, k1))
        k3 = rate(now_s + step_s / 2, _moved(motion, step_s / 2, k2))
        k4 = rate(now_s + step_s, _moved(motion, step_s, k3))
        motion = _moved(_moved(motion, step_s / 6, k1), step_s / 6, k4)
        motion = _moved(_moved(motion, step_s / 3, k2), step_s / 3, k3)
    noise = noise_g * np.random.default_rng(seed).normal(size=(len(time_s), 3))
    angle_rad = np.arccos(np.clip(angle, -1, 1))
    return Recording(time_s, np.array(force) / GRAVITY_M_S2 + noise, angle_rad, position_m, length_m)


def _moved(motion: Motion, step_s: float, rate: Motion) -> Motion:
    n, n_rate, x_axis = (add(c, scale(step_s, c_rate)) for c, c_rate in zip(motion, rate, strict=True))
    return n, n_rate, x_axis
