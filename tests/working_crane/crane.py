"""One case: the crane, its events, the sensor, and what is believed of the crane."""

from dataclasses import dataclass, field

from tests.blind.mechanics import Hook
from tests.working_crane.events import Event

G_M_S2 = 9.80665
DURATION_S = 180.0
RATE_HZ = 50.0


@dataclass(frozen=True, slots=True)
class Jib:
    """What carries the pivot around: a jib at a radius, or a boom that luffs."""

    radius_m: float = 0.0
    boom_m: float | None = None
    elevation_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class HeavyRope:
    """A rope with mass; its nodes are damped by forces in proportion to their velocity."""

    mass_ratio: float
    """To the load's."""
    damping_1_s: float
    """Force per mass and velocity."""
    links: int = 16


@dataclass(frozen=True, slots=True)
class Crane:
    """The mechanics. Positions of the housing are measured along the rope."""

    length_m: float
    """Pivot to load at the beginning of the recording, rope and rigging in one line."""
    above_load_m: float
    damping_ratio: float
    """Of the swing without a hook, by a force on the load in proportion to its velocity against the pivot."""
    hook: Hook | None = None
    rope: HeavyRope | None = None
    jib: Jib | None = None
    spin_rad_s: float = 0.0
    """Turning rate of the housing about the rope; a slewing jib adds its own."""

    @property
    def rate_rad_s(self) -> float:
        """Of small free swings without a hook."""
        return float((G_M_S2 / self.length_m) ** 0.5)


@dataclass(frozen=True, slots=True)
class Fault:
    """A disturbance of the recording; the motion is not affected."""

    kind: str
    """`gap`, `clipped`, `impact`."""
    start_s: float
    duration_s: float
    size_g: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """The true errors of the accelerometer."""

    noise_g: float
    offset_g: tuple[float, float, float]
    scale: tuple[float, float, float]
    drift_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Change of the offset from the first sample to the last."""
    drift_time_constant_s: float = 60.0
    faults: tuple[Fault, ...] = ()
    lost_fraction: float = 0.0
    full_scale_g: float = 2.0


@dataclass(frozen=True, slots=True)
class Case:
    """Everything that makes one recording."""

    kind: str
    seed: int
    rho: float
    crane: Crane
    events: tuple[Event, ...]
    sensor: SensorErrors
    believed_length_m: float
    tilt_rad: tuple[float, float]
    """The rope's lean toward world x and y at the start of the simulation; it starts at rest."""
    rigging_tilt_rad: tuple[float, float] = (0.0, 0.0)
    steady_wind_m_s2: tuple[float, float] = (0.0, 0.0)
    """Constant force on the load per mass; not marked as a gust."""
    lead_in_s: float = 0.0
    """Simulated time before the first sample."""
    extra: dict[str, float] = field(default_factory=dict)
    """More numbers for `case.json`."""
