"""Inputs of the crane, estimated from a recording: what trolley, bridge and winch did, as known parts of its model."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.measurement.source import Source
from gateway.motion.history import MotionHistory
from gateway.motion.hypotheses import IS_DRIVEN, IS_HOISTING
from gateway.motion.smoother import smooth_motion
from gateway.numerics.stats import true_runs
from gateway.swing.rig import MountedHousing
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.crane_input import CraneInput, CraneMotion, MotionCorrection, SineSeries
from gateway.twin.model import EffectValues, Model, TwinRig
from gateway.twin.reconcile.data.observations import Observations

Array = NDArray[np.float64]
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
    found: Array = seen + (1 / np.cos(angle_rad)[:, None] - 1) * along
    return found


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
