"""The whole report: one file that asks the network for nothing."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gateway.documents.environment import render
from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.report.confusable import confusable_view
from gateway.twin.report.disagreement import disagreement_view
from gateway.twin.report.equations import equations_view
from gateway.twin.report.gap import gap_view
from gateway.twin.report.motion import motion_view
from gateway.twin.report.parameters import parameters_view
from gateway.twin.report.provenance import computed_view, data_view
from gateway.twin.report.ranking import ranking_view
from gateway.twin.report.residual import residual_view
from gateway.twin.report.verdict import verdict_view


@dataclass(frozen=True, slots=True)
class ReportSection:
    """A section of the report."""

    name: str
    """Its anchor, and the name of its template."""
    title: str
    view: object


MODEL_SECTIONS: tuple[tuple[str, str, Callable[[Reconciliation], object]], ...] = (
    ("gap", "The gap, step by step", gap_view),
    ("motion", "Measured and simulated", motion_view),
    ("disagreement", "Where simulation and measurement disagree", disagreement_view),
    ("ranking", "Effects considered", ranking_view),
    ("confusable", "Effects that cannot be distinguished", confusable_view),
    ("parameters", "Estimated parameters", parameters_view),
    ("residual", "Residual of the final model", residual_view),
    ("model", "Model equations, before and after", equations_view),
)
"""Sections that need a fitted model: name, title, and what computes the view."""


def render_report(
    result: Reconciliation, *, title: str, software: str, computed: Mapping[str, str] | None = None
) -> str:
    """Return the HTML of a reconciliation.

    `software` is name and version of what computed it; `computed` whatever else it takes to compute it again, in words and in
    this order: the recordings, the rig's file, the seed, the time it took.
    """
    if result.gap is None and result.log is None:
        found = [ReportSection("lacking", "No model was fitted", None)]
    else:
        found = [ReportSection(name, heading, view(result)) for name, heading, view in MODEL_SECTIONS]
    sections = [
        *found,
        ReportSection("data", "The data", data_view(result)),
        ReportSection("computed", "How this was computed", computed_view(result, software, computed or {})),
    ]
    return render("report.html.j2", title=title, verdict=verdict_view(result), sections=sections)
