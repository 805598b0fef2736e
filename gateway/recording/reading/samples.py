"""The raw samples of recordings: part by part in bounded memory, or all of them in arrays."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from devices.block import DeviceInfo, SampleBlock
from devices.errors import RecordingError
from devices.recording import Recording, typical_interval
from gateway import messages
from gateway.errors import InputError
from gateway.recording.format import content as names
from gateway.recording.format.salvage import SalvageReport, describe_losses, sum_losses
from gateway.recording.reading.interval import WHOLE_RECORDING, RecordingInterval, iso_utc
from gateway.recording.reading.recording_file import EVERYTHING, RecordingFile, Selection, open_recording
from gateway.recording.reading.sample_columns import SampleColumns, columns_of, concatenate
from gateway.recording.reading.timeline import (
    CALIBRATION,
    CLOCK,
    MAX_BLOCK_NS,
    SAMPLES,
    Timeline,
    TimelineMessage,
    TimelineSpan,
    open_timeline,
)

PART_BLOCKS = 1024
"""Most blocks of a part; basis: one or two megabytes as arrays."""
TEMPERATURE_LEAD_NS = 300_000_000_000
"""Samples before an interval that are read too. Basis: ten time constants of the filter of the temperature, `TIME_CONSTANT_S`."""
FREE_DEVICE_FIELDS = frozenset({"details", "can_wait"})
"""Fields of a device that may differ between files: they do not change the meaning of a sample."""
SampledFile = tuple[RecordingFile, SampleColumns]
"""A file with its samples."""


class NoSamplesError(RecordingError):
    """A recording of the gateway has ended, or is read, before its first sample."""


@dataclass(frozen=True, slots=True)
class CalibrationInForce:
    """A calibration in force, and the gateway time of its first message."""

    log_time_ns: int
    message: messages.Calibration


@dataclass(slots=True)
class SampleReader:
    """Reads the samples of a timeline, and with them the files and the calibrations, known as far as it has come."""

    timeline: Timeline
    selection: Selection = EVERYTHING
    """The blocks that end within it are read."""
    files: list[RecordingFile] = field(default_factory=list)
    """The files with samples, in order of time."""
    wall_offsets_ns: dict[Path, int] = field(default_factory=dict)
    """UTC of the wall clock minus gateway time, by the last message of the clock in each file."""
    calibrations: list[CalibrationInForce] = field(default_factory=list)
    """The calibration in force at the start, and each later one."""
    suspensions: list[tuple[int, str]] = field(default_factory=list)
    """Gateway time of each begin and end of a recalibration in which no reading described the load, and who recalibrated; empty:
    it ended."""
    restarts_ns: list[int] = field(default_factory=list)
    """Gateway time of the first sample of each run of the gateway but the first."""
    _boot_id: str | None = None

    @property
    def device(self) -> DeviceInfo:
        """The device of the first samples."""
        return self.files[0].device()

    def parts(self) -> Iterator[SampleColumns]:
        """Yield the samples as the device delivered them, in parts of which each is from the last one of `files`.

        Raises `RecordingError` where there are no samples, no description of the device, or other devices in other files.
        """
        wanted = Selection(end_ns=self.selection.end_ns, topics=frozenset({SAMPLES, CALIBRATION, CLOCK}))
        blocks: list[SampleBlock] = []
        for message in self.timeline.messages(wanted):
            if blocks and (message.file is not self.files[-1] or len(blocks) == PART_BLOCKS):
                yield columns_of(blocks)
                blocks = []
            content = self._read(message)
            if isinstance(content, SampleBlock):
                self._begin_file(message.file)
                self._begin_run(message.file.boot_id, content)
                _check_unit(message.file, content)
                blocks.append(content)
            elif isinstance(content, messages.Calibration):
                self._add_calibration(CalibrationInForce(message.recorded.log_time_ns, content))
            elif isinstance(content, messages.ClockOffset):
                self.wall_offsets_ns[message.file.path] = content.wall_offset_ns
        if blocks:
            yield columns_of(blocks)
        if not self.files:
            raise _missing_samples_error(self.timeline)

    def recordings(self) -> Iterator[Recording]:
        """Yield the samples as recordings on one time axis, of bounded length, which follow each other. Raises as `parts`.

        Samples with a repeated or backward time are left out and counted.
        """
        held: SampleColumns | None = None
        origin_ns = newest_ns = None
        for part in self.parts():
            held = part if held is None else concatenate([held, part])
            recording = held.recording(self.device, origin_ns, newest_ns)
            if recording is not None:
                yield recording
                origin_ns, held = recording.origin_ns, None
                newest_ns = (origin_ns or 0) + round(float(recording.time_s[-1]) * 1e9)

    def _read(self, message: TimelineMessage) -> object:
        """Return the content of a message; None for a block before the selection, and for what cannot be read."""
        if message.recorded.topic != SAMPLES:
            return message.decode()
        begin_ns = self.selection.begin_ns  # the calibration and the clock before are needed
        if begin_ns is not None and message.recorded.log_time_ns < begin_ns:
            return None
        samples = message.samples()
        return None if samples is None else samples[1]

    def _begin_file(self, file: RecordingFile) -> None:
        if self.files and self.files[-1] is file:
            return
        device = file.device()
        if self.files:
            _check_same_device(self.files[0], file, device)
        self.files.append(file)

    def _begin_run(self, boot_id: str, block: SampleBlock) -> None:
        if self._boot_id not in (None, boot_id):
            self.restarts_ns.append(int(block.time_ns[0]))
        self._boot_id = boot_id

    def _add_calibration(self, calibration: CalibrationInForce) -> None:
        if not self.calibrations or _content(self.calibrations[-1]) != _content(calibration):
            self.calibrations.append(calibration)
        session = calibration.message.session
        by = (session.by or "somebody") if session.suspended else ""
        if by != (self.suspensions[-1][1] if self.suspensions else ""):
            self.suspensions.append((calibration.log_time_ns, by))


@dataclass(frozen=True, slots=True)
class RecordedSamples:
    """The samples of recordings of one gateway, with everything that is needed to compute their results again."""

    files: tuple[RecordingFile, ...]
    """In order of time."""
    samples: SampleColumns
    """The samples as the device delivered them: times in gateway time, readings in `device.unit`."""
    calibrations: tuple[CalibrationInForce, ...]
    """The calibration in force at the start, and each later one."""
    suspensions: tuple[tuple[int, str], ...]
    """As of `SampleReader`, also the next."""
    restarts_ns: tuple[int, ...]
    wall_offset_ns: int
    """UTC of the wall clock minus gateway time, by the last message of the clock in the last file."""
    remarks: tuple[str, ...]
    """Incomplete files, files without samples, and gaps between files."""
    span: TimelineSpan | None = None
    """First and last sample of all files, where only those of an interval were read."""

    @property
    def path(self) -> Path:
        """Path of the first file."""
        return self.files[0].path

    @property
    def device(self) -> DeviceInfo:
        """The device; its details are those of the first file."""
        return self.files[0].device()

    @property
    def losses(self) -> SalvageReport:
        """What could not be read of all files."""
        return sum_losses([each.losses for each in self.files])

    def recording(self) -> Recording:
        """Return the samples for `measure`; times count from the first sample of all files.

        Samples with a repeated or backward time are left out and counted. Raises `RecordingError` for fewer than two.
        """
        origin_ns = None if self.span is None else self.span.first_ns
        recording = self.samples.recording(self.device, origin_ns, restarts_ns=self.restarts_ns)
        if recording is None:
            raise RecordingError(f"{self.path}: has a single sample; choose a longer recording")
        return recording


def read_samples(paths: Sequence[Path], interval: RecordingInterval = WHOLE_RECORDING) -> RecordedSamples:
    """Read files and folders of one gateway as one recording, in order of time; incomplete files are read up to their end.

    Of an interval, only its samples are read, from the files that contain a part of it, and there those of the five minutes
    before it. Gaps between files remain gaps in time.
    Raises `RecordingError` where a file cannot be read, no file has samples, the files are of different gateways or devices, or
    two of them overlap; `InputError` for an impossible interval, and for one without samples.
    """
    timeline = open_timeline(paths)
    if interval == WHOLE_RECORDING:
        return _gather(SampleReader(timeline), None)
    span, selection = timeline.span(), timeline.select(interval)
    chosen = [each for each in timeline.segments if selection.may_contain(each.from_ns - MAX_BLOCK_NS, each.to_ns)]
    needed = Selection(
        None if selection.begin_ns is None else selection.begin_ns - TEMPERATURE_LEAD_NS,
        None if selection.end_ns is None else selection.end_ns + MAX_BLOCK_NS,
    )
    problem = InputError(f"the interval has fewer than two samples; the recording is {span.extent}")
    if not chosen:
        raise problem
    try:
        return _gather(SampleReader(replace(timeline, segments=tuple(chosen)), needed), span)
    except NoSamplesError as error:
        raise problem from error


def _gather(reader: SampleReader, span: TimelineSpan | None) -> RecordedSamples:
    """Return all samples of a reader in arrays."""
    parts: dict[Path, list[SampleColumns]] = {}
    for part in reader.parts():
        parts.setdefault(reader.files[-1].path, []).append(part)
    samples = [concatenate(each) for each in parts.values()]
    files = list(zip(reader.files, samples, strict=True))
    for before, after in pairwise(sorted(files, key=lambda each: each[1].span_ns)):
        _check_overlap(*before, *after)
    remarks = list(reader.timeline.remarks)
    if span is None:
        empty = [each.path.name for each in reader.timeline.segments if each.path not in parts]
        remarks += [f"{name}: has no samples, left out" for name in empty]
    remarks += _describe_incomplete(files, reader.wall_offsets_ns, is_whole=span is None)
    remarks += _describe_gaps(files)
    return RecordedSamples(
        files=tuple(reader.files),
        samples=concatenate(samples),
        calibrations=tuple(reader.calibrations),
        suspensions=tuple(reader.suspensions),
        restarts_ns=tuple(reader.restarts_ns),
        wall_offset_ns=reader.wall_offsets_ns.get(reader.files[-1].path, 0),
        remarks=tuple(remarks),
        span=span,
    )


def _content(calibration: CalibrationInForce) -> tuple[object, ...]:
    message = calibration.message
    return message.calibration_id, message.status, message.record, message.in_force


def _missing_samples_error(timeline: Timeline) -> RecordingError:
    """Return the error of a timeline without samples, by what its last file has instead."""
    file = open_recording(timeline.segments[-1].path)
    topics = sorted({message.topic for message in file.messages()} | {each.topic for each in file.channels.values()})
    if SAMPLES in topics or names.ORIGIN in file.metadata:
        return NoSamplesError(
            f"{file.path}: has no samples; the gateway was stopped or lost its device before the first one"
        )
    found = ", ".join(topics[:12]) or "none"
    return RecordingError(
        f"{file.path}: has no topic /samples, which a recording of the gateway has; its topics: {found}"
    )


def _check_unit(file: RecordingFile, block: SampleBlock) -> None:
    """Raise `RecordingError` where a block is not in the unit of the device."""
    unit, expected = "counts" if block.raw.dtype.kind == "i" else "g", file.device().unit
    if unit != expected:
        raise RecordingError(f"{file.path}: samples in {unit} from a device in {expected}; it cannot be replayed")


def _check_same_device(first: RecordingFile, other: RecordingFile, device: DeviceInfo) -> None:
    expected = first.device()
    for name in (each.name for each in fields(DeviceInfo) if each.name not in FREE_DEVICE_FIELDS):
        values = getattr(expected, name), getattr(device, name)
        if values[0] != values[1]:
            shown = "" if name == "factory_calibration" else f" ({values[1]}, not {values[0]})"
            raise RecordingError(
                f"{other.path}: has another device.{name}{shown} than {first.path}; give the files of one device and rate"
            )


def _check_overlap(
    before: RecordingFile, samples: SampleColumns, after: RecordingFile, following: SampleColumns
) -> None:
    span_ns, next_ns = samples.span_ns, following.span_ns
    if next_ns[0] <= span_ns[1]:
        overlap_s = (span_ns[1] - next_ns[0]) / 1e9
        raise RecordingError(f"{after.path}: overlaps {before.path} by {overlap_s:.3f} s; give one of them")


def _describe_incomplete(
    files: Sequence[SampledFile], wall_offsets_ns: Mapping[Path, int], *, is_whole: bool
) -> Iterator[str]:
    for each, samples in files:
        if losses := describe_losses(each.losses):
            end_ns = int(samples.time_ns.max()) + wall_offsets_ns.get(each.path, 0)
            yield f"{each.path.name}: {', '.join(losses)}" + (f"; samples up to {iso_utc(end_ns)}" if is_whole else "")


def _describe_gaps(files: Sequence[SampledFile]) -> Iterator[str]:
    if len(files) == 1:
        return
    time_ns = np.concatenate([samples.time_ns for _, samples in files])
    period_ns = typical_interval((time_ns - time_ns[0]).astype(np.float64))
    for (before, samples), (after, following) in pairwise(files):
        gap_ns = following.span_ns[0] - samples.span_ns[1]
        if (lost := round(gap_ns / period_ns) - 1) > 0:
            what = f", {lost} samples lost" if after.boot_id == before.boot_id else ": the gateway was started again"
            yield f"{after.path.name}: begins {gap_ns / 1e9:.3f} s after {before.path.name} ends{what}"
