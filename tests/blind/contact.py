"""Friction that holds before it slides, as a contact at the pivot that remembers where it comes from (Dahl 1968)."""

from dataclasses import dataclass, field

import numpy as np

from tests.blind.mechanics import Array, Holding


@dataclass(slots=True)
class Contact:
    """The elastic rotation of the contact against the pivot, carried from step to step."""

    holding: Holding
    gravity_m_s2: float
    step_s: float
    _last: Array | None = None
    _rotation_rad: Array = field(default_factory=lambda: np.zeros(3))

    def pull(self, place_m: Array) -> Array:
        """Force over mass on a load that has come to a place, m/s^2, from the pivot, m; exact for a straight way there.

        The friction of a bearing is in proportion to what hangs on it.
        """
        length_m = float(np.linalg.norm(place_m))
        n = place_m / length_m
        way = np.cross(n if self._last is None else self._last, n)
        self._last = n
        distance_rad, yields_rad = float(np.linalg.norm(way)), self.holding.presliding_rad
        if distance_rad > 0:
            sliding = yields_rad * way / distance_rad
            self._rotation_rad = sliding + (self._rotation_rad - sliding) * np.exp(-distance_rad / yields_rad)
        tension_m_s2 = -self.gravity_m_s2 * n[2] + length_m * (distance_rad / self.step_s) ** 2
        pulled: Array = -self.holding.hold_rad * tension_m_s2 * np.cross(self._rotation_rad / yields_rad, n)
        return pulled
