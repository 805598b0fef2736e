"""The thread of the commands: recalibration and configuration are decided and carried out here, and it waits for the disk.

It learns from the processing thread what the sensor reads, and that thread takes the calibration in force as a message for the
pipeline from `RecalibrationService`.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from devices.block import DeviceInfo, SampleBlock
from gateway.atomic_io import write_durably
from gateway.calibration.correction import Correction
from gateway.daemon.commands.requests import HANGS, RemoteRequest, RequestHandler, RequestQueue
from gateway.daemon.runtime.host import WallClockMonitor
from gateway.daemon.runtime.worker import BoundedQueue, FaultRegister, Worker
from gateway.daemon.storage.calibration_provider import CalibrationProvider
from gateway.file_input import reason_of
from gateway.messages import CalibrationOffer, CalibrationSession, Verdict
from gateway.pipeline.drift_monitor import DriftMonitor
from gateway.pipeline.outgoing_message import RateLimiter
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.requests import VERBS, Fetch, LoadSignal, Request
from gateway.recalibration.session import Session, Timestamp, make_session_message
from gateway.recording.segments.segment import CalibrationFiles

SESSION_PERIOD_S = 0.5
"""While a session collects poses it is published this often. Basis: a choice; a person sees a pose within half a second, and
`calibrate` asks after 1.5 s of silence."""
OFFER_PERIOD_S = 60.0
"""The store is searched for an offered record this often. Basis: a choice; a person waits a minute after weeks of service."""
NOT_OPEN = "no device has been opened yet"
INBOX = 256
"""Blocks and requests that may wait. Basis: a choice; 25 s of blocks of 0.1 s, longer than a write waits for a card."""
RESERVED = 16
"""Places of the inbox that blocks cannot take: for devices and state files. Basis: a choice; requests and state files come one by
one, and blocks lose little."""
WAITING = 16
"""Requests that may wait. Basis: a choice; commands come from persons, and more are refused at once."""
PATIENCE_S = 8.0
"""A step that takes longer hangs: requests are then refused. Basis: an SD card that cleans up stops for several seconds; a client
asks for 30 s."""
PART = "state_files"


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
        self._offer_limiter = RateLimiter(OFFER_PERIOD_S)
        self.offer: CalibrationOffer | None = None
        """The record that waits to be put in force."""
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
        if told is not None and self._offer_limiter.is_due(self._wall_clock.clock.now_ns()):
            self.offer = self._calibrations.offer(told.info)
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
            self.offer = self._calibrations.offer(self._info)
            changes = 0 if before is None else before.changes + 1
            self.instruction = PipelineInstruction(self._info, correction, drift, session, changes)
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


if TYPE_CHECKING:
    from gateway.daemon.commands.site_certificates import SiteCertificates  # its library is an extra


@dataclass(frozen=True, slots=True)
class StateFile:
    """A file that is to be replaced."""

    path: Path
    content: bytes


CommandItem = DeviceInfo | ProcessedBlock | StateFile


class CommandWorker(Worker[CommandItem]):
    """Carries out one request after the other, writes state files, and looks at the gateway's certificate."""

    def __init__(
        self,
        recalibration: RecalibrationService,
        handlers: Mapping[str, RequestHandler],
        certificates: "SiteCertificates | None",
        faults: FaultRegister,
    ) -> None:
        """`handlers` carry out the requests of other verbs than those of the recalibration; they may wait for the disk."""
        super().__init__("commands", BoundedQueue(INBOX))
        self._recalibration = recalibration
        self._handlers = dict(handlers) | dict.fromkeys(VERBS, recalibration.carry_out)
        self._certificates = certificates
        self._faults = faults
        self.requests = RequestQueue(WAITING)
        self.judge_trial: Callable[[float], None] | None = None
        """Ends a trial of the configuration when it is due, while samples are taken; its argument is the monotonic time, s."""

    @property
    def verbs(self) -> tuple[str, ...]:
        """The verbs of the requests that are carried out."""
        return tuple(self._handlers)

    @property
    def offer(self) -> CalibrationOffer | None:
        """The calibration record that waits to be put in force."""
        return self._recalibration.offer

    def open(self, info: DeviceInfo) -> None:
        """Take a device that was opened. Called by the processing thread."""
        self.inbox.put(info)

    def feed(self, block: ProcessedBlock, patience_s: float) -> None:
        """Take what the pipeline has made of a block; waits so long for room. Called by the processing thread."""
        if not patience_s or not self.inbox.put_waiting(block, patience_s):
            self.inbox.put(block, RESERVED)

    def write_soon(self, path: Path, content: bytes) -> None:
        """Replace a file without waiting for it; the old one stays where that fails, which is reported as a fault."""
        if not self.inbox.put(StateFile(path, content)):
            self._report(path, HANGS)

    def refuse_overdue(self) -> None:
        """Refuse what waits, where this thread does not get on. Called by the main thread."""
        if time.monotonic() - self.progress_s > PATIENCE_S:
            self.requests.refuse(f"could not be executed: {HANGS}")

    def handle(self, item: CommandItem) -> None:
        """Take an item, then do the next step."""
        match item:
            case DeviceInfo():
                self._recalibration.open(item)
            case ProcessedBlock():
                self._recalibration.feed(item)
            case StateFile():
                self._write(item)
        self.idle()

    def idle(self) -> None:
        """Carry out one request, so that many of them do not fill the inbox, and do what is due."""
        self._recalibration.tick()
        if self._certificates is not None:
            self._certificates.watch_expiry()
        if (judge_trial := self.judge_trial) is not None:
            judge_trial(time.monotonic())
        if (request := self.requests.take()) is not None:
            self._handlers[request.verb](request)

    def close(self) -> None:
        """Nothing is open between two steps."""

    def _write(self, file: StateFile) -> None:
        try:
            write_durably(file.path, file.content)
        except OSError as error:
            self._report(file.path, reason_of(error))
        else:
            self._faults.clear(PART)

    def _report(self, path: Path, why: str) -> None:
        self._faults.set(PART, f"{path}: cannot be saved ({why})")
