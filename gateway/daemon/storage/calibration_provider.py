"""The calibration of the open device: the correction that its record makes, and the files that recordings carry of it."""

import logging
from dataclasses import replace
from pathlib import Path

from devices.axes_map import AxesMap
from devices.block import DeviceInfo
from gateway.calibration.correction import Correction, correction_for
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.store import CalibrationStore, find_record_in_force
from gateway.daemon.storage.drift_state_store import read_drift_monitor
from gateway.pipeline.drift_monitor import DriftMonitor
from gateway.recording.segments.calibration_files import CalibrationFiles, calibration_files

log = logging.getLogger("plumbline.calibration")
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
        """Return the monitor of the record behind a correction, with its state from the disk."""
        return read_drift_monitor(self._data_dir, info.device_id, correction)

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
        """Return the record's parent, and older records than these two. A damaged one is reported and left out."""
        store = CalibrationStore(self._data_dir, info.device_id)
        known: dict[str, CalibrationRecord] = {}
        if info.factory_calibration is not None:
            factory = CalibrationRecord.model_validate(info.factory_calibration)
            known[factory.id] = factory
        for record_id in store.ids():
            try:
                known[record_id] = store.record(record_id)
            except CalibrationError as error:
                log.error("%s", error)
        parent = None if record.parent is None else known.pop(record.parent, None)
        older = [one for one in known.values() if one.created_utc < record.created_utc]
        return parent, sorted(older, key=lambda one: one.created_utc)[-MAX_EARLIER_RECORDS:]
