"""The gateway: everything put together, watched, and taken apart again in order."""

import logging
import sys
import threading
import time
import uuid
from contextlib import ExitStack

from devices.clock import HostClock
from gateway import __version__
from gateway.bus.session import open_session
from gateway.configuration.model import Configuration
from gateway.configuration.render import to_toml
from gateway.daemon.calibration_provider import CalibrationProvider
from gateway.daemon.device_factory import make_device
from gateway.daemon.drift_state_store import DriftStateStore
from gateway.daemon.health import HealthReport
from gateway.daemon.instance import InstanceLock
from gateway.daemon.logs import RecordingHandler
from gateway.daemon.notify import ServiceNotifier
from gateway.daemon.page_process import PageProcess
from gateway.daemon.processor import Processor
from gateway.daemon.publisher import Publisher
from gateway.daemon.recalibration_service import RecalibrationService
from gateway.daemon.recording_worker import RecordingWorker
from gateway.daemon.sampler import Sampler
from gateway.daemon.wall_clock import WallClockWatch
from gateway.messages import Log
from gateway.pipeline.outgoing_message import OutgoingMessage
from gateway.recalibration.recalibration import Recalibration
from gateway.recalibration.standard import StandardMethods
from gateway.recording.events import AlertEventIndex
from gateway.recording.header import RecordingHeader
from gateway.recording.writer import Recorder

log = logging.getLogger("plumbline")
WATCH_S = 0.2
JOIN_S = 0.8
"""Longest wait for a thread to end: a read takes at most half a second."""
SWITCH_S = 0.0005
"""A thread that wants the interpreter waits this long at most: an alert must not wait out the usual 5 ms of a swing fit."""
DRAIN_S = 60.0
"""Longest wait for a recording that was replayed faster than it is processed."""


class Gateway:
    """One gateway, from construction to `stop`. What cannot be started raises its own error, and all else is released."""

    def __init__(self, configuration: Configuration) -> None:
        """Take the data folder, open device, recording, bus and page.

        Raises `InstanceError`, `DeviceError`, `RecorderError`, `BusError` or `PageError`.
        """
        self.configuration = configuration
        self._notifier = ServiceNotifier()
        section, boot_id, clock = configuration.gateway, uuid.uuid4().hex[:12], HostClock()
        with ExitStack() as undo:
            self._lock = InstanceLock(section.data_dir)
            undo.callback(self._lock.release)
            device = make_device(configuration, clock)
            info = device.open()
            undo.callback(device.close)
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
                marks=AlertEventIndex(configuration.recorder.pre_event_s, configuration.recorder.post_event_s),
            )
            self.recording_path = recorder.start(clock.now_ns())
            undo.callback(recorder.close)
            bus = configuration.bus
            session = open_session(bus.mode, bus.connect, bus.listen, bus.tls.files)
            undo.callback(session.close)
            self._page = PageProcess(configuration) if configuration.page.enabled else None
            undo.pop_all()
        self._recording = RecordingWorker(recorder, clock.now_ns)
        log.addHandler(RecordingHandler(lambda line: self._record_line(line, clock.now_ns())))
        self._publisher = Publisher(session, section.key)
        watch = WallClockWatch(clock)
        recalibration = Recalibration(
            section.data_dir, StandardMethods(configuration.device.axes), software=__version__, tell=log.warning
        )
        desk = RecalibrationService(recalibration, watch)
        self._publisher.serve(desk)
        shelf = CalibrationProvider(section.data_dir, configuration.device.axes)
        drift = DriftStateStore(section.data_dir)
        self.processor = Processor(configuration, info, shelf, drift, watch, desk, self._recording, self._publisher)
        self._sampler = Sampler(device, info, self.processor.inbox, self._notifier)
        self._health = HealthReport(
            device, self._sampler, self.processor, self._recording, self._publisher, section.data_dir, boot_id
        )
        self.processor.health = self._health.make

    def _record_line(self, line: Log, now_ns: int) -> None:
        """A line of the log goes into the recording; called by any thread."""
        self._recording.inbox.put(OutgoingMessage("log", now_ns, line))

    def describe(self) -> str:
        """Where everything is, for the person who started it."""
        configuration, key = self.configuration, self.configuration.gateway.key
        page = f"http://{configuration.page.listen}/" if self._page is not None else "off (page.enabled)"
        bus = ", ".join([*configuration.bus.listen, *configuration.bus.connect]) or "no endpoint"
        return "\n".join(
            (
                f"plumbline {__version__}: {self.processor.info.kind} {self.processor.info.device_id}, "
                f"{self.processor.info.odr_hz:g} Hz; calibration {self.processor.correction.text}",
                f"  page       {page}",
                f"  recording  {self.recording_path}",
                f"  bus        {key}/** at {bus}",
                "  log        standard error, and /log in the recording",
            )
        )

    @property
    def threads(self) -> tuple[threading.Thread, ...]:
        """In the order of the data's flow."""
        return self._sampler, self.processor, self._recording, self._publisher

    def run(self, stopping: threading.Event, duration_s: float | None = None) -> str | None:
        """Sample until told to stop, the duration has passed or a recording has ended; the name of a thread that failed."""
        sys.setswitchinterval(SWITCH_S)
        for thread in reversed(self.threads):
            thread.start()
        self._notifier.send(f"READY=1\nSTATUS=sampling {self.processor.info.device_id}")
        end_s = None if duration_s is None else time.monotonic() + duration_s
        failed = None
        while not stopping.is_set() and not self._sampler.ended.is_set() and failed is None:
            if self._page is not None:
                self._page.watch()
            remaining_s = WATCH_S if end_s is None else min(WATCH_S, end_s - time.monotonic())
            if remaining_s <= 0:
                break
            stopping.wait(remaining_s)
            failed = next((t.name for t in self.threads if not t.is_alive() and not self._sampler.ended.is_set()), None)
        self.stop()
        return failed

    @property
    def samples_not_recorded(self) -> int:
        """Samples that came and are not on the disk, as far as they were counted."""
        return self._recording.samples_lost + self._sampler.lost_in_queue

    def stop(self) -> None:
        """Let the samples on their way reach the disk, then release everything; within two seconds of a signal."""
        self._notifier.send("STOPPING=1")
        self._health.stopping = True
        patience_s = DRAIN_S if self._sampler.ended.is_set() else JOIN_S
        self._sampler.stop()
        self._sampler.join(JOIN_S)
        for worker in (self.processor, self._recording, self._publisher):
            worker.finish()
            worker.join(patience_s)
        if self._page is not None:
            self._page.stop()
        self._lock.release()
        self._notifier.close()
