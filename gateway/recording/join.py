"""Several files of one gateway as one recording."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from devices.block import DeviceInfo
from devices.errors import RecordingError
from devices.recording import Recording, longest_increasing_mask, typical_interval
from gateway.errors import InputError
from gateway.recording.catalogue import open_timeline
from gateway.recording.interval import WHOLE_RECORDING, RecordingInterval
from gateway.recording.mcap_salvage import describe_losses, sum_losses
from gateway.recording.reader import EVERYTHING, Selection
from gateway.recording.run import NoSamplesError, RecordedRun, list_changes, read_samples
from gateway.recording.sample_columns import concatenate
from gateway.recording.timeline import LONGEST_BLOCK_NS, Timeline, TimelineSegment, TimelineSpan
from gateway.recording.timestamp import iso_utc

LEAD_NS = 300_000_000_000
"""Samples before an interval that are read too: ten time constants of the filter of the temperature, `TIME_CONSTANT_S`."""
FREE_DEVICE_FIELDS = frozenset({"details", "can_wait"})
"""Fields of a device that may differ between files: they do not change the meaning of a sample."""


@dataclass(frozen=True, slots=True)
class JoinedRun:
    """The recording that several files make together."""

    whole: RecordedRun
    """All samples and calibrations; its path, origin, device and configuration are those of the first file."""
    parts: tuple[RecordedRun, ...]
    """The files in order of time."""
    remarks: tuple[str, ...]
    """Incomplete files, files without samples, and gaps between files."""
    span: TimelineSpan | None = None
    """First and last sample of all files, where only those of an interval were read."""

    def recording(self) -> Recording:
        """Return the samples; times count from the first sample of all files. Raises as `RecordedRun.recording`."""
        return self.whole.recording(None if self.span is None else self.span.first_ns)


def read_joined_samples(paths: Sequence[Path], interval: RecordingInterval = WHOLE_RECORDING) -> JoinedRun:
    """Read files and folders of one gateway as one recording, in order of time; incomplete files are read up to their end.

    Of an interval, only its samples are read, from the files that contain a part of it, and there those of the five minutes
    before it. Gaps between files remain gaps in time.
    Raises `RecordingError` where a file cannot be read, no file has samples, the files are of different gateways or devices, or
    two of them overlap; `InputError` for an impossible interval, and for one without samples.
    """
    timeline = open_timeline(paths)
    if interval == WHOLE_RECORDING:
        span, (runs, remarks) = None, _read_runs(timeline.segments, EVERYTHING)
    else:
        span = timeline.span()
        runs, remarks = _read_interval(timeline, timeline.select(interval), span)
    remarks = [*timeline.remarks, *remarks]
    spans_ns = {run.path: _span_ns(run) for run in runs}
    runs.sort(key=lambda run: spans_ns[run.path])
    for run in runs[1:]:
        _check_same_device(runs[0], run)
    for before, after in pairwise(runs):
        _check_overlap(before, after, spans_ns[before.path], spans_ns[after.path])
    remarks += _describe_incomplete(runs, is_whole=span is None)
    if len(runs) == 1:
        return JoinedRun(runs[0], tuple(runs), tuple(remarks), span)
    remarks += _describe_gaps(runs, [spans_ns[run.path] for run in runs])
    return JoinedRun(_concatenate(runs), tuple(runs), tuple(remarks), span)


def _read_interval(timeline: Timeline, selection: Selection, span: TimelineSpan) -> tuple[list[RecordedRun], list[str]]:
    """Return the parts of the files that an interval needs. Raises `InputError` where it has no samples."""
    chosen = [each for each in timeline.segments if selection.may_contain(each.from_ns - LONGEST_BLOCK_NS, each.to_ns)]
    begin_ns = None if selection.begin_ns is None else selection.begin_ns - LEAD_NS
    end_ns = None if selection.end_ns is None else selection.end_ns + LONGEST_BLOCK_NS
    try:
        return _read_runs(chosen, Selection(begin_ns, end_ns))[0], []
    except NoSamplesError as error:
        raise InputError(f"the interval has fewer than two samples; the recording is {span.extent}") from error


def _read_runs(segments: Sequence[TimelineSegment], wanted: Selection) -> tuple[list[RecordedRun], list[str]]:
    """Return the runs of all files with samples, and a remark on each file without. Raises `NoSamplesError` for no run."""
    runs, remarks, failure = [], [], NoSamplesError("no file")
    for segment in segments:
        try:
            runs.append(read_samples(segment.path, wanted.begin_ns, wanted.end_ns))
        except NoSamplesError as error:
            failure = error
            remarks.append(f"{segment.path.name}: has no samples, left out")
    if not runs:
        raise failure
    return runs, remarks


def _span_ns(run: RecordedRun) -> tuple[int, int]:
    """Return the times of the first and the last sample, without those that are out of order."""
    time_ns = run.samples.time_ns
    kept_ns = time_ns[longest_increasing_mask(time_ns)]
    return int(kept_ns[0]), int(kept_ns[-1])


def _check_same_device(first: RecordedRun, other: RecordedRun) -> None:
    for field in fields(DeviceInfo):
        values = [getattr(run.device, field.name) for run in (first, other)]
        if field.name not in FREE_DEVICE_FIELDS and values[0] != values[1]:
            shown = "" if field.name == "factory_calibration" else f" ({values[1]}, not {values[0]})"
            raise RecordingError(
                f"{other.path}: has another device.{field.name}{shown} than {first.path}; give the files of one device and rate"
            )


def _check_overlap(before: RecordedRun, after: RecordedRun, span_ns: tuple[int, int], next_ns: tuple[int, int]) -> None:
    if next_ns == span_ns:
        raise RecordingError(f"{after.path}: has the same times as {before.path}; give one of them")
    if next_ns[0] <= span_ns[1]:
        overlap_s = (span_ns[1] - next_ns[0]) / 1e9
        raise RecordingError(f"{after.path}: overlaps {before.path} by {overlap_s:.3f} s; give one of them")


def _concatenate(runs: Sequence[RecordedRun]) -> RecordedRun:
    """Return one run of all files; the offset of the wall clock is the newest one."""
    return replace(
        runs[0],
        samples=concatenate([run.samples for run in runs]),
        calibrations=list_changes(calibration for run in runs for calibration in run.calibrations),
        losses=sum_losses([run.losses for run in runs]),
        wall_offset_ns=runs[-1].wall_offset_ns,
    )


def _describe_incomplete(runs: Sequence[RecordedRun], *, is_whole: bool) -> Iterator[str]:
    for run in runs:
        if losses := describe_losses(run.losses):
            end_ns = int(run.samples.time_ns.max()) + run.wall_offset_ns
            yield f"{run.path.name}: {', '.join(losses)}" + (f"; samples up to {iso_utc(end_ns)}" if is_whole else "")


def _describe_gaps(runs: Sequence[RecordedRun], spans_ns: Sequence[tuple[int, int]]) -> Iterator[str]:
    time_ns = np.concatenate([run.samples.time_ns for run in runs])
    period_ns = typical_interval((time_ns - time_ns[0]).astype(np.float64))
    for number in range(1, len(runs)):
        before, after = runs[number - 1 : number + 1]
        gap_ns = spans_ns[number][0] - spans_ns[number - 1][1]
        if (lost := round(gap_ns / period_ns) - 1) > 0:
            yield f"{after.path.name}: begins {gap_ns / 1e9:.3f} s after {before.path.name} ends, {lost} samples lost"
