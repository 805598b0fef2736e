"""The measurement of a recording: formulas, swing, tilt and conditions.

The four formulas of Łuczak et al. 2022 are evaluated over the recording and over each of its swings, as published and
corrected. The conditions are judged window by window, with the motion filter and the gates of the live pipeline.
"""

import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.configuration.model import MAX_CUTOFF_SHARE, FilterSection
from gateway.measurement.motion import (
    RecordingMotion,
    estimate_source_motion,
    is_free_swing,
    with_smoothed_angle,
)
from gateway.measurement.source import Source
from gateway.measurement.swing import cut_to_free_swing, estimate_source_swing
from gateway.messages.header import Reason
from gateway.motion.motion_monitor import MotionMonitor
from gateway.numerics.array import Array
from gateway.pipeline.motion_stage import motion_context
from gateway.stages.condition import DRIVEN_STATES, ConditionResult, MotionContext, judge_condition
from gateway.stages.condition_window import ConditionWindow
from gateway.stages.lowpass import LowPass
from gateway.stages.tilt import TiltAngles, axial_tilt, fused_tilt, plain_tilt, roll_about_x
from gateway.swing.detection.free_swing import FreeSwing
from gateway.swing.estimate import FormulaAngles, SwingEstimate
from gateway.swing.formulas import LowpassGain, as_published, corrected, extremes

BLOCK_S = 0.1
"""Length of the blocks in which samples enter window and motion filter. Basis: as live, `device_factory.BLOCK_S`."""
BLOCKS_PER_VERDICT = 5
"""Definition: two verdicts per second, as live."""
NOT_KNOWN = MotionContext(
    state="unknown", reasons=(Reason("not_configured", "where the housing is on the rope is not known"),)
)
FILTER = FilterSection()
"""The low-pass of a gateway without other settings."""
NO_ANGLES = FormulaAngles(arccos_min_az=None, arcsin_max_axy=None, arctan_max_axy_min_az=None, arccos_max_az=None)


@dataclass(frozen=True, slots=True)
class ConditionSummary:
    """The most frequent verdict of a recording."""

    verdict: str
    cause: str | None
    """The most frequent cause of that verdict."""
    reasons: tuple[str, ...]
    """Reasons of the first window with that verdict and cause, and with the most frequent reasons among these."""
    windows: dict[str, int]
    """Number of windows by verdict."""


def summarise_conditions(source: Source, *, swings_freely: bool = False) -> ConditionSummary:
    """Judge every window of a recording and return the most frequent verdict.

    `swings_freely`: one free swing explains the whole recording, so that nothing else acts in any window.
    """
    by_verdict: dict[str, list[ConditionResult]] = defaultdict(list)
    windows_judged = list(_judge_windows(source, swings_freely))
    later = [result for result in windows_judged if result.gates.get("enough_data", True)]
    for result in later or windows_judged:  # the first windows of a recording are always too short
        by_verdict[result.verdict].append(result)
    if not by_verdict:
        return ConditionSummary("unknown", None, ("less than a second of data",), {})
    verdict = max(by_verdict, key=lambda verdict: len(by_verdict[verdict]))
    kinds = Counter((result.cause, _without_numbers(result.reasons)) for result in by_verdict[verdict])
    (cause, wording), _ = kinds.most_common(1)[0]
    first = next(
        result for result in by_verdict[verdict] if (result.cause, _without_numbers(result.reasons)) == (cause, wording)
    )
    windows = {name: len(results) for name, results in by_verdict.items()}
    return ConditionSummary(verdict, cause, first.reasons, windows)


def _without_numbers(reasons: Sequence[str]) -> tuple[str, ...]:
    """Return reasons so that those of several windows are the same, whatever their numbers."""
    return tuple(re.sub(r"[-+]?\d[\d.]*", "#", reason) for reason in reasons)


def _judge_windows(source: Source, swings_freely: bool) -> Iterator[ConditionResult]:
    recording = source.recording
    noise_g = None if source.noise_g is None else float(np.max(source.noise_g))
    window, monitor = ConditionWindow(), _motion_monitor(source, noise_g)
    clipped = source.find_clipped()
    block_samples = max(1, round(BLOCK_S * recording.rate_hz))
    for number, start in enumerate(range(0, len(recording), block_samples), start=1):
        block = slice(start, start + block_samples)
        time_s, force_g = recording.time_s[block], source.force_g[block]
        is_clipped = clipped[block]
        window.update(
            time_s,
            force_g,
            int(np.count_nonzero(is_clipped)),
            int(recording.lost_before[block].sum() + recording.unusable_before[block].sum()),
            _turning(source, monitor, block),
        )
        if monitor is not None:
            monitor.update(time_s, force_g, is_clipped, None if source.rate_rad_s is None else source.rate_rad_s[block])
        if number % BLOCKS_PER_VERDICT == 0:
            motion = _motion_at(float(time_s[-1]), monitor, source, swings_freely)
            yield judge_condition(window, motion, noise_g, source.permissible_norm_error_g)


def _motion_at(time_s: float, monitor: MotionMonitor | None, source: Source, swings_freely: bool) -> MotionContext:
    if monitor is None:
        return NOT_KNOWN
    motion = motion_context(monitor.estimate(time_s), source.housing, is_explained=monitor.is_explained)
    is_free = swings_freely and motion.state in DRIVEN_STATES
    return replace(motion, state="free", reasons=()) if is_free else motion


def _motion_monitor(source: Source, noise_g: float | None) -> MotionMonitor | None:
    if source.housing is None:
        return None
    return MotionMonitor(source.housing, mount_u_rad=source.mount_u_rad, noise_g=noise_g, gyro=source.gyro)


def _turning(source: Source, monitor: MotionMonitor | None, block: slice) -> Array | None:
    """Return the angular rates of a block without the gyroscope's bias; as read where that is not known."""
    if source.rate_rad_s is None:
        return None
    bias_rad_s = None if monitor is None else monitor.gyro_bias_rad_s()
    rate_rad_s = source.rate_rad_s[block]
    return rate_rad_s if bias_rad_s is None else rate_rad_s - bias_rad_s


@dataclass(frozen=True, slots=True)
class FormulaResult:
    """The angles by the formulas over one interval."""

    as_published: FormulaAngles
    corrected: FormulaAngles
    """Corrected for rho and for the attenuation of the low-pass; empty where the position of the housing or the period is not
    known."""


@dataclass(frozen=True, slots=True)
class FormulaEvaluation:
    """Evaluates the formulas on intervals of one recording after the low-pass."""

    source: Source
    lowpass: LowPass
    lowpassed_g: NDArray[np.float64]
    """Specific force after the low-pass, shape (n, 3)."""
    swing: SwingEstimate

    def whole_recording(self) -> FormulaResult:
        """Return the result over all samples."""
        return self._evaluate(self.lowpassed_g)

    def each_swing(self) -> tuple[FormulaResult, ...]:
        """Return the result over one period around each maximum of the swing, shifted by the delay of the low-pass."""
        period_s = self.swing.period_s
        if period_s is None:
            return ()
        middles_s = np.array([peak.time_s for peak in self.swing.swings]) + self.lowpass.delay_s(1 / period_s)
        halves_s = np.array([[-0.5], [0.5]]) * period_s
        bounds = np.searchsorted(self.source.recording.time_s, middles_s + halves_s).T
        return tuple(self._evaluate(self.lowpassed_g[start:stop]) for start, stop in bounds)

    def _evaluate(self, lowpassed_g: NDArray[np.float64]) -> FormulaResult:
        found = extremes(lowpassed_g)
        if found is None:
            return FormulaResult(NO_ANGLES, NO_ANGLES)
        housing, swing, lowpass = self.source.housing, self.swing, self.lowpass
        if housing is None or swing.length_m is None or swing.period_s is None:
            return FormulaResult(as_published(found), NO_ANGLES)
        gain = LowpassGain(gain_f0=lowpass.gain(1 / swing.period_s), gain_2f0=lowpass.gain(2 / swing.period_s))
        return FormulaResult(as_published(found), corrected(found, housing.rho_at(swing.length_m), gain))


@dataclass(frozen=True, slots=True)
class Measurement:
    """The results of a recording; angles in radians."""

    formulas: FormulaResult
    """Over the whole recording."""
    swing: SwingEstimate
    formulas_by_swing: tuple[FormulaResult, ...]
    """One entry for each of `swing.swings`."""
    tilt: TiltAngles
    arctangent_tilt: TiltAngles
    """By the arctangent alone (Łuczak n.d., eq. 3 and 4)."""
    roll_gamma_rad: float
    """Roll about the housing's x axis (Zams and Łuczak 2024, eq. 7)."""
    axial_rad: float
    conditions: ConditionSummary
    judged: Source
    """What the results are of: the recording, or its longest free swing."""
    free_swing: FreeSwing | None
    """Where the recording swings freely between hands; None: nothing was held."""
    motion: RecordingMotion | None
    """None: the crane does not work in the recording, or nothing can be said."""


def measure(source: Source, *, with_motion: bool = False) -> Measurement:
    """Return the results of a recording; without a position of the housing the swing is not known.

    What was held or moved by hand is not judged. `with_motion`: smooth the motion of a free swing too.
    """
    cut = cut_to_free_swing(source)
    source = cut.source
    rate_hz = source.recording.rate_hz
    lowpass = LowPass(min(FILTER.cutoff_hz, MAX_CUTOFF_SHARE * rate_hz), FILTER.order, rate_hz)
    lowpassed_g = lowpass.apply(source.force_g)
    mean_g = lowpassed_g.mean(axis=0)
    swing = estimate_source_swing(source)
    formulas = FormulaEvaluation(source, lowpass, lowpassed_g, swing)
    motion = estimate_source_motion(source, swing) if with_motion or not is_free_swing(swing) else None
    if motion is not None and not (with_motion or motion.crane_worked):
        motion = None
    return Measurement(
        formulas=formulas.whole_recording(),
        swing=swing if motion is None else with_smoothed_angle(swing, motion),
        formulas_by_swing=formulas.each_swing(),
        tilt=fused_tilt(mean_g),
        arctangent_tilt=plain_tilt(mean_g),
        roll_gamma_rad=roll_about_x(mean_g),
        axial_rad=axial_tilt(mean_g),
        conditions=summarise_conditions(source, swings_freely=bool(swing.swinging) and is_free_swing(swing)),
        judged=source,
        free_swing=cut.free_swing,
        motion=motion,
    )
