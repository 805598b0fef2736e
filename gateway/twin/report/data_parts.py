"""The parts of the data: what each was used for, and how well both models agree with it."""

from dataclasses import dataclass

from gateway.twin.reconcile.output.result import Curves, Gap, Reconciliation


@dataclass(frozen=True, slots=True)
class DataPart:
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


def data_parts(result: Reconciliation, gap: Gap) -> tuple[DataPart, ...]:
    """Return the parts; the last one is the least influenced by the choice of the model, and its gap is published."""
    return (
        DataPart("fit", fitted_part_name(result), gap.before_log, gap.after_log, result.log),
        DataPart("selection", held_out_name(result), gap.before_held_out, gap.after_held_out, result.held_out),
    )


def fitted_part_name(result: Reconciliation) -> str:
    """Return the name of what the model was fitted to."""
    return "first two thirds of the recording" if result.held_out_is_last_third else "recording"


def held_out_name(result: Reconciliation) -> str:
    """Return the name of what was held out of the fit."""
    return "last third of the recording" if result.held_out_is_last_third else "held-out recording"
