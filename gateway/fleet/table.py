"""The list of gateways as text. Everything that came over the bus is printed without control characters."""

from collections import Counter
from collections.abc import Sequence

from gateway.documents.format import printable_text
from gateway.fleet.gateway_status import STATE_LABELS, GatewayStatus
from gateway.units import DAY_S, HOUR_S, MINUTE_S

TABLE_HEADER = ("gateway", "state", "level", "swing", "battery", "signal", "calibrated", "seen", "software", "why")
MAX_COLUMN_CHARACTERS = 48
"""Basis: a choice; columns stay side by side in a terminal."""
MAX_REASON_CHARACTERS = 160
"""Basis: a choice; a sentence, in the last column."""
UNKNOWN_CELL = "-"


def summary_line(statuses: Sequence[GatewayStatus], failing: Sequence[GatewayStatus]) -> str:
    """Return one line: how many gateways there are, and what is wrong."""
    if not statuses:
        return "no gateway"
    counts = Counter(status.state for status in statuses)
    states = ", ".join(f"{counts[word]} {label}" for word, label in STATE_LABELS.items() if counts[word])
    verdict = "all well" if not failing else f"{len(failing)} not well"
    return f"{len(statuses)} {'gateway' if len(statuses) == 1 else 'gateways'}, {verdict}: {states}"


def format_table(statuses: Sequence[GatewayStatus]) -> list[str]:
    """Return the lines of the table, the header first."""
    rows = [TABLE_HEADER, *(_row(status) for status in statuses)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(TABLE_HEADER) - 1)]
    return ["  ".join((*map(str.ljust, row, widths), row[-1])).rstrip() for row in rows]


def _row(status: GatewayStatus) -> tuple[str, ...]:
    return (
        printable_text(status.name, MAX_COLUMN_CHARACTERS),
        status.label,
        status.level,
        _swing(status),
        _battery(status),
        UNKNOWN_CELL if status.signal_dbm is None else f"{status.signal_dbm:.0f} dBm",
        _calibration(status),
        UNKNOWN_CELL if status.seen_s is None else format_age(status.seen_s),
        UNKNOWN_CELL if status.software is None else printable_text(status.software, MAX_COLUMN_CHARACTERS),
        printable_text("; ".join(status.reasons), MAX_REASON_CHARACTERS),
    )


def _swing(status: GatewayStatus) -> str:
    swing = status.swing
    if swing is None:
        return UNKNOWN_CELL
    if swing.phi_max_deg is not None:
        return f"{swing.phi_max_deg:.2f} deg" + ("" if swing.u_deg is None else f" u {swing.u_deg:.2f}")
    return UNKNOWN_CELL if swing.upper95_deg is None else f"< {swing.upper95_deg:.2f} deg"


def _battery(status: GatewayStatus) -> str:
    if status.battery_percent is not None:
        return f"{status.battery_percent:.0f} %"
    return UNKNOWN_CELL if status.battery_v is None else f"{status.battery_v:.2f} V"


def _calibration(status: GatewayStatus) -> str:
    if status.calibration_age_days is not None:
        return f"{max(status.calibration_age_days, 0.0):.0f} d ago"
    return UNKNOWN_CELL if status.calibration is None else status.calibration.replace("_", " ")


def format_age(age_s: float) -> str:
    """Return a time that has passed, in the largest fitting unit."""
    for unit_s, unit in ((DAY_S, "d"), (HOUR_S, "h"), (MINUTE_S, "min")):
        if age_s >= 2 * unit_s:
            return f"{age_s / unit_s:.0f} {unit}"
    return f"{age_s:.0f} s"
