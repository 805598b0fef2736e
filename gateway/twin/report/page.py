"""The whole report: one file that asks the network for nothing."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gateway.documents.environment import render
from gateway.twin.reconcile.output.result import Comparison, Reconciliation
from gateway.twin.report.gap import gap_content
from gateway.twin.report.motion import disagreement_figures, motion_content, residual_figures
from gateway.twin.report.text import COUNTED, REFITTED, caution, final_model_name, is_same_model, model_value, rig_facts
from gateway.twin.report.verdict import (
    assessment,
    component_texts,
    is_transient,
    ranked_candidates,
    relative_deficit,
    verdict_content,
)

Content = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class ReportSection:
    """A section of the report."""

    name: str
    """Its anchor, and the name of its template."""
    title: str
    content: Content
    """What its template prints beside the result itself: figures, and functions of parts of the result."""


def _ranking_content(result: Reconciliation, _compared: Comparison) -> Content:
    return {"candidates": ranked_candidates(result), "assessment": assessment, "relative_deficit": relative_deficit}


def _parameters_content(_result: Reconciliation, compared: Comparison) -> Content:
    is_same = is_same_model(compared.log)
    return {"component_texts": component_texts, "is_transient": is_transient, "is_same_model": is_same}


def _model_content(result: Reconciliation, _compared: Comparison) -> Content:
    return {"caution": caution(result), "after_name": final_model_name(result), "model_value": model_value}


DATA_CONTENT: Content = {"counted": COUNTED, "refitted": REFITTED}
"""The words for the counts of samples and for parameters that were fitted again."""
MODEL_SECTIONS: tuple[tuple[str, str, Callable[[Reconciliation, Comparison], Content]], ...] = (
    ("gap", "The gap, step by step", gap_content),
    ("motion", "Measured and simulated", motion_content),
    ("disagreement", "Where simulation and measurement disagree", disagreement_figures),
    ("ranking", "Effects considered", _ranking_content),
    ("parameters", "Estimated parameters", _parameters_content),
    ("residual", "Residual of the final model", residual_figures),
    ("model", "Model equations, before and after", _model_content),
)
"""Sections that need a fitted model: name, title, and what returns their content."""


def render_report(
    result: Reconciliation, *, title: str, software: str, computed: Mapping[str, str] | None = None
) -> str:
    """Return the HTML of a reconciliation.

    `software` is name and version of what computed it; `computed` whatever else it takes to compute it again, in words and in
    this order: the recordings, the rig's file, the seed, the time it took.
    """
    compared = result.comparison
    if compared is None:
        found = [ReportSection("lacking", "No model was fitted", {})]
    else:
        found = [ReportSection(name, heading, content(result, compared)) for name, heading, content in MODEL_SECTIONS]
    facts = (("software", software), *(computed or {}).items())
    sections = [
        *found,
        ReportSection("data", "The data", DATA_CONTENT),
        ReportSection("computed", "How this was computed", {"facts": facts, "rig": rig_facts(result.rig)}),
    ]
    return render("report.html.j2", title=title, result=result, verdict=verdict_content(result), sections=sections)
