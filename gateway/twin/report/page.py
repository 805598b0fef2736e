"""The whole report: one file that asks the network for nothing."""

from collections.abc import Mapping

from gateway.twin.reconcile.output.result import Reconciliation
from gateway.twin.report.confusable import confusable_part
from gateway.twin.report.disagreement import disagreement_part
from gateway.twin.report.equations import equations_part
from gateway.twin.report.gap import gap_part
from gateway.twin.report.markup import Html, element, joined, paragraph, section
from gateway.twin.report.motion import motion_part
from gateway.twin.report.parameters import parameters_part
from gateway.twin.report.provenance import computed_part, data_part
from gateway.twin.report.ranking import ranking_part
from gateway.twin.report.remaining import remaining_part
from gateway.twin.report.style import CSS
from gateway.twin.report.verdict import verdict_part

NOTHING_ELSE = Html(
    '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:\">"
)

FOUND = (
    gap_part,
    motion_part,
    disagreement_part,
    ranking_part,
    confusable_part,
    parameters_part,
    remaining_part,
    equations_part,
)
NO_MODEL = section(
    "What this report lacks",
    paragraph(
        "No model was fitted. So there is no gap, no comparison of measured and simulated, no ranking, no parameter, "
        "no residual and no equation to show."
    ),
    name="lacking",
)


def report(result: Reconciliation, *, title: str, software: str, computed: Mapping[str, str] | None = None) -> str:
    """HTML of a reconciliation.

    `software` is name and version of what computed it; `computed` whatever else it takes to compute it again, in words and in
    this order: the recordings, the rig's file, the seed, the time it took.
    """
    found = NO_MODEL if result.gap is None and result.log is None else joined(part(result) for part in FOUND)
    parts = [verdict_part(result), found, data_part(result), computed_part(result, software, computed or {})]
    head = element("head", NOTHING_ELSE, element("title", title), element("style", Html(CSS)))
    top = element("header", element("h1", title), element("p", "Simulation against measurement: what is missing?"))
    return f'<!doctype html>\n<html lang="en">{head}{element("body", top, element("main", joined(parts)))}</html>\n'
