"""Estimated inputs of the crane: drives and hoists that are known from a recording, as parts of the model of that recording."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.evaluation_context import ZERO_VECTOR, EvaluationContext, RopeGeometry
from gateway.twin.effects.parameter import Symbols, Value, Values, amplitude
from gateway.twin.effects.pulse import start

Array = NDArray[np.float64]
HARMONIC_S = 1.5
"""Half period of the highest harmonic of a profile. Basis: a choice; what it leaves out changes the swing by little, and is in
the corrections."""
FEWEST_HARMONICS, MOST_HARMONICS = 4, 16
LARGEST_CORRECTION_M_S, LARGEST_LENGTH_CORRECTION = 2.0, 0.1
"""Bounds of the corrections; that of the length relative to the nominal one. Basis: a choice; a crane moves no faster, and a drum
is known to a tenth."""
LENGTH_CORRECTION = "length_correction_m"
REFERENCE = "smoothed estimate of the motion (Rauch et al. 1965)"


START = replace(start(0.0), lower=-1e6, step_limit=math.inf)
"""Start of the interval, which may lie before the first sample."""


@dataclass(frozen=True, slots=True)
class SineSeries:
    """A profile over an interval, zero at both ends: the sum of c_k sin(k pi t/T)."""

    coefficients: tuple[float, ...]
    duration_s: float

    @classmethod
    def of(cls, elapsed_s: Array, values: Array, duration_s: float) -> "SineSeries":
        """Return the series nearest to values at times since the start of the interval, both of shape (n,)."""
        count = int(np.clip(np.ceil(duration_s / HARMONIC_S), FEWEST_HARMONICS, MOST_HARMONICS))
        phase_rad = np.pi / duration_s * np.outer(elapsed_s, np.arange(1, count + 1))
        found = np.linalg.lstsq(np.sin(phase_rad), values, rcond=1e-6)[0]
        return cls(tuple(found.tolist()), duration_s)

    def value(self, elapsed_s: Scalar) -> Scalar:
        """Return the profile."""
        total: Scalar = sum(c * sine for c, _, (sine, _) in self._terms(elapsed_s))
        return total

    def slope(self, elapsed_s: Scalar) -> Scalar:
        """Return its derivative by time."""
        total: Scalar = sum(c * rate * cosine for c, rate, (_, cosine) in self._terms(elapsed_s))
        return total

    def integral(self, elapsed_s: Scalar) -> Scalar:
        """Return its integral from the start of the interval."""
        total: Scalar = sum(c / rate * (1 - cosine) for c, rate, (_, cosine) in self._terms(elapsed_s))
        return total

    def _terms(self, elapsed_s: Scalar) -> Iterator[tuple[float, float, tuple[Scalar, Scalar]]]:
        """Yield coefficient, angular frequency, and sine and cosine, by recurrence: products are quicker than sines."""
        rate_1_s = np.pi / self.duration_s
        first = sine, cosine = ca.sin(rate_1_s * elapsed_s), ca.cos(rate_1_s * elapsed_s)
        for k, coefficient in enumerate(self.coefficients, start=1):
            yield coefficient, k * rate_1_s, (sine, cosine)
            sine, cosine = sine * first[1] + cosine * first[0], cosine * first[1] - sine * first[0]


class CraneInput(Effect):
    """Base class of what is known of the crane in an interval of one recording; not part of the vocabulary."""

    discriminating_experiment = "let the crane rest while the load swings"
    reference = REFERENCE
    transient: ClassVar[bool] = True
    found_before_search: ClassVar[bool] = True
    scored: ClassVar[bool | None] = False
    duration_s: float

    def interval_s(self, values: Values) -> tuple[float, float]:
        """Return the time in which it acts."""
        start_s = float(np.asarray(values["start_s"]))
        return start_s, start_s + self.duration_s

    def without_correction(self, start_s: float) -> dict[str, Value]:
        """Return the parameters as estimated."""
        return {**{p.name: p.typical for p in self.parameters}, "start_s": start_s}


class CraneMotion(CraneInput):
    """Acceleration of the pivot and speed of the hoist as estimated; the total change of length has a correction."""

    equation = "a_p = (a_x(t), a_y(t), 0), L′ = r′ = v(t) + ΔL (1 − cos 2πt/T)/T, a and v as estimated"
    explains = "Trolley, bridge or winch worked, as estimated from this recording."
    enters = "pivot and rope"

    def __init__(
        self,
        name: str,
        duration_s: float,
        *,
        pivot_m_s2: tuple[SineSeries, SineSeries] | None,
        hoist_m_s: SineSeries | None,
        length_m: float,
    ) -> None:
        """`length_m`: nominal length of the rope."""
        self.name, self.duration_s = name, duration_s
        self._pivot_m_s2, self._hoist_m_s = pivot_m_s2, hoist_m_s
        self.changes_length = hoist_m_s is not None
        largest_m = LARGEST_LENGTH_CORRECTION * length_m
        correction = amplitude(
            LENGTH_CORRECTION,
            "m",
            "ΔL, correction of the change of the rope's length",
            (-largest_m, largest_m),
            0.0,
            refitted=True,
        )
        self.parameters = (START, correction) if self.changes_length else (START,)

    def longest_step_s(self, p: Symbols, length_m: float, gravity_m_s2: float) -> Scalar:
        """Return a small part of the shortest half period of the profiles."""
        return HARMONIC_S / 8

    def discontinuities_s(self, p: Symbols) -> tuple[Scalar, ...]:
        """Return start and end of the interval."""
        return p["start_s"], p["start_s"] + self.duration_s

    def pivot_acceleration_m_s2(self, p: Symbols, context: EvaluationContext) -> Vector:
        """Return the estimated acceleration."""
        if self._pivot_m_s2 is None:
            return ZERO_VECTOR
        elapsed_s, acts = self._elapsed(p, context)
        x, y = (series.value(elapsed_s) for series in self._pivot_m_s2)
        return acts * x, acts * y, 0.0

    def rope_geometry(self, p: Symbols, context: EvaluationContext, geometry: RopeGeometry) -> RopeGeometry:
        """Change both distances, since the housing keeps its distance to the load."""
        if self._hoist_m_s is None:
            return geometry
        elapsed_s, acts = self._elapsed(p, context)
        further_m, rate = p[LENGTH_CORRECTION], 2 * np.pi / self.duration_s
        done = elapsed_s / self.duration_s - ca.sin(rate * elapsed_s) / (2 * np.pi)
        during_m = self._hoist_m_s.integral(elapsed_s) + further_m * done
        after_m = self._hoist_m_s.integral(self.duration_s) + further_m
        change = (
            acts * during_m + context.step_at(p["start_s"] + self.duration_s) * after_m,
            acts * (self._hoist_m_s.value(elapsed_s) + further_m * (1 - ca.cos(rate * elapsed_s)) / self.duration_s),
            acts * (self._hoist_m_s.slope(elapsed_s) + further_m * rate * ca.sin(rate * elapsed_s) / self.duration_s),
        )
        return geometry.with_changes(change, change)

    def _elapsed(self, p: Symbols, context: EvaluationContext) -> tuple[Scalar, Scalar]:
        """Return the time since the start, and 1 while the crane works."""
        start_s = p["start_s"]
        return context.time_s - start_s, context.is_between(start_s, start_s + self.duration_s)


class MotionCorrection(CraneInput):
    """A small jump of the load's velocity: two of them in an interval leave the load with any motion after it.

    So what is missing from the model is judged by the time in which the crane rests, and an error of the estimate is no effect.
    """

    equation = "v⁺ = v⁻ + (Δv_x, Δv_y, 0) at t₀"
    explains = "What the estimate of the crane's motion lacks."
    enters = "force on the load"
    instantaneous = True
    duration_s = 0.0

    def __init__(self, name: str) -> None:
        self.name = name
        correction = amplitude(
            "delta_v_m_s",
            "m/s",
            "correction of the load's velocity",
            (-LARGEST_CORRECTION_M_S, LARGEST_CORRECTION_M_S),
            (0.0, 0.0),
            ("x", "y"),
            refitted=True,
        )
        self.parameters = (START, correction)

    def velocity_jump_m_s(self, p: Symbols) -> Vector:
        """Return the jump of the velocity."""
        x, y = p["delta_v_m_s"]
        return x, y, 0.0
