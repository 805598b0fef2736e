"""The measurement of a recording: formulas, swing, tilt and conditions.

The four formulas of Łuczak et al. 2022 are evaluated over the recording and over each of its swings, as published and
corrected. The conditions are judged window by window, with the motion filter and the gates of the live pipeline.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.configuration.model import MAX_CUTOFF_SHARE, FilterSection
from gateway.measurement.followed_recording import ConditionSummary, follow_recording
from gateway.measurement.motion import RecordingMotion, has_motion, is_free_swing, recording_motion, with_smoothed_angle
from gateway.measurement.source import Source
from gateway.measurement.swing import CutSource, cut_to_free_swing, estimate_source_swing
from gateway.stages.lowpass import LowPass
from gateway.stages.tilt import TiltAngles, axial_tilt, fused_tilt, plain_tilt, roll_about_x
from gateway.swing.detection.free_swing import FreeSwing
from gateway.swing.estimate import FormulaAngles, SwingEstimate
from gateway.swing.formulas import LowpassGain, as_published, corrected, extremes

FILTER = FilterSection()
"""The low-pass of a gateway without other settings."""
NO_ANGLES = FormulaAngles(arccos_min_az=None, arcsin_max_axy=None, arctan_max_axy_min_az=None, arccos_max_az=None)


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

    What was held or moved by hand is not judged. Where the rest is no free swing either, a crane worked, and no hand.
    `with_motion`: smooth the motion of a free swing too.
    """
    cut = cut_to_free_swing(source)
    found = _measure(cut, with_motion=with_motion)
    if cut.free_swing is None or found.motion is None or not found.motion.crane_worked:
        return found
    whole = _measure(CutSource(source, None), with_motion=with_motion)
    return whole if whole.motion is not None and whole.motion.doubt is None else found


def _measure(cut: CutSource, *, with_motion: bool) -> Measurement:
    source = cut.source
    rate_hz = source.recording.rate_hz
    lowpass = LowPass(min(FILTER.cutoff_hz, MAX_CUTOFF_SHARE * rate_hz), FILTER.order, rate_hz)
    lowpassed_g = lowpass.apply(source.force_g)
    mean_g = lowpassed_g.mean(axis=0)
    swing = estimate_source_swing(source)
    formulas = FormulaEvaluation(source, lowpass, lowpassed_g, swing)
    is_free = is_free_swing(swing)
    smooths = (with_motion or not is_free) and has_motion(source, swing)
    followed = follow_recording(source, swings_freely=bool(swing.swinging) and is_free, smooths=smooths)
    motion = None if followed.motion is None else recording_motion(source, swing, followed.motion)
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
        conditions=followed.conditions,
        judged=source,
        free_swing=cut.free_swing,
        motion=motion,
    )
