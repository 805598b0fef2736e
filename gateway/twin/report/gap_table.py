"""The parts of the data and the gap on each: chi-square, multiple of the noise, and the equivalent error of the rope's angle.

A free swing of the rope's angle phi reads (1 - p/L) sin(phi) g across the rope, at a housing p below the pivot on a rope of
length L (derived from the equations of motion; exact for a fixed pivot). A residual across the rope, read as such a swing,
becomes an angle, and the angle times L a displacement of the load.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.documents.format import format_number, format_percent
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.output import result as result_module
from gateway.twin.reconcile.output.result import Curves, Gap, Reconciliation
from gateway.twin.report.text import format_change, noise_ratio

Array = NDArray[np.float64]
MIN_TRANSVERSE_SENSITIVITY = 0.1
"""Least |1 - p/L|, in g per radian. Basis: there a position that is known to 5 % of the length makes the angle uncertain by
half."""
NOISE_DEVIATIONS = 2.0
"""A residual variance within so many standard deviations of the noise's own is no more than an upper bound."""


@dataclass(frozen=True, slots=True)
class RopeAngleError:
    """Equivalent error of a simulated rope angle, rms."""

    angle_rad: float
    displacement_m: float
    """At the load."""
    is_upper_bound: bool
    """The residual is not larger than the noise can be."""


def transverse_sensitivity(rig: TwinRig) -> float:
    """Return 1 - p/L: the reading across the rope in g per radian of a free swing."""
    return 1 - rig.position_m / rig.length_m


def rope_angle_error(residual_g: Array, rig: TwinRig) -> RopeAngleError | None:
    """Return the rope angle that a residual of x, y, z (n, 3) is equivalent to, the noise's variance subtracted.

    None where the housing is so close to the load that the transverse channels do not show the angle.
    """
    sensitivity = abs(transverse_sensitivity(rig))
    if sensitivity < MIN_TRANSVERSE_SENSITIVITY or not len(residual_g):
        return None
    variance_g2 = np.square(np.array(rig.noise_g[:2], dtype=np.float64))
    excess_g2 = float(np.square(residual_g[:, :2]).sum(axis=1).mean() - variance_g2.sum())
    bound_g2 = NOISE_DEVIATIONS * math.sqrt(2 * float(np.square(variance_g2).sum()) / len(residual_g))
    is_upper_bound = excess_g2 <= bound_g2
    transverse_g = math.sqrt(max(excess_g2, 0.0) + bound_g2 if is_upper_bound else excess_g2)
    angle_rad = math.asin(min(1.0, transverse_g / sensitivity))
    return RopeAngleError(angle_rad, rig.length_m * angle_rad, is_upper_bound)


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
