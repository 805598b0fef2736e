"""Simulated swings of every mounting, and what the swing's benchmarks share."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from devices.pendulum import pendulum
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from gateway.swing.estimate import SwingEstimate
from gateway.swing.rig import MountedHousing

GRAVITY_M_S2 = STANDARD_GRAVITY_M_S2
RHOS = (0.02, 0.2, 0.5, 0.8, 0.95, 1.0)
AMPLITUDES_DEG = (1.0, 2.0, 4.0, 8.0, 12.0, 20.0)
ELLIPTICITIES = (0.0, 0.5)
NOISES_G = (1e-4, 4e-4, 2.5e-3)
RATE_HZ, SECONDS = 50.0, 90.0
LENGTH_U_REL = 0.1


@dataclass(frozen=True)
class Recordings:
    """All at once: the first dimension is the recording."""

    rho: np.ndarray
    planar: np.ndarray
    length_m: np.ndarray
    noise_g: np.ndarray
    force_g: np.ndarray
    """Shape (recordings, samples, 3)."""
    phi_max_deg: np.ndarray


def simulate(rng: np.random.Generator) -> Recordings:
    """Every rho with every amplitude, planar and elliptical, every noise; length, azimuth, phase and damping by chance."""
    cases = np.array(list(product(RHOS, AMPLITUDES_DEG, ELLIPTICITIES, NOISES_G)))
    rho, amplitude_deg, ellipticity, noise_g = cases.T
    count = len(cases)
    length_m = rng.uniform(6, 15, count)
    rate_1_s = np.sqrt(GRAVITY_M_S2 / length_m)
    phase, turn = rng.uniform(0, 2 * np.pi, count), np.exp(1j * rng.uniform(0, 2 * np.pi, count))
    a = np.radians(amplitude_deg)
    place = turn * a * (np.cos(phase) + 1j * ellipticity * np.sin(phase))
    speed = turn * a * rate_1_s * (-np.sin(phase) + 1j * ellipticity * np.cos(phase))
    starts = zip(place.real, place.imag, speed.real, speed.imag, strict=True)
    motion = np.array([pendulum.start_motion(*start) for start in starts])
    force_m_s2, angle_rad = _swing(motion, rho * length_m, length_m, rng.uniform(0.001, 0.004, count))
    force_g = force_m_s2 / GRAVITY_M_S2 + noise_g[:, None, None] * rng.normal(size=force_m_s2.shape)
    phi_max_deg = np.array([largest(np.degrees(angles)) for angles in angle_rad])
    return Recordings(rho, ellipticity == 0, length_m, noise_g, force_g, phi_max_deg)


def _swing(
    motion: np.ndarray, position_m: np.ndarray, length_m: np.ndarray, damping_ratio: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Specific force (recordings, samples, 3) and rope angle (recordings, samples) of free swings."""
    length, position = length_m[:, None], position_m[:, None]
    damping_1_s = (2 * damping_ratio * np.sqrt(GRAVITY_M_S2 / length_m))[:, None]

    def rate(_time_s: float, motion: np.ndarray) -> np.ndarray:
        drive = np.array([0.0, 0.0, -GRAVITY_M_S2]) - damping_1_s * length * motion[:, 1]
        return pendulum.motion_rate(motion, drive, length, 0.0)

    forces, angles = [], []
    for _ in range(round(SECONDS * RATE_HZ)):
        n_acceleration = rate(0.0, motion)[:, 1]
        forces.append(pendulum.specific_force_m_s2(motion, n_acceleration, np.zeros(3), GRAVITY_M_S2, position))
        angles.append(np.arctan2(np.hypot(motion[:, 0, 0], motion[:, 0, 1]), -motion[:, 0, 2]))
        motion = pendulum.runge_kutta_step(rate, 0.0, motion, 1 / RATE_HZ)
    return np.stack(forces, axis=1), np.stack(angles, axis=1)


def maxima(angle_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of the local maxima, and their heights between the samples (the vertex of a parabola)."""
    a = angle_deg
    place = np.flatnonzero((a[1:-1] > a[:-2]) & (a[1:-1] >= a[2:])) + 1
    before, middle, after = a[place - 1], a[place], a[place + 1]
    return place, middle + (before - after) ** 2 / (8 * (2 * middle - before - after))


def largest(angle_deg: np.ndarray) -> float:
    """Largest angle, ends included."""
    return float(max(*maxima(angle_deg)[1], angle_deg[0], angle_deg[-1]))


def rig(length_m: float, rho: float, rng: np.random.Generator) -> MountedHousing:
    """The place known, the rope's length believed wrong by its stated uncertainty."""
    belief_m = length_m * (1 + LENGTH_U_REL * rng.normal())
    return MountedHousing(length_m=belief_m, position_m=rho * length_m, length_u_rel=LENGTH_U_REL)


def covers(estimate: SwingEstimate, true_deg: float) -> bool:
    if estimate.coverage95_rad is None:
        return False
    low_deg, high_deg = np.degrees(estimate.coverage95_rad)
    return bool(low_deg <= true_deg <= high_deg)
