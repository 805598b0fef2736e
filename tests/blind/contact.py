"""Friction that holds before it slides, as a contact that remembers where it comes from (Dahl 1968)."""

from dataclasses import dataclass

import numpy as np

from tests.blind.mechanics import Array, Holding


@dataclass(slots=True)
class Contact:
    """The elastic deflection between the load's path and the world, carried from step to step."""

    holding: Holding
    _last_m: Array | None = None
    _deflection_m: Array | None = None

    def pull(self, place_m: Array) -> Array:
        """Horizontal force over mass on the load when it has come to a place, shape (2,); exact for a straight way there."""
        if self._last_m is None or self._deflection_m is None:
            self._last_m, self._deflection_m = place_m.copy(), np.zeros(2)
        way = place_m - self._last_m
        self._last_m = place_m.copy()
        distance_m = float(np.hypot(*way))
        if distance_m > 0:
            sliding = self.holding.deflection_m * way / distance_m
            rest = np.exp(-distance_m / self.holding.deflection_m)
            self._deflection_m = sliding + (self._deflection_m - sliding) * rest
        pulled: Array = -self._deflection_m / self.holding.deflection_m * self.holding.force_m_s2
        return pulled
