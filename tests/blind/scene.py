"""What a case is drawn on: the believed rig, the true scene that effects change, and the shape of an effect."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tests.blind.mechanics import Mechanics, ScalarProfile, Start, VectorProfile
from tests.blind.sensor import Sensor

STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True, slots=True)
class Rig:
    """What is believed, and how far it swings (which is not written into the rig's file)."""

    length_m: float
    position_m: float
    noise_g: float
    amplitude_rad: float
    rate_hz: float = 50.0
    full_scale_g: float = 2.0
    gravity_m_s2: float = STANDARD_GRAVITY_M_S2

    @property
    def rho(self) -> float:
        """The housing's place as a part of the rope's length."""
        return self.position_m / self.length_m

    @property
    def rate_rad_s(self) -> float:
        """Small swings'."""
        return float(np.sqrt(self.gravity_m_s2 / self.length_m))

    def believed(self) -> Mechanics:
        """The crane with nothing missing."""
        return Mechanics(self.length_m, self.position_m, self.gravity_m_s2)


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything that makes one recording, but for its sampling."""

    mechanics: Mechanics
    start: Start
    sensor: Sensor

    def with_mechanics(self, **changes: Any) -> "Scene":
        """The same with other mechanics."""
        return replace(self, mechanics=replace(self.mechanics, **changes))

    def with_start(self, **changes: Any) -> "Scene":
        """The same with another start."""
        return replace(self, start=replace(self.start, **changes))

    def with_sensor(self, **changes: Any) -> "Scene":
        """The same with another sensor."""
        return replace(self, sensor=replace(self.sensor, **changes))


@dataclass(frozen=True, slots=True)
class Effect:
    """One hidden effect, its parameters drawn."""

    name: str
    parameters: dict[str, Any]
    apply: Callable[[Scene, np.random.Generator], Scene]
    """The scene with it; the generator draws what differs from run to run (phases, a second pendulum's start)."""


Draw = Callable[[np.random.Generator, Rig, float], Effect]
"""Generator, believed rig, size (1 is the usual one) -> an effect."""


def adding(**profiles: Any) -> Callable[[Scene, np.random.Generator], Scene]:
    """One more of each kind to the mechanics, the same in every run."""

    def apply(scene: Scene, _run: np.random.Generator) -> Scene:
        return scene.with_mechanics(**{kind: (*getattr(scene.mechanics, kind), one) for kind, one in profiles.items()})

    return apply


def changing_sensor(**changes: Any) -> Callable[[Scene, np.random.Generator], Scene]:
    """Another value in the sensor chain, the same in every run."""
    return lambda scene, _run: scene.with_sensor(**changes)


def signed(rng: np.random.Generator, low: float, high: float) -> float:
    """Between low and high, either sign."""
    return float(rng.uniform(low, high) * rng.choice([-1, 1]))


def horizontal(rng: np.random.Generator, size: float) -> tuple[float, float]:
    """A vector of this length in any direction."""
    angle = rng.uniform(0, 2 * np.pi)
    return float(size * np.cos(angle)), float(size * np.sin(angle))


def pulse(start_s: float, duration_s: float, rise_s: float = 0.0) -> ScalarProfile:
    """0, then 1 for a duration, then 0; its area is the duration, however it rises. No edge is sharper than 5 ms."""
    rise_s = max(rise_s, 0.005)

    def level(time_s: np.ndarray) -> np.ndarray:
        up, down = (np.clip((time_s - edge) / rise_s + 0.5, 0, 1) for edge in (start_s, start_s + duration_s))
        return up - down

    return level


def along(vector: tuple[float, float], level: ScalarProfile) -> VectorProfile:
    """A horizontal vector times a level."""
    return lambda time_s: np.outer(level(time_s), [*vector, 0.0])


def sine(frequency_hz: float, phase_rad: float) -> ScalarProfile:
    """Unit amplitude."""
    return lambda time_s: np.sin(2 * np.pi * frequency_hz * time_s + phase_rad)
