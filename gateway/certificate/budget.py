"""The uncertainty budget (GUM 5 and 8): contributions, combined, expanded."""

import math
from xml.etree.ElementTree import Element

from gateway.calibration.record import CalibrationRecord
from gateway.certificate.element import Content, element, short, table
from gateway.certificate.figures import COVERAGE_FACTOR, significant

MOST_ROWS = 7
SOURCE = 36
NEGLIGIBLE = 1e-6
"""mg or degrees: digits below say nothing."""


def budget(record: CalibrationRecord) -> Element:
    """The rows of the record, the largest first where there are more than fit, and the root of the sum of squares of all."""
    title = element("h2", "Uncertainty of a corrected reading")
    if not record.budget:
        return element("section", title, element("p", "The record states no budget.", class_="missing"))
    rows = record.budget
    if len(rows) > MOST_ROWS:
        rows = sorted(rows, key=lambda row: row.u_g, reverse=True)[:MOST_ROWS]
    shown: list[list[Content]] = [[short(row.source, SOURCE), row.type, *_figures(row.u_g, row.u_deg)] for row in rows]
    if left := len(record.budget) - len(rows):
        shown.append([f"{left} smaller ones, counted below", "", "", ""])
    combined_g = math.hypot(*(row.u_g for row in record.budget))
    combined_deg = math.hypot(*(row.u_deg for row in record.budget))
    shown.append(["combined, u", "", *_figures(combined_g, combined_deg)])
    shown.append(["expanded, U (k = 2)", "", *_figures(COVERAGE_FACTOR * combined_g, COVERAGE_FACTOR * combined_deg)])
    made = table(["source", "type", "u / mg", "u / °"], shown, "numbers budget")
    return element("section", title, made)


def _figures(u_g: float, u_deg: float) -> list[Content]:
    return [_figure(1000 * u_g), _figure(u_deg)]


def _figure(value: float) -> str:
    return f"< {NEGLIGIBLE:g}" if 0 < value < NEGLIGIBLE else significant(value)
