"""The calibration of the open device: its correction, the files that recordings carry of it, and the monitor of its drift.

The state of the monitor is `drift.json` in the folder of the device.
"""

import json
import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from devices.axes_map import AxesMap
from devices.block import DeviceInfo
from gateway.calibration.correction import Correction, correction_for
from gateway.calibration.drift.rest_monitor import RestDriftMonitor
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.store import CalibrationStore, find_record_in_force
from gateway.file_input import parse_json, read_bounded
from gateway.messages import CalibrationOffer
from gateway.pipeline.drift_monitor import DriftMonitor
from gateway.recording.segments.segment import CalibrationFiles, calibration_files

log, drift_log = logging.getLogger("plumbline.calibration"), logging.getLogger("plumbline.drift")
MAX_EARLIER_RECORDS = 32
"""The forecast in a certificate uses this many earlier records, the newest ones. Basis: a choice; decades at one a year, and a
bound of the work."""


class CalibrationProvider:
    """Reads the records of the device that is open."""

    def __init__(self, data_dir: Path, axes: AxesMap) -> None:
        self._data_dir = data_dir
        self._axes = axes
        self._files: CalibrationFiles | None = None

    def correction(self, info: DeviceInfo) -> Correction:
        """Return the correction in force for a device. A record that must not be used leaves the device uncalibrated."""
        try:
            return correction_for(info, self._axes, find_record_in_force(self._data_dir, info.device_id))
        except CalibrationError as error:
            log.error("%s", error)
            uncalibrated = self.uncalibrated(info)
            return replace(uncalibrated, text=f"{uncalibrated.text}; {error}")

    def drift_monitor(self, info: DeviceInfo, correction: Correction) -> DriftMonitor:
        """Return the monitor of the record behind a correction with its saved state, without which it starts again."""
        if correction.record is None:
            return DriftMonitor(None)
        try:
            return DriftMonitor(RestDriftMonitor(correction, _read_state(_state_path(self._data_dir, info.device_id))))
        except CalibrationError as error:
            drift_log.error("%s; its drift is not monitored", error)
            return DriftMonitor(None)

    def offer(self, info: DeviceInfo) -> CalibrationOffer | None:
        """Return the record that waits to be put in force; None where there is none, or it cannot be read."""
        try:
            record = CalibrationStore(self._data_dir, info.device_id).offer()
        except CalibrationError:
            return None
        if record is None:
            return None
        text = f"{record.method} of {record.created_utc[:10]} by {record.by}"
        return CalibrationOffer(record=record.id, text="; ".join([text, *record.warnings[:1]]))

    def uncalibrated(self, info: DeviceInfo) -> Correction:
        """Return the correction of a device whose record is not known; the factory's must not replace it silently."""
        return correction_for(replace(info, factory_calibration=None), self._axes, None)

    def files(self, info: DeviceInfo, correction: Correction) -> CalibrationFiles | None:
        """Return the record behind a correction and its certificate; None where there is no record."""
        if correction.record is None:
            return None
        record = CalibrationRecord.model_validate(correction.record)
        files = self._files
        if files is None or (files.device_id, files.record_id) != (record.device_id, record.id):
            files = self._files = calibration_files(record, *self._earlier(record, info))
        return files

    def _earlier(
        self, record: CalibrationRecord, info: DeviceInfo
    ) -> tuple[CalibrationRecord | None, list[CalibrationRecord]]:
        """Return the record's parent, and older ones that were in force and not withdrawn. A damaged one is left out."""
        store = CalibrationStore(self._data_dir, info.device_id)
        known: dict[str, CalibrationRecord] = {}
        if info.factory_calibration is not None:
            factory = CalibrationRecord.model_validate(info.factory_calibration)
            known[factory.id] = factory
        try:
            standing = store.state().standing
        except CalibrationError as error:
            log.error("%s", error)
            standing = ()
        for record_id in store.ids():
            if record_id != record.parent and record_id not in standing:
                continue
            try:
                known[record_id] = store.record(record_id)
            except CalibrationError as error:
                log.error("%s", error)
        parent = None if record.parent is None else known.pop(record.parent, None)
        older = [one for one in known.values() if one.created_utc < record.created_utc]
        return parent, sorted(older, key=lambda one: one.created_utc)[-MAX_EARLIER_RECORDS:]


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


def _state_path(data_dir: Path, device_id: str) -> Path:
    return CalibrationStore(data_dir, device_id).folder / "drift.json"


def _read_state(path: Path) -> dict[str, Any] | None:
    """Return the saved state; None where there is none that can be read: the monitor then starts again."""
    try:
        content = parse_json(read_bounded(path))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        drift_log.error("%s: cannot be read (%s); the drift monitor starts again", path, error)
        return None
    return content if isinstance(content, dict) else None
