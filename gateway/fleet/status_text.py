"""The state of one gateway as a page of text for a person. What came over the bus is printed without control characters."""

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

import msgspec

from gateway.bus.authenticity import Doubt
from gateway.bus.fleet_inbox import FleetArrival, FleetBatch
from gateway.documents.format import printable_text
from gateway.fleet.fleet_state import FleetState
from gateway.fleet.gateway_status import GatewayStatus
from gateway.fleet.report import format_age
from gateway.messages import Alert, Calibration, Condition, Health, Message, Motion, Swing
from gateway.topics import TOPICS

MAX_STATUS_CHARACTERS = 200
"""Basis: a choice; a wide terminal, and no page of hostile text."""
NAME_WIDTH = 12
"""Basis: a choice; names of cranes are shorter, and longer ones push their line."""
CLOCK_S = 5.0
"""Difference of two clocks that is worth a word. Basis: a message is at most a second or two old."""


def judge_answer(
    key: str, topics: Mapping[str, Any], doubt: Doubt | None, now_s: float, now_utc: datetime
) -> tuple[GatewayStatus, Mapping[str, Message]]:
    """Return the status that a gateway's answer shows, and the valid messages in it; the others are left out."""
    fleet = FleetState()
    payloads = {topic: msgspec.json.encode(content) for topic, content in topics.items() if topic in TOPICS}
    arrivals = {
        (key, topic): FleetArrival(payload, now_s, live=True, doubt=doubt) for topic, payload in payloads.items()
    }
    fleet.receive(FleetBatch(arrivals, {key: True}, {} if doubt is None else {key: (doubt, now_s)}))
    (status,) = fleet.statuses(now_s, now_utc)
    return status, fleet.messages(key)


def status_lines(
    status: GatewayStatus, messages: Mapping[str, Message], drift: Mapping[str, str], now_utc: datetime
) -> list[str]:
    """Return the lines: the state with its reasons, then what is known, by subject."""
    lines = [f"{status.name}: {status.label}", *_entries("why", status.reasons)]
    for message in (
        messages.get(topic) for topic in ("motion", "swing", "condition", "alert", "calibration", "health")
    ):
        match message:
            case Motion():
                lines += _entries("motion", [message.text])
            case Swing():
                lines += _entries("swing", [_swing_text(message)])
            case Condition():
                lines += _entries("condition", ["; ".join([message.verdict, *message.reasons])])
            case Alert():
                lines += _entries("alerts", [message.text])
            case Calibration():
                lines += _entries("calibration", [_calibration_text(message, status)])
                lines += _entries("drift", [f"at rest {drift['at_rest']}", f"by records {drift['by_records']}"])
            case Health():
                if message.offer is not None:
                    put = f"put it in force: plumbline remote rollback --to {message.offer.record} --by NAME"
                    lines += _entries("offered", [message.offer.text, put])
                lines += _health_lines(message, now_utc)
    return [printable_text(line, MAX_STATUS_CHARACTERS) for line in lines]


def _entries(name: str, texts: "Iterator[str] | list[str] | tuple[str, ...]") -> list[str]:
    return [f"  {name if number == 0 else '':<{NAME_WIDTH}} {text}" for number, text in enumerate(texts)]


def _swing_text(swing: Swing) -> str:
    if swing.swinging is None:
        return "; ".join(["not known", *swing.reasons])
    if not swing.swinging:
        upper = "" if swing.coverage95_deg is None else f", below {swing.coverage95_deg[1]:.2f} deg"
        return f"no swing{upper}"
    largest = "not known" if swing.phi_max_deg is None else f"{swing.phi_max_deg:.2f} deg"
    u = "" if swing.u_deg is None else f", standard uncertainty {swing.u_deg:.2f}"
    period = "" if swing.period_s is None else f", period {swing.period_s:.2f} s"
    return f"largest angle {largest}{u}{period}"


def _calibration_text(calibration: Calibration, status: GatewayStatus) -> str:
    age = "" if status.calibration_age_days is None else f", {max(status.calibration_age_days, 0.0):.0f} days old"
    session = "" if calibration.session.phase == "idle" else f"; recalibration: {calibration.session.text}"
    return f"{calibration.text}{age}{session}"


def _health_lines(health: Health, now_utc: datetime) -> list[str]:
    rate = "rate not known" if health.measured_rate_hz is None else f"{health.measured_rate_hz:.1f} Hz"
    age_s = now_utc.replace(tzinfo=now_utc.tzinfo or UTC).timestamp() - health.time_ns / 1e9
    radio = [
        f"battery {health.battery_percent:.0f} %" if health.battery_percent is not None else "",
        f"battery {health.battery_v:.2f} V" if health.battery_v is not None else "",
        f"signal {health.signal_dbm:.0f} dBm" if health.signal_dbm is not None else "",
    ]
    recording = health.recording_error or health.recording or "not recording"
    free = "" if health.disk_free_mb is None else f"; {health.disk_free_mb:,.0f} MB free"
    counts = {**health.faults, **{f"{queue} dropped": count for queue, count in health.dropped.items() if count}}
    faults = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in counts.items())
    lines = _entries(
        "device",
        [
            f"{health.device_kind} {health.device_id or ''}, {rate}; {health.samples:,} samples, {health.lost:,} lost, "
            f"{health.invalid:,} invalid",
            *(["; ".join(filter(None, radio))] if any(radio) else []),
        ],
    )
    lines += _entries("faults", [faults or "none"])
    lines += _entries("recording", [f"{recording}{free}"])
    clock = f"; its clock differs from this one by {age_s:+.0f} s" if abs(age_s) > CLOCK_S else ""
    lines += _entries(
        "gateway", [f"plumbline {health.software}, {health.state} for {format_age(health.uptime_s)}{clock}"]
    )
    return lines
