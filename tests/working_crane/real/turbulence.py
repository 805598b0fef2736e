"""Turbulent wind: the spectrum of Kaimal along and across the mean, and the drag of a load in it."""

from dataclasses import dataclass

import mujoco
import numpy as np

from tests.blind.mechanics import Array
from tests.working_crane.real.rig import Outside, OutsideFactory

AIR_KG_M3 = 1.225
GRID_S = 0.05
ACROSS = 0.8
"""Standard deviation across the mean wind per that along it."""
FAR = 0.3
"""A gust: pressure so far from its mean."""


@dataclass(frozen=True, slots=True)
class Wind:
    """At the half steps."""

    velocity_m_s: Array
    """Shape (n, 3)."""
    gust: Array


def kaimal(frequency_hz: Array, mean_m_s: float, deviation_m_s: float, scale_m: float) -> Array:
    """Return the one-sided power density of the speed along the mean, m^2/s^2 per Hz."""
    reduced = scale_m / mean_m_s
    density: Array = 4 * deviation_m_s**2 * reduced / (1 + 6 * frequency_hz * reduced) ** (5 / 3)
    return density


def gusty(rng: np.random.Generator, time_s: Array, mean_m_s: float, deviation_m_s: float, scale_m: float) -> Array:
    """Return a speed without its mean, with random phases."""
    count = int(2 ** np.ceil(np.log2((time_s[-1] - time_s[0]) / GRID_S * 1.3)))
    frequency_hz: Array = np.fft.rfftfreq(count, GRID_S)[1:].astype(np.float64)
    amplitude = np.sqrt(2 * kaimal(frequency_hz, mean_m_s, deviation_m_s, scale_m) * frequency_hz[0])
    spectrum = np.concatenate([[0.0], amplitude * np.exp(2j * np.pi * rng.random(len(amplitude)))])
    speed = np.fft.irfft(spectrum * count / 2, count)
    return np.asarray(np.interp(time_s - time_s[0], GRID_S * np.arange(count), speed))


def wind_m_s(rng: np.random.Generator, time_s: Array, mean_m_s: float) -> Wind:
    """Draw direction, strength (12 to 25 %) and size (60 to 150 m) of the turbulence; it rises before the first sample."""
    deviation, scale_m, side = rng.uniform(0.12, 0.25) * mean_m_s, rng.uniform(60, 150), rng.uniform(0, 2 * np.pi)
    along = mean_m_s + gusty(rng, time_s, mean_m_s, deviation, scale_m)
    across = gusty(rng, time_s, mean_m_s, ACROSS * deviation, scale_m / 2)
    pressure = along**2 + across**2
    gust = np.abs(pressure / pressure[time_s >= 0].mean() - 1) > FAR
    rise = np.clip((time_s - time_s[0]) / max(-time_s[0], 1e-9), 0.0, 1.0)
    rise = rise**2 * (3 - 2 * rise)
    cosine, sine = np.cos(side), np.sin(side)
    velocity = np.column_stack([along * cosine - across * sine, along * sine + across * cosine, 0 * along])
    return Wind(velocity * rise[:, None], gust)


def blown(body: str, velocity_m_s: Array, area_m2: float) -> OutsideFactory:
    """Return the drag of a body in this wind; `area_m2` is drag coefficient times area."""

    def make(model: mujoco.MjModel, _time_s: Array) -> Outside:
        number = model.body(body).id
        first = int(model.body_dofadr[number])

        def apply(data: mujoco.MjData, stage: int) -> None:
            x, y, z = velocity_m_s[stage] - data.qvel[first : first + 3]
            factor = 0.5 * AIR_KG_M3 * area_m2 * (x * x + y * y + z * z) ** 0.5
            data.xfrc_applied[number, :3] = factor * x, factor * y, factor * z

        return apply

    return make
