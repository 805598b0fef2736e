"""Sparse regression on the residual: sequentially thresholded least squares over a library of terms, by pysindy.

Sideways the residual is that of the pendulum's equation, s'' + c (g/L) s + (s s') s'/c^2 with s the lean that the readings show
and c = sqrt(1 - s^2), in weak form: multiplied by test functions and integrated by parts, so that noise is not differentiated.
Axially it is what the fitted base model leaves. A term that survives is read as the effect that it usually stands for, and
these effects are fitted by the twin's equations so that a prediction can be compared. Events have no term in such a library.

`python -m tests.blind.baselines.sparse reconcile LOG --rig RIG --held-out LOG2 --json FILE --prediction FILE`; wants
`pip install pysindy`, which the project does not depend on.
"""

import sys
from collections.abc import Mapping

import numpy as np
from pysindy.differentiation import SmoothedFiniteDifference
from pysindy.optimizers import STLSQ

from gateway.twin.model import TwinRig
from gateway.twin.simulator.simulator import Simulator
from tests.blind.baselines.files import Found, Measured, answer
from tests.blind.baselines.fitting import NEAR_LOAD, base_fit, conclude, first_start, fit_growing, free_on_log
from tests.blind.mechanics import Array

WINDOW_PERIODS, POLYNOMIAL = 0.15, 3
"""Part of a swing over which the readings are smoothed before they are differentiated, and the polynomial's order."""
UPRIGHT = 0.03
"""Least squared cosine of the lean, 80 degrees: beyond, the sideways readings do not show it."""
TRAINED_ON = 0.6
"""Part of the log; the rest chooses the threshold."""
THRESHOLDS = np.logspace(-3, 1, 25)
"""Of the rms that a term explains, in rms of the residual's noise."""
RIDGE = 0.01
"""Of each term's mean square: the frictions are nearly collinear."""
WORTH = 0.05
"""A sparser model is taken when it explains no more than this part of the validation residual less."""
FEW_ROWS, MANY_ROWS = 2.0, 1.02
"""So far above its mean the square of the noise may be by chance: test functions overlap, samples do not."""
TESTS_PER_SWING = 12
SMOOTHNESS = 4
"""Test functions are (1 - x^2)^SMOOTHNESS, one swing wide."""


def sparse(rig: TwinRig, log: Measured, held_out: Measured) -> Found:
    """Terms, read as effects."""
    base = base_fit(rig, log)
    simulated_g = base.simulator.predict(base.values, log.time_s, log.temperature_c)
    found = surviving(*_axial(log, simulated_g))
    if abs(1 - rig.position_m / rig.length_m) > NEAR_LOAD:
        for axis in (0, 1):
            found |= surviving(*_sideways(rig, log, axis))
    names = tuple(sorted(found))
    simulator = Simulator(rig, names)
    values = simulator.values(list(first_start(rig, log)), {})
    fit = fit_growing(simulator, log, values, free_on_log(simulator)) if names else base
    return conclude(rig, log, held_out, base, fit, names)


def surviving(terms: Mapping[str, tuple[str, Array]], residual: Array, noise2: float) -> set[str]:
    """Effects of the sparsest terms that explain the validation part as well as any, or down to `noise2`, its mean square."""
    library = np.stack([column / (np.sqrt((column**2).mean()) + 1e-30) for _, column in terms.values()], axis=1)
    cut = int(TRAINED_ON * len(residual))
    size = np.sqrt((residual**2).mean())
    tried = [((residual[cut:] ** 2).mean(), np.zeros(len(terms)))]
    for threshold in THRESHOLDS:
        optimizer = STLSQ(threshold=threshold * size, alpha=RIDGE * cut, max_iter=50)
        coefficients = optimizer.fit(library[:cut], residual[:cut, None]).coef_[0]
        left = ((residual[cut:] - library[cut:] @ coefficients) ** 2).mean()
        tried.append((left, coefficients))
    best = min(left for left, _ in tried)
    allowed = max(best + WORTH * (residual[cut:] ** 2).mean(), noise2)
    _, coefficients = min((one for one in tried if one[0] <= allowed), key=lambda one: np.count_nonzero(one[1]))
    return {name for (name, _), value in zip(terms.values(), coefficients, strict=True) if value}


def _sideways(rig: TwinRig, log: Measured, axis: int) -> tuple[dict[str, tuple[str, Array]], Array, float]:
    """Terms of the residual of the lean's equation along one axis of the housing, a row for each test function; its noise."""
    time_s = log.time_s - log.time_s[0]
    force_g = np.stack([np.interp(time_s, time_s[log.used], log.force_g[log.used, each]) for each in (0, 1)], axis=1)
    s = -force_g / (1 - rig.position_m / rig.length_m)
    rate2 = rig.gravity_m_s2 / rig.length_m
    window = int(WINDOW_PERIODS * rig.small_swing_period_s / np.median(np.diff(time_s))) | 1
    smoothing = {"window_length": max(window, POLYNOMIAL + 2), "polyorder": POLYNOMIAL}
    v = SmoothedFiniteDifference(smoother_kws=smoothing)(s, time_s)
    tests, slopes, bends = _test_functions(time_s, 2 * np.pi / np.sqrt(rate2))
    own, other, fast = s[:, axis], s[:, 1 - axis], np.hypot(*v.T) + 1e-9
    cosine2 = np.maximum(1 - (s**2).sum(axis=1), UPRIGHT)
    residual = bends @ own + tests @ (np.sqrt(cosine2) * rate2 * own + (s * v).sum(axis=1) * v[:, axis] / cosine2)
    weights = (bends + rate2 * tests) / (1 - rig.position_m / rig.length_m)
    noise2 = FEW_ROWS * float((weights**2).sum(axis=1).mean()) * _noise_g(log, axis) ** 2
    terms = {
        "1": ("axis_offset", tests @ np.ones_like(own)),
        "s": ("rope_length", tests @ own),
        "s_other": ("cross_axis", tests @ other),
        "s'": ("viscous_damping", -slopes @ own),
        "s'_other": ("housing_spin", -slopes @ other),
        "|s'|s'": ("quadratic_drag", tests @ (fast * v[:, axis])),
        "s'/|s'|": ("coulomb_friction", tests @ (v[:, axis] / fast)),
    }
    if log.temperature_c is not None:
        terms["T"] = ("thermal_drift", tests @ (log.temperature_c - log.temperature_c[0]))
    return terms, residual, noise2


def _noise_g(log: Measured, axis: int) -> float:
    return float(np.broadcast_to(log.noise_g, 3)[axis])


def _test_functions(time_s: Array, width_s: float) -> tuple[Array, Array, Array]:
    """Weights of the integrals with each test function, its slope and its second derivative, each of shape (tests, n)."""
    half_s, p = width_s / 2, SMOOTHNESS
    centres_s = np.arange(half_s, time_s[-1] - half_s, width_s / TESTS_PER_SWING)
    x = (time_s - centres_s[:, None]) / half_s
    inside = np.clip(1 - x**2, 0, None)
    step_s = np.gradient(time_s)
    slope = -2 * p * x * inside ** (p - 1) / half_s
    bend = (4 * p * (p - 1) * x**2 * inside ** (p - 2) - 2 * p * inside ** (p - 1)) / half_s**2
    return inside**p * step_s, slope * step_s, bend * step_s


def _axial(log: Measured, simulated_g: Array) -> tuple[dict[str, tuple[str, Array]], Array, float]:
    """Terms of what the base model leaves along the rope; its noise."""
    used = log.used
    swing = simulated_g[used, 2] - 1
    terms = {
        "1": ("axis_offset", np.ones_like(swing)),
        "f_z": ("housing_position", swing),
        "f_z'": ("lowpass_lag", np.gradient(swing, log.time_s[used])),
        "f_x": ("cross_axis", log.force_g[used, 0]),
        "f_y": ("cross_axis", log.force_g[used, 1]),
    }
    if log.temperature_c is not None:
        terms["T"] = ("thermal_drift", log.temperature_c[used] - log.temperature_c[0])
    return terms, log.force_g[used, 2] - simulated_g[used, 2], MANY_ROWS * _noise_g(log, 2) ** 2


if __name__ == "__main__":
    sys.exit(answer(sparse))
