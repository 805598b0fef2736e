"""The parts of the data: what each was used for, and how well both models agree with it."""

from dataclasses import dataclass, replace

import numpy as np

from gateway.twin.reconcile.output import result as result_module
from gateway.twin.reconcile.output.result import Curves, Gap, Reconciliation


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
