"""What a kind of crane consists of: bodies, ropes, joints that are driven, the place of the housing."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import mujoco

from tests.blind.mechanics import Array
from tests.working_crane.real.moves import Moves

G_M_S2 = 9.80665

Outside = Callable[[mujoco.MjData, int], None]
"""Sets forces on bodies, from the state and the number of the half step."""
OutsideFactory = Callable[[mujoco.MjModel, Array], Outside]
"""Makes it from the model and the times of the half steps, s."""


@dataclass(frozen=True, slots=True)
class Rope:
    """A massless elastic rope through sites, whose tension is the same all along; it pulls and never pushes."""

    name: str
    sites: tuple[str, ...]
    rest_m: float
    """Without tension, at the beginning."""
    axial_n: float
    """Tension per strain."""
    damping_n_s_m: float
    falls: float = 0
    """Parts of rope that the winch pays out: its length changes by so many times the hoist."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where the housing sits: on the straight part of rope between two sites, or on a body."""

    top: str
    bottom: str
    above_end_m: float | None = None
    """Distance to the lower end: the clamp moves with the rope's end."""
    below_top_m: float | None = None
    """Distance to the upper end: the part does not run."""
    body_site: str | None = None
    """A site on a body that gives the housing its axes."""
    leans_by_design: bool = False
    """The part of rope leans while the load hangs at rest: one of several ropes, a fall of a block."""


@dataclass(frozen=True, slots=True)
class Disturbances:
    """What moves the housing or spoils the log, apart from the crane."""

    beside_m: tuple[float, float] = (0.0, 0.0)
    """Of the sensor from the rope, in the housing's axes."""
    slip: tuple[float, float, float] | None = None
    """Time in s, way down the rope in m, turn about it in degrees."""
    drift_g: float = 0.0
    """Change of the zero-g offset in 10 min."""
    askew_deg: float = 0.0
    """Mount error that is not zeroed."""
    step_g: float | None = None
    impacts: tuple[tuple[float, float, float], ...] = ()
    """Time in s, duration in s, size in g."""
    vibration: tuple[float, float] | None = None
    """Frequency in Hz and amplitude in g of the fundamental."""
    radio: tuple[float, float] | None = None
    """Share of samples lost, mean lateness of a stamp in s."""


@dataclass(frozen=True, slots=True)
class Rig:
    """One crane in MuJoCo's language, and what is recorded of it."""

    bodies: str
    ropes: tuple[Rope, ...]
    place: Place
    moves: Moves
    driven: tuple[str, ...] = ("x", "y")
    """Joints of prescribed motion; each follows the axis of its name."""
    pivots: tuple[str, ...] = ("pivot",)
    """Sites whose middle is the pivot."""
    end: str = "load"
    load: str = "load"
    sites: tuple[str, ...] = ()
    """Further sites to record."""
    damping: dict[str, float | tuple[float, ...]] = field(default_factory=dict)
    """Of joints, N s/m or N m s/rad."""
    mass_damping_1_s: float = 0.0
    """Damping force per momentum of what hangs in joints under the pivot."""
    push: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """Velocities given to joints when the simulation begins."""
    outside: OutsideFactory | None = None
    pivot_path: Array | None = None
    """Prescribed acceleration of the pivot beside the moves, m/s^2, shape (half steps, 3)."""
    heading_lag_s: float | None = None
    """Time constant with which the rope's heading follows the slewing jib."""
    gust: Array | None = None
    """At the half steps: whether the wind is far from its mean."""
    touch: bool = False
    """Whether a touched ground or a snag is marked."""
    always_driven: bool = False
    load_length: bool = False
    """Whether the stated length and place refer to the load, not to the rope's end."""
    disturbances: Disturbances = Disturbances()
    facts: dict[str, Any] = field(default_factory=dict)
