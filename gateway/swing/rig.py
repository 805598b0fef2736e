"""The nominal description of the rope and of the housing on it, as the swing estimator needs it."""

from dataclasses import dataclass, replace

from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2, small_swing_length_m, small_swing_period_s
from gateway.configuration.model import PLACED_FROM_LOAD, MountedOn

NOMINAL_LENGTH_U_REL = 0.2
"""Standard uncertainty of a nominal length over it, where none is stated. Basis: a choice; a rope a fifth longer or shorter
starts in the reach of a fit, and the measured period takes precedence."""

SPREADER_REACH_M, SPREADER_REACH = 1.0, 0.08
"""Distance above the load, and its share of the rope's length, up to which the housing may be on a spreader."""
CONVERGING_REACH = 0.15
"""Share of the rope's length above the load up to which it may be on one of several ropes that converge."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MountedHousing:
    """A housing clamped to a rope. Standard uncertainties are 1 sigma; 0 means exactly known.

    Its place is known from one end of the rope: `position_m` or `above_load_m`. Raises `ValueError` for both or neither, and for
    an impossible length, position or uncertainty.
    """

    length_m: float
    """Pivot to the load's centre: nominal, the measured period takes precedence."""
    position_m: float | None = None
    """Pivot to the accelerometer, along the rope."""
    above_load_m: float | None = None
    """Accelerometer to the load's centre; constant while hoisting, because the housing is clamped."""
    mounted_on: MountedOn | None = None
    """None: it is not stated, and found from the readings."""
    length_u_rel: float = NOMINAL_LENGTH_U_REL
    position_u_m: float = 0.0
    gravity_m_s2: float = STANDARD_GRAVITY_M_S2
    gravity_u_rel: float = 0.0
    """Its standard uncertainty, relative: that of a rope's length by the period, and of no angle, which 1 g is the unit of."""
    zero_g_offset_u_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Standard uncertainty of the zero-g offset after calibration, per axis."""
    scale_u: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Standard uncertainty of the scale factor after calibration, per axis, relative."""
    cross_axis_u: float = 0.0
    """Standard uncertainty of the response of z to x and y, relative: cross-axis sensitivity, and the axes' misalignment with the
    rope. In a swing it resembles a lean."""
    mount_rad: tuple[float, float] = (0.0, 0.0)
    """Expected angles of the housing against the rope, about x and y."""
    mount_u_rad: float | None = 0.0
    """Their standard uncertainty; None: nothing is known, and a tilt that the readings show may be the mount's."""
    beside_u_m: float = 0.0
    """Standard uncertainty of the accelerometer's place across the rope, per axis: the lever arm beside the line."""
    pull_u: float = 0.3
    """Standard uncertainty of a steady side pull over the weight, per axis."""
    bandwidth_hz: float | None = None
    """-3 dB of the low-pass inside the sensor; None: there is none, or it is not known."""

    def __post_init__(self) -> None:
        if not (self.length_m > 0 and self.gravity_m_s2 > 0 and 0 < self.length_u_rel < 1):
            raise ValueError("rope length and gravity must be positive, length_u_rel between 0 and 1")
        if (self.position_m is None) == (self.above_load_m is None):
            raise ValueError("give the housing's place once: position_m (from the pivot) or above_load_m")
        if self.mounted_on in PLACED_FROM_LOAD and self.above_load_m is None:
            raise ValueError(f"a housing on {self.mounted_on} has its place from the load: give above_load_m")
        if not ((self.position_m or 0.0) >= 0 and (self.above_load_m or 0.0) >= 0 and self.position_u_m >= 0):
            raise ValueError("the housing's position and its uncertainty must not be negative")
        if min(*self.zero_g_offset_u_g, *self.scale_u, self.cross_axis_u) < 0:
            raise ValueError("uncertainties of offset, scale and cross-axis sensitivity must not be negative")
        if min(self.mount_u_rad or 0.0, self.beside_u_m) < 0:
            raise ValueError("uncertainties of the mount and of the place beside the rope must not be negative")
        if self.bandwidth_hz is not None and not self.bandwidth_hz > 0:
            raise ValueError("the sensor's bandwidth must be positive")

    @property
    def small_swing_period_s(self) -> float:
        """Period of a small swing on the nominal rope."""
        return small_swing_period_s(self.length_m, self.gravity_m_s2)

    @property
    def possible_structures(self) -> list[MountedOn]:
        """What may carry the housing: what is stated, or all that its distance above the load allows."""
        if self.mounted_on is not None:
            return [self.mounted_on]
        found: list[MountedOn] = ["rope"]
        if self.above_load_m is not None and self.above_load_m <= CONVERGING_REACH * self.length_m:
            found.append("converging_ropes")
        if self.above_load_m is not None and self.above_load_m <= max(SPREADER_REACH_M, SPREADER_REACH * self.length_m):
            found.append("spreader")
        return found

    def moving_with_load(self) -> "MountedHousing":
        """Return the housing as a hoist moves it: with the load where it is so near that the load would run past it."""
        clamped = self.possible_clamps[-1]
        is_near = clamped.above_load_m is not None and clamped.above_load_m <= CONVERGING_REACH * self.length_m
        return clamped if is_near else self

    @property
    def possible_clamps(self) -> list["MountedHousing"]:
        """What a place from the pivot may mean: on a part of the rope that stays, or that a hoist moves with the load."""
        if self.position_m is None or self.position_m > self.length_m:
            return [self]
        return [self, replace(self, position_m=None, above_load_m=self.length_m - self.position_m)]

    def length_of(self, rate_1_s: float) -> float:
        """Return the length of a rope on which a small swing has this angular frequency."""
        return small_swing_length_m(rate_1_s, self.gravity_m_s2)

    def position_at(self, length_m: float) -> float:
        """Return the distance from pivot to accelerometer for a length of the rope, never negative."""
        if self.above_load_m is not None:
            return max(length_m - self.above_load_m, 0.0)
        return float(self.position_m or 0.0)

    def rho_at(self, length_m: float) -> float:
        """Return position over length, at most 1."""
        return min(self.position_at(length_m) / length_m, 1.0)
