"""The replay of a timeline: what is compared, how exactly, and what came of it."""

import platform
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from gateway import __version__
from gateway.calibration.record import CalibrationRecord
from gateway.configuration.model import Configuration
from gateway.errors import InputError
from gateway.recording.chain.missing_files import describe_hidden, missing_of
from gateway.recording.format.salvage import SalvageReport, describe_losses, may_hide_messages
from gateway.recording.format.segment_summary import SegmentSummary
from gateway.recording.format.summary_builder import SummaryBuilder
from gateway.recording.reading.interval import RecordingInterval, iso_utc
from gateway.recording.reading.recording_file import RecordingFile, Selection
from gateway.recording.reading.timeline import (
    SAMPLES,
    SUMMARISED_PATHS,
    ReportProgress,
    Timeline,
    ignore_progress,
)
from gateway.recording.replay.replay_comparison import (
    AFTER_START,
    EXACT,
    LATEST_NS,
    MAX_COUNTERPART_DELAY_NS,
    OTHER_PLATFORM,
    ReplayComparison,
    Tolerance,
)
from gateway.recording.replay.replay_pipeline import ReplayPipeline, ReplayStep, StepMessage, read_steps
from gateway.topics import TOPICS

WARM_UP_NS = 120_000_000_000
"""Time after which a replay from the middle of a run is compared. Basis: in free swing its angle agrees within 0.03 degrees after
40 s; the angle of a filter that was not sure of itself may differ for as long as that lasts."""
NOTHING_COMPARED = (
    f"nothing could be compared: without the start of a run its first {WARM_UP_NS / 1e9:g} s say nothing, and no part of these "
    "recordings is longer without a gap; give the whole run"
)
ReplayMode = Literal["same", "other"]


@dataclass(slots=True)
class ReplayResult:
    """What a replay has found."""

    mode: ReplayMode
    """same: with the recorded configuration and calibration; other: what it would have said with others."""
    comparison: ReplayComparison
    recorded: list[tuple[str, SegmentSummary]]
    """What each run told, by its boot id, in order of time."""
    recomputed: list[tuple[str, SegmentSummary]]
    notes: list[str] = field(default_factory=list)
    """Files that were left out, how exactly the results are compared, and from when on."""
    hidden: list[str] = field(default_factory=list)
    """Segments that are missing, and what could not be read: nothing of it was compared."""
    altered: list[str] = field(default_factory=list)
    """Files with a wrong checksum of which every message could be read."""
    is_from_start: bool = True
    """Every run was replayed from its beginning: its motion, swing, conditions and alerts can be computed again."""

    @property
    def is_compared(self) -> bool:
        """Something was compared: messages, or with other settings what was told."""
        return bool(self.recorded) if self.mode == "other" else bool(self.comparison.compared)

    @property
    def has_losses(self) -> bool:
        """Not everything could be compared, or a file is not as it was written."""
        return bool(self.hidden or self.altered) or not self.is_compared


class ReplayRun:
    """Replays the steps of a timeline."""

    def __init__(
        self,
        timeline: Timeline,
        interval: RecordingInterval,
        configuration: Configuration | None = None,
        record: CalibrationRecord | None = None,
        warm_up_s: float | None = None,
    ) -> None:
        """`warm_up_s`: begin this long before the interval in place of the beginning of the run.

        Raises `InputError` for an impossible interval, `RecordingError` where there are no samples.
        """
        timeline.span()
        self._timeline = timeline
        self._selection = timeline.select(interval)
        if warm_up_s is not None and self._selection.begin_ns is None:
            raise InputError("--warm-up: is for a part of the recording; give --from or --last too")
        self._warm_up_ns = None if warm_up_s is None else round(warm_up_s * 1e9)
        self._pipeline = ReplayPipeline(timeline, configuration, record)
        self._mode: ReplayMode = "same" if configuration is None and record is None else "other"
        self._comparison = ReplayComparison(EXACT)
        self._recorded: defaultdict[str, SummaryBuilder] = defaultdict(SummaryBuilder)
        """Of each run, by its boot id."""
        self._recomputed: defaultdict[str, SummaryBuilder] = defaultdict(SummaryBuilder)
        self._from_ns = self._selection.begin_ns or 0
        """Gateway time from which on the results are compared."""
        self._boot_id: str | None = None
        self._sequence = -1
        self._files: dict[Path, RecordingFile] = {}
        """Those that were read."""
        self._newest: ReplayStep | None = None
        """The last step with a block."""
        self._notes: list[str] = []
        self._is_from_start = True
        self._missing_blocks = 0
        """Before `_from_ns`."""
        self._waiting_note = ""
        """How the results are compared from `_from_ns` on; a note as soon as one is."""
        self._why_not = ""
        """Why they cannot be compared before that."""
        self._compared_up_to = ""
        """End of what was compared before the missing blocks; empty: nothing was."""

    def result(self, report: ReportProgress = ignore_progress) -> ReplayResult:
        """Replay everything. Raises `RecordingError`, `CalibrationError` or `ConfigurationError`."""
        selection = self._steps()
        for step in read_steps(self._timeline, selection, report):
            self._files[step.file.path] = step.file
            self._check_continuity(step)
            self._take(step)
            self._newest = self._newest if step.block is None else step
        self._end_run(is_last=True)
        result = ReplayResult(
            self._mode,
            self._comparison,
            _summaries(self._recorded),
            _summaries(self._recomputed),
            [*self._timeline.remarks, *missing_of(self._timeline).remarks, *self._notes],
            [*describe_hidden(self._timeline, selection), *self._damaged(may_hide_messages)],
            self._damaged(lambda losses: losses.altered and not may_hide_messages(losses)),
            self._is_from_start,
        )
        if not result.is_compared:
            result.notes.append(NOTHING_COMPARED)
        return result

    def _damaged(self, is_meant: Callable[[SalvageReport], bool]) -> list[str]:
        return [
            f"{path.name}: {', '.join(describe_losses(file.losses))}"
            for path, file in self._files.items()
            if is_meant(file.losses)
        ]

    def _steps(self) -> Selection:
        """Return the selection of the steps: from the beginning of the run, or of the warm-up."""
        begin_ns = self._selection.begin_ns
        if begin_ns is None:
            return self._selection
        if self._warm_up_ns is not None:
            return Selection(begin_ns - self._warm_up_ns, self._selection.end_ns)
        segments = self._timeline.segments
        first = next((each for each in segments if each.to_ns >= begin_ns), segments[-1])
        begin = next(each for each in segments if each.boot_id == first.boot_id)
        return Selection(begin.from_ns, self._selection.end_ns)

    def _check_continuity(self, step: ReplayStep) -> None:
        """Choose how exactly the results of this and the next steps are compared."""
        if step.boot_id != self._boot_id:
            self._end_run()
            self._boot_id, self._sequence = step.boot_id, -1
            self._from_ns = self._selection.begin_ns or 0
            self._comparison.tolerance = self._platform_tolerance(step.origin)
        block, sequence = (step.next_block, step.next_sequence) if step.block is None else (step.block, step.sequence)
        missing = sequence - self._sequence - 1
        if missing > 0 and block is not None:
            self._missing_blocks += missing
            if self._sequence >= 0:
                self._begin_gap()
            self._compare_from(int(block.time_ns[0]) + WARM_UP_NS, step, is_begin=self._sequence < 0)
        self._sequence = max(self._sequence, sequence)

    def _end_run(self, *, is_last: bool = False) -> None:
        """Count what waits.

        What follows from the last block may be missing where the end of the run was cut off, and at the end of the last file,
        because a file that was not given may go on with it.
        """
        if self._compared_up_to:
            self._note_end()
        self._missing_blocks, self._waiting_note = 0, ""
        torn_from_ns = LATEST_NS
        newest = self._newest
        if newest is not None and newest.block is not None:
            ends = [
                each for each in self._timeline.segments if each.boot_id == newest.boot_id
            ]  # the last may have no block
            if is_last or newest.segment.is_torn or ends[-1].is_torn:
                torn_from_ns = int(newest.block.time_ns[0])
        self._comparison.end_waiting(LATEST_NS, torn_from_ns)

    def _begin_gap(self) -> None:
        """Count what waits before missing blocks: what follows from the last block before them may be missing with them."""
        newest = self._newest
        if newest is None or newest.block is None:
            return
        self._comparison.end_waiting(LATEST_NS, int(newest.block.time_ns[0]), is_gap=True)
        if newest.end_ns >= self._from_ns:
            self._compared_up_to = iso_utc(newest.end_ns + newest.clock.wall_offset_ns)

    def _compare_from(self, time_ns: int, step: ReplayStep, *, is_begin: bool) -> None:
        """Compare within a tolerance, from this time on."""
        self._comparison.tolerance, self._is_from_start = AFTER_START, False
        why = f"{self._missing_blocks} blocks of the run are not in these files, or cannot be read"
        if is_begin and self._warm_up_ns is not None:
            why, time_ns = f"a warm-up of {self._warm_up_ns / 1e9:g} s", self._from_ns
        self._from_ns = max(self._from_ns, time_ns)
        up_to = f"up to {self._compared_up_to}, and " if self._compared_up_to else ""
        since = iso_utc(self._from_ns + step.clock.wall_offset_ns)
        self._why_not = why
        self._waiting_note = f"{why}: compared {up_to}from {since} on, {AFTER_START.description}"

    def _note_end(self) -> None:
        """Note that nothing behind missing blocks was compared: the run ends, or what was asked for, before anything could be."""
        newest = self._newest
        left_ns = 0 if newest is None else max(0, newest.end_ns - self._from_ns + WARM_UP_NS)
        self._notes.append(
            f"{self._why_not}: compared up to {self._compared_up_to}, and nothing behind them: "
            f"{WARM_UP_NS / 1e9:g} s would be needed, {left_ns / 1e9:.1f} s are left"
        )

    def _note_tolerance(self) -> None:
        """Note how the results are compared, once something is."""
        self._notes += filter(None, [self._waiting_note])
        self._missing_blocks, self._waiting_note, self._compared_up_to = 0, "", ""

    def _platform_tolerance(self, origin: Mapping[str, str]) -> Tolerance:
        # the fields of an origin on which the last bit of a result may depend
        here = {"software": __version__, "numpy": np.__version__, "machine": platform.machine()}
        others = [
            f"{name} {origin.get(name, '?')}, here {value}" for name, value in here.items() if origin.get(name) != value
        ]
        if not others:
            return EXACT
        self._notes.append(f"recorded with {'; '.join(others)}: compared {OTHER_PLATFORM.description}")
        return OTHER_PLATFORM

    def _take(self, step: ReplayStep) -> None:
        for message in step.messages:
            self._take_recorded(message, step)
        for outgoing in self._pipeline.compute(step):
            if self._from_ns <= outgoing.log_time_ns <= step.known_to_ns:
                if self._mode == "same":
                    self._comparison.add_recomputed(outgoing)
                if outgoing.topic != "samples":
                    told = self._recomputed[step.boot_id]
                    told.count(TOPICS[outgoing.topic].path, outgoing.log_time_ns, 0)
                    told.add(outgoing.message, outgoing.log_time_ns)
        if self._mode == "same":
            self._comparison.end_waiting(step.end_ns - MAX_COUNTERPART_DELAY_NS)

    def _take_recorded(self, message: StepMessage, step: ReplayStep) -> None:
        recorded = message.recorded
        if self._from_ns <= recorded.log_time_ns <= step.known_to_ns:
            self._note_tolerance()
            if self._mode == "same":
                self._comparison.add_recorded(recorded)
            if recorded.topic != SAMPLES:
                self._note(message, step)
        elif recorded.log_time_ns >= (self._selection.begin_ns or 0):
            self._comparison.leave_out(recorded)

    def _note(self, message: StepMessage, step: ReplayStep) -> None:
        """Add a recorded message to the summary of its run, which knows the others by their number."""
        recorded, told = message.recorded, self._recorded[step.boot_id]
        told.count(recorded.topic, recorded.log_time_ns, len(recorded.data))
        if recorded.topic in SUMMARISED_PATHS:
            told.add(message.content or step.file.decode(recorded), recorded.log_time_ns)


def _summaries(builders: Mapping[str, SummaryBuilder]) -> list[tuple[str, SegmentSummary]]:
    found = ((boot_id, builder.summary()) for boot_id, builder in builders.items())
    return [(boot_id, summary) for boot_id, summary in found if summary is not None]
