"""The drift monitor of the record in force, and its state on the disk: `drift.json` in the folder of the device."""

import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gateway.calibration.correction import Correction
from gateway.calibration.drift.rest_monitor import RestDriftMonitor
from gateway.calibration.record import CalibrationError
from gateway.calibration.store import CalibrationStore
from gateway.disk_job import PerformJob, perform_now
from gateway.file_input import parse_json, read_bounded
from gateway.pipeline.drift_monitor import DriftMonitor

log = logging.getLogger("plumbline.drift")


class DriftStateStore:
    """Starts a monitor for each record, continues it after a restart, and saves its state once an hour and at the end."""

    def __init__(self, data_dir: Path, write: Callable[[Path, bytes], object]) -> None:
        """`write` replaces a file soon; it must not wait."""
        self._data_dir = data_dir
        self._write = write
        self._path: Path | None = None
        self._saved_status: dict[str, Any] | None = None
        self.monitor = DriftMonitor(None)

    def open(self, device_id: str, correction: Correction, perform: PerformJob = perform_now) -> DriftMonitor:
        """Return the monitor of the record behind a correction: the present one if the record is the same.

        `perform` carries out the reading of the saved state, without which the monitor starts again.
        """
        path = CalibrationStore(self._data_dir, device_id).folder / "drift.json"
        if path == self._path and self.monitor.calibration_id == correction.calibration_id:
            return self.monitor
        self.save()
        self._path = path
        self.monitor = DriftMonitor(_rest_monitor(correction, path, perform))
        self._saved_status = self.monitor.status_json
        return self.monitor

    def save_if_evaluated(self) -> None:
        """Save the state if the monitor has evaluated it since the last time: once an hour while there is rest."""
        if self.monitor.status_json is not self._saved_status:
            self.save()

    def save(self) -> None:
        """Save the state now, if it has changed."""
        self._saved_status = self.monitor.status_json
        if self._path is None or not self.monitor.has_unsaved_readings:
            return
        self._write(self._path, json.dumps(self.monitor.dump_state()).encode())


def _rest_monitor(correction: Correction, path: Path, perform: PerformJob) -> RestDriftMonitor | None:
    if correction.record is None:
        return None
    try:
        return RestDriftMonitor(correction, _read_state(path, perform))
    except CalibrationError as error:
        log.error("%s; its drift is not monitored", error)
        return None


def _read_state(path: Path, perform: PerformJob) -> dict[str, Any] | None:
    """Return the saved state; None where there is none that can be read: the monitor then starts again."""
    try:
        content = parse_json(perform(lambda _is_wanted: read_bounded(path)))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        log.error("%s: cannot be read (%s); the drift monitor starts again", path, error)
        return None
    return content if isinstance(content, dict) else None
