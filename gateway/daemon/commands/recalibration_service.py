"""The recalibration inside the daemon: requests and blocks in, the calibration in force out, as a message for the pipeline."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.correction import Correction
from gateway.daemon.commands.requests import RemoteRequest
from gateway.daemon.runtime.host import WallClockMonitor
from gateway.daemon.storage.calibration_provider import CalibrationProvider
from gateway.messages import CalibrationSession, Verdict
from gateway.pipeline.drift_monitor import DriftMonitor
from gateway.pipeline.outgoing_message import RateLimiter
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.requests import Fetch, LoadSignal, Request
from gateway.recalibration.session import Session, Timestamp, make_session_message
from gateway.recording.segments.segment import CalibrationFiles

SESSION_PERIOD_S = 0.5
"""While a session collects poses it is published this often. Basis: a choice; a person sees a pose within half a second, and
`calibrate` asks after 1.5 s of silence."""
NOT_OPEN = "no device has been opened yet"


@dataclass(frozen=True, slots=True)
class ProcessedBlock:
    """A block of raw samples and what the pipeline has made of it; without a block: what it has made of their absence."""

    block: SampleBlock | None
    verdict: Verdict | None
    """The verdict of the condition stage, where there is a new one."""
    time_ns: int
    changes: int
    """Those of the calibration that the pipeline knew."""


@dataclass(frozen=True, slots=True, eq=False)
class PipelineInstruction:
    """What the pipeline is told of the calibration of a device, and of its recalibration.

    It publishes what it is told at once, so that a replay of the recording knows the same.
    """

    info: DeviceInfo
    correction: Correction
    drift: DriftMonitor
    """The monitor of the record with its state from the disk, for a pipeline that does not monitor this record yet."""
    session: CalibrationSession
    suspended: str | None
    """Why nothing is known of the load; None: it is known."""
    changes: int
    """Number of changes of the correction or of the suspension."""


class RecalibrationService:
    """Serves the recalibration. The thread of the commands calls everything but `fetch` and `set_load_signal`."""

    def __init__(
        self,
        recalibration: Recalibration,
        calibrations: CalibrationProvider,
        wall_clock: WallClockMonitor,
        attach: Callable[[CalibrationFiles | None], bool],
    ) -> None:
        """`attach` has recordings carry the files of the record in force; it returns False where it must be called again."""
        self._recalibration = recalibration
        self._calibrations = calibrations
        self._wall_clock = wall_clock
        self._attach = attach
        self._attached: Correction | None = None
        """The correction whose files were attached last."""
        self._loaded_ns: int | None = None
        self._limiter = RateLimiter(SESSION_PERIOD_S)
        self._shown: Session | None = None
        self._info: DeviceInfo | None = None
        self.instruction: PipelineInstruction | None = None
        """The newest message for the pipeline, which takes it before each block; None: no device has been opened."""
        self.opened = threading.Event()
        """Set when the first device has been opened."""

    def set_load_signal(self, signal: LoadSignal) -> None:
        """Take a message of the load signal. Called by any thread."""
        if signal.loaded:
            self._loaded_ns = self._wall_clock.clock.now_ns()

    def fetch(self, request: RemoteRequest) -> None:
        """Answer with what is stored. Called by the thread of the remote calls."""
        if self.instruction is None:
            request.refuse(NOT_OPEN)
        else:
            request.answer(self._recalibration.fetch(request.expect(Fetch)))

    def open(self, info: DeviceInfo) -> None:
        """Start with a device that was opened."""
        self._recalibration.open(info, self._now())
        self._info = info
        self._tell(True)
        self.opened.set()

    def feed(self, step: ProcessedBlock) -> None:
        """Take a block, and for the interlock its verdict, unless it is of a pipeline from before the last change."""
        if self.instruction is None:
            return
        has_ended = step.block is not None and self._recalibration.feed(step.block, self._now())
        if step.verdict is not None and step.changes == self.instruction.changes:
            self._recalibration.interlock.add_verdict(step.verdict, step.time_ns)
        self._tell(has_ended)

    def tick(self) -> None:
        """End a session that has timed out, take the load signal, and attach the files of another record to the recording."""
        if self._loaded_ns is not None:
            self._recalibration.interlock.note_load(self._loaded_ns)
        self._tell(self._recalibration.tick(self._now()))
        told = self.instruction
        if told is None or told.correction is self._attached:
            return
        if self._attach(self._calibrations.files(told.info, told.correction)):
            self._attached = told.correction

    def carry_out(self, request: RemoteRequest) -> None:
        """Execute a request or refuse it; the pipeline is told before the answer is sent."""
        if self.instruction is None:
            request.refuse(NOT_OPEN)
            return
        response = self._recalibration.answer(request.verb, request.expect(Request), self._now(), request.begin)
        self._tell(response.pipeline_changed)
        request.answer(response.answer)

    def _tell(self, changed: bool) -> None:
        """Make the next message where there is news; `changed`: the correction or the suspension may be another one."""
        session, before = self._session_message(), self.instruction
        if changed and self._info is not None:
            correction = self._calibrations.correction(self._info)
            drift = self._calibrations.drift_monitor(self._info, correction)
            changes = 0 if before is None else before.changes + 1
            self.instruction = PipelineInstruction(
                self._info, correction, drift, session, self._recalibration.suspension, changes
            )
        elif before is not None and session is not before.session:
            due = session.phase == "collecting" and self._limiter.is_due(self._wall_clock.clock.now_ns())
            if due or _steady(session) != _steady(before.session):
                self.instruction = replace(before, session=session)

    def _session_message(self) -> CalibrationSession:
        """Return the state of the session for the messages; the same object while nothing has changed."""
        session, progress = self._recalibration.session, self._recalibration.progress
        if session is not self._shown or progress is not None or self.instruction is None:
            self._shown = session
            return make_session_message(session, progress)
        return self.instruction.session

    def _now(self) -> Timestamp:
        now_ns = self._wall_clock.clock.now_ns()
        return Timestamp(now_ns, now_ns + self._wall_clock.state.wall_offset_ns)


def _steady(session: CalibrationSession) -> CalibrationSession:
    """Return the session without the fields that change with every block."""
    return replace(session, pose_fraction=0.0, seconds_left=None, next_direction=None)
