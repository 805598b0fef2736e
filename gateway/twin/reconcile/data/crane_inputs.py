"""Inputs of the crane, estimated from a recording: what trolley, bridge and winch did, as known parts of its model."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar, Vector
from gateway.measurement.source import Source
from gateway.motion.history import MotionHistory
from gateway.motion.hypotheses import IS_DRIVEN, IS_HOISTING
from gateway.motion.smoother import smooth_motion
from gateway.numerics.stats import true_runs
from gateway.swing.rig import MountedHousing
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.evaluation_context import ZERO_VECTOR, EvaluationContext, RopeGeometry
from gateway.twin.effects.parameter import Symbols, Value, Values, amplitude
from gateway.twin.effects.pulse import start
from gateway.twin.model import EffectValues, Model, TwinRig
from gateway.twin.reconcile.data.observations import Observations

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
        return sum(c * sine for c, _, (sine, _) in self._terms(elapsed_s))

    def slope(self, elapsed_s: Scalar) -> Scalar:
        """Return its derivative by time."""
        return sum(c * rate * cosine for c, rate, (_, cosine) in self._terms(elapsed_s))

    def integral(self, elapsed_s: Scalar) -> Scalar:
        """Return its integral from the start of the interval."""
        return sum(c / rate * (1 - cosine) for c, rate, (_, cosine) in self._terms(elapsed_s))

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
            LENGTH_CORRECTION, "m", "ΔL, correction of the length's change", (-largest_m, largest_m), 0.0, refitted=True
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
            0.0,
            ("x", "y"),
            refitted=True,
        )
        self.parameters = (START, correction)

    def velocity_jump_m_s(self, p: Symbols) -> Vector:
        """Return the jump of the velocity."""
        x, y = p["delta_v_m_s"]
        return x, y, 0.0


InputKind = Literal["drive", "hoist"]
LIKELY = 0.5
"""Probability from which the crane drives or hoists."""
MARGIN_S = 1.0
"""Time before and after, in which a smooth start or end acts unseen."""
LONGEST_REST_S = 2.0
"""A shorter rest between two inputs belongs to them."""
SIGNIFICANT = 4.0
"""Standard uncertainties that the acceleration of a drive or the speed of a hoist exceeds at its peak."""
LENGTH_U_REL, PLACE_U_REL = 0.1, 0.05
"""Standard uncertainties of rope length and housing position over the length. What is missing from the model is not known yet."""
LEVEL_U = 5e-3
"""Standard uncertainty of the zero-g offsets, in g, and of the mount, in rad, for the same reason."""
LARGEST_SHARE_APART = 0.8
"""Of an interval, between its two corrections; best is a quarter of the swing's period."""
SOURCE = "the estimated inputs of the crane"
"""Name in the registry of effects."""


@dataclass(frozen=True, slots=True)
class EstimatedInput:
    """A drive or a hoist that was found; times count from the first sample of the recording."""

    kind: InputKind
    from_s: float
    to_s: float
    peak: float
    """Largest horizontal acceleration of the pivot, or speed of the hoist, lowering positive."""

    @property
    def unit(self) -> str:
        """Unit of the peak."""
        return "m/s²" if self.kind == "drive" else "m/s"


@dataclass(frozen=True, slots=True)
class CraneInputs:
    """What the crane did in a recording; empty where it rested."""

    found: tuple[EstimatedInput, ...] = ()
    effects: tuple[CraneInput, ...] = ()
    """For each interval in which the crane works its motion, and the corrections."""
    starts_s: tuple[float, ...] = ()
    """Of these effects, since the first sample of the recording."""

    @property
    def values(self) -> EffectValues:
        """The parameters of the effects, without corrections."""
        return {
            effect.name: effect.without_correction(start_s)
            for effect, start_s in zip(self.effects, self.starts_s, strict=True)
        }

    def leave_out(self, observations: Observations) -> Observations:
        """Return the observations of the recording in which only the time counts in which the crane rests."""
        works = np.zeros(len(observations.time_s), dtype=bool)
        for effect, start_s in zip(self.effects, self.starts_s, strict=True):
            elapsed_s = observations.time_s - start_s
            works |= (elapsed_s > 0) & (elapsed_s < effect.duration_s)
        return replace(observations, used=observations.used & ~works)


NO_INPUTS = CraneInputs()
"""Of a recording in which the crane rests, or is taken to rest."""


@contextmanager
def registered(*inputs: CraneInputs) -> Iterator[None]:
    """Add the effects of inputs to the registry for as long as they are needed."""
    EFFECTS.register([effect for each in inputs for effect in each.effects], SOURCE)
    try:
        yield
    finally:
        EFFECTS.unregister(SOURCE)


def estimate_inputs(source: Source, rig: TwinRig, prefix: str = "") -> CraneInputs:
    """Return the inputs of the crane in a recording; `prefix` of the effects' names tells recordings apart."""
    time_s = source.recording.time_s
    stated_m = None if source.housing is None else source.housing.above_load_m
    believed = MountedHousing(
        length_m=rig.length_m,
        above_load_m=max(rig.length_m - rig.position_m, 0.0) if stated_m is None else stated_m,
        length_u_rel=LENGTH_U_REL,
        position_u_m=PLACE_U_REL * rig.length_m,
        gravity_m_s2=rig.gravity_m_s2,
        zero_g_offset_u_g=(LEVEL_U, LEVEL_U, LEVEL_U),
        bandwidth_hz=source.bandwidth_hz,
    )
    history = smooth_motion(time_s, source.force_g, believed, LEVEL_U, min(rig.noise_g))
    return find_inputs(replace(history, time_s=history.time_s - time_s[0]), rig, prefix)


def find_inputs(history: MotionHistory, rig: TwinRig, prefix: str = "") -> CraneInputs:
    """Return the inputs in a smoothed motion whose times count from the first sample of the recording."""
    size_m_s2 = np.hypot(*history.pivot_acceleration_m_s2.T)
    drives = _events("drive", history, IS_DRIVEN, size_m_s2, history.pivot_acceleration_u_m_s2)
    hoists = _events("hoist", history, IS_HOISTING, history.hoist_m_s, history.hoist_u_m_s)
    found = sorted([*drives, *hoists], key=lambda each: each.from_s)
    windows = merge_spans([(each.from_s - MARGIN_S, each.to_s + MARGIN_S) for each in found], LONGEST_REST_S)
    effects: dict[CraneInput, float] = {}
    for number, (from_s, to_s) in enumerate(windows, start=1):
        name = f"{prefix}crane_motion_{number}"
        kinds = {each.kind for each in found if from_s <= each.from_s <= to_s}
        effects[_motion(name, history, rig, (from_s, to_s), kinds)] = from_s
        apart_s = min(LARGEST_SHARE_APART * (to_s - from_s), rig.small_swing_period_s / 4)
        for part, side in (("a", -1), ("b", 1)):
            effects[MotionCorrection(f"{name}{part}")] = (from_s + to_s + side * apart_s) / 2
    return CraneInputs(tuple(found), tuple(effects), tuple(effects.values()))


def _events(
    kind: InputKind, history: MotionHistory, hypotheses: NDArray[np.bool_], signal: Array, u: Array
) -> list[EstimatedInput]:
    # The hypotheses say that something acts, the signal from when until when: a steady winch may stand still.
    likely = (history.probabilities[:, hypotheses].sum(axis=1) > LIKELY) & (np.abs(signal) > u)
    runs = [run for run in true_runs(likely | (np.abs(signal) > SIGNIFICANT * u)) if likely[slice(*run)].any()]
    times_s = [(float(history.time_s[first]), float(history.time_s[stop - 1])) for first, stop in runs]
    found = []
    for from_s, to_s in merge_spans(times_s, LONGEST_REST_S):
        at = (history.time_s >= from_s) & (history.time_s <= to_s)
        largest = np.argmax(np.abs(signal[at]))
        if abs(signal[at][largest]) > SIGNIFICANT * u[at][largest]:
            found.append(EstimatedInput(kind, from_s, to_s, float(signal[at][largest])))
    return found


def merge_spans(spans_s: Sequence[tuple[float, float]], gap_s: float) -> list[tuple[float, float]]:
    """Return ascending time spans, those closer than a gap as one."""
    merged: list[tuple[float, float]] = []
    for from_s, to_s in spans_s:
        if merged and from_s - merged[-1][1] < gap_s:
            merged[-1] = (merged[-1][0], max(to_s, merged[-1][1]))
        else:
            merged.append((from_s, to_s))
    return merged


def _motion(
    name: str, history: MotionHistory, rig: TwinRig, span_s: tuple[float, float], kinds: set[InputKind]
) -> CraneMotion:
    from_s, to_s = span_s
    inside = (history.time_s > from_s) & (history.time_s < to_s)
    elapsed_s, duration_s = history.time_s[inside] - from_s, to_s - from_s
    x, y = (SineSeries.of(elapsed_s, each, duration_s) for each in _horizontal_m_s2(history)[inside].T)
    return CraneMotion(
        name,
        duration_s,
        pivot_m_s2=(x, y) if "drive" in kinds else None,
        hoist_m_s=SineSeries.of(elapsed_s, history.hoist_m_s[inside], duration_s) if "hoist" in kinds else None,
        length_m=rig.length_m,
    )


def _horizontal_m_s2(history: MotionHistory) -> Array:
    """Return the pivot's acceleration along the horizontal axes nearest to those of the housing, shape (n, 2).

    The smallest rotation that makes the rope vertical turns a horizontal vector's component along the lean by the rope's angle.
    """
    seen = history.pivot_acceleration_m_s2
    angle_rad, azimuth_rad = (np.nan_to_num(each) for each in (history.angle_rad, history.azimuth_rad))
    lean = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], axis=1)
    along: Array = (seen * lean).sum(axis=1, keepdims=True) * lean
    return seen + (1 / np.cos(angle_rad)[:, None] - 1) * along


@dataclass(frozen=True, slots=True)
class KnownModel:
    """What is known before the search: the model of the rig, and what the crane did in each recording."""

    model: Model
    inputs: CraneInputs
    held_out_inputs: CraneInputs
    """The same as `inputs` where the held-out part is the end of the log."""

    @property
    def of_log(self) -> Model:
        """The model on the log."""
        return Model(self.model.rig, {**self.model.effects, **self.inputs.values})

    @property
    def held_out_effects(self) -> EffectValues:
        """The effects that the model has on the held-out recording."""
        return {**self.model.effects, **self.held_out_inputs.values}
