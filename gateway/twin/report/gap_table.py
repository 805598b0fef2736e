"""The parts of the data and the gap on each: chi-square, multiple of the noise, and the equivalent error of the rope's angle."""

import math
from dataclasses import dataclass, replace

import numpy as np

from gateway.documents.format import format_number, format_percent
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.output import result as result_module
from gateway.twin.reconcile.output.result import Curves, Gap, Reconciliation
from gateway.twin.report.rope_angle import RopeAngleError, rope_angle_error
from gateway.twin.report.text import format_change, noise_ratio

NOT_EVALUATED = "not evaluated"
NOT_DETERMINED = "not determined"
ANGLE_DIGITS = 2


@dataclass(frozen=True, slots=True)
class PartGap:
    """A part of the data with the gap of both models on it."""

    role: str
    """What it was used for: fit, selection or test."""
    name: str
    """What it is: a recording, or a part of one."""
    before: float | None
    """Reduced chi-square of the nominal model; None where it was not evaluated."""
    after: float | None
    """Of the final model."""
    curves: Curves | None
    """None where the samples of this part alone are not kept."""


def data_parts(result: Reconciliation, gap: Gap) -> tuple[PartGap, ...]:
    """Return the parts; the last one is the least influenced by the choice of the model, and its gap is published."""
    found = [
        PartGap("fit", fitted_part_name(result), gap.before_log, gap.after_log, result.log),
        PartGap("selection, test", held_out_name(result), gap.before_held_out, gap.after_held_out, result.held_out),
    ]
    test = next((part for part in result.parts if part.role == "test"), None)
    if test is not None:
        name, curves = f"test part of the {held_out_name(result)}", _curves_of(result.held_out, test)
        found.append(PartGap("test", name, gap.before_test, gap.after_test, curves))
    return tuple(found)


def _curves_of(curves: Curves | None, part: result_module.DataPart) -> Curves | None:
    """Return the curves with the samples of a part in use."""
    if curves is None:
        return None
    time_s = curves.recording_time_s
    inside = np.any([(time_s >= from_s) & (time_s <= to_s) for from_s, to_s in part.blocks_s], axis=0)
    return replace(curves, used=curves.used & inside)


def fitted_part_name(result: Reconciliation) -> str:
    """Return the name of what the model was fitted to."""
    return "first two thirds of the recording" if result.held_out_is_last_third else "recording"


def held_out_name(result: Reconciliation) -> str:
    """Return the name of what was held out of the fit."""
    return "last third of the recording" if result.held_out_is_last_third else "held-out recording"


@dataclass(frozen=True, slots=True)
class PartRow:
    """The gap on a part of the data, before → after."""

    name: str
    role: str
    chi2: str
    rms: str
    """In multiples of the noise."""
    closed: str
    """Percent of the gap that the final model closes."""
    angle: str
    """Equivalent error of the rope's angle, rms."""
    displacement: str
    """The same at the load."""


def part_rows(result: Reconciliation) -> tuple[PartRow, ...]:
    """Return the gap on each part of the data, the published one last; nothing where no model was fitted."""
    if result.gap is None:
        return ()
    return tuple(_row(part, result.rig) for part in data_parts(result, result.gap))


def _row(part: PartGap, rig: TwinRig) -> PartRow:
    angle, displacement = _angle_texts(part.curves, rig)
    if part.before is None or part.after is None:
        return PartRow(part.name, part.role, NOT_EVALUATED, NOT_EVALUATED, NOT_EVALUATED, angle, displacement)
    return PartRow(
        part.name,
        part.role,
        format_change(format_number(part.before), format_number(part.after)),
        f"{format_change(noise_ratio(part.before), noise_ratio(part.after))} × noise",
        _closed(part.before, part.after),
        angle,
        displacement,
    )


def _closed(before: float, after: float) -> str:
    if before == after:
        return "unchanged"
    closed = Gap.closed_percent(before, after)
    return "no gap" if closed is None else format_percent(closed)


def _angle_texts(curves: Curves | None, rig: TwinRig) -> tuple[str, str]:
    """Return angle and displacement of both models."""
    if curves is None:
        return NOT_EVALUATED, NOT_EVALUATED
    before = rope_angle_error(curves.residual_before_g[curves.used], rig)
    after = rope_angle_error(curves.residual_after_g[curves.used], rig)
    if before is None or after is None:
        return NOT_DETERMINED, NOT_DETERMINED
    return (
        format_change(_angle(before), _angle(after)),
        format_change(_displacement(before), _displacement(after)),
    )


def _angle(error: RopeAngleError) -> str:
    return f"{_bound(error)}{format_number(math.degrees(error.angle_rad), ANGLE_DIGITS)}°"


def _displacement(error: RopeAngleError) -> str:
    return f"{_bound(error)}{format_number(100 * error.displacement_m, ANGLE_DIGITS)} cm"


def _bound(error: RopeAngleError) -> str:
    return "< " if error.is_upper_bound else ""
