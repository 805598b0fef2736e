"""The health message: what every thread has counted, in one place."""

import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from devices.device import Device
from gateway import __version__
from gateway.daemon.processor import Counts, Processor
from gateway.daemon.publisher import Publisher
from gateway.daemon.recording_worker import RecordingWorker
from gateway.daemon.resources import CpuMeter, disk_free_mb, resident_mb
from gateway.daemon.sampler import Sampler
from gateway.messages import Health
from gateway.pipeline.header import Header

RATE_WINDOW = 60
"""Messages, one a second, over which the rate is taken."""


@dataclass(slots=True)
class HealthReport:
    """Reads the threads' counters; makes one message at a time."""

    device: Device
    sampler: Sampler
    processor: Processor
    recording: RecordingWorker
    publisher: Publisher
    data_dir: Path
    boot_id: str
    stopping: bool = False
    _cpu: CpuMeter = field(default_factory=CpuMeter)
    _started_s: float = field(default_factory=time.monotonic)
    _passed: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=RATE_WINDOW))
    """(time of the newest sample, samples up to it) at each of the last messages."""

    def make(self, header: Header) -> Health:
        """How the gateway is now."""
        counts, path = self.processor.counts, self.recording.path
        return Health(
            **header,
            state=self._state(),
            device_id=self.processor.info.device_id,
            device_kind=self.processor.info.kind,
            boot_id=self.boot_id,
            software=__version__,
            uptime_s=time.monotonic() - self._started_s,
            measured_rate_hz=self._rate_hz(counts),
            samples=counts.samples,
            lost=counts.lost + self.sampler.lost_in_queue,
            invalid=counts.invalid,
            faults=self._faults(),
            dropped={
                "blocks": self.processor.inbox.dropped,
                "recording": self.recording.inbox.dropped,
                "bus": self.publisher.inbox.dropped,
                "requests": self.processor.requests_dropped,
            },
            recording=None if path is None else str(path),
            recording_error=self.recording.error,
            disk_free_mb=disk_free_mb(self.data_dir),
            cpu_percent=self._cpu.percent(),
            resident_mb=resident_mb(),
            drift=self.processor.drift.rest.told,
        )

    def _state(self) -> Literal["running", "recovering", "stopping"]:
        if self.stopping:
            return "stopping"
        return "recovering" if self.sampler.recovering else "running"

    def _faults(self) -> dict[str, int]:
        own: Mapping[str, int] = {
            "device_reopened": self.sampler.reopened,
            "recording_failures": self.recording.failures,
            "samples_not_recorded": self.recording.samples_lost,
            "messages_not_writable": self.recording.unwritable,
        }
        counted = {**self.device.faults, **own}
        return {name: count for name, count in counted.items() if count}

    def _rate_hz(self, counts: Counts) -> float | None:
        """By the sample times of the last minute, which follow the part's own clock; lost samples were measured too."""
        if counts.newest_ns is None or (self._passed and self._passed[-1][0] == counts.newest_ns):
            return None
        self._passed.append((counts.newest_ns, counts.samples + counts.lost))
        (first_ns, before), (last_ns, now) = self._passed[0], self._passed[-1]
        return None if last_ns <= first_ns else (now - before) / ((last_ns - first_ns) / 1e9)
