"""The gateway: start, supervision and orderly end of its parts.

Sampling and the evaluation of the samples are essential. Every other part may fail at start or later: it is tried again in the
background, and its fault is published.

The person who starts it reads what was started.
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
from pathlib import Path

from devices.block import DeviceInfo
from devices.device import Device
from devices.errors import DeviceError
from devices.host_clock import HostClock
from gateway import __version__
from gateway.bus.session import gateway_settings
from gateway.calibration.correction import Correction
from gateway.configuration.model import Configuration
from gateway.configuration.user_state import remember_data_folder
from gateway.daemon.commands.configuration_service import ConfigurationService, TrialSupervisor
from gateway.daemon.parts import compose
from gateway.daemon.runtime.instance import FolderError, InstanceLock
from gateway.daemon.runtime.logs import LineWriter, RecordingHandler
from gateway.daemon.runtime.supervision import HUNG_S, SLOW_DISK_S, STOP_S, Shutdown, Watchdog
from gateway.daemon.runtime.worker import FaultRegister
from gateway.daemon.sampling.device_factory import make_device
from gateway.daemon.storage.recording_worker import describe_key, load_key
from gateway.messages import Log
from gateway.page.sign_in import PIN_NAME
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.service_state import ServiceNotifier

log = logging.getLogger("plumbline")
SUPERVISION_S = 0.2
"""Time between two looks at the threads. Basis: a choice; an end is noticed within what a person sees, and costs five wakings per
second."""
FIRST_ATTEMPTS_S = 1.0
"""Longest wait for the first attempts to record and to open the bus, before their state is printed. Basis: a choice; a disk and a
router on the network answer within it, and a start waits no longer."""
JOIN_S = 0.8
"""Longest wait for a thread to end. Basis: a read takes at most half a second."""
SWITCH_S = 0.0005
"""Longest wait of a thread for the interpreter. Basis: the usual 5 ms of a swing fit would delay an alert; shorter ones cost
switches."""
SINKS_END_S = 2.2
"""Of `STOP_S`, what is kept after a signal for those that write and send what was processed. Basis: a choice; a sync of
a slow card and two `JOIN_S`."""
PAGE_END_S = 3.0
"""Longest wait for the page to end. Basis: a choice; it closes its streams in less, and the service has 10 s in all
(TimeoutStopSec)."""
WRITING_S = 10.0
"""Longest wait for a disk to take what is queued. Basis: a choice; a slow card flushes a few megabytes in less, and an end by
hand waits no longer."""
DRAIN_S = 60.0
"""Longest wait for a step in the processing of a recording that was replayed faster than it is processed, and for the last
compaction. Basis: a choice; a step takes far less, and one that takes longer has hung."""


def describe(
    configuration: Configuration,
    info: DeviceInfo | None,
    correction: Correction | None,
    recording: Path | None,
    signed: str,
    faults: FaultRegister,
) -> str:
    """Return the addresses of page, recording, bus and log, or the fault of what does not work."""
    bus = ", ".join([*configuration.bus.active_listeners, *configuration.bus.connect]) or "no endpoint"
    places = {
        "page": f"http://{configuration.page.listen}/" if configuration.page.enabled else "off (page.enabled)",
        "PIN": f"{configuration.gateway.data_dir / PIN_NAME}, to acknowledge alarms on the page",
        "recording": str(recording),
        "signed": signed,
        "bus": f"{configuration.gateway.key}/** at {bus}",
        "log": "standard error, and /log in the recording",
    }
    if not configuration.page.enabled:
        del places["PIN"]
    standing = faults.standing
    lines = [
        f"  {place:<10} {f'FAULT: {standing[place]}' if place in standing else text}" for place, text in places.items()
    ]
    if info is None or correction is None:
        head = f"plumbline {__version__}: FAULT: {standing.get('device', 'the device is not open yet')}"
    else:
        head = (
            f"plumbline {__version__}: {info.kind} {info.device_id}, {info.odr_hz:g} Hz; calibration {correction.text}"
        )
    return "\n".join((head, *lines))


class Gateway:
    """One gateway, from construction to the end of `run`."""

    def __init__(
        self,
        configuration: Configuration,
        output: LineWriter,
        changes: ConfigurationService,
        *,
        waits_for_device: bool = False,
    ) -> None:
        """Lock the data folder, open the device and compose the parts; `output` writes the log.

        With `waits_for_device` a device that does not answer at start is a fault like any other. Raises `InstanceError` where
        another gateway uses the folder, `DeviceError`, and `BusError` for an endpoint of wrong form.
        """
        self.configuration, self._changes = configuration, changes
        self.faults = FaultRegister()
        section, clock = configuration.gateway, HostClock()
        gateway_settings(configuration.bus, section.key)
        with ExitStack() as undo:
            self._lock = InstanceLock(section.data_dir)
            with suppress(FolderError):  # the recorder tries again, and publishes it
                self._lock.acquire()
            undo.callback(self._lock.release)
            device = make_device(configuration, clock)
            undo.callback(device.close)
            self._chain = SegmentChain(section.data_dir, section.key, None)
            self._parts = compose(
                configuration,
                device=device,
                info=_try_open(device) if waits_for_device else device.open(),
                clock=clock,
                boot_id=uuid.uuid4().hex[:12],
                chain=self._chain,
                claim_folder=self._claim_folder,
                output=output,
                changes=changes,
                faults=self.faults,
            )
            undo.pop_all()
        self._notifier = ServiceNotifier()
        self._log_handler = RecordingHandler(lambda line: self._record_line(line, clock.now_ns()))

    def _claim_folder(self) -> None:
        """Lock the data folder and find the key in it. Raises `InstanceError` or `FolderError`."""
        self._lock.acquire()
        load_key(self.configuration, self._chain, self.faults)

    def _record_line(self, line: Log, now_ns: int) -> None:
        """Record a line of the log. Called by any thread."""
        self._parts.recording.inbox.put(encode_message("log", line, now_ns))

    def run(
        self, stopping: threading.Event, duration_s: float | None = None, announce: Callable[[str], object] = str
    ) -> str | None:
        """Sample until `stopping` is set or the duration or the recording has ended; return the name of a failed thread.

        `announce` takes the description, once it is known what works.
        """
        sys.setswitchinterval(SWITCH_S)
        gc.freeze()  # a collection of everything that was loaded would hold all threads for some 30 ms
        end_s = float("inf") if duration_s is None else time.monotonic() + duration_s
        log.addHandler(self._log_handler)
        try:
            for thread in reversed(self._parts.threads):
                if thread is not self._parts.commands:  # which runs
                    thread.start()
            self._notifier.send("READY=1\nSTATUS=sampling")
            self._await_first_attempts(stopping)
            announce(self._describe())
            if not os.environ.get("NOTIFY_SOCKET"):  # a service is found by its configuration
                folder = self.configuration.gateway.data_dir
                threading.Thread(target=remember_data_folder, args=(folder,), name="remember", daemon=True).start()
            return self._supervise(stopping, end_s)
        finally:
            self._stop(stopping)

    def _await_first_attempts(self, stopping: threading.Event) -> None:
        parts, end_s = self._parts, time.monotonic() + FIRST_ATTEMPTS_S
        if parts.page is not None:
            parts.page.supervise()
        for tried in (parts.recording.tried, parts.bus.tried):
            while not tried.wait(SUPERVISION_S / 10) and time.monotonic() < end_s and not stopping.is_set():
                pass

    def _describe(self) -> str:
        processor, signed = self._parts.processor, describe_key(self._chain, self.faults)
        recording = self._parts.recording.path
        return describe(self.configuration, processor.info, processor.correction, recording, signed, self.faults)

    def _supervise(self, stopping: threading.Event, end_s: float) -> str | None:
        """Keep the page running and feed the watchdog; return the name of a thread without which the gateway cannot go on."""
        parts = self._parts
        trial = TrialSupervisor(self._changes, parts.health.find_problem, stopping, time.monotonic())
        parts.commands.judge_trial = trial.tick
        watchdog = Watchdog(
            {
                parts.sampler: HUNG_S,
                parts.processor: HUNG_S,
                parts.alerts: SLOW_DISK_S,
                parts.publisher: SLOW_DISK_S,
                parts.recording: SLOW_DISK_S,
            },
            optional=(parts.outbox, parts.rpc, parts.commands),
            notifier=self._notifier,
            faults=self.faults,
        )
        while not stopping.is_set() and not parts.sampler.ended.is_set() and time.monotonic() < end_s:
            if parts.page is not None:
                parts.page.supervise()
            parts.commands.refuse_overdue()
            hung = watchdog.check()
            for thread in (parts.sampler, parts.processor):
                if not thread.is_alive() and not parts.sampler.ended.is_set():
                    return thread.name
            if parts.processor in hung:
                parts.processor.report_status()
            stopping.wait(max(0.0, min(SUPERVISION_S, end_s - time.monotonic())))
        return None

    @property
    def samples_not_recorded(self) -> int:
        """Number of samples that arrived and are not on the disk, as far as they were counted."""
        return self._parts.recording.samples_lost + self._parts.sampler.lost_in_queue

    @property
    def is_backlog_lost(self) -> bool:
        """Whether samples were left in a queue at the end, because a thread between them and the disk did not get on."""
        return not {self._parts.processor.name, self._parts.recording.name}.isdisjoint(self.shutdown.stuck)

    def _stop(self, signalled: threading.Event) -> None:
        """Write the queued samples to the disk, then release everything; within `STOP_S` after a signal.

        A segment that is not compacted in time stays readable as it is, until the next start compacts it.
        """
        parts = self._parts
        self._notifier.send("STOPPING=1")
        parts.health.stopping = True
        parts.commands.judge_trial = None  # a gateway that ends is not healthy, and that is no reason to roll back
        self.shutdown = shutdown = Shutdown(signalled)
        patience_s = DRAIN_S if parts.sampler.ended.is_set() else JOIN_S
        compaction_s = JOIN_S if signalled.is_set() else DRAIN_S
        parts.sampler.stop()
        shutdown.join(parts.sampler, JOIN_S)
        parts.processor.finish()
        shutdown.drain(parts.processor, max(patience_s, HUNG_S), JOIN_S, SINKS_END_S)
        page_end = threading.Thread(
            target=parts.page.stop if parts.page is not None else bool, name="page", daemon=True
        )
        page_end.start()  # beside the others: a page that hangs is killed after two seconds
        for worker in parts.sinks:
            if worker is not parts.compaction:  # which gets the last segment from the recorder
                worker.finish()
        for worker in parts.sinks:
            worker.finish()
            if worker is parts.recording:
                shutdown.drain(worker, max(patience_s, WRITING_S), STOP_S, JOIN_S)
            else:
                shutdown.join(worker, compaction_s if worker is parts.compaction else patience_s)
        if parts.time_stamper is not None:
            parts.time_stamper.stop()
        parts.bus.stop()
        shutdown.join(parts.bus, JOIN_S)
        shutdown.join(page_end, PAGE_END_S)
        log.removeHandler(self._log_handler)
        if not shutdown.stuck:
            self._lock.release()
        self._notifier.close()


def _try_open(device: Device) -> DeviceInfo | None:
    """Return the description of a device; None where it does not answer: the sampler tries again, and publishes it."""
    try:
        return device.open()
    except DeviceError:
        return None
