"""Hypotheses on a hysteresis, and the mean over them.

A hysteresis is a play (backlash): the offset is displaced to one side while the element warms and to the other while it cools,
and crosses over within a width of temperature. Whether there is any, how wide it is, and on which side it begins are open: a
result is the mean over all of these, weighted by their evidence (Hoeting et al. 1999). Each has its own lag and noise.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gateway.bench.thermal.ramp import fit_lag
from gateway.bench.thermal.slow_noise import NoiseGrid, RecordingNoise, System
from gateway.numerics.array import Array

PLAY_WIDTHS_C = (2.0, 4.0, 8.0, 16.0)
"""Widths of a hysteresis that may be, °C. Basis: a choice; a narrower one is a step between warming and cooling, a wider one does
not turn within a ramp, and a width between them is a change of shape to first order."""
PLAY_STARTS = (0.0, 1.0)
"""Sides on which a recording begins: in the middle of the play, and on that of cooling. Definition: of a part that stood, and of
one that was cooled before."""
NUMBERS = range(1 + len(PLAY_WIDTHS_C) * len(PLAY_STARTS))
"""Numbers of the hypotheses. Definition: 0 is none, then those of `play_forms`."""
PRIOR_PLAY_G = 0.00025
"""Standard deviation of the displacement to either side that is expected, g. Basis: a choice; data sheets that state a hysteresis
state a tenth of a milligravity to a milligravity from side to side."""
MIN_PROBABILITY = 1e-3
"""Least probability of a hypothesis that is kept. Basis: a choice; below it the mean does not change."""


def play(temperature_c: Array, width_c: float | Array, start: float | Array) -> Array:
    """Return the side of a hysteresis, from -1 in warming to 1 in cooling, for series of temperatures along the last axis.

    Widths and starts broadcast against the series' first value.
    """
    half_c = np.asarray(width_c) / 2
    centre = temperature_c[..., 0] + start * half_c
    sides = []
    for now_c in np.moveaxis(temperature_c, -1, 0):
        centre = np.clip(centre, now_c - half_c, now_c + half_c)
        sides.append((centre - now_c) / half_c)
    return np.stack(sides, axis=-1)


def play_forms(temperature_c: Array) -> Array:
    """Return the side and its change by the width for each play that may be, (plays, series, n, 2), of series (series, n)."""
    octaves = np.array([-0.5, 0.0, 0.5])
    width_c, start = np.meshgrid(np.outer(PLAY_WIDTHS_C, 2**octaves), PLAY_STARTS, indexing="ij")
    sides = play(temperature_c, width_c.reshape(-1, 1), start.reshape(-1, 1))
    narrow, middle, wide = np.moveaxis(
        sides.reshape(len(PLAY_WIDTHS_C), 3, len(PLAY_STARTS), *temperature_c.shape), 1, 0
    )
    return np.stack([middle, wide - narrow], axis=-1).reshape(-1, *temperature_c.shape, 2)


@dataclass(frozen=True, slots=True)
class Explanation:
    """One hypothesis, with what it makes of the recordings."""

    play: int
    """Its number."""
    lag_s: float
    u_lag_s: float
    noise: RecordingNoise
    probability: float


def explain(
    grid: NoiseGrid, systems: Callable[[float, int], list[System]], lags_s: Mapping[int, float]
) -> list[Explanation]:
    """Return the hypotheses with their probabilities, the most probable first.

    `systems` returns the system of each axis at a lag by a hypothesis; `lags_s` has the lag from which each begins.
    """
    found, evidence = [], []
    for number, from_s in lags_s.items():
        noise, _ = grid.estimate(systems(from_s, number))

        def residuals(at_s: float, number: int = number, noise: RecordingNoise = noise) -> Array:
            return np.array([noise.residual(*system) for system in systems(at_s, number)])

        lag_s, u_lag_s, of_lag = fit_lag(residuals, from_s)
        noise, of_noise = grid.estimate(systems(lag_s, number))
        before = np.log(0.5 if number == 0 else 0.5 / (len(NUMBERS) - 1))
        evidence.append(of_lag + of_noise + float(before))
        found.append(Explanation(number, lag_s, u_lag_s, noise, 0.0))
    weight = np.exp(np.array(evidence) - max(evidence))
    weight /= weight.sum()
    kept = [number for number in np.argsort(-weight).tolist() if weight[number] > MIN_PROBABILITY]
    return [replace(found[number], probability=float(weight[number] / weight[kept].sum())) for number in kept]


def mean_over(
    explanations: Sequence[Explanation], values: Sequence[Array], covariances: Sequence[Array]
) -> tuple[Array, Array]:
    """Return the mean of values (p,), and its covariances by each cause, (causes, p, p), the spread between hypotheses last."""
    share = np.array([one.probability for one in explanations])
    mean = share @ np.array(values)
    apart = np.array(values) - mean
    return mean, np.array([*np.tensordot(share, np.array(covariances), 1), (share[:, None] * apart).T @ apart])
