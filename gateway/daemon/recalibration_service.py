"""Where requests wait for the processing thread, and what of a session is news."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

from pydantic import BaseModel, ConfigDict, ValidationError

from devices.block import DeviceInfo, SampleBlock
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.wall_clock import WallClockWatch
from gateway.messages import NO_SESSION, CalibrationSession, Verdict
from gateway.pipeline.rate_limiter import RateLimiter
from gateway.recalibration.interlock import LoadState
from gateway.recalibration.journal import Answer
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.session import Session
from gateway.recalibration.timestamp import Timestamp
from gateway.recalibration.view import session_message

log = logging.getLogger("plumbline.recalibration")
WAITING = 16
NEWS_PERIOD_S = 0.5


@dataclass(frozen=True, slots=True)
class PendingRequest:
    """A request on its way; `reply` may be called from the processing thread."""

    verb: str
    payload: bytes
    reply: Callable[[Answer], object]


class LoadSignal(BaseModel):
    """What a load cell or the crane's controller puts on `<gateway>/load`."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)

    loaded: bool


class RecalibrationService:
    """Serves the recalibration; all but `ask` and `hear_load` is called by the processing thread."""

    def __init__(self, recalibration: Recalibration, watch: WallClockWatch) -> None:
        self._recalibration = recalibration
        self._watch = watch
        self._waiting: BoundedQueue[PendingRequest] = BoundedQueue(WAITING)
        self._loads: BoundedQueue[bytes] = BoundedQueue(WAITING)
        self._pace = RateLimiter(NEWS_PERIOD_S)
        self._told = NO_SESSION
        self._seen: Session | None = None
        self._pipeline_changed = False
        self.view = NO_SESSION

    def submit(self, asked: PendingRequest) -> bool:
        """Hand a request over; False when too many wait. Called by any thread."""
        return self._waiting.put(asked)

    def set_load_signal(self, payload: bytes) -> None:
        """Hand over what the load signal said. Called by any thread."""
        self._loads.put(payload)

    @property
    def dropped(self) -> int:
        """Requests that found too many waiting."""
        return self._waiting.dropped

    @property
    def suspended(self) -> str | None:
        """Why nothing may be said of the load; None: it may."""
        return self._recalibration.suspended

    def open(self, info: DeviceInfo) -> None:
        """A device has been opened."""
        self._recalibration.open(info, self._now())
        self._look()

    def take(self, block: SampleBlock) -> None:
        """A block of raw samples."""
        self._pipeline_changed |= self._recalibration.feed(block, self._now())

    def set_condition(self, verdict: Verdict, time_ns: int) -> None:
        """What the condition stage said."""
        self._recalibration.watch.verdict(verdict, time_ns)

    def serve(self) -> bool:
        """Answer the waiting requests and end a session that has timed out; return whether the pipeline must be opened again."""
        while len(self._loads) and (payload := self._loads.get(0.0)) is not None:
            self._load(payload)
        changed = self._recalibration.tick(self._now()) or self._pipeline_changed
        self._pipeline_changed = False
        while len(self._waiting) and (asked := self._waiting.get(0.0)) is not None:
            response = self._recalibration.answer(asked.verb, asked.payload, self._now())
            changed |= response.pipeline_changed
            asked.reply(response.answer)
        self._look()
        return changed

    def has_changed(self) -> bool:
        """Whether the session must be told of now: at once when it has changed, at its pace while it collects."""
        changed = self.view is not self._told and _without_counters(self.view) != _without_counters(self._told)
        due = self.view.phase == "collecting" and self._pace.is_due(self._watch.clock.now_ns())
        self._told = self.view
        return changed or due

    def _look(self) -> None:
        session, progress = self._recalibration.session, self._recalibration.progress
        if session is not self._seen or progress is not None:
            self._seen, self.view = session, session_message(session, progress)

    def _load(self, payload: bytes) -> None:
        try:
            said = LoadSignal.model_validate_json(payload)
        except ValidationError as error:
            log.error('load signal: %s; it must be JSON such as {"loaded": true}', error.errors()[0]["msg"])
            return
        self._recalibration.watch.load(LoadState(said.loaded, self._watch.clock.now_ns()))

    def _now(self) -> Timestamp:
        now_ns = self._watch.clock.now_ns()
        return Timestamp(now_ns, now_ns + self._watch.state.wall_offset_ns)


def _without_counters(view: CalibrationSession) -> CalibrationSession:
    return replace(view, pose_fraction=0.0, seconds_left=None, next_direction=None)
