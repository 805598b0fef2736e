"""The pipeline again, on the samples of a recording: with its configuration and calibration, or with others.

The recording comes step by step: a block, with everything that was recorded until the next one.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TypeVar

from devices.block import DeviceInfo, SampleBlock
from devices.errors import RecordingError
from gateway import messages
from gateway.calibration.correction import correction_for
from gateway.calibration.drift.rest_monitor import RestDriftMonitor
from gateway.calibration.record import CalibrationRecord
from gateway.configuration.model import Configuration
from gateway.pipeline.drift_monitor import DriftMonitor
from gateway.pipeline.incidents import Acknowledgement, IncidentRegister, past_incident
from gateway.pipeline.outgoing_message import ClockState, HeaderMaker, MessageTime, OutgoingMessage
from gateway.pipeline.pipeline import Pipeline, PipelineCalibration
from gateway.recording.reading.recording_file import RecordedMessage, RecordingFile, SegmentIndex, Selection
from gateway.recording.reading.sample_calibration import recorded_configuration, recorded_correction
from gateway.recording.reading.timeline import (
    SAMPLES,
    ReportProgress,
    Timeline,
    TimelineMessage,
)
from gateway.recording.replay.replay_comparison import LATEST_NS
from gateway.topics import TOPIC_OF, paths_with

RECOMPUTED_PATHS = paths_with(lambda topic: topic.recomputed)
IDLE_PATHS = paths_with(lambda topic: topic.sent_idle)
INPUT_PATHS = paths_with(lambda topic: topic.type in (messages.Condition, messages.Calibration, messages.Alert))
"""Topics from which the replay learns what it cannot compute: the clock, the recalibration, acknowledgements."""
First = TypeVar("First", messages.Calibration, messages.Alert)


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

    segment: SegmentIndex
    file: RecordingFile
    origin: dict[str, str]
    """Of the run."""
    block: SampleBlock | None
    sequence: int
    """Of the block in its run; -1 without one."""
    clock: ClockState
    messages: list[StepMessage] = field(default_factory=list)
    next_block: SampleBlock | None = None
    """The next block of the run; None at its end."""
    next_sequence: int = -1

    @property
    def boot_id(self) -> str:
        """Id of the run."""
        return self.origin.get("boot_id", "")

    @property
    def end_ns(self) -> int:
        """Gateway time of the newest sample; 0 without a block."""
        return 0 if self.block is None else int(self.block.time_ns[-1])

    @property
    def known_to_ns(self) -> int:
        """Gateway time up to which the results can be computed: without limit, or where blocks are missing next, of this one."""
        is_followed = self.block is None or self.next_block is None or self.next_sequence <= self.sequence + 1
        return LATEST_NS if is_followed else self.end_ns

    def is_idle(self, message: StepMessage) -> bool:
        """Return whether a message was sent while no samples came: after this block, and not because of the next one."""
        time_ns = message.recorded.log_time_ns
        if message.recorded.topic not in IDLE_PATHS or not self.end_ns < time_ns <= self.known_to_ns:
            return False
        return self.next_block is None or time_ns not in self.next_block.time_ns


def read_steps(timeline: Timeline, selection: Selection, report: ReportProgress) -> Iterator[ReplayStep]:
    """Yield the steps of a selection in order. Raises `RecordingError`."""
    wanted = Selection(selection.begin_ns, selection.end_ns, RECOMPUTED_PATHS)
    step: ReplayStep | None = None
    for message in timeline.messages(wanted, report):
        following = None
        if message.recorded.topic == SAMPLES:
            following = _begin_step(message)
        elif step is None or step.boot_id != message.file.boot_id:
            following = ReplayStep(
                message.segment, message.file, message.file.origin, None, -1, ClockState("free_running", 0)
            )
        if following is not None:
            if step is not None:
                if step.boot_id == following.boot_id:
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
    return ReplayStep(message.segment, message.file, message.file.origin, block, samples.sequence, clock)


def _read(message: TimelineMessage) -> StepMessage:
    content = message.decode() if message.recorded.topic in INPUT_PATHS else None
    return StepMessage(message.recorded, content)


class ReplayPipeline:
    """Computes what follows from each step, in the way of the gateway's processing thread.

    What the gateway was told from outside is taken from the recording: the state of a recalibration, the change of a record,
    acknowledgements, the number of the first alert, the clock, and when it noted that no samples came.
    """

    def __init__(
        self,
        timeline: Timeline,
        configuration: Configuration | None = None,
        record: CalibrationRecord | None = None,
    ) -> None:
        """`configuration` and `record` take the place of the recorded ones."""
        self._timeline = timeline
        self._own_configuration = configuration
        self._own_record = record
        self._boot_id: str | None = None
        self._device: DeviceInfo | None = None

    def compute(self, step: ReplayStep) -> list[OutgoingMessage]:
        """Return what follows from a step. Raises `RecordingError`, `CalibrationError` or `ConfigurationError`."""
        if step.boot_id != self._boot_id:
            self._begin_run(step)
        elif (device := step.file.device()) != self._device:
            self._device = device
            self._open(self._calibration, step)
        return list(self._compute(step))

    def _begin_run(self, step: ReplayStep) -> None:
        self._boot_id = step.boot_id
        self._device = step.file.device()
        configuration = self._own_configuration or recorded_configuration(step.file)
        if configuration is None:
            raise RecordingError(f"{step.segment.path}: has no configuration; give one with --config")
        self._configuration = configuration
        self._headers = HeaderMaker()
        self._incidents = IncidentRegister(self._boot_id, self._last_number(step))
        self._drift = DriftMonitor(None)
        calibration = self._first(step, messages.Calibration)
        self._session = messages.NO_SESSION if calibration is None else calibration.session
        self._open(calibration, step)

    def _open(self, calibration: messages.Calibration | None, step: ReplayStep) -> None:
        """Make the pipeline of a calibration."""
        self._calibration = calibration
        device = step.file.device()
        axes = self._configuration.device.axes
        if self._own_record is not None:
            correction = correction_for(device, axes, self._own_record)
        else:
            correction = recorded_correction(step.file, calibration, axes)
        if self._drift.calibration_id != correction.calibration_id or correction.record is None:
            self._drift = DriftMonitor(None if correction.record is None else RestDriftMonitor(correction))
        self._pipeline = Pipeline(self._configuration, device, correction, self._headers, self._drift, self._incidents)

    def _last_number(self, step: ReplayStep) -> int | None:
        """Return the number of the last change before the run; None where the recording was made before changes had one."""
        first = self._first(step, messages.Alert)
        if first is None or first.alert_number is None:
            return None
        return first.alert_number if first.rule is None else first.alert_number - 1

    def _first(self, step: ReplayStep, kind: type[First]) -> First | None:
        """Return the first message of a kind in the run, or in the part of it that is replayed."""
        wanted = Selection(step.segment.from_ns, topics=frozenset({TOPIC_OF[kind].path}))
        for message in self._timeline.messages(wanted):
            content = message.decode()
            if message.file.boot_id == self._boot_id and isinstance(content, kind):
                return content
        return None

    def _compute(self, step: ReplayStep) -> Iterator[OutgoingMessage]:
        own_calibrations = 0
        # The first messages of a long block are recorded before it: at a start in a step without a block.
        self._pipeline.set_session(self._session)
        if step.block is not None:
            made = self._pipeline.process(step.block, step.clock).messages
            own_calibrations = sum(message.topic == "calibration" for message in made)
            yield from made
        idle_ns = 0
        for message in step.messages:
            time_ns = message.recorded.log_time_ns
            if isinstance(message.content, messages.Calibration):
                own_calibrations -= 1
                if own_calibrations < 0:
                    yield self._announce(message, step)
            elif step.is_idle(message) and time_ns > idle_ns:
                idle_ns = time_ns
                clock = next(
                    (each.clock for each in step.messages if each.clock and each.recorded.log_time_ns == time_ns), None
                )
                yield from self._pipeline.idle(time_ns, clock or step.clock).messages
            if isinstance(message.content, messages.Alert):
                yield from self._acknowledge(message.content, MessageTime(time_ns, message.clock or step.clock))

    def _acknowledge(self, alert: messages.Alert, now: MessageTime) -> list[OutgoingMessage]:
        """Return what follows from an acknowledgement."""
        if alert.event != "acknowledged" or alert.incident is None or alert.acknowledged_by is None:
            return []
        is_past = not alert.incident.startswith(f"{self._boot_id}-")
        if is_past and alert.rule is not None and self._incidents.find(alert.incident) is None:
            self._incidents.remember([past_incident(alert.incident, alert.rule, alert.limit_deg, alert.time_ns)])
        return self._pipeline.acknowledge(
            Acknowledgement(alert.incident, alert.acknowledged_by, alert.reason or ""), now
        )

    def _announce(self, message: StepMessage, step: ReplayStep) -> OutgoingMessage:
        """Take a calibration that the gateway was told, and return the message in which it announced it."""
        content, before = message.content, self._calibration
        assert isinstance(content, messages.Calibration)
        self._session = content.session
        if before is None or _calibration_state(before) != _calibration_state(content):
            self._open(content, step)
        self._pipeline.set_session(self._session)
        return self._pipeline.calibration_message(
            MessageTime(message.recorded.log_time_ns, message.clock or step.clock)
        )


def _calibration_state(calibration: messages.Calibration) -> PipelineCalibration:
    return PipelineCalibration(calibration.calibration_id, calibration.status, calibration.session.suspended)
