"""The parts of a gateway, composed: threads, queues between them, and what they share. Nothing is opened here."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from devices.block import DeviceInfo
from devices.device import Device
from devices.host_clock import HostClock
from gateway import __version__
from gateway.authorization.message_signature import MessageSigner
from gateway.bus.session import open_gateway_session
from gateway.configuration.model import Configuration
from gateway.configuration.relay_section import NoRelay
from gateway.daemon.commands.configuration_service import ConfigurationService
from gateway.daemon.commands.handlers import AcknowledgementService, AlertHistory, MarkService, make_handlers
from gateway.daemon.commands.requests import RequestDispatcher
from gateway.daemon.commands.rpc_server import PageRequests, RpcServer, SignInWatch
from gateway.daemon.commands.security import (
    SECURITY_LOG_NAME,
    SecurityLog,
    make_authoriser,
    make_voucher_source,
    read_certificates,
    refuse_all,
)
from gateway.daemon.commands.worker import CommandWorker, RecalibrationService
from gateway.daemon.health import HealthReporter, SampleCounters
from gateway.daemon.outputs.bus_connection import BusConnection, SilentConnectionWatch
from gateway.daemon.outputs.duplicate_watch import DuplicateWatch
from gateway.daemon.outputs.page_channel import PageChannel
from gateway.daemon.outputs.page_process import PageProcess
from gateway.daemon.outputs.publisher import AlertSender, Publisher
from gateway.daemon.processor import Processor
from gateway.daemon.runtime.host import WallClockMonitor
from gateway.daemon.runtime.logs import LineWriter
from gateway.daemon.runtime.worker import BoundedQueue, FaultRegister, Worker
from gateway.daemon.sampling.device_factory import make_rigger
from gateway.daemon.sampling.sampler import Sampler, SamplerItem
from gateway.daemon.storage.calibration_provider import CalibrationProvider, DriftStateStore
from gateway.daemon.storage.outbox_writer import OutboxWriter
from gateway.daemon.storage.recording_worker import CompactionWorker, RecordingWorker, make_recorder
from gateway.outbox import FOLDER as OUTBOX_FOLDER
from gateway.page.sign_in import PIN_NAME
from gateway.pipeline.outgoing_message import EncodedMessage
from gateway.recalibration.recalibration import Recalibration
from gateway.recording.chain.segment_chain import SegmentChain

if TYPE_CHECKING:
    from gateway.daemon.outputs.relay_worker import RelayWorker
    from gateway.daemon.storage.time_stamper import TimeStamper

log = logging.getLogger("plumbline")
MAX_WAITING_BLOCKS = 256
"""Blocks that may wait for the processor; more are dropped and counted. Basis: a choice; 25 s of blocks of 0.1 s, longer than a
load of the host lasts, and a bound of the memory."""
RECALL_PATIENCE_S = 0.5
"""Longest wait of a page's start for the alerts on the disk; it starts without them where the disk does not answer. Basis: a
choice; a disk answers in milliseconds, and a page that waits longer is missed."""


@dataclass(frozen=True, slots=True)
class Parts:
    """The threads of a gateway, the page's process, and its health."""

    sampler: Sampler
    processor: Processor
    recording: RecordingWorker
    compaction: CompactionWorker
    outbox: OutboxWriter
    commands: CommandWorker
    rpc: RpcServer
    alerts: AlertSender
    publisher: Publisher
    bus: BusConnection
    time_stamper: "TimeStamper | None"
    relay: "RelayWorker | None"
    page: PageProcess | None
    health: HealthReporter

    @property
    def sinks(self) -> tuple[Worker[Any], ...]:
        """What the processor feeds, in the order of the end; the bus must end after them."""
        relay = () if self.relay is None else (self.relay,)
        writers = self.outbox, self.recording, self.commands, self.compaction
        return *relay, self.alerts, *writers, self.rpc, self.publisher

    @property
    def threads(self) -> tuple[threading.Thread, ...]:
        """The threads in the order of the data flow."""
        stamper = () if self.time_stamper is None else (self.time_stamper,)
        return self.sampler, self.processor, *self.sinks, self.bus, *stamper


def compose(
    configuration: Configuration,
    *,
    device: Device,
    info: DeviceInfo | None,
    clock: HostClock,
    boot_id: str,
    chain: SegmentChain,
    claim_folder: Callable[[], None],
    output: LineWriter,
    changes: ConfigurationService,
    faults: FaultRegister,
) -> Parts:
    """Return the parts. `info`: of the opened device, None: it is not open yet; `claim_folder`: see `RecordingWorker`."""
    section = configuration.gateway
    certificates = read_certificates(configuration.bus.tls)
    voucher = make_voucher_source(section.key, lambda: chain.key, certificates)
    compaction = CompactionWorker(chain)
    recording = RecordingWorker(
        make_recorder(configuration, chain, boot_id, voucher),
        now_ns=clock.now_ns,
        rewrite=compaction.inbox.put,
        data_dir=section.data_dir,
        claim_folder=claim_folder,
        faults=faults,
    )
    signer = MessageSigner(lambda: chain.key, boot_id, clock.now_ns)
    publisher = Publisher(section.key, signer)
    outbox = OutboxWriter(section.data_dir / OUTBOX_FOLDER, faults)
    alerts = AlertSender(section.key, outbox, clock.now_ns, publisher.note_latest, signer)
    relay = _make_relay(configuration, faults)
    wall_clock = WallClockMonitor(clock)
    axes = configuration.device.axes
    calibrations = CalibrationProvider(section.data_dir, axes)
    recalibration = RecalibrationService(
        Recalibration(section.data_dir, axes, software=__version__, log_line=log.warning),
        calibrations,
        wall_clock,
        recording.set_calibration,
    )
    commands = CommandWorker(recalibration, changes.open(section.data_dir), certificates, faults)
    commands.start()  # the processor opens the device before the others start
    marks = MarkService(wall_clock, lambda mark: _send_mark(mark, publisher, recording))
    acknowledgements = AcknowledgementService()
    security_log = SecurityLog(section.data_dir / SECURITY_LOG_NAME)
    dispatcher = RequestDispatcher(
        section.key,
        refuse_all(boot_id),
        make_handlers(
            publisher.latest,
            recalibration,
            commands,
            marks,
            acknowledgements,
            AlertHistory(outbox),
        ),
        security_log,
        clock.now_ns,
        voucher,
    )

    def prepare_calls() -> None:
        dispatcher.use(make_authoriser(boot_id, section.data_dir, configuration.bus.tls, certificates))
        changes.compare_limits(configuration.alerts)

    rpc = RpcServer(
        section.key,
        dispatcher,
        recalibration,
        SignInWatch(security_log, faults, section.data_dir / PIN_NAME, clock.now_ns),
        signer,
        prepare=prepare_calls,
    )
    duplicates = DuplicateWatch(section.key, boot_id, faults, lambda: chain.key, rpc.note_refusal)
    # Calls first: who hears or sees the gateway may ask it at once.
    silent = SilentConnectionWatch(configuration.bus.active_listeners, faults)
    users = rpc.attach, duplicates.attach, silent.attach, publisher.attach, alerts.attach
    bus = BusConnection(
        partial(open_gateway_session, configuration.bus, section.key),
        users,
        [duplicates.poll, silent.poll],
        recording.key_tried,
        faults,
        lambda: silent.are_too_many,
    )
    page_channel = PageChannel(
        PageRequests({"acknowledge": acknowledgements.requests.submit}).answer,
        partial(outbox.recent, RECALL_PATIENCE_S),
        rpc.receive_sign_in_report,
    )
    page = PageProcess(configuration, page_channel, faults) if configuration.page.enabled else None
    drift_store = DriftStateStore(section.data_dir, commands.write_soon)
    blocks: BoundedQueue[SamplerItem] = BoundedQueue(MAX_WAITING_BLOCKS)
    counters = SampleCounters()
    sampler = Sampler(device, info, blocks, faults)
    health = HealthReporter(
        device=device,
        device_kind=configuration.device.kind,
        sampler=sampler,
        counters=counters,
        drift_store=drift_store,
        commands=commands,
        acknowledgements=acknowledgements,
        rpc=rpc,
        security_log=security_log,
        certificates=certificates,
        changes=changes,
        recording=recording,
        publisher=publisher,
        alerts=alerts,
        page=page_channel,
        relay=relay,
        workers=(
            recording,
            compaction,
            outbox,
            rpc,
            alerts,
            publisher,
            commands,
            *(() if relay is None else (relay,)),
        ),
        output=output,
        faults=faults,
        boot_id=boot_id,
        page_url=configuration.page.url if configuration.page.enabled else None,
    )
    processor = Processor(
        configuration,
        info,
        blocks,
        counters,
        health,
        calibrations,
        drift_store,
        wall_clock,
        recalibration,
        commands,
        acknowledgements,
        recording,
        publisher,
        outbox,
        alerts,
        page_channel,
        relay,
        make_rigger(configuration, device),
    )
    return Parts(
        sampler=sampler,
        processor=processor,
        recording=recording,
        compaction=compaction,
        outbox=outbox,
        commands=commands,
        rpc=rpc,
        alerts=alerts,
        publisher=publisher,
        bus=bus,
        time_stamper=_make_time_stamper(configuration, recording, faults),
        relay=relay,
        page=page,
        health=health,
    )


def _make_relay(configuration: Configuration, faults: FaultRegister) -> "RelayWorker | None":
    """Return the thread of the relay; None where there is none, and its module is then not loaded."""
    if isinstance(configuration.relay, NoRelay):
        return None
    from gateway.daemon.outputs.relay_worker import RelayWorker  # noqa: PLC0415

    return RelayWorker(configuration.relay, faults)


def _make_time_stamper(
    configuration: Configuration, recording: RecordingWorker, faults: FaultRegister
) -> "TimeStamper | None":
    """Return the thread of the time stamps; None where no authority is configured, and its module is then not loaded."""
    url, every_s = configuration.recorder.time_stamp_authority, configuration.recorder.time_stamp_every_s
    if url is None:
        return None
    from gateway.daemon.storage.time_stamper import TimeStamper  # noqa: PLC0415

    return TimeStamper(url, every_s, lambda: recording.newest_statement, configuration.gateway.data_dir, faults)


def _send_mark(mark: EncodedMessage, publisher: Publisher, recording: RecordingWorker) -> bool:
    """Record a mark and publish it; return whether it is recorded. Called by the thread of the remote calls."""
    publisher.inbox.put(mark)
    return recording.inbox.put(mark)
