"""The metrics at `/metrics`, in the Prometheus text format 0.0.4: families of samples with labels.

A measured value that is stale or not known is omitted, so that no dashboard shows an old one.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from math import inf
from typing import Any, Literal, get_args

from gateway.messages import Alert, Calibration, CalibrationStatus, Condition, Health, HealthState, Level, Motion, Swing
from gateway.messages.calibration import created_utc
from gateway.page.verdict import STYLES, PageEvidence, is_fresh, verdict
from gateway.pipeline.alert_rules import RULE_NAMES
from gateway.units import BYTES_PER_MB, DAY_S

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
METRIC_PREFIX = "plumbline_"
Value = float | int | bool | None
"""None: not known, and left out."""
Labels = Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Family:
    """All samples of one metric."""

    name: str
    kind: Literal["gauge", "counter"]
    text: str
    samples: tuple[tuple[Labels, Value], ...]


def gauge(name: str, text: str, value: Value) -> Family:
    """Return a gauge without labels."""
    return Family(METRIC_PREFIX + name, "gauge", text, (({}, value),))


def labelled_gauge(name: str, label: str, text: str, values: Mapping[str, Value]) -> Family:
    """Return a gauge with one sample for each value of a label."""
    return Family(METRIC_PREFIX + name, "gauge", text, tuple(({label: key}, value) for key, value in values.items()))


def state_gauge(name: str, label: str, text: str, states: Sequence[str], present: str) -> Family:
    """Return a gauge that is 1 at the present state and 0 at the others."""
    return labelled_gauge(name, label, text, {state: state == present for state in states})


def info_gauge(name: str, text: str, labels: Labels) -> Family:
    """Return a gauge that is always 1 and states its labels."""
    return Family(f"{METRIC_PREFIX}{name}_info", "gauge", text, ((labels, 1),))


def counter(name: str, text: str, value: int | None) -> Family:
    """Return a counter without labels."""
    return Family(f"{METRIC_PREFIX}{name}_total", "counter", text, (({}, value),))


def labelled_counter(name: str, label: str, text: str, counts: Mapping[str, int]) -> Family:
    """Return a counter with one sample for each value of a label."""
    samples = tuple(({label: key}, count) for key, count in counts.items())
    return Family(f"{METRIC_PREFIX}{name}_total", "counter", text, samples)


def with_labels(families: Iterable[Family], labels: Labels) -> Iterator[Family]:
    """Add labels to every sample."""
    for family in families:
        samples = tuple(({**labels, **own}, value) for own, value in family.samples)
        yield replace(family, samples=samples)


def render(families: Iterable[Family]) -> str:
    """Return the text; families of one name become one group, as the format demands. Unknown values are left out."""
    groups: dict[str, Family] = {}
    for family in families:
        before = groups.get(family.name)
        groups[family.name] = family if before is None else replace(before, samples=(*before.samples, *family.samples))
    lines: list[str] = []
    for family in groups.values():
        samples = [_sample(family.name, labels, value) for labels, value in family.samples if value is not None]
        if samples:
            lines += [f"# HELP {family.name} {family.text}", f"# TYPE {family.name} {family.kind}", *samples]
    return "\n".join(lines) + "\n"


def _sample(name: str, labels: Labels, value: float | bool) -> str:
    inside = ",".join(f'{label}="{_escape(text)}"' for label, text in labels.items())
    return f"{name}{{{inside}}} {value:g}" if isinstance(value, bool) else f"{name}{{{inside}}} {value!r}"


def _escape(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


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


def health_families(health: Health | None) -> Iterator[Family]:
    """Yield the metrics of the health message."""
    if health is None:
        return
    yield from _identity_families(health)
    yield from _sample_families(health)
    yield from _resource_families(health)
    yield from _drift_families(health.drift)
    yield from _radio_families(health)


def _identity_families(health: Health) -> Iterator[Family]:
    identity = {"version": health.software, "device_kind": health.device_kind, "device_id": health.device_id or ""}
    yield info_gauge("gateway", "Software and sensor of the gateway.", identity)
    yield gauge("gateway_uptime_seconds", "Time since the gateway's start.", health.uptime_s)
    states = {state: state == health.state for state in get_args(HealthState)}
    yield labelled_gauge("gateway_state", "state", "1 at the state of the gateway.", states)


def _sample_families(health: Health) -> Iterator[Family]:
    yield counter("samples", "Samples since the gateway's start.", health.samples)
    yield counter("lost_samples", "Samples lost since the gateway's start.", health.lost)
    yield counter("invalid_samples", "Samples that arrived and could not be used.", health.invalid)
    yield gauge("sample_rate_hertz", "Measured sample rate.", health.measured_rate_hz)
    yield labelled_counter("faults", "fault", "Faults since the gateway's start that did not stop it.", health.faults)
    standing = dict.fromkeys(health.standing_faults, 1)
    yield labelled_gauge(
        "part_faulty", "part", "1 for each part of the gateway that does not work at present.", standing
    )
    yield labelled_counter("dropped_messages", "queue", "Messages dropped by a bounded queue.", health.dropped)
    yield labelled_counter("refused_requests", "kind", "Requests that were refused.", health.refused)
    latency_ms = {name: value for name, value in (health.alert_latency_ms or {}).items() if name != "count"}
    yield labelled_gauge(
        "alert_latency_seconds",
        "statistic",
        "From the newest sample to the sending of the change of an alert, over the last hour.",
        {name: value / 1e3 for name, value in latency_ms.items()},
    )


def _resource_families(health: Health) -> Iterator[Family]:
    yield gauge("recording", "1 while a recording is written.", health.recording is not None)
    yield gauge("recording_error", "1 while the recorder reports an error.", health.recording_error is not None)
    yield gauge("disk_free_bytes", "Free space for recordings.", _scaled(health.disk_free_mb, BYTES_PER_MB))
    yield gauge("gateway_cpu_ratio", "Processor time of the gateway; 1 is one core.", _scaled(health.cpu_percent, 0.01))
    yield gauge(
        "gateway_resident_memory_bytes", "Resident memory of the gateway.", _scaled(health.resident_mb, BYTES_PER_MB)
    )
    changed = None if health.changed_limits is None else len(health.changed_limits)
    yield gauge("changed_limits", "Limits of the alerts that are not as they were at commissioning.", changed)
    text = "Time until the bus certificate of the gateway expires, in whole days."
    yield gauge("certificate_remaining_seconds", text, _scaled(health.certificate_days_left, DAY_S))
    if health.relay is not None:
        yield gauge(
            "relay_energised", "1 while the relay is energised, because all is well.", health.relay == "energised"
        )
        yield gauge("relay_failed", "1 while the relay cannot be switched.", health.relay == "failed")


def _drift_families(drift: Mapping[str, Any] | None) -> Iterator[Family]:
    error_mg = None if drift is None else drift.get("norm_error_mg")
    if drift is None or not isinstance(error_mg, int | float):
        return
    text = "Norm at rest minus 1 g, in g; omitted while not known."
    yield gauge("drift_norm_error_g", text, error_mg / 1e3)
    alarm = drift.get("state") == "alarm"
    yield gauge("drift_alarm", "1 while the norm at rest is outside its interval; omitted while not known.", alarm)


def _radio_families(health: Health) -> Iterator[Family]:
    yield gauge("battery_ratio", "Charge of the sensor's battery, 0 to 1.", _scaled(health.battery_percent, 0.01))
    yield gauge("battery_volts", "Voltage of the sensor's battery.", health.battery_v)
    yield gauge("battery_low", "1 while the battery is below the sensor's limit.", health.battery_low)
    yield gauge("signal_dbm", "Received power of a wireless sensor, in dBm.", health.signal_dbm)


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor
