"""What the store has of a device: the correction that its record makes, and what recordings carry of it."""

import logging
from dataclasses import replace
from pathlib import Path

from devices.block import DeviceInfo
from gateway.calibration.correction import Correction, correction_for
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.calibration.store import CalibrationStore, find
from gateway.recording.calibration_files import CalibrationFiles, calibration_files

log = logging.getLogger("plumbline.calibration")
MOST_EARLIER = 32
"""Records that a certificate's forecast looks back on, the newest."""
Axes = tuple[tuple[int, int], ...]
"""(sensor axis, sign) of each housing axis."""


class CalibrationProvider:
    """Reads the records of whichever device is open."""

    def __init__(self, data_dir: Path, axes: Axes) -> None:
        self._data_dir = data_dir
        self._axes = axes
        self._made: CalibrationFiles | None = None

    def correction(self, info: DeviceInfo) -> Correction:
        """The calibration in force for a device. A record that must not be used leaves it uncalibrated, and says so."""
        try:
            return correction_for(info, self._axes, find(self._data_dir, info.device_id))
        except CalibrationError as error:
            log.error("%s", error)
            bare = correction_for(
                replace(info, factory_calibration=None), self._axes, None
            )  # not silently the factory's
            return replace(bare, text=f"{bare.text}; {error}")

    def files(self, info: DeviceInfo, correction: Correction) -> CalibrationFiles | None:
        """The record behind a correction, and its certificate; None where there is no record."""
        if correction.record is None:
            return None
        record = CalibrationRecord.model_validate(correction.record)
        made = self._made
        if made is None or (made.device_id, made.record_id) != (record.device_id, record.id):
            made = self._made = calibration_files(record, *self._before(record, info))
        return made

    def _before(
        self, record: CalibrationRecord, info: DeviceInfo
    ) -> tuple[CalibrationRecord | None, list[CalibrationRecord]]:
        """The record's parent, and older ones than either; a spoilt one is said and takes nothing from the record."""
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
        return parent, sorted(older, key=lambda one: one.created_utc)[-MOST_EARLIER:]
