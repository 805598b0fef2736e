"""The battery and the radio link of a wireless sensor, as its latest reports state them."""

import logging
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from devices.block import RadioStatus

log = logging.getLogger("plumbline.device")
STALE_S = 30.0
"""An older report says nothing about the present."""
WARNING_PERIOD_S = 3600.0
"""A battery near its limit is low now and then: one warning an hour is enough."""


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
        oldest_s = self._now_s() - STALE_S
        return RadioStatus(**{name: value for name, (time_s, value) in self._reports.items() if time_s >= oldest_s})
