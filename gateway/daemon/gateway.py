"""The gateway: composition, supervision and orderly end of the threads."""

import gc
import logging
import os
import sys
import threading
import time
import uuid
from contextlib import ExitStack

from devices.clock import HostClock
from gateway import __version__
from gateway.authorization.authoriser import Authoriser
from gateway.bus.session import open_gateway_session
from gateway.configuration.known_data_folders import remember_data_folder
from gateway.configuration.model import Configuration
from gateway.configuration.render import to_toml
from gateway.daemon.acknowledgement_service import AcknowledgementService
from gateway.daemon.alert_history import AlertHistory
from gateway.daemon.alert_sender import AlertSender
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.calibration_provider import CalibrationProvider
from gateway.daemon.command_token import load_or_create_token
from gateway.daemon.compaction_worker import CompactionWorker
from gateway.daemon.counters import SampleCounters
from gateway.daemon.device_factory import make_device, make_rigger
from gateway.daemon.drift_state_store import DriftStateStore
from gateway.daemon.health import HealthReporter
from gateway.daemon.instance import InstanceLock
from gateway.daemon.logs import RecordingHandler
from gateway.daemon.mark_service import MarkService
from gateway.daemon.notify import ServiceNotifier
from gateway.daemon.outbox_writer import OutboxWriter
from gateway.daemon.page_channel import PageChannel
from gateway.daemon.page_process import PageProcess
from gateway.daemon.page_requests import PageRequests
from gateway.daemon.processor import Processor
from gateway.daemon.publisher import Publisher
from gateway.daemon.recalibration_service import RecalibrationService
from gateway.daemon.recording_worker import RecordingWorker
from gateway.daemon.relay_worker import make_relay
from gateway.daemon.request_dispatcher import RequestDispatcher
from gateway.daemon.request_handlers import make_handlers
from gateway.daemon.rpc_server import RpcServer
from gateway.daemon.sampler import Sampler, SamplerItem
from gateway.daemon.security_log import SECURITY_LOG_NAME, SecurityLog
from gateway.daemon.wall_clock import WallClockMonitor
from gateway.messages import Log
from gateway.outbox.outbox import FOLDER as OUTBOX_FOLDER
from gateway.pipeline.outgoing_message import EncodedMessage, encode_message
from gateway.recalibration.recalibration import Recalibration
from gateway.recording.chain import SegmentChain
from gateway.recording.events import EventIndex
from gateway.recording.header import RecordingHeader
from gateway.recording.signing_key import (
    KEY_NAME,
    MISSING_EXTRA,
    KeyFileError,
    SigningKey,
    fingerprint,
    load_or_create_key,
)
from gateway.recording.writer import Recorder

log = logging.getLogger("plumbline")
BLOCKS = 256
"""Blocks that may wait for the processor; more are dropped and counted."""
SUPERVISION_S = 0.2
JOIN_S = 0.8
"""Longest wait for a thread to end: a read takes at most half a second."""
SWITCH_S = 0.0005
"""Longest wait of a thread for the interpreter. The usual 5 ms of a swing fit would delay an alert."""
SLOW_DISK_S = 10.0
"""Longest wait for a disk to take what is queued."""
DRAIN_S = 60.0
"""Longest wait for the processing of a recording that was replayed faster than it is processed, and for the last compaction."""


class Gateway:
    """One gateway, from construction to `stop`. If a part cannot be started, the others are released and its error is raised."""

    def __init__(self, configuration: Configuration) -> None:
        """Lock the data folder and open device, recording, bus and page.

        Raises `InstanceError`, `DeviceError`, `RecorderError`, `BusError` or `PageError`.
        """
        self.configuration = configuration
        self._notifier = ServiceNotifier()
        section, boot_id, clock = configuration.gateway, uuid.uuid4().hex[:12], HostClock()
        with ExitStack() as undo:
            self._lock = InstanceLock(section.data_dir)
            undo.callback(self._lock.release)
            self._key, self._key_error = _load_key(configuration)
            chain = SegmentChain(section.data_dir, section.key, self._key)
            recorder = Recorder(
                section.data_dir,
                RecordingHeader(
                    software=__version__,
                    site=section.site,
                    crane=section.crane,
                    sensor=section.sensor,
                    boot_id=boot_id,
                    configuration_toml=to_toml(configuration),
                ),
                segment_s=configuration.recorder.segment_s,
                fsync_s=configuration.recorder.fsync_s,
                quota_mb=configuration.recorder.quota_mb,
                events=EventIndex(configuration.recorder.pre_event_s, configuration.recorder.post_event_s),
                chain=chain,
            )
            device = make_device(configuration, clock)
            info = device.open()
            undo.callback(device.close)
            self.recording_path = recorder.start(clock.now_ns())
            undo.callback(recorder.close)
            session = open_gateway_session(configuration.bus, section.key)
            undo.callback(session.close)
            acknowledgements = AcknowledgementService()
            page_channel = PageChannel(PageRequests({"acknowledge": acknowledgements.submit}).answer)
            self._page = PageProcess(configuration, page_channel) if configuration.page.enabled else None
            undo.pop_all()
        self._compaction = CompactionWorker(chain)
        self._recording = RecordingWorker(recorder, clock.now_ns, self._compaction.inbox.put)
        log.addHandler(RecordingHandler(lambda line: self._record_line(line, clock.now_ns())))
        self._publisher = Publisher(session, section.key)
        self._outbox = OutboxWriter(section.data_dir / OUTBOX_FOLDER)
        self._alerts = AlertSender(section.key, self._outbox, clock.now_ns, self._publisher.note_latest)
        self._alerts.attach(session)
        self._relay = make_relay(configuration.relay)
        wall_clock = WallClockMonitor(clock)
        axes = configuration.device.axes
        recalibration = RecalibrationService(
            Recalibration(section.data_dir, axes, software=__version__, log_line=log.warning), wall_clock
        )
        marks = MarkService(wall_clock, self._send_mark)
        security_log = SecurityLog(section.data_dir / SECURITY_LOG_NAME)
        dispatcher = RequestDispatcher(
            section.key,
            Authoriser(boot_id, load_or_create_token(section.data_dir)),
            make_handlers(self._publisher.latest, recalibration, marks, acknowledgements, AlertHistory(self._outbox)),
            security_log,
            clock.now_ns,
        )
        self._rpc = RpcServer(session, section.key, dispatcher, recalibration)
        drift_store = DriftStateStore(section.data_dir)
        blocks: BoundedQueue[SamplerItem] = BoundedQueue(BLOCKS)
        counters = SampleCounters()
        self._sampler = Sampler(device, info, blocks, self._notifier)
        self._health = HealthReporter(
            device=device,
            sampler=self._sampler,
            counters=counters,
            drift_store=drift_store,
            recalibration=recalibration,
            rpc=self._rpc,
            security_log=security_log,
            recording=self._recording,
            publisher=self._publisher,
            outbox=self._outbox,
            alerts=self._alerts,
            page=page_channel,
            relay=self._relay,
            data_dir=section.data_dir,
            boot_id=boot_id,
        )
        self.processor = Processor(
            configuration,
            info,
            blocks,
            counters,
            self._health,
            CalibrationProvider(section.data_dir, configuration.device.axes),
            drift_store,
            wall_clock,
            recalibration,
            acknowledgements,
            self._recording,
            self._publisher,
            self._outbox,
            self._alerts,
            page_channel,
            self._relay,
            make_rigger(configuration, device),
        )

    def _record_line(self, line: Log, now_ns: int) -> None:
        """Record a line of the log. Called by any thread."""
        self._recording.inbox.put(encode_message("log", line, now_ns))

    def _send_mark(self, mark: EncodedMessage) -> bool:
        """Record a mark and publish it; return whether it is recorded. Called by the thread of the remote calls."""
        self._publisher.inbox.put(mark)
        return self._recording.inbox.put(mark)

    def describe(self) -> str:
        """Return the addresses of page, recording, bus and log, as text for the person who started the gateway."""
        configuration, key = self.configuration, self.configuration.gateway.key
        page = f"http://{configuration.page.listen}/" if self._page is not None else "off (page.enabled)"
        bus = ", ".join([*configuration.bus.listen, *configuration.bus.connect]) or "no endpoint"
        return "\n".join(
            (
                f"plumbline {__version__}: {self.processor.info.kind} {self.processor.info.device_id}, "
                f"{self.processor.info.odr_hz:g} Hz; calibration {self.processor.correction.text}",
                f"  page       {page}",
                f"  recording  {self.recording_path}",
                f"  signed     {self._describe_key()}",
                f"  bus        {key}/** at {bus}",
                "  log        standard error, and /log in the recording",
            )
        )

    def _describe_key(self) -> str:
        if self._key is None:
            return f"no, chained by hashes only: {self._key_error}"
        return f"public key {self._key.public_hex}, fingerprint {fingerprint(self._key.public_hex)}"

    @property
    def threads(self) -> tuple[threading.Thread, ...]:
        """The threads in the order of the data flow."""
        bus = self._rpc, self._alerts, self._publisher
        relay = () if self._relay is None else (self._relay,)
        return self._sampler, self.processor, self._recording, self._compaction, self._outbox, *bus, *relay

    def run(self, stopping: threading.Event, duration_s: float | None = None) -> str | None:
        """Sample until `stopping` is set or the duration or the recording has ended; return the name of a failed thread."""
        sys.setswitchinterval(SWITCH_S)
        gc.freeze()  # a collection of everything that was loaded would hold all threads for some 30 ms
        for thread in reversed(self.threads):
            thread.start()
        if not os.environ.get("NOTIFY_SOCKET"):  # a service is found by its configuration
            remember_data_folder(self.configuration.gateway.data_dir)
        self._notifier.send(f"READY=1\nSTATUS=sampling {self.processor.info.device_id}")
        end_s = None if duration_s is None else time.monotonic() + duration_s
        failed = None
        while not stopping.is_set() and not self._sampler.ended.is_set() and failed is None:
            if self._page is not None:
                self._page.supervise()
            remaining_s = SUPERVISION_S if end_s is None else min(SUPERVISION_S, end_s - time.monotonic())
            if remaining_s <= 0:
                break
            stopping.wait(remaining_s)
            failed = next((t.name for t in self.threads if not t.is_alive() and not self._sampler.ended.is_set()), None)
        self.stop(hurried=stopping.is_set())
        return failed

    def _patience_s(self, worker: threading.Thread, usual_s: float, hurried: bool) -> float:
        """Return how long to wait for the end of a thread: a slow disk gets what is queued, and the last compaction its time."""
        if worker is self._recording:
            return max(usual_s, SLOW_DISK_S)
        return DRAIN_S if worker is self._compaction and not hurried else usual_s

    @property
    def samples_not_recorded(self) -> int:
        """Number of samples that arrived and are not on the disk, as far as they were counted."""
        return self._recording.samples_lost + self._sampler.lost_in_queue

    def stop(self, *, hurried: bool = True) -> None:
        """Write the queued samples to the disk, then release everything; within two seconds where it is hurried, by a signal.

        A segment that is not compacted in time stays readable as it is, until the next start compacts it.
        """
        self._notifier.send("STOPPING=1")
        self._health.stopping = True
        patience_s = DRAIN_S if self._sampler.ended.is_set() else JOIN_S
        self._sampler.stop()
        self._sampler.join(JOIN_S)
        relay = () if self._relay is None else (self._relay,)
        sinks = *relay, self._alerts, self._outbox, self._recording, self._compaction, self._rpc, self._publisher
        for worker in (self.processor, *sinks):
            worker.finish()
            worker.join(self._patience_s(worker, patience_s, hurried))
        if self._page is not None:
            self._page.stop()
        self._lock.release()
        self._notifier.close()


def _load_key(configuration: Configuration) -> tuple[SigningKey | None, str]:
    """Return the key of the recordings, or the reason why there is none: the gateway works without it."""
    path = configuration.recorder.key or configuration.gateway.data_dir / KEY_NAME
    try:
        key = load_or_create_key(path)
    except KeyFileError as error:
        log.error("recordings are not signed: %s", error)
        return None, str(error)
    return key, MISSING_EXTRA
