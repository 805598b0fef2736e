"""Torsional oscillation of the housing about the rope."""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.evaluation_context import EvaluationContext
from gateway.twin.effects.experiments import LOCK_SLEWING
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.parameter import Parameter, ParameterKind, Symbols, Values

Array = NDArray[np.float64]
BIN_S = 0.1
"""Interval over which samples are averaged for the guess of a frequency."""
MAX_GUESS_HZ = 2.0
"""Highest frequency that is guessed: ropes twist in seconds to minutes."""
FREQUENCIES_PER_CYCLE = 4
"""Frequencies that are tried per cycle of the recording."""
MIN_GAIN = 0.3
"""Share of the residual across the rope that a guess must explain: an oscillation that is there explains most of it."""


class HousingTorsion(Effect):
    """A free torsional oscillation of the rope, which turns the housing to and fro."""

    name = "housing_torsion"
    equation = "ψ″ + 2 ζ ω ψ′ + ω² ψ = 0 about the housing's z axis, ω = 2π f"
    explains = "The rope twists to and fro and turns the housing with it."
    reference = "free vibration with viscous damping, Inman 2014, section 1.3; torsional pendulum, section 1.5"
    enters = "housing"
    linear_at_neutral = False
    discriminating_experiment = LOCK_SLEWING
    parameters = (
        Parameter(
            "frequency_hz",
            "Hz",
            "f",
            lower=1e-3,
            upper=10.0,
            neutral=0.1,
            scale=1e-4,
            typical=0.1,
            kind=ParameterKind.FREQUENCY,
            step_limit=0.01,
        ),
        Parameter(
            "damping_ratio",
            "1",
            "ζ",
            lower=0.0,
            upper=0.5,
            neutral=0.0,
            scale=1e-3,
            typical=0.01,
            step_limit=0.05,
        ),
        Parameter(
            "start_deg",
            "°",
            "ψ and (ψ′ + ζ ω ψ)/ω at the first sample",
            lower=-180.0,
            upper=180.0,
            neutral=0.0,
            scale=0.1,
            typical=(8.0, 0.0),
            components=("angle", "rate"),
            refitted=True,
            step_limit=10.0,
        ),
    )

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return the oscillation that best explains the residual across the rope; none where it explains little of it."""
        return guess_torsion(context)

    def housing_rotation_rad(self, p: Symbols, context: EvaluationContext) -> Scalar:
        """Return the angle of a damped oscillation."""
        angle, rate = (ca.pi / 180 * each for each in p["start_deg"])
        omega_t = 2 * ca.pi * p["frequency_hz"] * context.time_s
        damped = ca.sqrt(1 - p["damping_ratio"] ** 2) * omega_t
        return ca.exp(-p["damping_ratio"] * omega_t) * (angle * ca.cos(damped) + rate * ca.sin(damped))


def guess_torsion(context: GuessContext) -> list[Values]:
    """Return the undamped oscillation whose small rotations take the most off the residual across the rope.

    A rotation ψ changes a reading f = x + i y by −i ψ f, so the residual shows ψ = −Im(f* r)/|f|² with a weight of |f|². A
    constant and a linear rotation are left to the heading and to a housing that spins.
    """
    angle_rad, weight, time_s, total = _rotation_in_residual(context)
    count = int(MAX_GUESS_HZ * context.duration_s * FREQUENCIES_PER_CYCLE)
    tried_hz: Array = np.arange(2.0, count + 2.0) / (FREQUENCIES_PER_CYCLE * context.duration_s)
    drift = np.stack([np.ones_like(time_s), time_s], axis=1) * np.sqrt(weight)[:, None]
    basis = np.asarray(np.linalg.qr(drift)[0], dtype=np.float64)

    def without_drift(columns: Array) -> Array:
        left: Array = columns - basis @ (basis.T @ columns)
        return left

    target = without_drift(np.sqrt(weight) * angle_rad)
    gains, fitted = np.zeros(count), np.zeros((count, 2))
    for i, hz in enumerate(tried_hz):
        phase = 2 * np.pi * hz * time_s
        columns = without_drift(np.stack([np.cos(phase), np.sin(phase)], axis=1) * np.sqrt(weight)[:, None])
        fitted[i] = np.linalg.lstsq(columns, target, rcond=1e-9)[0]
        gains[i] = (columns @ fitted[i]) @ target
    best = int(np.argmax(gains))
    if gains[best] < MIN_GAIN * total:
        return []
    start_deg = np.degrees(fitted[best])
    return [{"frequency_hz": float(tried_hz[best]), "start_deg": (float(start_deg[0]), float(start_deg[1]))}]


def _rotation_in_residual(context: GuessContext) -> tuple[Array, Array, Array, float]:
    """Return binned rotations in rad, their weights and times, and the sum of squares of the residual beyond the noise."""
    predicted = context.force_g - context.residual_g
    figure, residual = (each[:, 0] + 1j * each[:, 1] for each in (predicted, context.residual_g))
    bins = np.floor(context.time_s / BIN_S).astype(np.int64)
    count = int(bins[-1]) + 1
    torque, weight, members, elapsed = (
        np.bincount(bins, each, count).astype(np.float64)
        for each in (-np.imag(np.conj(figure) * residual), np.abs(figure) ** 2, np.ones(len(bins)), context.time_s)
    )
    full = weight > 0
    noise = len(residual) * float((context.noise_g[:2] ** 2).sum())
    total = max(float((np.abs(residual) ** 2).sum()) - noise, 0.0)
    return torque[full] / weight[full], weight[full], elapsed[full] / members[full], total
