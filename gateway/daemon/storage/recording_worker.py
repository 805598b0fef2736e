"""The threads of the recording: one writes messages, survives failures of the disk, and counts the samples that these cost.

The other, the compaction, rewrites ended segments, repairs incomplete ones, and trims those that the quota would take.
"""

import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from devices.block import DeviceInfo
from devices.errors import RecordingError
from gateway import __version__
from gateway.configuration.loading import to_toml
from gateway.configuration.model import Configuration
from gateway.daemon.runtime.host import DISK_RETRY_S, disk_free_mb
from gateway.daemon.runtime.instance import FolderError, InstanceError
from gateway.daemon.runtime.worker import BoundedQueue, FaultRegister, Worker
from gateway.extras import what_is_missing
from gateway.messages import NewestStatement, Samples
from gateway.pipeline.outgoing_message import EncodedMessage
from gateway.pki.signing_key import KEY_NAME, KeyFileError, fingerprint, load_or_create_key
from gateway.recording.chain.segment_chain import SegmentChain, newest_signed
from gateway.recording.format.content import RecordingHeader
from gateway.recording.format.salvage import SalvageReport, describe_losses
from gateway.recording.segments.compaction import CompactionError, compact, trim
from gateway.recording.segments.events import EventIndex, uncompacted_marker
from gateway.recording.segments.recorder import Recorder, RecorderError
from gateway.recording.segments.segment import CalibrationFiles

log = logging.getLogger("plumbline.recorder")
MAX_WAITING_SEGMENTS = 4096
"""Segments that may wait. Basis: a choice; more than a quota has, and a bound of the memory."""
MAX_WAITING_RECORDS = 4096
"""Messages that may wait. Basis: a choice; a slow card may stop for a minute at some fifty messages per second, and the memory is
bounded."""
LOOK_NS = 1_000_000_000
"""Time between two looks at the free space. Basis: a choice; the health states it once per second."""
ROOM_S = 0.5
"""Time after which a source that waits for room looks whether the disk takes anything. Basis: a choice; half a second more of a
replay does not matter, and a look costs nothing."""
STALLED_S = 5.0
"""A disk that takes nothing for so long is not waited for. Basis: shorter than what the watchdog allows the processor."""
PART = "recording"
SIGNING = "signing"
CLOCK_PART = "clock"
CHAIN_PART = "chain"
TIME_STAMPS = "time_stamps"


@dataclass(frozen=True, slots=True)
class RewriteRequest:
    """A segment that shall be rewritten."""

    path: Path
    rewrite: Callable[[Path, SegmentChain], SalvageReport]
    """`compact` or `trim`; returns what an interruption had cost of it."""


class CompactionWorker(Worker[RewriteRequest]):
    """Rewrites one segment after the other, beside the recording."""

    def __init__(self, chain: SegmentChain) -> None:
        super().__init__("compaction", BoundedQueue(MAX_WAITING_SEGMENTS))
        self._chain = chain

    def handle(self, item: RewriteRequest) -> None:
        """Rewrite a segment; it stays as it is where that fails."""
        path = item.path
        try:
            losses = item.rewrite(path, self._chain)
        except (RecordingError, OSError) as error:
            _explain(path, error)
        else:
            if not losses.closed:
                log.warning("%s: repaired after an interruption: %s", path, ", ".join(describe_losses(losses)))

    def close(self) -> None:
        """Nothing is open between two segments."""


def _explain(path: Path, error: RecordingError | OSError) -> None:
    """Say why a segment was not rewritten; one that the quota has deleted meanwhile is no loss."""
    if not path.exists():
        log.info("%s: was deleted before it was rewritten", path)
    elif isinstance(error, OSError):
        log.warning("%s: not rewritten (%s); it stays readable as it is", path, error.strerror or error)
    else:
        log.warning("%s", error)
    if isinstance(error, CompactionError):
        with suppress(OSError):
            uncompacted_marker(path).unlink(missing_ok=True)  # another try would end in the same way


@dataclass(frozen=True, slots=True)
class CalibrationChange:
    """Another calibration is in force from now on."""

    files: CalibrationFiles | None
    """What recordings carry of it; None: no record is in force."""


RecordingItem = EncodedMessage | DeviceInfo | CalibrationChange


class RecordingWorker(Worker[RecordingItem]):
    """Owns the recorder: starts it, and starts it again as often as the disk fails."""

    def __init__(
        self,
        recorder: Recorder,
        *,
        now_ns: Callable[[], int],
        rewrite: Callable[[RewriteRequest], object],
        data_dir: Path,
        claim_folder: Callable[[], None],
        faults: FaultRegister,
    ) -> None:
        """`rewrite` is called with each segment that is to be compacted or trimmed; it must not wait.

        `claim_folder` is called before each start and raises `InstanceError` or `FolderError` while the folder is not ours.
        """
        super().__init__("recorder", BoundedQueue(MAX_WAITING_RECORDS))
        self._rewrite = rewrite
        self._recorder = recorder
        self._now_ns = now_ns
        self._data_dir = data_dir
        self._claim_folder = claim_folder
        self._faults = faults
        self._retry_at_ns: int | None = 0
        """Gateway time of the next attempt to record; None while it is recorded."""
        self.tried = threading.Event()
        """Set after the first attempt to record."""
        self.key_tried = threading.Event()
        """Set after the first attempt to load the key that signs recordings and messages."""
        self._lost_on_disk = 0
        self._lost_in_queue = 0
        self.unwritable = 0
        """Number of messages with a time that no recording can hold."""
        self.disk_free_mb: float | None = None
        """Free space at the data folder; None where it is not known."""
        self._look_at_ns = 0

    @property
    def path(self) -> Path | None:
        """The file that is being written; None while nothing is recorded."""
        return self._recorder.path

    @property
    def newest_statement(self) -> NewestStatement | None:
        """The newest final statement about a segment; None: there is none."""
        return self._recorder.newest_statement

    @property
    def samples_lost(self) -> int:
        """Number of samples that a failure of the disk has cost, or that found the queue full."""
        return self._lost_on_disk + self._lost_in_queue

    @property
    def undeletable(self) -> int:
        """How often a segment beyond the quota could not be deleted."""
        return self._recorder.undeletable

    @property
    def vanished(self) -> int:
        """How often the open segment was deleted or moved away."""
        return self._recorder.vanished

    def set_calibration(self, files: CalibrationFiles | None) -> bool:
        """Attach these files to what is recorded from now on; return False where there was no room in time."""
        return self.inbox.put_waiting(CalibrationChange(files), ROOM_S)

    def submit(self, message: EncodedMessage, *, can_wait: bool) -> None:
        """Record a message; from a source that can wait, wait for room while the disk takes something. Called by any thread."""
        while can_wait and time.monotonic() - self.progress_s <= STALLED_S:
            if self.inbox.put_waiting(message, ROOM_S):
                return
        if not self.inbox.put(message) and isinstance(message.message, Samples):
            self._lost_in_queue += len(message.message.x)

    def run(self) -> None:
        """Begin to record, and work until the end."""
        self._attempt(self._start_if_due)
        self.tried.set()
        super().run()

    def handle(self, item: RecordingItem) -> None:
        """Write a message, or note another device or another calibration for the following messages."""
        self._look_at_disk()
        self._start_if_due()
        try:
            if isinstance(item, DeviceInfo):
                self._recorder.set_device(item, self._now_ns())
            elif isinstance(item, CalibrationChange):
                self._recorder.set_calibration(item.files, self._now_ns())
            else:
                self._write(item)
        except RecorderError as error:
            self._fail(error)
        self._pass_ended_segments()

    def _write(self, message: EncodedMessage) -> None:
        try:
            self._recorder.write(message)
        except ValueError:
            self.unwritable += 1
            self._faults.set(
                CLOCK_PART, "clock: the host's clock is before 1970; nothing can be recorded until it is set"
            )
        else:
            self._faults.clear(CLOCK_PART)
        self._recorder.tick(self._now_ns())

    def idle(self) -> None:
        """Write the buffered messages to the disk in time."""
        self._look_at_disk()
        self._start_if_due()
        try:
            self._recorder.tick(self._now_ns())
        except RecorderError as error:
            self._fail(error)
        self._pass_ended_segments()

    def _look_at_disk(self) -> None:
        """Determine the free space once a second."""
        if (now_ns := self._now_ns()) >= self._look_at_ns:
            self._look_at_ns = now_ns + LOOK_NS
            self.disk_free_mb = disk_free_mb(self._data_dir)

    def recover(self, defect: Exception) -> None:
        """Abandon the open segment, whose end is not known, and begin another one."""
        self._fail(self._recorder.abandon(f"{type(defect).__name__}: {defect}"))

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
        self._lost_on_disk += error.lost_samples
        if self._retry_at_ns is not None:
            return  # recording had stopped before; this message is only counted
        self._interrupt(str(error))

    def _interrupt(self, reason: str) -> None:
        self._retry_at_ns = self._now_ns() + round(DISK_RETRY_S * 1e9)
        self._faults.set(PART, f"{reason}; retrying every {DISK_RETRY_S:.0f} s; other functions are not affected")

    def _start_if_due(self) -> None:
        """Begin to record where it has not begun or has stopped, once every few seconds."""
        if self._retry_at_ns is None or self._now_ns() < self._retry_at_ns:
            return
        try:
            try:
                self._claim_folder()
            finally:
                self.key_tried.set()
            path = self._recorder.start(self._now_ns())
        except (InstanceError, FolderError, RecorderError) as error:
            self._interrupt(str(error))
            return
        self._retry_at_ns = None
        if self.tried.is_set():
            log.warning("recording continues in %s; %d samples were not recorded", path, self.samples_lost)
        self._faults.clear(PART)
        if loss := self._recorder.chain_loss:
            self._faults.set(CHAIN_PART, loss)


def make_recorder(
    configuration: Configuration, chain: SegmentChain, boot_id: str, voucher: Callable[[], str | None]
) -> Recorder:
    """Return the recorder, which has not started yet and has touched no file; `voucher`: see `RecordingHeader`."""
    section, recorder = configuration.gateway, configuration.recorder
    header = RecordingHeader(
        software=__version__,
        site=section.site,
        crane=section.crane,
        sensor=section.sensor,
        boot_id=boot_id,
        configuration_toml=to_toml(configuration),
        voucher=voucher,
    )
    return Recorder(
        section.data_dir,
        header,
        segment_s=recorder.segment_s,
        fsync_s=recorder.fsync_s,
        quota_mb=recorder.quota_mb,
        keep_events_days=recorder.keep_events_days,
        events=EventIndex(recorder.pre_event_s, recorder.post_event_s),
        chain=chain,
    )


def load_key(configuration: Configuration, chain: SegmentChain, faults: FaultRegister) -> None:
    """Give the chain its key, where it has none yet; the gateway works without it, and with another one, and says so."""
    if chain.key is not None:
        return
    path = signing_key_path(configuration)
    was_missing = not path.exists()
    try:
        chain.key = load_or_create_key(path)
    except KeyFileError as error:
        faults.set(SIGNING, f"recordings are not signed: {error}")
        return
    before = newest_signed(configuration.gateway.data_dir)
    if chain.key is None or before is None or before.public_key == chain.key.public_hex:
        faults.clear(SIGNING)
        return
    what = "was missing, and a new key was made" if was_missing else "is another key"
    faults.set(
        SIGNING,
        f"{path}: {what}: recordings before are signed with {fingerprint(before.public_key)}, those from now on with "
        f"{fingerprint(chain.key.public_hex)}, and neither proves both; stop the gateway and restore the file from its backup, "
        "or keep both public keys",
    )


def signing_key_path(configuration: Configuration) -> Path:
    """Return the file of the key."""
    return configuration.recorder.key or configuration.gateway.data_dir / KEY_NAME


def describe_key(chain: SegmentChain, faults: FaultRegister) -> str:
    """Return the public key as text, or why there is none."""
    if chain.key is None:
        why = faults.standing.get(SIGNING) or what_is_missing("signing")
        return f"no, chained by hashes only: {why}"
    return f"public key {chain.key.public_hex}, fingerprint {fingerprint(chain.key.public_hex)}"
