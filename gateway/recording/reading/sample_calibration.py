"""The correction in force in a recording, and the samples of a timeline as specific force in the housing frame by it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.axes_map import SAME_AXES, AxesMap, parse_axes_map
from devices.block import SampleBlock
from devices.errors import RecordingError
from gateway import messages
from gateway.calibration.correction import Correction, correction_for
from gateway.calibration.store import parse_record
from gateway.configuration.loading import validate
from gateway.configuration.model import Configuration
from gateway.file_input import parse_toml
from gateway.messages import Calibration
from gateway.pipeline.force_stage import TemperatureFilter
from gateway.recording.format.salvage import SalvageReport, describe_losses, is_damaged, sum_losses
from gateway.recording.reading.recording_file import RecordingFile, SegmentIndex, Selection
from gateway.recording.reading.timeline import (
    CALIBRATION,
    MAX_BLOCK_NS,
    SAMPLES,
    ReportProgress,
    Timeline,
    TimelineMessage,
    ignore_progress,
)

NEEDED_TOPICS = frozenset({CALIBRATION, SAMPLES})


def recorded_correction(file: RecordingFile, message: Calibration | None, axes: AxesMap) -> Correction:
    """Return the correction of a calibration message, by the device of a file and axes.

    A factory record is in the device. Raises `RecordingError` for what the file states, and `CalibrationError` for a damaged
    record.
    """
    device = file.device()
    if message is not None and message.status == "calibrated":
        return correction_for(device, axes, parse_record(message.record, device.device_id, str(file.path)))
    if message is not None and message.status == "uncalibrated":
        device = replace(device, factory_calibration=None)  # the gateway did not use the factory's either
    return correction_for(device, axes, None)


def recorded_axes(file: RecordingFile) -> AxesMap:
    """Return the axes of the device in a recording, whatever else its configuration has. Raises `RecordingError`."""
    device = (_recorded_table(file) or {}).get("device")
    text = device.get("axes_map") if isinstance(device, dict) else None
    if text is None:
        return SAME_AXES
    try:
        return parse_axes_map(str(text))
    except ValueError as error:
        raise RecordingError(f"{file.path}: its configuration: device.axes_map {error}") from error


def recorded_configuration(file: RecordingFile) -> Configuration | None:
    """Return the configuration in a recording; None: it has none.

    Raises `RecordingError`, and `ConfigurationError` where it is not valid.
    """
    table = _recorded_table(file)
    return None if table is None else validate(table, f"{file.path}: its configuration")


def _recorded_table(file: RecordingFile) -> dict[str, Any] | None:
    if file.configuration_toml is None:
        return None
    try:
        return parse_toml(file.configuration_toml)
    except ValueError as error:
        raise RecordingError(f"{file.path}: its configuration is not TOML: {error}") from error


@dataclass(frozen=True, slots=True)
class CalibratedBlock:
    """A block of samples."""

    segment: SegmentIndex
    block: SampleBlock
    force_g: NDArray[np.float64]
    """Specific force in the housing frame, shape (n, 3)."""
    correction: Correction
    wall_offset_ns: int
    """UTC minus gateway time."""
    sequence: int
    """Number of the block in the run of the gateway."""


class CalibratedReader:
    """Reads the samples of a selection; times that go back are left out and counted."""

    def __init__(self, timeline: Timeline, selection: Selection, *, needs_axes: bool = True) -> None:
        """Without `needs_axes` a recording whose axes cannot be read is taken in those of the sensor, and a remark says so."""
        self._timeline = timeline
        self._needs_axes = needs_axes
        self._unread_axes: dict[str, None] = {}
        self._selection = selection
        end_ns = None if selection.end_ns is None else selection.end_ns + MAX_BLOCK_NS
        self.wanted = Selection(selection.begin_ns, end_ns, NEEDED_TOPICS)
        """The messages that `add` needs."""
        self._segment: SegmentIndex | None = None
        self._boot_id = ""
        self._message: messages.Calibration | None = None
        self._correction: Correction | None = None
        self._thermometer = TemperatureFilter()
        self._newest_ns = 0
        self.not_ascending = 0
        """Number of samples that were left out because their times do not ascend."""
        self.losses: list[SalvageReport] = []
        """What could not be read of each segment."""
        self.corrections: list[str] = []
        """The corrections that were applied, in order of time."""

    def blocks(self, report: ReportProgress = ignore_progress) -> Iterator[CalibratedBlock]:
        """Yield the blocks in order of time. Raises `RecordingError`, and `CalibrationError` for a damaged record."""
        for message in self._timeline.messages(self.wanted, report):
            if (block := self.add(message)) is not None:
                yield block

    def add(self, message: TimelineMessage) -> CalibratedBlock | None:
        """Take the next message of `wanted`; return the selected samples of a block. Raises as `blocks`."""
        if message.file.boot_id != self._boot_id:
            self._boot_id, self._correction = message.file.boot_id, None
        if message.segment is not self._segment:
            self._segment, self._correction = message.segment, None
            self.losses.append(message.file.losses)
            if self._message is None:
                self._message = self._calibration_at_begin()
        if message.recorded.topic == SAMPLES:
            return self._calibrate(message)
        content = message.decode()
        if isinstance(content, messages.Calibration):
            self._set_calibration(content)
        return None

    def _calibration_at_begin(self) -> messages.Calibration | None:
        """Return the calibration in force at the begin: the last one before it, or the first one at all."""
        found = None
        for message in self._timeline.messages(self._before_begin()):
            content = message.decode()
            if not isinstance(content, messages.Calibration):
                continue
            begin_ns = self._selection.begin_ns
            if found is not None and (begin_ns is None or message.recorded.log_time_ns > begin_ns):
                break
            found = content
        return found

    def _before_begin(self) -> Selection:
        """Return the selection of the calibrations in the segment where the interval begins, and later."""
        first = next(iter(self._timeline.chosen(self._selection)), None)
        return Selection(first.from_ns if first else None, self._selection.end_ns, frozenset({CALIBRATION}))

    def _set_calibration(self, message: messages.Calibration) -> None:
        before, self._message = self._message, message
        if before is None or (before.calibration_id, before.status) != (message.calibration_id, message.status):
            self._correction = None

    def _calibrate(self, message: TimelineMessage) -> CalibratedBlock | None:
        read = message.samples()
        if read is None:
            return None
        samples, block = read
        correction = self._correction_of(message.file)
        end_ns = int(block.time_ns[-1])
        temperature_c = self._thermometer.update(end_ns, block.temperature_c)
        ascending = block.time_ns > np.maximum.accumulate(np.concatenate([[self._newest_ns], block.time_ns[:-1]]))
        self.not_ascending += int((~ascending).sum())
        kept = ascending & self._is_selected(block.time_ns)
        if not kept.any():
            return None
        if not kept.all():
            block = block.select(kept)
        self._newest_ns = int(block.time_ns[-1])
        force_g = correction.apply(block.raw, temperature_c)
        return CalibratedBlock(message.segment, block, force_g, correction, samples.time_ns - end_ns, samples.sequence)

    def _is_selected(self, time_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        selected = np.ones(len(time_ns), dtype=np.bool_)
        if self._selection.begin_ns is not None:
            selected &= time_ns >= self._selection.begin_ns
        if self._selection.end_ns is not None:
            selected &= time_ns < self._selection.end_ns
        return selected

    def _correction_of(self, file: RecordingFile) -> Correction:
        if self._correction is None:
            self._correction = recorded_correction(file, self._message, self._axes_of(file))
            if self._correction.text not in self.corrections[-1:]:
                self.corrections.append(self._correction.text)
                self._thermometer = TemperatureFilter()  # as in the gateway, where a new record begins anew
        return self._correction

    def _axes_of(self, file: RecordingFile) -> AxesMap:
        try:
            return recorded_axes(file)
        except RecordingError as error:
            if self._needs_axes:
                raise
            self._unread_axes[f"{error}; the readings are shown in the axes of the sensor"] = None
            return SAME_AXES

    def remarks(self) -> list[str]:
        """Return what a user should know of the samples that were read."""
        remarks = list(self._unread_axes)
        if len(self.corrections) > 1:
            remarks.append(f"the calibration changes: {'; then '.join(self.corrections)}")
        if self.not_ascending:
            remarks.append(f"{self.not_ascending} samples left out, because their times do not ascend")
        losses = sum_losses(self.losses)
        return remarks + describe_losses(replace(losses, closed=True))

    @property
    def has_losses(self) -> bool:
        """Something between the first and the last readable sample could not be read."""
        return is_damaged(sum_losses(self.losses))
