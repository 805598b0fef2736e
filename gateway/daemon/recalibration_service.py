"""The recalibration inside the daemon: requests wait here for the processing thread, which answers them between two blocks."""

from dataclasses import dataclass, replace

from devices.block import DeviceInfo, SampleBlock
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.remote_request import RemoteRequest
from gateway.daemon.wall_clock import WallClockMonitor
from gateway.messages import NO_SESSION, CalibrationSession, Verdict
from gateway.pipeline.rate_limiter import RateLimiter
from gateway.recalibration.interlock import LoadState
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.requests import Fetch, LoadSignal, Request
from gateway.recalibration.session import Session, Timestamp
from gateway.recalibration.session_message import make_session_message

WAITING = 16
SESSION_PERIOD_S = 0.5
"""While a session collects poses it is published this often."""


@dataclass(frozen=True, slots=True)
class ServiceUpdate:
    """What follows from the requests that were answered."""

    pipeline_changed: bool
    """The pipeline must be opened again."""
    session_due: bool
    """The session must be published now: it has changed, or it collects poses."""


class RecalibrationService:
    """Serves the recalibration. The processing thread calls everything but `submit`, `fetch` and `set_load_signal`."""

    def __init__(self, recalibration: Recalibration, wall_clock: WallClockMonitor) -> None:
        self._recalibration = recalibration
        self._wall_clock = wall_clock
        self._waiting: BoundedQueue[RemoteRequest] = BoundedQueue(WAITING)
        self._load: LoadState | None = None
        self._limiter = RateLimiter(SESSION_PERIOD_S)
        self._published = NO_SESSION
        self._shown: Session | None = None
        self._pipeline_changed = False
        self.session: CalibrationSession = NO_SESSION
        """The state of the session for the messages."""

    def submit(self, request: RemoteRequest) -> None:
        """Add a request, or refuse it if too many are waiting. Called by the thread of the remote calls."""
        if not self._waiting.put(request):
            request.refuse("busy: too many requests are waiting")

    def set_load_signal(self, signal: LoadSignal) -> None:
        """Take a message of the load signal. Called by the thread of the remote calls."""
        self._load = LoadState(signal.loaded, self._wall_clock.clock.now_ns())

    def fetch(self, request: RemoteRequest) -> None:
        """Answer with what is stored. Called by the thread of the remote calls."""
        request.answer(self._recalibration.fetch(request.expect(Fetch)))

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
        """Answer one waiting request, and end a session that has timed out. More than one would delay a block."""
        if self._load is not None:
            self._recalibration.interlock.set_load_state(self._load)
        changed = self._recalibration.tick(self._now()) or self._pipeline_changed
        self._pipeline_changed = False
        if len(self._waiting) and (request := self._waiting.get(0.0)) is not None:
            response = self._recalibration.answer(request.verb, request.expect(Request), self._now())
            changed |= response.pipeline_changed
            request.answer(response.answer)
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

    def _now(self) -> Timestamp:
        now_ns = self._wall_clock.clock.now_ns()
        return Timestamp(now_ns, now_ns + self._wall_clock.state.wall_offset_ns)


def _steady(session: CalibrationSession) -> CalibrationSession:
    """Return the session without the fields that change with every block."""
    return replace(session, pose_fraction=0.0, seconds_left=None, next_direction=None)
