"""The recording thread: writes messages, keeps going when the disk does not, and counts what that cost."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from devices.block import DeviceInfo
from gateway.daemon.worker import Worker
from gateway.pipeline.outgoing_message import OutgoingMessage
from gateway.recording.calibration_files import CalibrationFiles
from gateway.recording.writer import Recorder, RecorderError

log = logging.getLogger("plumbline.recorder")
INBOX = 4096
RETRY_S = 5.0


@dataclass(frozen=True, slots=True)
class InForce:
    """What recordings carry of the calibration from now on."""

    files: CalibrationFiles | None
    """None: no record is in force."""


class RecordingWorker(Worker[OutgoingMessage | DeviceInfo | InForce]):
    """Owns the recorder, which has been started, from start to stop."""

    def __init__(self, recorder: Recorder, now_ns: Callable[[], int]) -> None:
        super().__init__("recorder", INBOX)
        self._recorder = recorder
        self._now_ns = now_ns
        self._retry_at_ns = 0
        self.error: str | None = None
        self.samples_lost = 0
        self.failures = 0
        self.unwritable = 0

    @property
    def path(self) -> Path | None:
        """The file being written; None while nothing is recorded."""
        return self._recorder.path

    def handle(self, item: OutgoingMessage | DeviceInfo | InForce) -> None:
        """Write one message, or note which device the next ones are from, or which record makes their numbers."""
        if self.error is not None and self._now_ns() >= self._retry_at_ns:
            self._try_again()
        try:
            if isinstance(item, DeviceInfo):
                self._recorder.set_device(item, self._now_ns())
            elif isinstance(item, InForce):
                self._recorder.set_calibration(item.files, self._now_ns())
            else:
                self._recorder.write(item.topic, item.message, item.log_time_ns)
                self._recorder.tick(self._now_ns())
        except RecorderError as error:
            self._fail(error)
        except ValueError as error:
            log.error("%s", error)  # a time that no recording can hold: the host's clock is before 1970
            self.unwritable += 1

    def idle(self) -> None:
        """What is buffered reaches the disk on time even when nothing comes."""
        try:
            if self.error is None:
                self._recorder.tick(self._now_ns())
        except RecorderError as error:
            self._fail(error)

    def close(self) -> None:
        """Close the file."""
        try:
            self._recorder.close()
        except RecorderError as error:
            self._fail(error)

    def _fail(self, error: RecorderError) -> None:
        self.samples_lost += error.lost_samples
        if self.error is not None:
            return  # stopped already: this message only adds to what is lost
        log.error("%s; next try in %.0f s", error, RETRY_S)
        self.error = str(error)
        self.failures += 1
        self._retry_at_ns = self._now_ns() + round(RETRY_S * 1e9)

    def _try_again(self) -> None:
        self.error = None
        try:
            path = self._recorder.start(self._now_ns())
        except RecorderError as error:
            self._fail(error)
            return
        log.warning("recording again, to %s; %d samples were not recorded", path, self.samples_lost)
