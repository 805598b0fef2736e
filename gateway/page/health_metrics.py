"""The metrics of a gateway's own state."""

from collections.abc import Iterator, Mapping
from typing import Any

from gateway.messages import Health
from gateway.page.exposition import Family, counter, gauge, info_gauge, labelled_counter, labelled_gauge
from gateway.units import BYTES_PER_MB, DAY_S

HEALTH_STATES = ("starting", "running", "recovering", "stopping")


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
    states = {state: state == health.state for state in HEALTH_STATES}
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
