"""The drift monitor of the record in force. The pipeline feeds it at rest; it evaluates the readings once an hour."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.drift.rest_monitor import NS_PER_HOUR, RestDriftMonitor, is_at_rest
from gateway.calibration.drift.rest_status import judge_at_rest

DRIFTED = "at rest the norm has left the record's interval: calibrate"


class DriftMonitor:
    """Monitors one record. It outlives the pipelines, which get it when they are made."""

    def __init__(self, rest_monitor: RestDriftMonitor | None) -> None:
        """`rest_monitor` is None where there is no record that could drift."""
        self._rest = rest_monitor
        self._hour: int | None = None
        self._status = None if rest_monitor is None else judge_at_rest(rest_monitor)
        self.status_json: dict[str, Any] | None = None if self._status is None else asdict(self._status)
        """The content of the health message; None: nothing is monitored."""
        self.has_unsaved_readings = False
        """Readings have come since the last call of `dump_state`."""

    @property
    def calibration_id(self) -> str | None:
        """Id of the monitored record."""
        return None if self._rest is None else self._rest.record.id

    @property
    def alarm(self) -> str | None:
        """Why the record can no longer be trusted; None: no evidence against it, which is no proof."""
        if self._rest is None or self._rest.alarm_since_hour is None:
            return None
        return self._status.reasons[0] if self._status is not None and self._status.reasons else DRIFTED

    def update(
        self, gates: Mapping[str, bool], utc_ns: int, lowpassed_g: NDArray[np.float64], temperature_c: float | None
    ) -> None:
        """Take a low-passed reading, shape (3,), if the gates of the condition show that the housing is at rest."""
        if self._rest is None or not is_at_rest(gates):
            return
        self._rest.feed(utc_ns, lowpassed_g, temperature_c)
        self.has_unsaved_readings = True
        if (hour := utc_ns // NS_PER_HOUR) != self._hour:
            self._hour = hour
            self._status = judge_at_rest(self._rest)
            self.status_json = asdict(self._status)

    def dump_state(self) -> dict[str, Any] | None:
        """Return the state from which a restart continues; None where nothing is monitored."""
        self.has_unsaved_readings = False
        return None if self._rest is None else self._rest.state()
