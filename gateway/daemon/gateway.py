"""The gateway: composition, supervision and orderly end of the threads.

Sampling and the evaluation of the samples are essential. Every other part may fail at start or later: it is tried again in the
background, and its fault is published.
"""

import gc
import logging
import os
import sys
import threading
import time
import uuid
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import partial

from devices.clock import HostClock
from gateway import __version__
from gateway.bus.session import gateway_settings, open_gateway_session
from gateway.configuration.known_data_folders import remember_data_folder
from gateway.configuration.model import Configuration
from gateway.daemon.acknowledgement_service import AcknowledgementService
from gateway.daemon.alert_history import AlertHistory
from gateway.daemon.alert_sender import AlertSender
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.bus_connection import BusConnection
from gateway.daemon.calibration_provider import CalibrationProvider
from gateway.daemon.command_authorisation import make_authoriser, read_certificates
from gateway.daemon.compaction_worker import CompactionWorker
from gateway.daemon.configuration_service import ConfigurationService
from gateway.daemon.counters import SampleCounters
from gateway.daemon.device_factory import make_device, make_rigger
from gateway.daemon.drift_state_store import DriftStateStore
from gateway.daemon.faults import FaultRegister
from gateway.daemon.health import HealthReporter
from gateway.daemon.instance import FolderError, InstanceLock
from gateway.daemon.line_writer import LineWriter
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
from gateway.daemon.recording_parts import describe_key, load_key, make_recorder
from gateway.daemon.recording_worker import RecordingWorker
from gateway.daemon.relay_worker import make_relay
from gateway.daemon.request_dispatcher import RequestDispatcher
from gateway.daemon.request_handlers import make_handlers
from gateway.daemon.rpc_server import RpcServer
from gateway.daemon.sampler import Sampler, SamplerItem
from gateway.daemon.security_log import SECURITY_LOG_NAME, SecurityLog
from gateway.daemon.shutdown import Shutdown
from gateway.daemon.start_description import describe
from gateway.daemon.trial_supervisor import TrialSupervisor
from gateway.daemon.wall_clock import WallClockMonitor
from gateway.messages import Log
from gateway.outbox.outbox import FOLDER as OUTBOX_FOLDER
from gateway.pipeline.outgoing_message import EncodedMessage, encode_message
from gateway.recalibration.recalibration import Recalibration
from gateway.recording.chain import SegmentChain

log = logging.getLogger("plumbline")
BLOCKS = 256
"""Blocks that may wait for the processor; more are dropped and counted."""
SUPERVISION_S = 0.2
FIRST_ATTEMPTS_S = 1.0
"""Longest wait for the first attempts to record and to open the bus, before their state is printed."""
JOIN_S = 0.8
"""Longest wait for a thread to end: a read takes at most half a second."""
SWITCH_S = 0.0005
"""Longest wait of a thread for the interpreter. The usual 5 ms of a swing fit would delay an alert."""
SLOW_DISK_S = 10.0
"""Longest wait for a disk to take what is queued."""
DRAIN_S = 60.0
"""Longest wait for the processing of a recording that was replayed faster than it is processed, and for the last compaction."""


class Gateway:
    """One gateway, from construction to the end of `run`."""

    def __init__(self, configuration: Configuration, output: LineWriter, changes: ConfigurationService) -> None:
        """Lock the data folder, open the device and compose the parts; `output` writes the log.

        Raises `InstanceError` where another gateway uses the folder, `DeviceError`, and `BusError` for an endpoint of wrong form.
        """
        self.configuration, self._changes = configuration, changes
        self.faults = FaultRegister()
        section, bus, boot_id, clock = configuration.gateway, configuration.bus, uuid.uuid4().hex[:12], HostClock()
        gateway_settings(bus, section.key)
        with ExitStack() as undo:
            self._lock = InstanceLock(section.data_dir)
            with suppress(FolderError):  # the recorder tries again, and publishes it
                self._lock.acquire()
            undo.callback(self._lock.release)
            device = make_device(configuration, clock)
            info = device.open()
            undo.callback(device.close)
            self._notifier = ServiceNotifier()
            undo.callback(self._notifier.close)
            self._chain = SegmentChain(section.data_dir, section.key, None)
            self._compaction = CompactionWorker(self._chain)
            self._recording = RecordingWorker(
                make_recorder(configuration, self._chain, boot_id),
                now_ns=clock.now_ns,
                rewrite=self._compaction.inbox.put,
                claim_folder=self._claim_folder,
                faults=self.faults,
            )
            self._log_handler = RecordingHandler(lambda line: self._record_line(line, clock.now_ns()))
            log.addHandler(self._log_handler)
            undo.callback(log.removeHandler, self._log_handler)
            self._publisher = Publisher(section.key)
            self._outbox = OutboxWriter(section.data_dir / OUTBOX_FOLDER, self.faults)
            self._alerts = AlertSender(section.key, self._outbox, clock.now_ns, self._publisher.note_latest)
            self._relay = make_relay(configuration.relay, self.faults)
            wall_clock = WallClockMonitor(clock)
            axes = configuration.device.axes
            recalibration = RecalibrationService(
                Recalibration(section.data_dir, axes, software=__version__, log_line=log.warning), wall_clock
            )
            marks = MarkService(wall_clock, self._send_mark)
            acknowledgements = AcknowledgementService()
            security_log = SecurityLog(section.data_dir / SECURITY_LOG_NAME)
            certificates = read_certificates(bus.tls)
            dispatcher = RequestDispatcher(
                section.key,
                make_authoriser(boot_id, section.data_dir, bus.tls, certificates),
                make_handlers(
                    self._publisher.latest,
                    recalibration,
                    marks,
                    acknowledgements,
                    AlertHistory(self._outbox),
                    changes.open(section.data_dir),
                ),
                security_log,
                clock.now_ns,
            )
            self._rpc = RpcServer(section.key, dispatcher, recalibration)
            users = self._publisher.attach, self._alerts.attach, self._rpc.attach
            self._bus = BusConnection(partial(open_gateway_session, bus, section.key), users, self.faults)
            page_channel = PageChannel(PageRequests({"acknowledge": acknowledgements.submit}).answer)
            self._page = PageProcess(configuration, page_channel, self.faults) if configuration.page.enabled else None
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
                compaction=self._compaction,
                output=output,
                faults=self.faults,
                data_dir=section.data_dir,
                boot_id=boot_id,
            )
            self.processor = Processor(
                configuration,
                info,
                blocks,
                counters,
                self._health,
                CalibrationProvider(section.data_dir, axes),
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
            undo.pop_all()

    def _claim_folder(self) -> None:
        """Lock the data folder and find the key in it. Raises `InstanceError` or `FolderError`."""
        self._lock.acquire()
        load_key(self.configuration, self._chain, self.faults)

    def _record_line(self, line: Log, now_ns: int) -> None:
        """Record a line of the log. Called by any thread."""
        self._recording.inbox.put(encode_message("log", line, now_ns))

    def _send_mark(self, mark: EncodedMessage) -> bool:
        """Record a mark and publish it; return whether it is recorded. Called by the thread of the remote calls."""
        self._publisher.inbox.put(mark)
        return self._recording.inbox.put(mark)

    def describe(self) -> str:
        """Return what was started, as text for the person who started the gateway."""
        signed = describe_key(self._chain, self.faults)
        return describe(
            self.configuration,
            self.processor.info,
            self.processor.correction,
            self._recording.path,
            signed,
            self.faults,
        )

    @property
    def threads(self) -> tuple[threading.Thread, ...]:
        """The threads in the order of the data flow."""
        bus = self._rpc, self._alerts, self._publisher, self._bus
        relay = () if self._relay is None else (self._relay,)
        return self._sampler, self.processor, self._recording, self._compaction, self._outbox, *bus, *relay

    def run(
        self, stopping: threading.Event, duration_s: float | None = None, announce: Callable[[str], object] = str
    ) -> str | None:
        """Sample until `stopping` is set or the duration or the recording has ended; return the name of a failed thread.

        `announce` takes the description, once it is known what works.
        """
        sys.setswitchinterval(SWITCH_S)
        gc.freeze()  # a collection of everything that was loaded would hold all threads for some 30 ms
        end_s = float("inf") if duration_s is None else time.monotonic() + duration_s
        try:
            for thread in reversed(self.threads):
                thread.start()
            self._notifier.send(f"READY=1\nSTATUS=sampling {self.processor.info.device_id}")
            self._await_first_attempts(stopping)
            announce(self.describe())
            if not os.environ.get("NOTIFY_SOCKET"):  # a service is found by its configuration
                remember_data_folder(self.configuration.gateway.data_dir)
            return self._supervise(stopping, end_s)
        finally:
            self._stop(stopping)

    def _await_first_attempts(self, stopping: threading.Event) -> None:
        end_s = time.monotonic() + FIRST_ATTEMPTS_S
        if self._page is not None:
            self._page.supervise()
        for tried in (self._recording.tried, self._bus.tried):
            while not tried.wait(SUPERVISION_S / 10) and time.monotonic() < end_s and not stopping.is_set():
                pass

    def _supervise(self, stopping: threading.Event, end_s: float) -> str | None:
        """Keep the page running until the end; return the name of a thread without which the gateway cannot go on."""
        trial = TrialSupervisor(self._changes, self._health, stopping, time.monotonic())
        while not stopping.is_set() and not self._sampler.ended.is_set() and time.monotonic() < end_s:
            trial.tick(time.monotonic())
            if self._page is not None:
                self._page.supervise()
            for thread in self.threads:
                if not thread.is_alive() and not self._sampler.ended.is_set():
                    if thread in (self._sampler, self.processor):
                        return thread.name
                    self.faults.set(thread.name, f"the {thread.name} thread has ended by a defect; restart the gateway")
            stopping.wait(max(0.0, min(SUPERVISION_S, end_s - time.monotonic())))
        return None

    @property
    def samples_not_recorded(self) -> int:
        """Number of samples that arrived and are not on the disk, as far as they were counted."""
        return self._recording.samples_lost + self._sampler.lost_in_queue

    def _stop(self, signalled: threading.Event) -> None:
        """Write the queued samples to the disk, then release everything; within `STOP_S` after a signal.

        A segment that is not compacted in time stays readable as it is, until the next start compacts it.
        """
        self._notifier.send("STOPPING=1")
        self._health.stopping = True
        self.shutdown = shutdown = Shutdown(signalled)
        hurried = signalled.is_set()
        patience_s = DRAIN_S if self._sampler.ended.is_set() else JOIN_S
        patience_of_s = {
            self._recording: max(patience_s, SLOW_DISK_S),
            self._compaction: JOIN_S if hurried else DRAIN_S,
        }
        self._sampler.stop()
        shutdown.join(self._sampler, JOIN_S)
        relay = () if self._relay is None else (self._relay,)
        sinks = *relay, self._alerts, self._outbox, self._recording, self._compaction, self._rpc, self._publisher
        for worker in (self.processor, *sinks):
            worker.finish()
            shutdown.join(worker, patience_of_s.get(worker, patience_s))
        self._bus.stop()
        shutdown.join(self._bus, JOIN_S)
        if self._page is not None:
            self._page.stop()
        log.removeHandler(self._log_handler)
        if not shutdown.stuck:
            self._lock.release()
        self._notifier.close()
