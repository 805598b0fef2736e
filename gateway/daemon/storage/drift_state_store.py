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

    def open(self, device_id: str, read: DriftMonitor) -> DriftMonitor:
        """Return the monitor of a record: the present one if the record is the same, else the one that was read."""
        path = _state_path(self._data_dir, device_id)
        if path == self._path and self.monitor.calibration_id == read.calibration_id:
            return self.monitor
        self.save()
        self._path = path
        self.monitor = read
        self._saved_status = read.status_json
        return read

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


def read_drift_monitor(data_dir: Path, device_id: str, correction: Correction) -> DriftMonitor:
    """Return the monitor of the record behind a correction with its saved state, without which it starts again."""
    if correction.record is None:
        return DriftMonitor(None)
    try:
        return DriftMonitor(RestDriftMonitor(correction, _read_state(_state_path(data_dir, device_id))))
    except CalibrationError as error:
        log.error("%s; its drift is not monitored", error)
        return DriftMonitor(None)


def _state_path(data_dir: Path, device_id: str) -> Path:
    return CalibrationStore(data_dir, device_id).folder / "drift.json"


def _read_state(path: Path) -> dict[str, Any] | None:
    """Return the saved state; None where there is none that can be read: the monitor then starts again."""
    try:
        content = parse_json(read_bounded(path))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        log.error("%s: cannot be read (%s); the drift monitor starts again", path, error)
        return None
    return content if isinstance(content, dict) else None
