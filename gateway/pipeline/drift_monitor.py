"""The drift watch of the record in force, fed while the housing is at rest; what it says is made anew once an hour."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.drift.rest_monitor import NS_PER_HOUR, RestDriftMonitor, at_rest
from gateway.calibration.drift.rest_status import RestStatus, rest_status

DRIFTED = "at rest the norm has left the record's interval: calibrate"


class DriftMonitor:
    """Outlives the pipelines of one record: whoever opens a pipeline hands it in."""

    def __init__(self, watch: RestDriftMonitor | None) -> None:
        """`watch` is None where there is no record to drift from."""
        self._watch = watch
        self._hour: int | None = None
        self._status = None if watch is None else rest_status(watch)
        self.told: dict[str, Any] | None = None if self._status is None else self._status.as_json()
        """For the health message; None: nothing is watched."""
        self.unkept = False
        """Readings have been taken since the state was last asked for."""

    @property
    def calibration_id(self) -> str | None:
        """Of the record that is watched."""
        return None if self._watch is None else self._watch.record.id

    @property
    def alarm(self) -> str | None:
        """Why the record is no longer to be believed; None: nothing speaks against it, which is no proof."""
        if self._watch is None or self._watch.alarm_since_hour is None:
            return None
        return self._status.reasons[0] if self._status is not None and self._status.reasons else DRIFTED

    def take(
        self, gates: Mapping[str, bool], utc_ns: int, lowpassed_g: NDArray[np.float64], temperature_c: float | None
    ) -> None:
        """Take a low-passed reading, shape (3,), where the gates of the condition say that it is one of rest."""
        if self._watch is None or not at_rest(gates):
            return
        self._watch.feed(utc_ns, lowpassed_g, temperature_c)
        self.unkept = True
        if (hour := utc_ns // NS_PER_HOUR) != self._hour:
            self._hour = hour
            self._emit(rest_status(self._watch))

    def state(self) -> dict[str, Any] | None:
        """What a restart goes on from; None where nothing is watched."""
        self.unkept = False
        return None if self._watch is None else self._watch.state()

    def _emit(self, status: RestStatus) -> None:
        self._status, self.told = status, status.as_json()
