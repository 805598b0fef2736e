"""The four formulas, the swing estimate, tilt and conditions of a recording."""

from collections import Counter, defaultdict
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.measurement.source import Source
from gateway.stages.clipping import count_clipped
from gateway.stages.conditions.gates import SwingContext
from gateway.stages.conditions.verdict import ConditionResult, judge_condition
from gateway.stages.conditions.window import WINDOW_S, ConditionWindow
from gateway.stages.lowpass import LowPass
from gateway.stages.tilt import TiltAngles, axial_tilt, fused_tilt, plain_tilt
from gateway.swing.estimate import FormulaAngles, SwingEstimate
from gateway.swing.formulas import Extremes, LowpassGain, as_published, corrected, extremes
from gateway.swing.offline import estimate_swing

BLOCK_S = 0.1
JUDGE_EVERY = 5
NO_FORMULAS = FormulaAngles(arccos_min_az=None, arcsin_max_axy=None, arctan_max_axy_min_az=None, arccos_max_az=None)


@dataclass(frozen=True, slots=True)
class Conditions:
    """The verdicts of a recording's windows."""

    verdict: str
    cause: str | None
    """What disturbs, most often, in the windows of that verdict."""
    reasons: tuple[str, ...]
    windows: dict[str, int]
    """How many windows had each verdict."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """What a recording says; angles in radians."""

    formulas: FormulaAngles
    """As published."""
    corrected: FormulaAngles
    """For the housing's place on the rope and the low-pass; none where the place or the period is not known."""
    swing: SwingEstimate
    by_swing: tuple[tuple[FormulaAngles, FormulaAngles], ...]
    """As published and corrected, over each of `swing.swings`."""
    tilt: TiltAngles
    plain_tilt: TiltAngles
    """By the plain arctangent forms (003 eq. 6-7)."""
    axial_rad: float
    conditions: Conditions


def measure(source: Source, *, cutoff_hz: float = 1.0, order: int = 2) -> Measurement:
    """Measure a recording; where the place of the housing is not known there is no swing estimate."""
    recording, force_g = source.recording, source.force_g
    lowpass = LowPass(min(cutoff_hz, 0.4 * recording.rate_hz), order, recording.rate_hz)
    lowpassed_g = lowpass.apply(force_g)
    found = extremes(lowpassed_g)
    swing = _swing(source)
    mean_g = lowpassed_g.mean(axis=0)
    return Measurement(
        formulas=NO_FORMULAS if found is None else as_published(found),
        corrected=_corrected(source, found, swing, lowpass),
        swing=swing,
        by_swing=_by_swing(source, lowpassed_g, swing, lowpass),
        tilt=fused_tilt(mean_g),
        plain_tilt=plain_tilt(mean_g),
        axial_rad=float(axial_tilt(mean_g)),
        conditions=_conditions(source, swing),
    )


def _corrected(source: Source, found: Extremes | None, swing: SwingEstimate, lowpass: LowPass) -> FormulaAngles:
    if found is None or source.housing is None or swing.length_m is None or swing.period_s is None:
        return NO_FORMULAS
    passage = LowpassGain(gain_f0=lowpass.gain(1 / swing.period_s), gain_2f0=lowpass.gain(2 / swing.period_s))
    return corrected(found, source.housing.rho_at(swing.length_m), passage)


def _by_swing(
    source: Source, lowpassed_g: NDArray[np.float64], swing: SwingEstimate, lowpass: LowPass
) -> tuple[tuple[FormulaAngles, FormulaAngles], ...]:
    """The formulas over the period about each swing's maximum, which the low-pass shows later by its delay."""
    if swing.period_s is None:
        return ()
    middles_s = np.array([peak.time_s for peak in swing.swings]) + lowpass.delay_s(1 / swing.period_s)
    halves_s = np.array([[-0.5], [0.5]]) * swing.period_s
    found = [extremes(lowpassed_g[a:b]) for a, b in np.searchsorted(source.recording.time_s, middles_s + halves_s).T]
    return tuple(
        (NO_FORMULAS if each is None else as_published(each), _corrected(source, each, swing, lowpass))
        for each in found
    )


def _swing(source: Source) -> SwingEstimate:
    time_s = source.recording.time_s
    if source.housing is None:
        reason = "where the housing is on the rope is not known: give --rig"
        return SwingEstimate(from_s=float(time_s[0]), to_s=float(time_s[-1]), swinging=None, reasons=(reason,))
    found = estimate_swing(time_s, source.force_g, rig=source.housing, noise_g=source.noise_g)
    return replace(found, reasons=(*found.reasons, *source.remarks))


def _conditions(source: Source, swing: SwingEstimate) -> Conditions:
    """Windows judged one after the other, as live; the verdict is the most frequent one."""
    recording, housing = source.recording, source.housing
    noise_g = None if source.noise_g is None else float(np.max(source.noise_g))
    rho = None if housing is None or swing.length_m is None else housing.rho_at(swing.length_m)
    window = ConditionWindow()
    seen = SwingContext(
        swing.swinging,
        swing.phi_max_rad,
        consistent=swing.coverage95_rad is not None,
        rho=rho,
        period_s=swing.period_s,
        lean_g=swing.lean_g,
    )
    windows: dict[str, list[ConditionResult]] = defaultdict(list)
    n = max(1, round(BLOCK_S * recording.rate_hz))
    for index, begin in enumerate(range(0, len(recording), n)):
        block = slice(begin, begin + n)
        window.update(
            recording.time_s[block],
            source.force_g[block],
            count_clipped(source.force_g[block], source.full_scale_g),
            int(recording.lost_before[block].sum() + recording.unusable_before[block].sum()),
            None if recording.gyro_dps is None else np.radians(recording.gyro_dps[block]),
        )
        if index % JUDGE_EVERY == JUDGE_EVERY - 1:
            now = replace(seen, hoisting=_hoisting(swing, float(recording.time_s[block][-1])))
            found = judge_condition(window, now, noise_g, source.permissible_norm_error_g)
            windows[found.verdict].append(found)
    if not windows:
        return Conditions("unknown", None, ("less than a second of data",), {})
    verdict = max(windows, key=lambda verdict: len(windows[verdict]))
    cause = Counter(found.cause for found in windows[verdict]).most_common(1)[0][0]
    first = next(found for found in windows[verdict] if found.cause == cause)
    return Conditions(verdict, cause, first.reasons, {name: len(found) for name, found in windows.items()})


def _hoisting(swing: SwingEstimate, now_s: float) -> bool:
    """The rope's length changed within the window that ends now."""
    return any(begin_s < now_s and end_s > now_s - WINDOW_S for begin_s, end_s in swing.hoists_s)
