"""A campaign's plan from its seed: what is hidden in each case, before anything is simulated."""

from dataclasses import dataclass

import numpy as np

from tests.blind.body_effects import BODIES
from tests.blind.mechanics_effects import MECHANICS
from tests.blind.outside import OUTSIDE
from tests.blind.sensor_effects import SENSOR

CATALOGUE = {**MECHANICS, **BODIES, **SENSOR}

ALIKE = (
    {"axis_offset", "mount_misalignment", "steady_wind", "cross_axis", "scale_error", "housing_position"},
    {"rope_length", "load_inertia", "rope_mass", "clock_drift", "housing_position", "sample_loss", "double_pendulum"},
    {"viscous_damping", "quadratic_drag", "coulomb_friction", "pivot_friction"},
    {"wind_gust", "trolley_acceleration", "impact", "hoisting", "load_change"},
    {"slewing", "housing_spin"},
    {"housing_torsion", "slewing"},
    {"housing_torsion", "housing_spin"},
    {"housing_rocking", "housing_position"},
    {"housing_rocking", "scale_error"},
    {"housing_rocking", "cross_axis"},
    {"lever_arm", "mount_misalignment"},
    {"sample_hold", "sample_loss"},
    {"sample_hold", "vibration"},
    {"lever_arm", "cross_axis"},
    {"lowpass_lag", "vibration"},
    {"rope_stretch", "hoisting", "load_change", "double_pendulum"},
    {"rope_stretch", "rope_length", "load_inertia", "rope_mass", "clock_drift", "housing_position"},
    *({"load_change", force} for force in ("steady_wind", "viscous_damping", "quadratic_drag", "coulomb_friction")),
)
"""No pair is drawn from one of these: the two are not separable, one hides the other, or (the last) one changes the other."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What a case is to be."""

    index: int
    seed: int
    kind: str
    """null, single, pair or outside."""
    hidden: tuple[str, ...] = ()
    coloured: bool = False
    """Neighbouring samples' noise is correlated."""
    jittered: bool = False
    """Samples are not evenly spaced, and the stated times are a little wrong."""
    small: bool = False
    """A third of the usual size."""


def plan_cases(count: int, seed: int) -> list[Plan]:
    """A third nulls, a tenth outside the catalogue, two in fifteen pairs, the rest singles in even numbers.

    Of the nulls three in five have coloured noise and three in five jittered times; of the others one in ten each. One case
    in five with something hidden is small.
    """
    rng = np.random.default_rng([seed, count])
    nulls, outside, pairs = round(count / 3), round(count / 10), round(count * 2 / 15)
    hidden: list[tuple[str, tuple[str, ...]]] = [("null", ())] * nulls
    hidden += [("outside", (name,)) for name in _evenly(rng, list(OUTSIDE), outside)]
    hidden += [("single", (name,)) for name in _evenly(rng, list(CATALOGUE), count - nulls - outside - pairs)]
    hidden += [("pair", _separable_pair(rng)) for _ in range(pairs)]
    rng.shuffle(hidden)
    plans = []
    for index, (kind, names) in enumerate(hidden):
        odds = 0.6 if kind == "null" else 0.1
        coloured, jittered, small = rng.random(3) < [odds, odds, 0.2 if names else 0.0]
        plans.append(Plan(index, int(rng.integers(2**31)), kind, names, bool(coloured), bool(jittered), bool(small)))
    return plans


def _evenly(rng: np.random.Generator, names: list[str], count: int) -> list[str]:
    """Each name as often as every other, or once more."""
    rounds = -(-count // len(names))
    return [str(name) for _ in range(rounds) for name in rng.permutation(names)][:count]


def _separable_pair(rng: np.random.Generator) -> tuple[str, ...]:
    while True:
        pair = tuple(str(name) for name in rng.choice(list(CATALOGUE), 2, replace=False))
        if not any(set(pair) <= group for group in ALIKE):
            return pair
