"""Draws of the work: moves one after another, some before the last has ended, with hoists between them."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tests.blind.mechanics import Array
from tests.working_crane.real.moves import Move, Moves
from tests.working_crane.real.rig import G_M_S2

LEAD_IN_S = 16.0
"""Simulated from rest before the first sample."""
HORIZONTAL = ("x", "y", "trolley", "slew", "luff")
BRAKES = (0.0, 0.15)


@dataclass(slots=True)
class Draw:
    """Random numbers of one case, and the times of its half steps."""

    rng: np.random.Generator
    variant: int
    time_s: Array
    duration_s: float
    vigour: float = 1.0
    """Factor of all speeds but those of the winch."""
    lengths_m: list[float] = field(default_factory=list)

    def uniform(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def log_uniform(self, low: float, high: float) -> float:
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def sign(self) -> float:
        return float(self.rng.choice([-1.0, 1.0]))

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def commanded(self, moves: Sequence[Move], jerk_s: float, walk: float = 0.0) -> Moves:
        """Return the moves in order of time, on the half steps."""
        return Moves(self.time_s, tuple(sorted(moves, key=lambda move: move.start_s)), jerk_s, walk)

    def work(
        self,
        length_m: float,
        axes: dict[str, float],
        *,
        radius_m: float = 1.0,
        bounds_m: tuple[float, float] | None = None,
        accel_m_s2: tuple[float, float] = (0.1, 0.42),
        ramp_periods: tuple[float, float] = (0.15, 0.7),
        span_s: tuple[float, float] | None = None,
        fastest_m_s: float = 1.4,
        brake: float = 0.15,
    ) -> list[Move]:
        """Draw moves until the span is full; `axes` are the shares of the drives, `bounds_m` those of the length."""
        moves, length_now_m = [], length_m
        if span_s is None:
            moves.extend(self.first_swing(axes, radius_m))
        now_s, end_s = span_s or (self.uniform(6, 16), self.duration_s)
        names, shares = list(axes), np.array(list(axes.values()))
        low_m, high_m = bounds_m or (0.0, np.inf)
        while now_s < end_s - (4.0 if span_s is None else 0.0):
            axis = names[int(self.rng.choice(len(names), p=shares / shares.sum()))]
            if axis == "hoist":
                move = self.hoist(now_s, brake)
                if not low_m < length_now_m + move.way < high_m:
                    move = Move("hoist", move.start_s, -move.speed, move.ramp_s, move.hold_s, move.brake)
                if not low_m < length_now_m + move.way < high_m:
                    continue
                length_now_m += move.way
            else:
                move = self._travel(now_s, axis, length_m, radius_m, accel_m_s2, ramp_periods, fastest_m_s, brake)
            moves.append(move)
            now_s = move.end_s + (self.uniform(-2.5, 3) if self.chance(0.35) else self.uniform(3, 16))
        return [move for move in moves if move.end_s < end_s or span_s is None]

    def first_swing(self, axes: dict[str, float], radius_m: float) -> list[Move]:
        """Return a small move before the first sample, in two cases of three."""
        drives = [axis for axis in axes if axis in {"x", "y", "slew"}]
        if not drives or not self.chance(0.67):
            return []
        axis = str(self.rng.choice(drives))
        speed = self.sign() * self.uniform(0.03, 0.22) / (radius_m if axis == "slew" else 1.0)
        return [Move(axis, -LEAD_IN_S + 2.0, speed, self.uniform(0.8, 2.0), self.uniform(0.5, 3.0))]

    def hoist(self, start_s: float, brake: float = 0.15) -> Move:
        """Draw a hoist of 0.3 to 3 m."""
        speed = self.uniform(0.13, 0.48)
        ramp_s = max(0.35, speed / self.uniform(0.25, 0.6))
        stop = float(self.rng.choice([0.0, brake]))
        return Move("hoist", start_s, self.sign() * speed, ramp_s, self.uniform(0.7, 5.5), stop)

    def _travel(
        self,
        start_s: float,
        axis: str,
        length_m: float,
        radius_m: float,
        accel_m_s2: tuple[float, float],
        ramp_periods: tuple[float, float],
        fastest_m_s: float,
        brake: float,
    ) -> Move:
        period_s = 2 * np.pi * np.sqrt(length_m / G_M_S2)
        ramp_s = float(np.clip(self.uniform(*ramp_periods) * period_s, 0.6, 6.5))
        speed = min(self.uniform(*accel_m_s2) * ramp_s, fastest_m_s) * self.vigour
        if axis in {"slew", "luff"}:
            speed /= radius_m
        hold_s = self.uniform(2, 12) if axis == "slew" else self.uniform(0, 7)
        return Move(axis, start_s, self.sign() * speed, ramp_s, hold_s, float(self.rng.choice([0.0, brake])))
