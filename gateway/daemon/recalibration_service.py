"""The recalibration inside the daemon: requests wait here for the processing thread, which answers them between two blocks."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

from pydantic import BaseModel, ConfigDict, ValidationError

from devices.block import DeviceInfo, SampleBlock
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.wall_clock import WallClockMonitor
from gateway.errors import describe_problems
from gateway.messages import NO_SESSION, CalibrationSession, Verdict
from gateway.pipeline.rate_limiter import RateLimiter
from gateway.recalibration.interlock import LoadState
from gateway.recalibration.journal import RequestAnswer
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.session import Session, Timestamp
from gateway.recalibration.session_message import make_session_message

log = logging.getLogger("plumbline.recalibration")
WAITING = 16
SESSION_PERIOD_S = 0.5
"""While a session collects poses it is published this often."""


@dataclass(frozen=True, slots=True)
class PendingRequest:
    """A request that waits for its answer; `reply` is called by the processing thread."""

    verb: str
    payload: bytes
    reply: Callable[[RequestAnswer], object]


class LoadSignal(BaseModel):
    """The message that a load cell or the crane's controller puts on `<gateway>/load`."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)

    loaded: bool


@dataclass(frozen=True, slots=True)
class ServiceUpdate:
    """What follows from the requests that were answered."""

    pipeline_changed: bool
    """The pipeline must be opened again."""
    session_due: bool
    """The session must be published now: it has changed, or it collects poses."""


class RecalibrationService:
    """Serves the recalibration. The processing thread calls everything but `submit` and `set_load_signal`."""

    def __init__(self, recalibration: Recalibration, wall_clock: WallClockMonitor) -> None:
        self._recalibration = recalibration
        self._wall_clock = wall_clock
        self._waiting: BoundedQueue[PendingRequest] = BoundedQueue(WAITING)
        self._loads: BoundedQueue[bytes] = BoundedQueue(WAITING)
        self._limiter = RateLimiter(SESSION_PERIOD_S)
        self._published = NO_SESSION
        self._shown: Session | None = None
        self._pipeline_changed = False
        self.session: CalibrationSession = NO_SESSION
        """The state of the session for the messages."""

    def submit(self, request: PendingRequest) -> bool:
        """Add a request; return False if too many are waiting. Called by any thread."""
        return self._waiting.put(request)

    def set_load_signal(self, payload: bytes) -> None:
        """Take a message of the load signal. Called by any thread."""
        self._loads.put(payload)

    @property
    def dropped(self) -> int:
        """Number of requests that came while too many were waiting."""
        return self._waiting.dropped

    @property
    def suspended(self) -> str | None:
        """Why nothing is known of the load; None: it is known."""
        return self._recalibration.suspension

    def open(self, info: DeviceInfo) -> None:
        """Start with a device that was opened."""
        self._recalibration.open(info, self._now())
        self._update_session()

    def feed(self, block: SampleBlock) -> None:
        """Take a block of raw samples."""
        self._pipeline_changed |= self._recalibration.feed(block, self._now())

    def set_condition(self, verdict: Verdict, time_ns: int) -> None:
        """Take a verdict of the condition stage, for the interlock."""
        self._recalibration.interlock.add_verdict(verdict, time_ns)

    def serve(self) -> ServiceUpdate:
        """Answer the waiting requests, and end a session that has timed out."""
        while len(self._loads) and (payload := self._loads.get(0.0)) is not None:
            self._take_load_signal(payload)
        changed = self._recalibration.tick(self._now()) or self._pipeline_changed
        self._pipeline_changed = False
        while len(self._waiting) and (request := self._waiting.get(0.0)) is not None:
            response = self._recalibration.answer(request.verb, request.payload, self._now())
            changed |= response.pipeline_changed
            request.reply(response.answer)
        self._update_session()
        return ServiceUpdate(changed, self._is_session_due())

    def _is_session_due(self) -> bool:
        changed = self.session is not self._published and _steady(self.session) != _steady(self._published)
        due = self.session.phase == "collecting" and self._limiter.is_due(self._wall_clock.clock.now_ns())
        self._published = self.session
        return changed or due

    def _update_session(self) -> None:
        session, progress = self._recalibration.session, self._recalibration.progress
        if session is not self._shown or progress is not None:
            self._shown, self.session = session, make_session_message(session, progress)

    def _take_load_signal(self, payload: bytes) -> None:
        try:
            signal = LoadSignal.model_validate_json(payload)
        except ValidationError as error:
            log.error(
                'load signal: %s; it must be JSON such as {"loaded": true}', describe_problems(error, "message")[0]
            )
            return
        self._recalibration.interlock.set_load_state(LoadState(signal.loaded, self._wall_clock.clock.now_ns()))

    def _now(self) -> Timestamp:
        now_ns = self._wall_clock.clock.now_ns()
        return Timestamp(now_ns, now_ns + self._wall_clock.state.wall_offset_ns)


def _steady(session: CalibrationSession) -> CalibrationSession:
    """Return the session without the fields that change with every block."""
    return replace(session, pose_fraction=0.0, seconds_left=None, next_direction=None)
