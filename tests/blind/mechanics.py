"""What a simulated crane is made of, before any engine sees it: plain values that effects add to."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

VectorProfile = Callable[[Array], Array]
"""Times, s, shape (n,) -> world vectors, shape (n, 3)."""
ScalarProfile = Callable[[Array], Array]
"""Times, s, shape (n,) -> values, shape (n,)."""
VelocityForce = Callable[[float, float, float], Vector]
"""World velocity of the load, m/s -> force on it per mass, m/s^2."""

PlaceForce = Callable[[float, float, float], Vector]
"""Place of the load below the pivot, m -> force on it per mass, m/s^2."""


@dataclass(frozen=True, slots=True)
class Hook:
    """A hook block above the load: the rigging below it swings as a second pendulum."""

    rigging_length_m: float
    mass_ratio: float
    """Of the hook block to the load."""


@dataclass(frozen=True, slots=True)
class Spring:
    """A rope that stretches: the load's own vertical oscillation."""

    frequency_hz: float
    damping_ratio: float


@dataclass(frozen=True, slots=True)
class Release:
    """Half of the load's mass is let go: what is left hangs with its centre elsewhere, and swings on as it swung."""

    at_s: float
    shift_m: float
    """By how much the length of the equivalent pendulum grows."""


@dataclass(frozen=True, slots=True)
class Clamp:
    """A housing that turns against the rope on springs; it weighs next to nothing beside the load."""

    rocking_hz: tuple[float, float] | None = None
    """Frequencies about the housing's x and y axes, damped well; None is rigid."""
    below_m: float = 0.05
    """The housing's centre of mass below the clamp, and its radius of gyration."""
    torsion_hz: float | None = None
    """About the rope; None is rigid."""
    torsion_damping_ratio: float = 0.0


@dataclass(frozen=True, slots=True)
class Structure:
    """What carries the pivot: a mass on springs in two horizontal directions."""

    frequency_hz: float
    """Of the structure alone along its soft direction."""
    damping_ratio: float
    deflection_m: tuple[float, float]
    """Under a horizontal force of the load's weight: along the soft direction, across it."""
    azimuth_rad: float
    """Of the soft direction."""


@dataclass(frozen=True, slots=True)
class Holding:
    """Dry friction at the pivot that holds elastically before it slides."""

    hold_rad: float
    """Angle from the vertical at which it holds a load at rest."""
    presliding_rad: float
    """Rotation before all of it slides."""


@dataclass(frozen=True, slots=True)
class Mechanics:
    """The true crane. Profiles of one kind are summed."""

    length_m: float
    position_m: float
    gravity_m_s2: float
    gyration_m: float = 0.0
    """Radius of gyration of the load, which turns with the rope, about horizontal axes through its centre."""
    rope_kg: float = 0.0
    """Mass of the rope beside a load of 1 kg, as a chain of rigid links with damped joints."""
    share: float = 1.0
    """How much of a change of the rope's length the housing follows: 1 keeps its distance to the load, 0 to the pivot."""
    beside_m: tuple[float, float] = (0.0, 0.0)
    """The sensor's place beside the rope's line, along the housing's x and y."""
    clamp: Clamp | None = None
    spin_rad_s: float = 0.0
    hook: Hook | None = None
    spring: Spring | None = None
    """`length_m` and `position_m` are those of the rope without a load."""
    release: Release | None = None
    structure: Structure | None = None
    holding: Holding | None = None
    pivot_acceleration: tuple[VectorProfile, ...] = ()
    length_speed: tuple[ScalarProfile, ...] = ()
    """Rate of the rope's length, m/s."""
    load_acceleration: tuple[VectorProfile, ...] = ()
    """Outer force on the load per mass, m/s^2."""
    velocity_force: tuple[VelocityForce, ...] = ()
    place_force: tuple[PlaceForce, ...] = ()


@dataclass(frozen=True, slots=True)
class Start:
    """The motion at the first instant."""

    tilt_rad: tuple[float, float]
    """The rope's lean toward world x and y: n = (tan x, tan y, -1), normalised."""
    tilt_rate_rad_s: tuple[float, float]
    heading_rad: float
    """The housing's turn about the rope."""
    rigging_tilt_rad: tuple[float, float] = (0.0, 0.0)
    """Lean of the rigging below a hook beside the rope's."""
    stretch_m: float = 0.0
    """Beyond that of the load at rest."""
    bow_m: tuple[float, float] = (0.0, 0.0)
    """Of a rope with mass, beside its shape in the swing: sin(pi x) toward world x and y."""
    twist_rad: float = 0.0
    twist_rate_rad_s: float = 0.0
    """Of the housing against the rope."""


@dataclass(frozen=True, slots=True)
class Motion:
    """What the engine returns, one row per engine step."""

    time_s: Array
    force_m_s2: Array
    """Specific force in the housing's frame, shape (n, 3)."""
    angle_rad: Array
    """Angle of the rope at the pivot against the vertical, shape (n,)."""
