"""Counters that the processor writes and the health message reads, and the state of a radio."""

import logging
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

from devices.block import RadioStatus, SampleBlock

log = logging.getLogger("plumbline.device")
MAX_REPORT_AGE_S = 30.0
"""An older report says nothing about the present. Basis: a choice; several reports of a sensor, and less than a person's
patience."""
WARNING_PERIOD_S = 3600.0
"""A battery near its limit is low now and then. Basis: one warning an hour is enough."""


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
