"""The metrics at `/metrics`. A measured value that is stale or not known is omitted, so that no dashboard shows an old one."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from math import inf
from typing import get_args

from gateway.messages import Alert, Calibration, CalibrationStatus, Condition, Health, Level, Motion, Swing
from gateway.messages.calibration import created_utc
from gateway.page.exposition import (
    Family,
    counter,
    gauge,
    info_gauge,
    labelled_counter,
    labelled_gauge,
    render,
    state_gauge,
    with_labels,
)
from gateway.page.health_metrics import health_families
from gateway.page.verdict import STYLES, PageEvidence, is_fresh, verdict
from gateway.pipeline.alert_rules import RULE_NAMES


@dataclass(frozen=True, slots=True)
class Counters:
    """The counters of the page process itself."""

    received: Mapping[str, int]
    invalid: int
    clients: int
    dropped_clients: int


def format_exposition(evidence: PageEvidence, counters: Counters, labels: Mapping[str, str]) -> str:
    """Return the metrics of a gateway and of its page; `labels` (site, crane, sensor) are on every sample."""
    return render(with_labels(chain(gateway_families(evidence), _page_families(counters)), labels))


def gateway_families(evidence: PageEvidence) -> Iterator[Family]:
    """Yield the metrics of one gateway."""
    yield from _swing_families(evidence)
    yield from _verdict_families(evidence)
    yield from _alert_families(evidence)
    yield from _calibration_families(evidence.get(Calibration))
    yield from health_families(evidence.get(Health))


def _swing_families(evidence: PageEvidence) -> Iterator[Family]:
    if evidence.doubt is not None:
        return
    motion, swing = evidence.get(Motion), evidence.get(Swing)
    if motion is not None and evidence.gateway and evidence.age_s.get("motion", inf) <= evidence.stale_s:
        yield gauge("rope_angle_degrees", "Angle between rope and vertical.", motion.angle_deg)
        yield gauge("rope_angle_u_degrees", "Standard uncertainty of the rope angle.", motion.u_deg)
    if swing is None or not evidence.gateway or not is_fresh(evidence, "swing"):
        return
    high = swing.coverage95_deg[1] if swing.coverage95_deg else None
    yield gauge("swinging", "1 while the load swings, 0 when no swing is detected.", swing.swinging)
    yield gauge("phi_max_degrees", "Largest angle between rope and vertical over the last swing.", swing.phi_max_deg)
    yield gauge("phi_max_u_degrees", "Standard uncertainty of phi_max.", swing.u_deg)
    yield gauge("phi_max_upper95_degrees", "Upper end of the 95 % interval of phi_max, or its upper limit.", high)
    yield gauge("lean_degrees", "Steady lean of the rope.", swing.lean_deg)
    yield gauge("swing_period_seconds", "Period of the swing.", swing.period_s)
    yield gauge(
        "predicted_phi_max_degrees", "Predicted maximum of the current half swing.", swing.predicted_phi_max_deg
    )


def _verdict_families(evidence: PageEvidence) -> Iterator[Family]:
    condition = evidence.get(Condition)
    yield gauge("up", "1 while the gateway is alive.", evidence.gateway)
    yield gauge("authenticated", "1 while its messages are signed with its key, and fresh.", evidence.doubt is None)
    yield state_gauge("verdict", "verdict", "1 at the verdict of the page.", tuple(STYLES), verdict(evidence).word)
    if condition is not None and evidence.gateway and is_fresh(evidence, "condition"):
        yield gauge("trusted", "1 while the reading can be trusted.", condition.trusted)
        yield gauge(
            "clock_synchronised", "1 while the gateway's clock is synchronised.", condition.clock == "synchronised"
        )
    ages = {topic: round(age, 3) for topic, age in evidence.age_s.items()}
    yield labelled_gauge("age_seconds", "topic", "Time since the last new message of a topic.", ages)


def _alert_families(evidence: PageEvidence) -> Iterator[Family]:
    alert = evidence.get(Alert)
    present: Alert | None = alert if evidence.gateway and is_fresh(evidence, "alert") else None
    if present is not None and evidence.doubt is not None and present.level == "normal":
        present = None
    levels, text = get_args(Level), "1 at the present alert level; unknown does not mean safe."
    yield state_gauge("alert_level", "level", text, levels, "unknown" if present is None else present.level)
    active = {} if present is None else {each.rule: each for each in present.active}
    usual: Level = "unknown" if present is None else "normal"
    for rule in dict.fromkeys((*RULE_NAMES, *active)):
        level = active[rule].level if rule in active else usual
        states = state_gauge("alert_rule_level", "level", "1 at the present level of an alert rule.", levels, level)
        yield from with_labels([states], {"rule": rule})
    if present is None:
        return
    open_rules = {rule: each for rule, each in active.items() if each.incident is not None}
    yield labelled_gauge(
        "incident_open",
        "rule",
        "1 while an incident of a rule is open.",
        {rule: rule in open_rules for rule in RULE_NAMES},
    )
    yield labelled_gauge(
        "incident_acknowledged",
        "rule",
        "1 while a person has acknowledged the open incident.",
        {rule: each.acknowledged_by is not None for rule, each in open_rules.items()},
    )
    yield counter(
        "alert_changes", "Number of the last change of an alert, which continues over restarts.", present.alert_number
    )


def _calibration_families(calibration: Calibration | None) -> Iterator[Family]:
    if calibration is None:
        return
    statuses = get_args(CalibrationStatus)
    yield state_gauge(
        "calibration_status", "status", "1 at the status of the calibration.", statuses, calibration.status
    )
    yield info_gauge(
        "calibration",
        "Identity of the calibration record in force and of its device.",
        {"id": calibration.calibration_id or "", "device_id": calibration.device_id},
    )
    yield gauge("alerts_suspended", "1 while a recalibration suspends the alerts.", calibration.session.suspended)
    created = created_utc(calibration)
    text = "When the calibration record in force was made, in seconds since 1970."
    yield gauge("calibration_created_timestamp_seconds", text, None if created is None else created.timestamp())


def _page_families(counters: Counters) -> Iterator[Family]:
    yield labelled_counter("page_messages", "topic", "Messages received by the page.", counters.received)
    yield counter("page_invalid_messages", "Messages that the page could not read.", counters.invalid)
    yield counter("page_dropped_clients", "Browsers dropped because they were too slow.", counters.dropped_clients)
    yield gauge("page_clients", "Connected browsers.", counters.clients)
