"""The hypotheses on what acts on crane and load, and how one follows another.

A hypothesis joins a level of the pivot's acceleration, one of the force on the load and one of the winch. All of them have all
states: levels differ by how large a disturbance is and how long it lasts, so that wind and a yielding jib act beside a drive. A
pivot's acceleration and its heave are damped oscillators driven by white noise (Matérn 3/2 where critically damped: Hartikainen
and Särkkä 2010, eq. 12); a gust, and an acceleration that changes at once, are first-order processes.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from gateway.motion.mixture import Pairs
from gateway.numerics.array import Array

BOUNCE_RATE_1_S, BOUNCE_DAMPING = 5.3, 0.03
"""Rate and damping ratio of the bounce of a load on a jib or an elastic rope. Basis: jibs under their loads, 0.7 to 1.1 Hz."""
BOUNCE_SIGMA = 0.015
"""Standard deviation of the bounce that a winch excites which changes its speed again and again, over g. Basis: 30 to 100 mg
after a brake closes at 0.5 m/s, which lasts for half a second; twice the value hides gentle hoists (their intervals hold for 90 %
of the time instead of 96), and three times the value changes the error of the angle on real cranes by a fiftieth."""


@dataclass(frozen=True, slots=True)
class PivotLevel:
    """How the pivot moves: standard deviations over g, rates in 1/s."""

    sigma: float
    rate_1_s: float
    heave_sigma: float
    damping_ratio: float = 1.0
    heave_rate_1_s: float = BOUNCE_RATE_1_S
    heave_damping: float = BOUNCE_DAMPING
    is_abrupt: bool = False
    """The horizontal acceleration is a first-order process, which may change at once."""


@dataclass(frozen=True, slots=True)
class WindLevel:
    """How a force pushes the load: standard deviations over the weight, the rate in 1/s."""

    sigma: float
    rate_1_s: float
    side_sigma: float
    """Of the steady force before the first reading."""
    side_walk: float
    """Random walk of the steady force, 1/sqrt(s)."""


STILL, YIELDING, DRIVEN, ABRUPT, FLOATING, FLOATING_DRIVEN = range(6)
_SEA_HEAVE, _SEA_RATE_1_S, _SEA_DAMPING = 8e-3, 0.65, 0.25
PIVOT_LEVELS = (
    PivotLevel(sigma=1e-4, rate_1_s=4.0, heave_sigma=1e-4),
    PivotLevel(sigma=3e-3, rate_1_s=2.0, heave_sigma=2e-3),
    PivotLevel(sigma=2e-2, rate_1_s=0.6, heave_sigma=3e-4),
    PivotLevel(sigma=3e-2, rate_1_s=0.5, heave_sigma=3e-4, is_abrupt=True),
    PivotLevel(2e-2, 0.6, _SEA_HEAVE, _SEA_DAMPING, _SEA_RATE_1_S, _SEA_DAMPING),
    PivotLevel(3.5e-2, 0.5, _SEA_HEAVE, _SEA_DAMPING, _SEA_RATE_1_S, _SEA_DAMPING, is_abrupt=True),
)
"""Basis: a rigid crane; a jib or portal that yields at about a hertz by millimetres; ramps of 1 to 9 s to 0.2 to 2.5 m/s, and
their beginnings and ends within tenths of a second; a barge that rolls by a degree at 0.1 Hz under a pivot 20 to 40 m up, and
heaves by some decimetres."""
CALM, TURBULENT, HELD = range(3)
WIND_LEVELS = (
    WindLevel(sigma=2e-4, rate_1_s=0.3, side_sigma=3e-3, side_walk=0.0),
    WindLevel(sigma=5e-3, rate_1_s=0.2, side_sigma=1.2e-2, side_walk=3e-4),
    WindLevel(sigma=3e-2, rate_1_s=1.0, side_sigma=0.1, side_walk=3e-4),
)
"""Basis: leans of 0.2 degrees by a breeze; 5 to 10 m/s on a load of some m^2 per tonne; ground or snag that hold a load, by whose
friction a rope may stand aslant by several degrees."""

PIVOT_STARTS_1_S = np.array(
    [
        [0.0, 1 / 100, 1 / 25, 1 / 100, 0.0, 0.0],
        [1 / 30, 0.0, 1 / 25, 1 / 50, 0.0, 0.0],
        [1 / 20, 1 / 100, 0.0, 1 / 6, 0.0, 0.0],
        [1.0, 1 / 20, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1 / 25],
        [0.0, 0.0, 0.0, 0.0, 1 / 6, 0.0],
    ]
)
"""How often a level (row) is followed by another. Basis: a crane at work moves twice a minute, for some seconds; a base floats or
it does not."""
WIND_STARTS_1_S = np.array([[0.0, 1 / 90, 1 / 1500], [1 / 60, 0.0, 1 / 1500], [1 / 3, 1 / 20, 0.0]])
"""Basis: gusts of a minute; a load touches the ground, or leaves it, some times an hour."""
RESTING, STEADY, CHANGING = range(3)
"""What the winch does: it rests, it runs at a steady speed, its speed changes."""
WINCH_STARTS_1_S = np.array([[0.0, 1e-4, 1 / 60], [1 / 10, 0.0, 1 / 8], [1 / 2, 1 / 4, 0.0]])
"""Basis: a winch starts and stops by a change of its speed, which the axial reading shows; nothing shows a steady speed."""
_PIVOT_WEIGHTS = (0.6, 0.15, 0.12, 0.03, 0.07, 0.03)
_WIND_WEIGHTS, _WINCH_WEIGHTS = (0.745, 0.25, 0.005), (0.96, 0.01, 0.03)
"""Before the first reading. Basis: a gateway is switched on more often while the crane rests than while it works."""


def _is_distinct(pivot: int, wind: int, winch: int) -> bool:
    """Return whether readings can tell this hypothesis from others.

    The sea hides a wind, and a wind hides that a pivot yields. A load that is held tells nothing of drives, nor of the rope's
    length, which a steady hoist changes.
    """
    if wind == HELD:
        return pivot == STILL and winch != STEADY
    return wind != TURBULENT or pivot in (STILL, DRIVEN, ABRUPT)


_ALL = tuple(one for one in product(range(len(PIVOT_LEVELS)), range(len(WIND_LEVELS)), range(3)) if _is_distinct(*one))
N_HYPOTHESES = len(_ALL)
PIVOT_LEVEL = np.array([pivot for pivot, _, _ in _ALL])
WIND_LEVEL = np.array([wind for _, wind, _ in _ALL])
WINCH_LEVEL = np.array([winch for _, _, winch in _ALL])
IS_HOISTING = WINCH_LEVEL != RESTING
IS_DRIVEN = PIVOT_LEVEL >= DRIVEN
IS_GUST = WIND_LEVEL != CALM
IS_FLOATING = PIVOT_LEVEL >= FLOATING
HEAVE_SIGMA = np.where(
    (WINCH_LEVEL == CHANGING) & ~IS_FLOATING,
    BOUNCE_SIGMA,
    np.array([level.heave_sigma for level in PIVOT_LEVELS])[PIVOT_LEVEL],
)
"""Standard deviation of the heave under each hypothesis, over g."""
IS_FREE = ~IS_DRIVEN & ~IS_GUST & ~IS_HOISTING
"""The load swings freely or rests."""
_WEIGHTS = np.array([_PIVOT_WEIGHTS[p] * _WIND_WEIGHTS[w] * _WINCH_WEIGHTS[h] for p, w, h in _ALL])
INITIAL_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()
FLOATING_SHARE = float(INITIAL_WEIGHTS[IS_FLOATING].sum())
"""Probability of a floating base before the first reading."""
_EXCLUDED = 1e-200
"""Weight of a hypothesis of the other base: not zero, because its logarithm is taken."""


def initial_weights(*, floats: bool) -> Array:
    """Return the weights before the first reading of a base that floats, or of one that does not, shape (m,)."""
    weight = np.where(floats == IS_FLOATING, INITIAL_WEIGHTS, _EXCLUDED)
    normalised: Array = weight / weight.sum()
    return normalised


_KINDS = np.column_stack([IS_DRIVEN, IS_GUST & ~IS_DRIVEN, IS_HOISTING]).astype(float)


def stops() -> tuple[Pairs, ...]:
    """Return the hypotheses of a winch that runs, steadily and at a changing speed, and what each becomes when it stops."""
    found = []
    for level in (STEADY, CHANGING):
        running = [
            (i, _ALL.index((pivot, wind, RESTING))) for i, (pivot, wind, winch) in enumerate(_ALL) if winch == level
        ]
        sources, targets = np.array(running).T
        found.append((sources, targets))
    return tuple(found)


def releases() -> tuple[tuple[Pairs, ...], list[int]]:
    """Return the hypotheses of a load that is held, what each becomes when it is let go, and the level of the wind then."""
    levels = [CALM, TURBULENT]
    found = []
    for level in levels:
        held = [(i, _ALL.index((pivot, level, winch))) for i, (pivot, wind, winch) in enumerate(_ALL) if wind == HELD]
        sources, targets = np.array(held).T
        found.append((sources, targets))
    return tuple(found), levels


def probabilities(weight: Array) -> tuple[float, float, float]:
    """Return how probably the pivot accelerates, only a gust pushes the load, and the rope's length changes."""
    driven, gust, hoisting = (weight @ _KINDS).tolist()
    return driven, gust, hoisting


def starts_1_s() -> Array:
    """Return how often each hypothesis (row) is followed by each other one, shape (m, m)."""
    found = np.zeros((N_HYPOTHESES, N_HYPOTHESES))
    for i, (pivot, wind, winch) in enumerate(_ALL):
        for j, (next_pivot, next_wind, next_winch) in enumerate(_ALL):
            changes = (pivot != next_pivot, wind != next_wind, winch != next_winch)
            if changes == (True, False, False):
                found[i, j] = PIVOT_STARTS_1_S[pivot, next_pivot]
            elif changes == (False, True, False):
                found[i, j] = WIND_STARTS_1_S[wind, next_wind]
            elif changes == (False, False, True):
                found[i, j] = WINCH_STARTS_1_S[winch, next_winch]
    return found
