"""Least squares over the twin's equations of motion: one start, one shot, nothing clever."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.model import EffectValues, TwinRig
from gateway.twin.simulator.simulator import Simulator
from tests.blind.baselines.files import Found, Measured
from tests.blind.mechanics import Array

NO_READING = {"quantization", "sample_loss"}
"""They do not enter a prediction, so a fit cannot find them."""
DIRECTED = {"steady_wind", "wind_gust", "impact", "trolley_acceleration"}
"""They have a direction in the world, so that the heading matters."""
HEADING = 4
GROWING = (0.15, 0.4)
"""Parts of a recording that are fitted before all of it, so that the phase stays within a turn."""
EVENTS_S = np.arange(22.5, 60.0, 5.0)


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
    """Tilts and rates from the sideways readings' harmonics over the first period, heading 0, shape (5,)."""
    rate = np.sqrt(rig.gravity_m_s2 / rig.length_m)
    time_s = measured.time_s - measured.time_s[0]
    early = time_s < 2 * np.pi / rate
    waves = np.stack([np.cos(rate * time_s), np.sin(rate * time_s), np.ones_like(time_s)], axis=1)[early]
    cos, sin, _ = np.linalg.lstsq(waves, measured.force_g[early, :2])[0] / -(1 - rig.position_m / rig.length_m)
    limit = np.array([1.0, 1.0, rate, rate, 0.0]) * 0.4
    start: Array = np.clip([*cos, *(sin * rate), 0.0], -limit, limit)
    return start


def fit_nuisances(simulator: Simulator, measured: Measured, values: Array) -> Fit:
    """Only what belongs to a recording and not to the rig, on ever longer parts of it."""
    free = np.array([slot.refitted for slot in simulator.parameters])
    free[HEADING] = bool(DIRECTED & set(simulator.effect_names))
    for part in GROWING:
        count = int(part * len(measured.time_s))
        short = Measured(
            measured.time_s[:count], measured.force_g[:count], measured.temperature_c[:count], measured.noise_g
        )
        values = levenberg_marquardt(simulator, short, values, free).values
    return levenberg_marquardt(simulator, measured, values, free)


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
    """Fit the held-out recording's own nuisances under the model, and say what was found."""
    held_base = base_fit(rig, held_out)
    start = list(held_base.values[: held_base.simulator.n_initial_states])
    there = fit_nuisances(fit.simulator, held_out, fit.simulator.values(start, fit.effects()))
    prediction_g = there.simulator.predict(there.values, held_out.time_s, held_out.temperature_c)
    before = base.cost / log.force_g.size, held_base.cost / held_out.force_g.size
    return Found(names, fit.effects(), before, prediction_g, fit.cost / log.force_g.size)


def levenberg_marquardt(simulator: Simulator, measured: Measured, values: Array, free: Array, rounds: int = 12) -> Fit:
    """Until the cost falls by less than 1e-6 of itself."""
    lower, upper = (np.array([getattr(slot, side) for slot in simulator.parameters]) for side in ("lower", "upper"))
    damping, covariance = 1e-4, np.zeros((int(free.sum()),) * 2)
    residual, cost, by = _linearised(simulator, measured, values)
    for _ in range(rounds):
        flat = by[..., free].reshape(-1, int(free.sum())) / measured.noise_g
        scale = np.sqrt((flat**2).sum(axis=0)) + 1e-12
        normal, gradient = (flat / scale).T @ (flat / scale), (flat / scale).T @ residual.ravel()
        covariance = np.linalg.pinv(normal, rcond=1e-12, hermitian=True) / np.outer(scale, scale)
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
    flat = by[..., free].reshape(-1, int(free.sum())) / measured.noise_g
    step = np.asarray(np.linalg.lstsq(flat, residual.ravel(), rcond=1e-9)[0], dtype=np.float64)
    left = residual.ravel() - flat @ step
    return float((residual**2).sum() - left @ left), step


def guesses(name: str, measured: Measured, residual_g: Array) -> list[dict[str, float]]:
    """Values to start an effect from where it is not linear: moments, frequencies, limits."""
    parameters = {p.name for p in EFFECTS[name].parameters}
    if "start_s" in parameters:
        return [{"start_s": float(at_s)} for at_s in EVENTS_S]
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
    residual = measured.misfit(simulator.predict(values, measured.time_s, measured.temperature_c))
    cost = float((residual**2).sum())
    return cost if np.isfinite(cost) else np.inf


def _linearised(simulator: Simulator, measured: Measured, values: Array) -> tuple[Array, float, Array]:
    found = simulator.linearise(values, measured.time_s, measured.temperature_c)
    residual = measured.misfit(found.force_g)
    cost = float((residual**2).sum())
    by = found.jacobian
    by[0] = 0.0
    return residual, cost if np.isfinite(cost) else np.inf, by
