"""The recording thread: writes messages, survives failures of the disk, and counts the samples that these cost."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from devices.block import DeviceInfo
from gateway.daemon.bounded_queue import BoundedQueue
from gateway.daemon.compaction_worker import RewriteRequest
from gateway.daemon.worker import Worker
from gateway.pipeline.outgoing_message import EncodedMessage
from gateway.recording.calibration_files import CalibrationFiles
from gateway.recording.compaction import compact
from gateway.recording.trimming import trim
from gateway.recording.writer import Recorder, RecorderError

log = logging.getLogger("plumbline.recorder")
INBOX = 4096
RETRY_S = 5.0


@dataclass(frozen=True, slots=True)
class CalibrationChange:
    """Another calibration is in force from now on."""

    files: CalibrationFiles | None
    """The files that recordings carry of it; None: no record is in force."""


RecordingItem = EncodedMessage | DeviceInfo | CalibrationChange


class RecordingWorker(Worker[RecordingItem]):
    """Owns the recorder, which was started before, until its end."""

    def __init__(
        self, recorder: Recorder, now_ns: Callable[[], int], rewrite: Callable[[RewriteRequest], object]
    ) -> None:
        """`rewrite` is called with each segment that is to be compacted or trimmed; it must not wait."""
        super().__init__("recorder", BoundedQueue(INBOX))
        self._rewrite = rewrite
        self._recorder = recorder
        self._now_ns = now_ns
        self._retry_at_ns = 0
        self.error: str | None = None
        """Why nothing is recorded now; None: it is recorded."""
        self.samples_lost = 0
        self.failures = 0
        self.unwritable = 0
        """Number of messages with a time that no recording can hold."""

    @property
    def path(self) -> Path | None:
        """The file that is being written; None while nothing is recorded."""
        return self._recorder.path

    @property
    def undeletable(self) -> int:
        """How often a segment beyond the quota could not be deleted."""
        return self._recorder.undeletable

    def handle(self, item: RecordingItem) -> None:
        """Write a message, or note another device or another calibration for the following messages."""
        if self.error is not None and self._now_ns() >= self._retry_at_ns:
            self._retry()
        try:
            if isinstance(item, DeviceInfo):
                self._recorder.set_device(item, self._now_ns())
            elif isinstance(item, CalibrationChange):
                self._recorder.set_calibration(item.files, self._now_ns())
            else:
                self._recorder.write(item)
                self._recorder.tick(self._now_ns())
        except RecorderError as error:
            self._fail(error)
        except ValueError as error:
            log.error("%s", error)  # the host's clock is before 1970
            self.unwritable += 1
        self._pass_ended_segments()

    def idle(self) -> None:
        """Write the buffered messages to the disk in time."""
        try:
            if self.error is None:
                self._recorder.tick(self._now_ns())
        except RecorderError as error:
            self._fail(error)
        self._pass_ended_segments()

    def close(self) -> None:
        """Close the file."""
        try:
            self._recorder.close()
        except RecorderError as error:
            self._fail(error)
        self._pass_ended_segments()

    def _pass_ended_segments(self) -> None:
        for path in self._recorder.take_uncompacted():
            self._rewrite(RewriteRequest(path, compact))
        for path in self._recorder.take_segments_to_trim():
            self._rewrite(RewriteRequest(path, trim))

    def _fail(self, error: RecorderError) -> None:
        self.samples_lost += error.lost_samples
        if self.error is not None:
            return  # recording had stopped before; this message is only counted
        log.error("%s; next try in %.0f s", error, RETRY_S)
        self.error = str(error)
        self.failures += 1
        self._retry_at_ns = self._now_ns() + round(RETRY_S * 1e9)

    def _retry(self) -> None:
        self.error = None
        try:
            path = self._recorder.start(self._now_ns())
        except RecorderError as error:
            self._fail(error)
            return
        log.warning("recording continues in %s; %d samples were not recorded", path, self.samples_lost)
