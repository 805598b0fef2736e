"""Least squares over the twin's equations of motion, from the best of some starts."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.simulator.compiled_model import IntegrationError
from gateway.twin.simulator.simulator import Simulator
from tests.blind.baselines.files import Found, Measured
from tests.blind.mechanics import Array

NO_READING = {"quantization", "sample_loss", "sample_hold"}
"""They do not enter a prediction, so a fit cannot find them."""
DIRECTED = {"steady_wind", "wind_gust", "impact", "trolley_acceleration"}
"""They have a direction in the world, so that the heading matters."""
HEADING = 4
ROUNDS = 12
GROWING = (0.15, 0.4)
"""Parts of a recording that are fitted before all of it, so that the phase stays within a turn while a length is corrected."""
EVENTS_S = np.arange(22.5, 60.0, 5.0)
"""Starts of events that are tried in a recording of `LONG_S`; in a shorter one as many, spread evenly."""
LONG_S = 80.0
START_AMPLITUDES_RAD = np.radians([1.0, 3.0, 6.0, 12.0, 20.0, 30.0, 42.0, 56.0, 72.0, 90.0, 110.0])
START_PHASES_RAD = np.arange(0.0, 2 * np.pi, np.pi / 8)
"""Planar swings that are tried over the first period, beside the harmonics of the sideways readings."""
NEAR_LOAD = 0.05
"""Distance of the housing from the load, in rope lengths, below which the sideways readings show no tilt."""
NULL_EIGENVALUE = 1e-10
"""Eigenvalue of the scaled normal matrix from which on a combination of parameters is not determined."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Values of a simulator, and what is left."""

    simulator: Simulator
    values: Array
    cost: float
    """Sum of squared residuals in sigma."""
    free: Array
    covariance: Array
    """Of the free values, from the last linearisation."""

    def effects(self) -> EffectValues:
        """By name."""
        return self.simulator.effects(self.values)


def first_start(rig: TwinRig, measured: Measured) -> Array:
    """Return the start, of some, that follows the first period best: tilts, rates and heading 0, shape (5,)."""
    period_s = rig.small_swing_period_s
    early = measured.first(max(8, int(np.searchsorted(measured.time_s, measured.time_s[0] + period_s))))
    simulator = Simulator(rig)
    limit = np.array([slot.upper for slot in simulator.parameters])
    starts = [np.clip(start, -limit, limit) for start in (*_harmonic_start(rig, early), *_planar_starts(rig, early))]
    return min(starts, key=lambda start: _cost(simulator, early, start))


def _harmonic_start(rig: TwinRig, early: Measured) -> list[Array]:
    """Tilts and rates from the sideways readings' harmonics; none where the housing is near the load."""
    leverage = 1 - rig.position_m / rig.length_m
    if abs(leverage) < NEAR_LOAD:
        return []
    rate, time_s = rig.small_swing_rate_1_s, early.time_s - early.time_s[0]
    waves = np.stack([np.cos(rate * time_s), np.sin(rate * time_s), np.ones_like(time_s)], axis=1)
    cos, sin, _ = np.linalg.lstsq(waves[early.used], early.force_g[early.used, :2])[0] / -leverage
    return [np.array([*cos, *(sin * rate), 0.0])]


def _planar_starts(rig: TwinRig, early: Measured) -> list[Array]:
    """Swings in the plane of the largest sideways readings, of all amplitudes and phases."""
    sideways_g = early.force_g[early.used, :2]
    toward = np.linalg.svd(sideways_g - sideways_g.mean(axis=0), full_matrices=False)[2][0]
    starts = []
    for amplitude_rad in START_AMPLITUDES_RAD:
        for phase_rad in START_PHASES_RAD:
            tilt_rad = amplitude_rad * np.cos(phase_rad)
            speed = np.sqrt(2 * max(np.cos(tilt_rad) - np.cos(amplitude_rad), 0.0)) * -np.sign(np.sin(phase_rad))
            starts.append(_start(tilt_rad, rig.small_swing_rate_1_s * speed, toward))
    return starts


def _start(tilt_rad: float, rate_rad_s: float, toward: Array) -> Array:
    """Return the start of a planar swing in the direction `toward`; the tilt toward y is an arc sine."""

    def tilts(angle_rad: float) -> Array:
        x, y = np.sin(angle_rad) * toward
        return np.array([np.arctan2(x, np.cos(angle_rad)), np.arcsin(y)])

    step_rad = 1e-4
    slope = (tilts(tilt_rad + step_rad) - tilts(tilt_rad - step_rad)) / (2 * step_rad)
    return np.array([*tilts(tilt_rad), *(slope * rate_rad_s), 0.0])


def fit_nuisances(simulator: Simulator, measured: Measured, values: Array) -> Fit:
    """Only what belongs to a recording and not to the rig, on ever longer parts of it."""
    free = np.array([slot.refitted for slot in simulator.parameters])
    free[HEADING] = bool(DIRECTED & set(simulator.effect_names))
    return fit_growing(simulator, measured, values, free)


def fit_growing(simulator: Simulator, measured: Measured, values: Array, free: Array, rounds: int = ROUNDS) -> Fit:
    """Fit ever longer parts of a recording, each from the last, or from the start where that one diverges later."""
    start = values
    for part in (*GROWING, 1.0):
        longer = measured.first(int(part * len(measured.time_s)))
        from_last = bool(np.isfinite(_cost(simulator, longer, values)))
        fit = levenberg_marquardt(simulator, longer, values if from_last else start, free, rounds)
        values = fit.values
    return fit


def free_on_log(simulator: Simulator) -> Array:
    """Everything but the heading: on one recording it only turns the world."""
    free = np.ones(len(simulator.parameters), dtype=bool)
    free[HEADING] = False
    return free


def base_fit(rig: TwinRig, measured: Measured) -> Fit:
    """With nothing added."""
    simulator = Simulator(rig)
    return fit_nuisances(simulator, measured, simulator.values(list(first_start(rig, measured)), {}))


def conclude(rig: TwinRig, log: Measured, held_out: Measured, base: Fit, fit: Fit, names: tuple[str, ...]) -> Found:
    """Fit the held-out recording's own nuisances to its samples that count, and say what was found.

    Where it is the end of the log, events keep the time at which they were.
    """
    held_base = base_fit(rig, held_out)
    start = list(held_base.values[: held_base.simulator.n_initial_states])
    effects = {name: EFFECTS[name].shift_start(values, held_out.began_s) for name, values in fit.effects().items()}
    there = fit_nuisances(fit.simulator, held_out, fit.simulator.values(start, effects))
    predictions_g = [
        each.simulator.predict(each.values, held_out.time_s, held_out.temperature_c) for each in (held_base, there)
    ]
    return Found(
        names, fit.effects(), (base.cost / log.n_values, fit.cost / log.n_values), predictions_g[0], predictions_g[1]
    )


def levenberg_marquardt(
    simulator: Simulator, measured: Measured, values: Array, free: Array, rounds: int = ROUNDS
) -> Fit:
    """Until the cost falls by less than 1e-6 of itself."""
    lower, upper = (np.array([getattr(slot, side) for slot in simulator.parameters]) for side in ("lower", "upper"))
    damping, covariance = 1e-4, np.zeros((int(free.sum()),) * 2)
    residual, cost, by = _linearised(simulator, measured, values)
    for _ in range(rounds):
        flat = _in_sigma(measured, by[..., free])
        scale = np.sqrt((flat**2).sum(axis=0)) + 1e-12
        normal, gradient = (flat / scale).T @ (flat / scale), (flat / scale).T @ residual.ravel()
        covariance = covariance_of(normal) / np.outer(scale, scale)
        better = False
        while not better and damping < 1e6:
            trial = values.copy()
            trial[free] += np.linalg.solve(normal + damping * np.eye(len(scale)), gradient) / scale
            trial = np.clip(trial, lower, upper)
            better = _cost(simulator, measured, trial) < cost
            damping = damping / 10 if better else damping * 10
        if not better:
            break
        before, values = cost, trial
        residual, cost, by = _linearised(simulator, measured, values)
        if cost > (1 - 1e-6) * before:
            break
    return Fit(simulator, values, cost, free, covariance)


def linear_gain(simulator: Simulator, measured: Measured, values: Array, free: Array) -> tuple[float, Array]:
    """By how much the cost would fall if all were linear, and the step of the free values."""
    residual, _, by = _linearised(simulator, measured, values)
    if not (np.isfinite(residual).all() and np.isfinite(by).all()):
        return -np.inf, np.zeros(int(free.sum()))
    flat = _in_sigma(measured, by[..., free])
    step = np.asarray(np.linalg.lstsq(flat, residual.ravel(), rcond=1e-9)[0], dtype=np.float64)
    left = residual.ravel() - flat @ step
    return float((residual**2).sum() - left @ left), step


def sensible(measured: Measured) -> list[str]:
    """Effects that a fit can find in a recording."""
    without = set() if measured.temperature_c is not None else {n for n, e in EFFECTS.items() if e.needs_temperature}
    return [name for name in EFFECTS if name not in NO_READING | without]


def guesses(name: str, measured: Measured, residual_g: Array) -> list[dict[str, float]]:
    """Values to start an effect from where it is not linear: moments, frequencies, limits."""
    parameters = {p.name for p in EFFECTS[name].parameters}
    if "start_s" in parameters:
        spread_s = np.linspace(0.1, 0.9, len(EVENTS_S)) * measured.duration_s
        return [{"start_s": float(at_s)} for at_s in (EVENTS_S if measured.duration_s > LONG_S else spread_s)]
    if name == "vibration":
        return [{"frequency_hz": strongest_hz(measured, residual_g, 2.0, 24.0, (0, 1, 2))}]
    if name == "rope_stretch":
        return [{"frequency_hz": strongest_hz(measured, residual_g, 0.5, 8.0, (2,))}]
    if name == "clipping":
        return [{"full_scale_g": float(np.quantile(np.abs(measured.force_g).max(axis=1), 0.95))}]
    return [{"cutoff_hz": 2.0}] if name == "lowpass_lag" else [{}]


def strongest_hz(measured: Measured, residual_g: Array, low_hz: float, high_hz: float, axes: Collection[int]) -> float:
    """The highest line of a periodogram."""
    count = len(measured.time_s)
    step_s = (measured.time_s[-1] - measured.time_s[0]) / (count - 1)
    power = sum(np.abs(np.fft.rfft(residual_g[:, axis] * np.hanning(count), 8 * count)) ** 2 for axis in axes)
    frequency_hz = np.fft.rfftfreq(8 * count, step_s)
    inside = (frequency_hz >= low_hz) & (frequency_hz <= high_hz)
    return float(frequency_hz[inside][np.argmax(np.asarray(power)[inside])])


def _cost(simulator: Simulator, measured: Measured, values: Array) -> float:
    try:
        residual = measured.misfit(simulator.predict(values, measured.time_s, measured.temperature_c))
    except IntegrationError:
        return np.inf
    cost = float((residual**2).sum())
    return cost if np.isfinite(cost) else np.inf


def _linearised(simulator: Simulator, measured: Measured, values: Array) -> tuple[Array, float, Array]:
    found = simulator.linearise(values, measured.time_s, measured.temperature_c)
    residual = measured.misfit(found.force_g)
    cost = float((residual**2).sum())
    by = found.jacobian
    by[~measured.used] = 0.0
    return residual, cost if np.isfinite(cost) else np.inf, by


def _in_sigma(measured: Measured, by: Array) -> Array:
    """Derivatives of the readings (n, 3, free) as rows in sigma, shape (3 n, free)."""
    scaled: Array = by / np.broadcast_to(measured.noise_g, 3)[:, None]
    return scaled.reshape(-1, by.shape[-1])


def covariance_of(normal: Array) -> Array:
    """Invert a scaled normal matrix; what it does not determine has a variance of 1e12, not of 0 as with a pseudo-inverse."""
    eigenvalues, vectors = np.linalg.eigh(normal)
    variance = np.where(eigenvalues > NULL_EIGENVALUE * eigenvalues[-1], 1 / np.abs(eigenvalues + 1e-300), 1e12)
    inverse: Array = (vectors * variance) @ vectors.T
    return inverse
