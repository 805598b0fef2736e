"""The drift watch of whichever record is in force, and its state on the disk: `drift.json` in the device's store."""

import json
import logging
from pathlib import Path
from typing import Any

from gateway.atomic_io import write_durably
from gateway.calibration.correction import Correction
from gateway.calibration.drift.rest_monitor import RestDriftMonitor
from gateway.calibration.record import CalibrationError
from gateway.calibration.store import CalibrationStore
from gateway.pipeline.drift_monitor import DriftMonitor

log = logging.getLogger("plumbline.drift")


class DriftStateStore:
    """Begins a watch with each record, goes on with it after a restart, and keeps it once an hour and at the end."""

    def __init__(self, data_dir: Path) -> None:
        self._data_dir = data_dir
        self._path: Path | None = None
        self._kept: dict[str, Any] | None = None
        self.rest = DriftMonitor(None)

    def open(self, device_id: str, correction: Correction) -> DriftMonitor:
        """The watch of the record behind a correction: the one under way where it is the same, else its own."""
        path = CalibrationStore(self._data_dir, device_id).folder / "drift.json"
        if path == self._path and self.rest.calibration_id == correction.calibration_id:
            return self.rest
        self.keep()
        self._path = path
        self.rest = DriftMonitor(_watch(correction, path))
        self._kept = self.rest.told
        return self.rest

    def tick(self) -> None:
        """Keep the state where the watch has something new to say: once an hour while there is rest."""
        if self.rest.told is not self._kept:
            self.keep()

    def keep(self) -> None:
        """Keep the state now, if there is anything new in it."""
        self._kept = self.rest.told
        if self._path is None or not self.rest.unkept:
            return
        try:
            write_durably(self._path, json.dumps(self.rest.state()).encode())
        except OSError as error:
            log.error("%s: the drift watch cannot be kept: %s", self._path, error)


def _watch(correction: Correction, path: Path) -> RestDriftMonitor | None:
    if correction.record is None:
        return None
    try:
        return RestDriftMonitor(correction, _stored(path))
    except CalibrationError as error:
        log.error("%s; its drift is not watched", error)
        return None


def _stored(path: Path) -> dict[str, Any] | None:
    """What was kept; None where there is nothing that can be read: a watch that begins anew is worth more than none."""
    try:
        content = json.loads(path.read_bytes())
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        log.error("%s: cannot be read (%s); the drift watch begins anew", path, error)
        return None
    return content if isinstance(content, dict) else None
