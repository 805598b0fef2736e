"""The uncertainty budget (GUM 5 and 8): its largest contributions and their sum."""

import math

from gateway.calibration.record import BudgetEntry, CalibrationRecord
from gateway.documents.format import format_short

MAX_BUDGET_ROWS = 7
"""Basis: a choice; the table stays on one page."""
NEGLIGIBLE_CONTRIBUTION = 1e-6
"""mg or degrees: digits below say nothing. Basis: a choice; no sensor is good to a millionth."""


def largest_contributions(record: CalibrationRecord) -> list[BudgetEntry]:
    """Return the contributions in the order of the record; where there are more than fit, the largest first."""
    if len(record.budget) <= MAX_BUDGET_ROWS:
        return record.budget
    return sorted(record.budget, key=lambda entry: entry.u_g, reverse=True)[:MAX_BUDGET_ROWS]


def combined_uncertainty(record: CalibrationRecord) -> tuple[float, float]:
    """Return the root of the sum of squares of all contributions, in g and degrees."""
    return math.hypot(*(entry.u_g for entry in record.budget)), math.hypot(*(entry.u_deg for entry in record.budget))


def format_contribution(value: float) -> str:
    """Return an uncertainty in mg or degrees."""
    return f"< {NEGLIGIBLE_CONTRIBUTION:g}" if 0 < value < NEGLIGIBLE_CONTRIBUTION else format_short(value)
