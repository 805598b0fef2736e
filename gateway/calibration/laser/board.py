"""The board: a lattice of round dots of known pitch."""

from dataclasses import dataclass

import numpy as np

from gateway.numerics.array import Array


@dataclass(frozen=True, slots=True)
class DotBoard:
    """Layout of a board, by default that of Zhu et al. 2020, table 6."""

    columns: int = 7
    rows: int = 7
    pitch_m: float = 0.040
    """Distance between the centres of neighbouring dots."""
    dot_m: float = 0.020
    """Diameter of a dot."""
    u_pitch_m: float = 0.005e-3 / np.sqrt(3)
    """Standard uncertainty of the pitch, common to the whole board."""

    def node_m(self, index: Array) -> Array:
        """Return positions of lattice nodes (column, row), shape (n, 2): x to the right, y down, origin in the middle."""
        return np.asarray((index - (np.array([self.columns, self.rows]) - 1) / 2) * self.pitch_m)
