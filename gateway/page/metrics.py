"""The metrics at `/metrics` in the Prometheus text format 0.0.4.

A measured value that is stale or not known is omitted, so that no dashboard shows an old angle as a new one.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import get_args

from gateway.messages import Alert, Condition, Health, Level, Swing
from gateway.page.verdict import STYLES, PageEvidence, is_fresh, verdict

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
Rows = Iterable[tuple[Mapping[str, str], float | int | bool | None]]


@dataclass(frozen=True, slots=True)
class Counters:
    """The counters of the page process itself."""

    received: Mapping[str, int]
    invalid: int
    clients: int
    dropped_clients: int


def format_exposition(evidence: PageEvidence, counters: Counters, labels: Mapping[str, str]) -> str:
    """Return the whole text; `labels` (site, crane, sensor) are on every sample."""
    blocks = (
        *_swing_metrics(evidence),
        *_verdict_metrics(evidence),
        *_health_metrics(evidence.get(Health)),
        *_page_metrics(evidence, counters),
    )
    lines: list[str] = []
    for name, kind, text, rows in blocks:
        samples = [_sample(name, {**labels, **extra}, value) for extra, value in rows if value is not None]
        if samples:
            lines += [f"# HELP {name} {text}", f"# TYPE {name} {kind}", *samples]
    return "\n".join(lines) + "\n"


Block = tuple[str, str, str, Rows]


def _gauge(name: str, text: str, value: float | bool | None) -> Block:
    return f"plumbline_{name}", "gauge", text, [({}, value)]


def _counter(name: str, text: str, value: int | None) -> Block:
    return f"plumbline_{name}_total", "counter", text, [({}, value)]


def _swing_metrics(evidence: PageEvidence) -> Iterator[Block]:
    swing = evidence.get(Swing)
    if swing is None or not evidence.gateway or not is_fresh(evidence, "swing"):
        return
    high = swing.coverage95_deg[1] if swing.coverage95_deg else None
    yield _gauge("swinging", "1 while the load swings, 0 when no swing is detected.", swing.swinging)
    yield _gauge("phi_max_degrees", "Largest angle between rope and vertical over the last swing.", swing.phi_max_deg)
    yield _gauge("phi_max_u_degrees", "Standard uncertainty of phi_max.", swing.u_deg)
    yield _gauge("phi_max_upper95_degrees", "Upper end of the 95 % interval of phi_max, or its upper limit.", high)
    yield _gauge("lean_degrees", "Steady lean of the rope.", swing.lean_deg)
    yield _gauge("swing_period_seconds", "Period of the swing.", swing.period_s)
    yield _gauge(
        "predicted_phi_max_degrees", "Predicted maximum of the current half swing.", swing.predicted_phi_max_deg
    )


def _verdict_metrics(evidence: PageEvidence) -> Iterator[Block]:
    alert, condition = evidence.get(Alert), evidence.get(Condition)
    word = verdict(evidence).word
    level = alert.level if alert is not None and is_fresh(evidence, "alert") else "unknown"
    yield _gauge("up", "1 while the gateway answers.", evidence.gateway)
    yield (
        "plumbline_alert_level",
        "gauge",
        "1 at the present alert level; unknown does not mean safe.",
        [({"level": each}, each == level) for each in get_args(Level)],
    )
    yield (
        "plumbline_verdict",
        "gauge",
        "1 at the verdict of the page.",
        [({"verdict": each}, each == word) for each in STYLES],
    )
    if condition is not None and is_fresh(evidence, "condition"):
        yield _gauge("trusted", "1 while the reading can be trusted.", condition.trusted)
    ages = [({"topic": topic}, round(age, 3)) for topic, age in evidence.age_s.items()]
    yield "plumbline_age_seconds", "gauge", "Time since the last new message of a topic.", ages


def _health_metrics(health: Health | None) -> Iterator[Block]:
    if health is None:
        return
    yield _counter("samples", "Samples since the gateway's start.", health.samples)
    yield _counter("lost_samples", "Samples lost since the gateway's start.", health.lost)
    yield _counter("invalid_samples", "Samples that arrived and could not be used.", health.invalid)
    yield _labelled_counter("faults", "fault", "Faults since the gateway's start that did not stop it.", health.faults)
    yield _labelled_counter("dropped_messages", "queue", "Messages dropped by a bounded queue.", health.dropped)
    yield _gauge("sample_rate_hertz", "Measured sample rate.", health.measured_rate_hz)
    yield _gauge("recording", "1 while a recording is written.", health.recording is not None)
    yield _gauge("recording_error", "1 while the recorder reports an error.", health.recording_error is not None)
    if health.drift is not None:
        error_mg = health.drift.get("norm_error_mg")
        alarm = None if error_mg is None else health.drift.get("state") == "alarm"
        yield _gauge("drift_norm_error_milligrams", "Norm at rest minus 1 g; omitted while not known.", error_mg)
        yield _gauge("drift_alarm", "1 while the norm at rest is outside its interval; omitted while not known.", alarm)
    yield _gauge("disk_free_megabytes", "Free space for recordings.", health.disk_free_mb)
    yield _gauge("gateway_cpu_percent", "Processor load of the gateway.", health.cpu_percent)
    yield _gauge("gateway_resident_megabytes", "Resident memory of the gateway.", health.resident_mb)
    yield _gauge("gateway_uptime_seconds", "Time since the gateway's start.", health.uptime_s)


def _page_metrics(evidence: PageEvidence, counters: Counters) -> Iterator[Block]:
    yield _labelled_counter("page_messages", "topic", "Messages received by the page.", counters.received)
    yield _counter("page_invalid_messages", "Messages that the page could not read.", counters.invalid)
    yield _counter("page_dropped_clients", "Browsers dropped because they were too slow.", counters.dropped_clients)
    yield _gauge("page_clients", "Connected browsers.", counters.clients)


def _labelled_counter(name: str, label: str, text: str, counts: Mapping[str, int]) -> Block:
    return f"plumbline_{name}_total", "counter", text, [({label: key}, count) for key, count in counts.items()]


def _sample(name: str, labels: Mapping[str, str], value: float | bool) -> str:
    inside = ",".join(f'{label}="{_escape(text)}"' for label, text in labels.items())
    return f"{name}{{{inside}}} {value:g}" if isinstance(value, bool) else f"{name}{{{inside}}} {value!r}"


def _escape(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
