"""Recordings of a crane at work, by the simulated crane: its drives have other shapes than the profiles of the twin."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.pendulum import pendulum
from devices.pendulum.equations import Vector
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2, small_swing_rate_1_s
from devices.recording import Recording
from devices.simulated.crane import Crane
from devices.simulated.schedule import Event, Hoist, TrolleyMove

Array = NDArray[np.float64]
LENGTH_M, POSITION_M, NOISE_G, RATE_HZ, DURATION_S = 10.0, 5.0, 4e-4, 25.0, 110.0
DRIVES = (
    TrolleyMove(start_s=20.0, duration_s=8.0, ramp_s=2.5, speed_m_s=0.8, azimuth_rad=0.4),
    TrolleyMove(start_s=80.0, duration_s=7.0, ramp_s=2.5, speed_m_s=0.6, azimuth_rad=2.0),
)
HOIST = Hoist(start_s=46.0, duration_s=6.0, by_m=-1.2)
WORK: tuple[Event, ...] = (DRIVES[0], HOIST, DRIVES[1])


class DraggedCrane(Crane):
    """A crane whose load has a drag in proportion to the square of its speed, F/m = -k |v| v."""

    drag_per_m = 0.02

    def _rate(self, motion: list[Vector], acting: Vector, length: float, length_rate: float) -> list[Vector]:
        rate = np.array(motion[1])
        drag = self.drag_per_m * length**2 * float(np.linalg.norm(rate)) * rate
        x, y, z = (np.array(acting) - drag).tolist()
        return super()._rate(motion, (x, y, z), length, length_rate)

    def _with_damping(self, acting_m_s2: Array, n_rate: Array, length_m: Array) -> Array:
        drag = self.drag_per_m * length_m**2 * np.linalg.norm(n_rate, axis=1, keepdims=True) * n_rate
        return super()._with_damping(acting_m_s2 - drag, n_rate, length_m)


@dataclass(frozen=True, kw_only=True)
class Work:
    """A crane at work, and what differs from the rig."""

    events: tuple[Event, ...] = WORK
    crane: type[Crane] = Crane
    damping_ratio: float = 0.0
    offset_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drift_g_k: tuple[float, float, float] = (0.0, 0.0, 0.0)
    position_m: float = POSITION_M
    """The true one; the rig says `POSITION_M`."""
    amplitude_deg: float = 4.0
    seed: int = 1


def record(work: Work) -> Recording:
    """Return a recording of 110 s, with noise."""
    rng = np.random.default_rng(work.seed)
    speed = small_swing_rate_1_s(LENGTH_M, STANDARD_GRAVITY_M_S2)
    first = math.radians(work.amplitude_deg) * np.exp(1j * rng.uniform(0, 2 * np.pi))
    side = 0.3j * speed * first
    crane = work.crane(
        length_m=LENGTH_M,
        position_m=work.position_m,
        events=work.events,
        motion=pendulum.start_motion(first.real, first.imag, side.real, side.imag),
        damping_ratio=work.damping_ratio,
    )
    time_s: Array = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    warming_c = 10 * -np.expm1(-time_s / 40)
    force_g = crane.specific_force_m_s2(time_s) / STANDARD_GRAVITY_M_S2
    force_g += np.array(work.offset_g) + np.outer(warming_c, work.drift_g_k) + NOISE_G * rng.normal(size=force_g.shape)
    none = np.zeros(len(time_s), dtype=np.int64)
    return Recording(
        time_s=time_s, raw=force_g, unit="g", lost_before=none, unusable_before=none, temperature_c=22 + warming_c
    )
