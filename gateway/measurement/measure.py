"""The measurement of a recording: formulas, swing, tilt and conditions."""

from dataclasses import dataclass

from gateway.configuration.model import MAX_CUTOFF_SHARE
from gateway.measurement.conditions import ConditionSummary, summarise_conditions
from gateway.measurement.formulas import FormulaEvaluation, FormulaResult
from gateway.measurement.free_swing import cut_to_free_swing
from gateway.measurement.motion import (
    RecordingMotion,
    estimate_source_motion,
    is_free_swing,
    with_smoothed_angle,
)
from gateway.measurement.source import Source
from gateway.measurement.swing import estimate_source_swing
from gateway.stages.lowpass import LowPass
from gateway.stages.tilt import TiltAngles, axial_tilt, fused_tilt, plain_tilt, roll_about_x
from gateway.swing.detection.free_swing import FreeSwing
from gateway.swing.estimate import SwingEstimate


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


def measure(source: Source, *, cutoff_hz: float = 1.0, order: int = 2, with_motion: bool = False) -> Measurement:
    """Return the results of a recording; without a position of the housing the swing is not known.

    What was held or moved by hand is not judged. `with_motion`: smooth the motion of a free swing too.
    """
    cut = cut_to_free_swing(source)
    source = cut.source
    rate_hz = source.recording.rate_hz
    lowpass = LowPass(min(cutoff_hz, MAX_CUTOFF_SHARE * rate_hz), order, rate_hz)
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
        conditions=summarise_conditions(source),
        judged=source,
        free_swing=cut.free_swing,
        motion=motion,
    )
