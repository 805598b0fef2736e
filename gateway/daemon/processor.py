"""The processing thread: runs the pipeline over the blocks, adds health and clock, and hands messages to the sinks."""

import logging
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from devices.block import DeviceInfo, SampleBlock
from gateway.configuration.model import Configuration
from gateway.daemon.calibration_provider import CalibrationProvider
from gateway.daemon.drift_state_store import DriftStateStore
from gateway.daemon.logs import RECORDED_ONLY
from gateway.daemon.publisher import Publisher
from gateway.daemon.recalibration_service import RecalibrationService
from gateway.daemon.recording_worker import InForce, RecordingWorker
from gateway.daemon.sampler import SamplerItem
from gateway.daemon.wall_clock import WallClockWatch
from gateway.daemon.worker import Worker
from gateway.messages import ClockOffset, Condition, Health
from gateway.pipeline.header import Header, HeaderMaker
from gateway.pipeline.outgoing_message import OutgoingMessage
from gateway.pipeline.pipeline import Pipeline
from gateway.topics import TOPICS

log = logging.getLogger("plumbline.pipeline")
INBOX = 256
HEALTH_PERIOD_S = 1.0
SINK_PATIENCE_S = 0.5


@dataclass(slots=True)
class Counts:
    """What has passed since start."""

    samples: int = 0
    newest_ns: int | None = None
    """Gateway time of the newest sample."""
    lost: int = 0
    invalid: int = 0


class Processor(Worker[SamplerItem]):
    """Owns the pipeline from start to stop."""

    def __init__(
        self,
        configuration: Configuration,
        info: DeviceInfo,
        shelf: CalibrationProvider,
        drift: DriftStateStore,
        watch: WallClockWatch,
        desk: RecalibrationService,
        recording: RecordingWorker,
        publisher: Publisher,
    ) -> None:
        super().__init__("processor", INBOX)
        self._configuration = configuration
        self._shelf = shelf
        self.drift = drift
        self._watch = watch
        self._desk = desk
        self._recording = recording
        self._publisher = publisher
        self._headers = HeaderMaker()
        self._fitting = ThreadPoolExecutor(1, thread_name_prefix="swing")
        self._next_second_ns = 0
        self._clock_steps = 0
        self.counts = Counts()
        self.health: Callable[[Header], Health] | None = None
        """Makes the health message; set before the thread starts."""
        self._open(info)

    def _open(self, info: DeviceInfo) -> None:
        self.info = info
        self._desk.open(info)
        self._recording.inbox.put(info)
        self._open_pipeline()

    def _open_pipeline(self) -> None:
        """With the calibration that is in force now; recordings and the log are told which that is."""
        self.correction = self._shelf.correction(self.info)
        told = None if self.is_alive() else RECORDED_ONLY  # at start the gateway describes itself
        log.info("%s: calibration in force: %s", self.info.device_id, self.correction.text, extra=told)
        in_force = InForce(self._shelf.files(self.info, self.correction))
        if not self._recording.inbox.put_waiting(in_force, SINK_PATIENCE_S):
            log.error("the recorder is too busy: later segments do not carry %s", self.correction.text)
        rest = self.drift.open(self.info.device_id, self.correction)
        self._pipeline = Pipeline(self._configuration, self.info, self.correction, self._headers, self._fitting, rest)
        self._pipeline.recalibrating(self._desk.view, self._desk.suspended)

    @property
    def requests_dropped(self) -> int:
        """Requests that found too many waiting."""
        return self._desk.dropped

    def handle(self, item: SamplerItem) -> None:
        """A block, or news of a device that came back."""
        if isinstance(item, SampleBlock):
            self.counts.samples += len(item)
            self.counts.newest_ns = int(item.time_ns[-1])
            self.counts.lost += item.lost
            self.counts.invalid += item.invalid
            self._desk.take(item)
            self._serve_requests()
            self._hand_on(self._pipeline.process(item, self._watch.state))
        elif item.info != self.info:
            self._open(item.info)
        self._each_second()

    def idle(self) -> None:
        """No block came for a moment: the reading may have become stale."""
        self._serve_requests()
        self._hand_on(self._pipeline.idle(self._watch.clock.now_ns(), self._watch.state))
        self._each_second()

    def close(self) -> None:
        """Say a last word on health, and keep what the drift watch has seen."""
        self._fitting.shutdown(wait=True, cancel_futures=True)
        self._hand_on(self._seconds_messages(self._watch.clock.now_ns()))
        self.drift.keep()

    def _serve_requests(self) -> None:
        """Answer requests; a change of the session or of the record in force is told at once."""
        if anew := self._desk.serve():
            self._open_pipeline()
            self._next_second_ns = 0  # nobody may read the health of the record before as that of this one
        else:
            self._pipeline.recalibrating(self._desk.view, self._desk.suspended)
        if self._desk.has_changed() or anew:
            newest_ns = self.counts.newest_ns
            time_ns = self._watch.clock.now_ns() if newest_ns is None else newest_ns
            self._hand_on([self._pipeline.calibration(time_ns, self._watch.state)])

    def _each_second(self) -> None:
        now_ns = self._watch.clock.now_ns()
        if now_ns < self._next_second_ns:
            return
        self._next_second_ns = now_ns + round(HEALTH_PERIOD_S * 1e9)
        self._hand_on(self._seconds_messages(now_ns))
        self.drift.tick()

    def _seconds_messages(self, now_ns: int) -> Iterable[OutgoingMessage]:
        state = self._watch.poll()
        stepped, self._clock_steps = self._watch.steps > self._clock_steps, self._watch.steps
        header = self._headers.make("clock", now_ns, state, self.correction.calibration_id)
        clock = ClockOffset(**header, log_time_ns=now_ns, wall_offset_ns=state.wall_offset_ns, stepped=stepped)
        yield OutgoingMessage("clock", now_ns, clock)
        if self.health is not None:
            header = self._headers.make("health", now_ns, state, self.correction.calibration_id)
            yield OutgoingMessage("health", now_ns, self.health(header))

    def _hand_on(self, emissions: Iterable[OutgoingMessage]) -> None:
        for emission in emissions:
            if isinstance(emission.message, Condition):
                self._desk.set_condition(emission.message.verdict, emission.log_time_ns)
            topic = TOPICS[emission.topic]
            if topic.published:
                self._publisher.inbox.put(emission)
            if topic.logged and self.info.can_wait:
                self._recording.inbox.put_waiting(emission, SINK_PATIENCE_S)
            elif topic.logged:
                self._recording.inbox.put(emission)
