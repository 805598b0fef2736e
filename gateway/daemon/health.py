"""The health message, and the counters of the samples and of the radio that it states beside those of the threads."""

import logging
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import msgspec

from devices.block import DeviceInfo, RadioStatus, SampleBlock
from devices.device import Device
from gateway import __version__
from gateway.daemon.commands.configuration_service import ConfigurationService
from gateway.daemon.commands.handlers import AcknowledgementService
from gateway.daemon.commands.rpc_server import RpcServer
from gateway.daemon.commands.security import SecurityLog
from gateway.daemon.commands.worker import CommandWorker
from gateway.daemon.outputs.bus_connection import SILENT_CONNECTIONS
from gateway.daemon.outputs.page_channel import PageChannel
from gateway.daemon.outputs.publisher import AlertSender, Publisher
from gateway.daemon.runtime.host import CpuMeter, resident_mb
from gateway.daemon.runtime.logs import LineWriter
from gateway.daemon.runtime.worker import FaultRegister, Worker
from gateway.daemon.sampling.sampler import Sampler
from gateway.daemon.storage.calibration_provider import DriftStateStore
from gateway.daemon.storage.recording_worker import TIME_STAMPS, RecordingWorker
from gateway.messages import Health, HealthState
from gateway.pipeline.alert_rules import SWING
from gateway.pipeline.outgoing_message import Header

if TYPE_CHECKING:
    from gateway.daemon.commands.site_certificates import SiteCertificates  # its library is an extra
    from gateway.daemon.outputs.relay_worker import RelayWorker


log = logging.getLogger("plumbline.device")
MAX_REPORT_AGE_S = 30.0
"""An older report says nothing about the present. Basis: a choice; several reports of a sensor, and less than a person's
patience."""
WARNING_PERIOD_S = 3600.0
"""A battery near its limit is low now and then. Basis: one warning an hour is enough."""
RATE_WINDOW = 60
"""The rate is computed over this many messages, one per second. Basis: a choice; a minute shows a rate to 0.1 % and a change
soon."""
CAUSED_BY_ANYBODY = {SILENT_CONNECTIONS, TIME_STAMPS}
"""Faults that somebody can cause who has no right to anything: by connections to the bus, by cutting an authority off."""
NO_SAMPLES_S = 2.0
"""A gateway without a new sample for this long is not healthy. Basis: a choice; longer than a restart of a device that returns
(`sampler.MAX_REOPENING_PAUSE_S`) and twice the health's period."""


class RadioMonitor:
    """Keeps the latest report of each quantity until it is stale; a low battery is a warning in the log."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._reports: dict[str, tuple[float, Any]] = {}
        self._warned_s = float("-inf")

    def add(self, status: RadioStatus) -> None:
        """Keep what is reported; what is not reported stays as it was."""
        now_s = self._now_s()
        # one assignment: another thread reads
        self._reports = self._reports | {
            name: (now_s, value) for name, value in asdict(status).items() if value is not None
        }
        if status.battery_low and now_s - self._warned_s >= WARNING_PERIOD_S:
            self._warned_s = now_s
            voltage = "" if status.battery_v is None else f" ({status.battery_v:.2f} V)"
            log.warning("the sensor's battery is low%s; charge or change it", voltage)

    def status(self) -> RadioStatus:
        """Return the reports that are not stale."""
        oldest_s = self._now_s() - MAX_REPORT_AGE_S
        return RadioStatus(**{name: value for name, (time_s, value) in self._reports.items() if time_s >= oldest_s})


@dataclass(slots=True)
class SampleCounters:
    """What has passed the processor since start."""

    samples: int = 0
    newest_ns: int | None = None
    """Gateway time of the newest sample."""
    lost: int = 0
    invalid: int = 0
    radio: RadioMonitor = field(default_factory=RadioMonitor)

    def add(self, block: SampleBlock) -> None:
        """Count a block."""
        self.samples += len(block)
        self.newest_ns = int(block.time_ns[-1])
        self.lost += block.lost
        self.invalid += block.invalid
        if block.radio is not None:
            self.radio.add(block.radio)


@dataclass(slots=True)
class HealthReporter:
    """Reads the counters of the threads and makes the health message."""

    device: Device
    device_kind: str
    sampler: Sampler
    counters: SampleCounters
    drift_store: DriftStateStore
    commands: CommandWorker
    acknowledgements: AcknowledgementService
    rpc: RpcServer
    security_log: SecurityLog
    certificates: "SiteCertificates | None"
    changes: ConfigurationService
    recording: RecordingWorker
    publisher: Publisher
    alerts: AlertSender
    page: PageChannel
    relay: "RelayWorker | None"
    workers: tuple[Worker[Any], ...]
    """Those whose defects are counted."""
    output: LineWriter
    faults: FaultRegister
    boot_id: str
    page_url: str | None
    stopping: bool = False
    _cpu: CpuMeter = field(default_factory=CpuMeter)
    _started_s: float = field(default_factory=time.monotonic)
    _history: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=RATE_WINDOW))
    """(time of the newest sample, number of samples) at each of the last messages."""
    _last_samples: tuple[int, float] = (0, 0.0)
    """Number of samples, and when it last changed."""

    def make(self, header: Header, info: DeviceInfo | None) -> Health:
        """Return the present state of the gateway."""
        counters, path, standing = self.counters, self.recording.path, self.faults.standing
        return Health(
            **header,
            state=self._state(),
            device_id=None if info is None else info.device_id,
            device_kind=self.device_kind if info is None else info.kind,
            boot_id=self.boot_id,
            software=__version__,
            uptime_s=time.monotonic() - self._started_s,
            measured_rate_hz=self._rate_hz(),
            samples=counters.samples,
            lost=counters.lost + self.sampler.lost_in_queue,
            invalid=counters.invalid,
            faults=self._faults(),
            dropped={
                "blocks": self.sampler.blocks.dropped,
                "recording": self.recording.inbox.dropped,
                "bus": self.publisher.inbox.dropped + self.alerts.inbox.dropped + self.alerts.not_sent,
                "page": self.page.dropped,
                "commands": self.commands.inbox.dropped,
                "requests": self.commands.requests.dropped
                + self.acknowledgements.requests.dropped
                + self.rpc.inbox.dropped,
                "log": self.output.dropped,
            },
            standing_faults=standing,
            refused=dict(self.security_log.counts),
            page=self.page_url,
            certificate_days_left=None if self.certificates is None else self.certificates.expires_in_days,
            changed_limits=self.changes.changed_limits,
            recording=None if path is None else str(path),
            recording_error=standing.get("recording"),
            newest_statement=self.recording.newest_statement,
            disk_free_mb=self.recording.disk_free_mb,
            cpu_percent=self._cpu.percent(),
            resident_mb=resident_mb(),
            alert_latency_ms=self.alerts.latency_ms(),
            drift=self.drift_store.monitor.status_json,
            offer=self.commands.offer,
            **asdict(counters.radio.status()),
            relay=None if self.relay is None else self.relay.state,
            relay_reason=None if self.relay is None else self.relay.reason,
        )

    def find_problem(self, now_s: float) -> str | None:
        """Return what keeps the gateway from being healthy: no samples, no alerts, a part that does not work; None: it is.

        What anybody can cause does not count (`CAUSED_BY_ANYBODY`): he would keep every configuration from being confirmed.
        """
        samples, since_s = self._last_samples
        if self.counters.samples != samples:
            self._last_samples = (self.counters.samples, now_s)
        if self.sampler.recovering or samples == 0 or now_s - since_s > NO_SAMPLES_S:
            return "no samples arrive from the device"
        standing = [text for part, text in self.faults.standing.items() if part not in CAUSED_BY_ANYBODY]
        return next(iter(standing), None) or unable_to_alert(self.publisher.latest().get("alert"))

    def _state(self) -> HealthState:
        if self.stopping:
            return "stopping"
        return "recovering" if self.sampler.recovering else "running"

    def _faults(self) -> dict[str, int]:
        own: dict[str, int] = {
            "device_reopened": self.sampler.reopened,
            "alerts_not_stored": self.alerts.sent_unstored,
            "samples_not_recorded": self.recording.samples_lost,
            "messages_not_writable": self.recording.unwritable,
            "segments_vanished": self.recording.vanished,
            "segments_not_deleted": self.recording.undeletable,
            "security_log_not_written": self.security_log.write_failures,
        }
        if self.relay is not None:
            own |= self.relay.faults
        defects = {f"{worker.name}_defects": worker.defects for worker in self.workers}
        counts = {**self.device.faults, **own, **self.faults.counts, **defects}
        return {name: count for name, count in counts.items() if count}

    def _rate_hz(self) -> float | None:
        """Return the sample rate of the last minute by the sample times; lost samples count, for the device took them."""
        counters = self.counters
        if counters.newest_ns is None or (self._history and self._history[-1][0] == counters.newest_ns):
            return None
        self._history.append((counters.newest_ns, counters.samples + counters.lost))
        (first_ns, first_count), (last_ns, last_count) = self._history[0], self._history[-1]
        return None if last_ns <= first_ns else (last_count - first_count) / ((last_ns - first_ns) / 1e9)


def unable_to_alert(payload: bytes | None) -> str | None:
    """Return why an alert could not be raised now, by the last message of the alerts; None: it could."""
    if payload is None:
        return "no alert message yet"
    alert = msgspec.json.decode(payload)
    if alert["validity"] in ("no_samples", "suspended"):
        return f"alerts cannot be raised: {alert['text']}"
    swing = [each for each in alert["active"] if each["rule"] == SWING.name]
    if alert["validity"] == "not_known" or any(each["level"] == "unknown" for each in swing):
        return f"the angle is not known: {alert['text']}"
    return None
