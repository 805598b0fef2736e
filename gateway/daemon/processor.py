"""The processing thread: runs the pipeline over the blocks, adds health and clock messages, and feeds the sinks."""

import logging
import threading
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING

from devices.block import DeviceInfo, SampleBlock
from gateway.calibration.correction import Correction
from gateway.configuration.model import Configuration
from gateway.daemon.commands.handlers import AcknowledgementService
from gateway.daemon.commands.worker import CommandWorker, PipelineInstruction, ProcessedBlock, RecalibrationService
from gateway.daemon.health import HealthReporter, SampleCounters
from gateway.daemon.outputs.page_channel import PageChannel
from gateway.daemon.outputs.publisher import AlertSender, Publisher
from gateway.daemon.runtime.host import WallClockMonitor
from gateway.daemon.runtime.logs import RECORDED_ONLY
from gateway.daemon.runtime.worker import BoundedQueue, Worker
from gateway.daemon.sampling.device_factory import SimulatedRigger
from gateway.daemon.sampling.sampler import SamplerItem
from gateway.daemon.storage.calibration_provider import CalibrationProvider, DriftStateStore
from gateway.daemon.storage.outbox_writer import OutboxWriter
from gateway.daemon.storage.recording_worker import RecordingWorker
from gateway.messages import Alert, ClockOffset
from gateway.pipeline.drift_monitor import DriftMonitor
from gateway.pipeline.incidents import IncidentRegister
from gateway.pipeline.outgoing_message import HeaderMaker, MessageTime, OutgoingMessage, PipelineOutput, encode_message
from gateway.pipeline.pipeline import Pipeline, PipelineCalibration
from gateway.topics import TOPICS

if TYPE_CHECKING:
    from gateway.daemon.outputs.relay_worker import RelayWorker

log = logging.getLogger("plumbline.pipeline")
alert_log = logging.getLogger("plumbline.alert")
HEALTH_PERIOD_S = 1.0
"""Definition: the rate of the topic, once per second."""
OUTBOX_PATIENCE_S = 1.0
"""Longest wait at start for the number of the last alert. Basis: a choice; a disk answers in milliseconds, and samples wait
meanwhile."""
CALIBRATION_PATIENCE_S = 10.0
"""Longest wait at start for the record in force and the session; the device is uncalibrated until they are read. Basis: a choice;
a slow card reads some kilobytes in less, and samples wait meanwhile in `parts.MAX_WAITING_BLOCKS`."""
SINK_PATIENCE_S = 0.5
"""Longest wait for a sink with a full queue, where the source of the samples can wait. Basis: a choice; short beside the period
of the watchdog, long beside a write."""


class Processor(Worker[SamplerItem]):
    """Owns the pipeline from start to stop."""

    is_essential = True

    def __init__(
        self,
        configuration: Configuration,
        info: DeviceInfo | None,
        inbox: BoundedQueue[SamplerItem],
        counters: SampleCounters,
        health: HealthReporter,
        calibrations: CalibrationProvider,
        drift_store: DriftStateStore,
        wall_clock: WallClockMonitor,
        recalibration: RecalibrationService,
        commands: CommandWorker,
        acknowledgements: AcknowledgementService,
        recording: RecordingWorker,
        publisher: Publisher,
        outbox: OutboxWriter,
        alerts: AlertSender,
        page: PageChannel,
        relay: "RelayWorker | None",
        rigger: SimulatedRigger | None,
    ) -> None:
        super().__init__("processor", inbox)
        self._configuration = configuration
        self._counters = counters
        self._health = health
        self._calibrations = calibrations
        self._drift_store = drift_store
        self._wall_clock = wall_clock
        self._recalibration = recalibration
        self._commands = commands
        self._instruction: PipelineInstruction | None = None
        """The last message of the commands."""
        self._acknowledgements = acknowledgements
        self._recording = recording
        self._publisher = publisher
        self._outbox = outbox
        self._alerts = alerts
        self._page = page
        self._relay = relay
        self._rigger = rigger
        self._headers = HeaderMaker()
        self._incidents = IncidentRegister(health.boot_id, last_number=0)
        self._reporting = threading.Lock()
        self._next_second_ns = 0
        self._block_s = 0.0
        """Monotonic time at which the last block was taken."""
        self._clock_steps = 0
        self.info: DeviceInfo | None = None
        self.correction: Correction | None = None
        self._pipeline: Pipeline | None = None
        """None until the device is open for the first time."""
        self._made_for: PipelineCalibration | None = None
        if info is not None:
            self._open(info)

    def _open(self, info: DeviceInfo) -> None:
        """Begin with a device: uncalibrated, until the commands tell its calibration. Only a start waits for them."""
        self.info = info
        self._recording.inbox.put(info)
        self._commands.open(info)
        if not self.is_alive():
            self._recalibration.opened.wait(CALIBRATION_PATIENCE_S)
        if not self._follow_commands():
            self._open_pipeline(info, self._calibrations.uncalibrated(info), DriftMonitor(None))

    def _open_pipeline(self, info: DeviceInfo, correction: Correction, drift: DriftMonitor) -> None:
        """Make the pipeline of a calibration, and note that calibration in the log."""
        self.correction = correction
        extra = None if self.is_alive() else RECORDED_ONLY  # at start `Gateway.describe` has printed it
        log.info("%s: calibration in force: %s", info.device_id, self.correction.text, extra=extra)
        monitor = self._drift_store.open(info.device_id, drift)
        self._pipeline = Pipeline(self._configuration, info, self.correction, self._headers, monitor, self._incidents)
        self._made_for = self._present_calibration(self.correction)
        self._set_session(self._pipeline)

    def _set_session(self, pipeline: Pipeline) -> None:
        if (instruction := self._instruction) is None:
            return
        pipeline.set_session(instruction.session)
        if self._rigger is not None:
            self._rigger.follow(instruction.session)

    def run(self) -> None:
        """Continue the numbers of alerts and what waits for an acknowledgement, then work until the end."""
        self._incidents.last_number = self._outbox.await_last_number(OUTBOX_PATIENCE_S)
        self._incidents.remember(self._outbox.unacknowledged)
        super().run()

    def handle(self, item: SamplerItem) -> None:
        """Process a block, or open the pipeline again for a device that came back as another one."""
        if isinstance(item, SampleBlock):
            self._counters.add(item)
            self._follow_commands()
            assert self._pipeline is not None  # the sampler announces a device before its blocks
            time_ns = int(item.time_ns[-1])
            self._block_s = time.monotonic()
            self._forward(item, self._pipeline.process(item, self._wall_clock.state), time_ns)
            self._serve_acknowledgements(time_ns)
        elif item != self.info:
            self._open(item)
        self._each_step()

    def idle(self) -> None:
        """Take what the commands tell, and let the pipeline detect a stale reading."""
        self._follow_commands()
        now_ns = self._idle_ns()
        if self._pipeline is not None:
            self._forward(None, self._pipeline.idle(now_ns, self._wall_clock.state), now_ns)
        self._serve_acknowledgements(now_ns)
        self._each_step()

    def _idle_ns(self) -> int:
        """Return gateway time; while a recording with times of its own is played, that of its last block and what has passed."""
        newest_ns = self._counters.newest_ns
        if self._configuration.device.kind != "replay" or newest_ns is None:
            return self._wall_clock.clock.now_ns()
        return newest_ns + round((time.monotonic() - self._block_s) * 1e9)

    def close(self) -> None:
        """Send the last health message and save the state of the drift monitor."""
        self._send(self._status_messages(self._wall_clock.clock.now_ns()))
        self._drift_store.save()

    def _follow_commands(self) -> bool:
        """Take the newest message of the commands, and publish a change in it at once; return whether there was one."""
        before, instruction = self._instruction, self._recalibration.instruction
        if instruction is None or instruction is before or instruction.info is not self.info:
            return False
        self._instruction = instruction
        is_other_device = before is None or before.info is not instruction.info
        if (
            is_other_device
            or self._pipeline is None
            or self._present_calibration(instruction.correction) != self._made_for
        ):
            self._open_pipeline(instruction.info, instruction.correction, instruction.drift)
            self._next_second_ns = 0  # the health of the previous record must not be taken for that of the new one
        else:
            self._set_session(self._pipeline)
        if before is not None and self._pipeline is not None:
            newest_ns = self._counters.newest_ns
            time_ns = self._wall_clock.clock.now_ns() if newest_ns is None else newest_ns
            self._send([self._pipeline.calibration_message(MessageTime(time_ns, self._wall_clock.state))])
        return True

    def _present_calibration(self, correction: Correction) -> PipelineCalibration:
        """Return what a pipeline is made for; a replay finds the same in the recorded messages."""
        is_suspended = self._instruction is not None and self._instruction.session.suspended
        return PipelineCalibration(correction.calibration_id, correction.status, is_suspended)

    def _serve_acknowledgements(self, time_ns: int) -> None:
        """Acknowledge at the time of the last block, so that a replay acknowledges at the same place."""
        if (pipeline := self._pipeline) is None:
            return
        now = MessageTime(time_ns, self._wall_clock.state)
        self._acknowledgements.serve(self._incidents, lambda given: self._send(pipeline.acknowledge(given, now)))

    def _each_step(self) -> None:
        self.report_status()
        self._drift_store.save_if_evaluated()

    def report_status(self) -> None:
        """Send the health at its rate. Also called by another thread while this one hangs; neither waits for the other."""
        if not self._reporting.acquire(blocking=False):
            return
        try:
            now_ns = self._wall_clock.clock.now_ns()
            if now_ns >= self._next_second_ns:
                self._next_second_ns = now_ns + round(HEALTH_PERIOD_S * 1e9)
                self._send(self._status_messages(now_ns))
        finally:
            self._reporting.release()

    def _status_messages(self, now_ns: int) -> Iterable[OutgoingMessage]:
        now = MessageTime(now_ns, self._wall_clock.poll())
        stepped, self._clock_steps = self._wall_clock.steps > self._clock_steps, self._wall_clock.steps
        calibration_id = None if self.correction is None else self.correction.calibration_id
        header = self._headers.make("clock", now, calibration_id)
        offset_ns = now.clock.wall_offset_ns
        clock = ClockOffset(**header, log_time_ns=now_ns, wall_offset_ns=offset_ns, stepped=stepped)
        yield OutgoingMessage("clock", now_ns, clock)
        header = self._headers.make("health", now, calibration_id)
        yield OutgoingMessage("health", now_ns, self._health.make(header, self.info))

    def _forward(self, block: SampleBlock | None, output: PipelineOutput, time_ns: int) -> None:
        """Send the pipeline's messages, and pass the block and its verdict on to the recalibration."""
        self._send(output.messages)
        if block is not None or output.verdict is not None:
            changes = -1 if self._instruction is None else self._instruction.changes
            processed = ProcessedBlock(block, output.verdict, time_ns, changes)
            self._commands.feed(processed, SINK_PATIENCE_S if self._can_wait else 0.0)

    @property
    def _can_wait(self) -> bool:
        """Whether the source of the samples waits for their processing."""
        return self.info is not None and self.info.can_wait

    def _send(self, messages: Iterable[OutgoingMessage]) -> None:
        """Encode each message once and put it into the queues of its sinks; alerts go first."""
        can_wait = self._can_wait
        for message in sorted(messages, key=_is_no_alert):
            if isinstance(message.message, Alert) and message.message.change is not None:
                _log_change(message.message)
            if isinstance(message.message, Alert) and self._relay is not None:
                self._relay.inbox.put(message.message)
            encoded = encode_message(message.topic, message.message, message.log_time_ns)
            topic = TOPICS[message.topic]
            self._page.put(encoded.topic, encoded.payload)
            if isinstance(message.message, Alert):
                self._alerts.submit(message.message, message.log_time_ns, SINK_PATIENCE_S if can_wait else 0.0)
            elif topic.published:
                self._publisher.inbox.put(encoded)
            if topic.logged:
                self._recording.submit(encoded, can_wait=can_wait)


def _is_no_alert(message: OutgoingMessage) -> bool:
    return message.topic != "alert"


def _log_change(alert: Alert) -> None:
    """Write the change of an alert to the log; those of an incident are warnings, which `--quiet` prints too."""
    alert_log.log(logging.INFO if alert.incident is None else logging.WARNING, "%s", alert.change)
