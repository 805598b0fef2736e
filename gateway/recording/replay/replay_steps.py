"""The recording as a replay needs it: block by block, with everything that was recorded until the next block."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from devices.block import SampleBlock
from gateway import messages
from gateway.pipeline.outgoing_message import ClockState
from gateway.recording.reading.recording_file import EVERYTHING, RecordedMessage, RecordingFile, Selection
from gateway.recording.reading.timeline import (
    SAMPLES,
    ReportProgress,
    Timeline,
    TimelineMessage,
    TimelineSegment,
    ignore_progress,
)
from gateway.topics import paths_with

RECOMPUTED_PATHS = paths_with(lambda topic: topic.recomputed)
IDLE_PATHS = paths_with(lambda topic: topic.sent_idle)
INPUT_PATHS = paths_with(lambda topic: topic.type in (messages.Condition, messages.Calibration, messages.Alert))
"""Topics from which the replay learns what it cannot compute: the recalibration, why alerts were suspended, acknowledgements."""


@dataclass(frozen=True, slots=True)
class StepMessage:
    """A message of a step, with its content where the replay needs it."""

    recorded: RecordedMessage
    content: messages.Condition | messages.Calibration | messages.Alert | None

    @property
    def clock(self) -> ClockState | None:
        """The clock at the time of the message, where its content is known."""
        if self.content is None:
            return None
        return ClockState(self.content.clock, self.content.time_ns - self.recorded.log_time_ns)


@dataclass(slots=True)
class ReplayStep:
    """A block and the messages until the next one; at the start of a run, the messages before any block."""

    segment: TimelineSegment
    file: RecordingFile
    block: SampleBlock | None
    sequence: int
    """Of the block in its run; -1 without one."""
    clock: ClockState
    messages: list[StepMessage] = field(default_factory=list)
    next_block: SampleBlock | None = None
    """The next block of the run; None at its end."""
    next_sequence: int = -1

    @property
    def end_ns(self) -> int:
        """Gateway time of the newest sample; 0 without a block."""
        return 0 if self.block is None else int(self.block.time_ns[-1])

    def is_idle(self, message: StepMessage) -> bool:
        """Return whether a message was sent while no samples came: after this block, and not because of the next one."""
        time_ns = message.recorded.log_time_ns
        if message.recorded.topic not in IDLE_PATHS or time_ns <= self.end_ns:
            return False
        return self.next_block is None or time_ns not in self.next_block.time_ns


def read_steps(
    timeline: Timeline, selection: Selection = EVERYTHING, report: ReportProgress = ignore_progress
) -> Iterator[ReplayStep]:
    """Yield the steps of a selection in order. Raises `RecordingError`."""
    wanted = Selection(selection.begin_ns, selection.end_ns, RECOMPUTED_PATHS)
    step: ReplayStep | None = None
    for message in timeline.messages(wanted, report):
        following = None
        if message.recorded.topic == SAMPLES:
            following = _begin_step(message)
        elif step is None or step.segment.boot_id != message.segment.boot_id:
            following = ReplayStep(message.segment, message.file, None, -1, ClockState("free_running", 0))
        if following is not None:
            if step is not None:
                if step.segment.boot_id == following.segment.boot_id:
                    step.next_block, step.next_sequence = following.block, following.sequence
                yield step
            step = following
        if step is not None:
            step.messages.append(_read(message))
    if step is not None:
        yield step


def _begin_step(message: TimelineMessage) -> ReplayStep | None:
    """Return the step of a block; None where it cannot be read, which is counted."""
    read = message.samples()
    if read is None:
        return None
    samples, block = read
    clock = ClockState(samples.clock, samples.time_ns - int(block.time_ns[-1]))
    return ReplayStep(message.segment, message.file, block, samples.sequence, clock)


def _read(message: TimelineMessage) -> StepMessage:
    content = message.decode() if message.recorded.topic in INPUT_PATHS else None
    return StepMessage(message.recorded, content)
