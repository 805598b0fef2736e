"""The recorder: writes messages into segments that are complete in themselves, synced in time, within a quota.

It has no thread and reads no clock: its owner calls `tick` with the gateway time after each `write` and a few times a second. A
SIGKILL or a power failure costs at most `fsync_s` and the time between two ticks. A change of an alert is signed and synced at
the next tick, with everything before it.
"""

import errno
from pathlib import Path

from devices.block import DeviceInfo
from gateway.errors import PlumblineError
from gateway.messages import Alert, NewestStatement, Samples
from gateway.pipeline.outgoing_message import EncodedMessage
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.chain.statements import DeletionReason
from gateway.recording.format.content import RecordingHeader, logged_topics, schema_bytes
from gateway.recording.segments.copying import MAX_TIME_NS
from gateway.recording.segments.events import EventDetector, EventIndex
from gateway.recording.segments.retention import Retention, SegmentNames
from gateway.recording.segments.segment import AttachedFile, CalibrationFiles, Segment
from gateway.topics import TOPICS
from gateway.units import BYTES_PER_MB

SEGMENTS_IN_QUOTA = 4
"""A segment ends before it exceeds this part of the quota, because the open segment is never deleted. Basis: a choice; three
quarters of the quota are left at worst, and more parts make short segments."""
REMEDIES = {
    errno.ENOSPC: "free space on the disk, or lower recorder.quota_mb so that old recordings make room",
    errno.EDQUOT: "the user's disk quota is used up; raise it, or lower recorder.quota_mb",
    errno.EACCES: "let this user write to gateway.data_dir, or choose another folder",
    errno.EPERM: "let this user write to gateway.data_dir, or choose another folder",
    errno.EROFS: "the file system is read-only; mount it writable, or choose another gateway.data_dir",
    errno.ENOTDIR: "gateway.data_dir is not a folder; choose another",
    errno.EEXIST: "gateway.data_dir is not a folder; choose another",
    errno.EIO: "the disk does not take or keep data; replace it",
}


class RecorderError(PlumblineError):
    """Recording has stopped; everything that was synced stays readable. The text has one line with the place and the remedy.

    `lost_messages` and `lost_samples` were passed since the last sync and may not be on the disk.
    """

    def __init__(self, text: str, lost_messages: int = 0, lost_samples: int = 0) -> None:
        super().__init__(text)
        self.lost_messages = lost_messages
        self.lost_samples = lost_samples


class Recorder:
    """Writes segments into a folder. After a `RecorderError` nothing is recorded until `start` succeeds again."""

    def __init__(
        self,
        data_dir: Path,
        header: RecordingHeader,
        *,
        segment_s: float,
        fsync_s: float,
        quota_mb: float,
        keep_events_days: float = 0.0,
        events: EventIndex | None = None,
        chain: SegmentChain | None = None,
    ) -> None:
        """`events` records which segments contain events; without it the quota treats all segments alike.

        `chain` numbers and signs the segments.
        """
        self._chain = chain
        self._data_dir = data_dir
        self._header = header
        self._names = SegmentNames(header.site, header.crane, header.sensor)
        self._events = events
        self._detector = EventDetector()
        self._retention = Retention(
            self._names, data_dir, quota_mb, self._note_deletion, keep_events_days=keep_events_days
        )
        self._quota_mb = quota_mb
        self._segment_ns = round(segment_s * 1e9)
        self._fsync_ns = round(fsync_s * 1e9)
        self._largest_segment_bytes = quota_mb * BYTES_PER_MB / SEGMENTS_IN_QUOTA
        self._device: DeviceInfo | None = None
        self._segment: Segment | None = None
        self._synced_ns = 0
        self._has_change = False
        """Whether a change of an alert was written since the last sync."""
        self._repeated: dict[str, EncodedMessage] = {}
        self._calibration: CalibrationFiles | None = None
        self._unsynced_messages = 0
        self._unsynced_samples = 0
        for topic in logged_topics():
            schema_bytes(topic)  # kept: the first segment must not wait for them while samples come
        self.vanished = 0
        """How often the open segment was deleted or moved away; another one was begun."""
        self._uncompacted: list[Path] | None = None
        """Ended segments with short chunks; None: those of former runs have not been looked for."""

    @property
    def path(self) -> Path | None:
        """Path of the open segment; None while nothing is recorded."""
        return self._segment.path if self._segment else None

    @property
    def chain_loss(self) -> str | None:
        """What was lost of the state of the chain, in one line; None: nothing."""
        return None if self._chain is None else self._chain.loss

    @property
    def newest_statement(self) -> NewestStatement | None:
        """The newest final statement about a segment; None: there is none, or the segments are not chained."""
        return None if self._chain is None else self._chain.newest

    @property
    def undeletable(self) -> int:
        """How often a segment beyond the quota could not be deleted."""
        return self._retention.undeletable

    def take_uncompacted(self) -> list[Path]:
        """Return the segments that have ended since the last call, those of former runs first; `compact` shall rewrite them."""
        ended, self._uncompacted = self._uncompacted or [], []
        return ended

    def take_segments_to_trim(self) -> list[Path]:
        """Return the segments of which the quota leaves only the time around events; `trim` shall rewrite them."""
        return self._retention.take_segments_to_trim()

    def start(self, now_ns: int) -> Path:
        """Begin a segment, after ending the open one, and return its path. Raises `RecorderError`."""
        self.close()
        try:
            self._data_dir.mkdir(parents=True, exist_ok=True)
            if self._uncompacted is None:
                self._names.remove_unfinished(self._data_dir)
                self._restore_chain()
                self._uncompacted = self._names.list_uncompacted(self._data_dir)
            self._retention.rescan()
            self._segment = self._new_segment(now_ns)
            if self._events is not None:
                self._events.begin_segment(self._segment.path, now_ns)
        except OSError as error:
            raise self._stop(error) from error
        self._retention.enforce(self._segment.size_bytes)
        self._synced_ns = now_ns
        return self._segment.path

    def set_device(self, device: DeviceInfo, now_ns: int) -> None:
        """Set the device of the following samples; another device begins a new segment. Raises `RecorderError`."""
        if device == self._device:
            return
        another = self._device is not None
        self._device = device
        if self._segment is None:
            return
        if another:
            self.start(now_ns)
            return
        try:
            self._segment.add_device(device)
        except OSError as error:
            raise self._stop(error) from error

    def set_calibration(self, files: CalibrationFiles | None, now_ns: int) -> None:
        """Set the record in force; the open segment and every later one of its device contain it. Raises `RecorderError`."""
        if files == self._calibration:
            return
        self._calibration = files
        if self._segment is None or not (attached := self._attached_files()):
            return
        try:
            self._segment.attach(attached, now_ns)
        except OSError as error:
            raise self._stop(error) from error
        self._synced_ns = now_ns
        self._unsynced_messages = self._unsynced_samples = 0

    def write(self, encoded: EncodedMessage) -> None:
        """Record a message. Raises `RecorderError` when it cannot, `ValueError` for a time that no recording can hold."""
        topic, message, log_time_ns = TOPICS[encoded.topic], encoded.message, encoded.log_time_ns
        if not 0 <= log_time_ns <= MAX_TIME_NS or not 0 <= encoded.publish_time_ns <= MAX_TIME_NS:
            raise ValueError(f"{topic.path}: times {log_time_ns} and {encoded.publish_time_ns} ns are not after 1970")
        if encoded.sequence % topic.recorded_every:
            return
        if topic.repeated:
            self._repeated[topic.name] = encoded
        samples = len(message.x) if isinstance(message, Samples) else 0
        if self._segment is None:
            raise RecorderError("nothing is recorded until the recording is started again", 1, samples)
        self._unsynced_messages += 1
        self._unsynced_samples += samples
        try:
            self._segment.write(encoded, log_time_ns)
            self._has_change |= isinstance(message, Alert) and message.event != "standing"
            if self._detector.is_event(message) and self._events is not None:
                self._events.add_event(log_time_ns)
        except OSError as error:
            raise self._stop(error) from error

    def tick(self, now_ns: int) -> None:
        """Sync when `fsync_s` has passed, or an alert has changed; begin a new segment when the open one is too long or too
        large. Raises `RecorderError`."""
        is_due = now_ns - self._synced_ns >= self._fsync_ns
        if self._segment is None or not (is_due or self._has_change):
            return
        try:
            self._segment.sync(signs=self._has_change)
            vanished = self._segment.has_vanished
        except OSError as error:
            raise self._stop(error) from error
        self._has_change = False
        self._unsynced_messages = self._unsynced_samples = 0
        if not is_due:
            return
        self._synced_ns = now_ns
        self.vanished += vanished
        self._retention.enforce(self._segment.size_bytes)
        too_long = now_ns - self._segment.start_ns >= self._segment_ns
        if vanished or too_long or self._segment.size_bytes >= self._largest_segment_bytes:
            self.start(now_ns)

    def close(self) -> None:
        """End the open segment, with everything on the disk; may be called twice. Raises `RecorderError`."""
        if self._segment is None:
            return
        try:
            self._segment.close()
        except OSError as error:
            raise self._stop(error) from error
        self._end_segment()

    def abandon(self, reason: str) -> RecorderError:
        """Give up the open segment, which stays readable up to its last sync, and return the error with the losses."""
        return self._stop(OSError(reason))

    def _new_segment(self, now_ns: int) -> Segment:
        repeated = [self._repeated[topic] for topic in TOPICS if topic in self._repeated]
        path = self._names.unused_path(self._data_dir, now_ns)
        return Segment(path, self._header, self._device, now_ns, repeated, self._attached_files(), self._chain)

    def _restore_chain(self) -> None:
        """Continue the chain of the segments of former runs. Raises `OSError`."""
        if self._chain is not None:
            segments = self._names.list_segments(self._data_dir)
            segments.sort(key=lambda segment: (segment.utc, segment.copy), reverse=True)
            self._chain.restore([segment.path for segment in segments])

    def _note_deletion(self, path: Path, reason: DeletionReason) -> None:
        """Note in the chain that the quota deletes a segment. Raises `OSError`."""
        if self._chain is not None and (number := self._chain.number_of(path)):
            self._chain.note_deletion(number, reason, self._quota_mb)

    def _attached_files(self) -> tuple[AttachedFile, ...]:
        """Return the attachments for the calibration in force, none if it belongs to another device."""
        calibration, device = self._calibration, self._device
        if calibration is None or (device is not None and device.device_id != calibration.device_id):
            return ()
        return calibration.files

    def _stop(self, error: OSError) -> RecorderError:
        """Abandon the open segment and return the error with the losses."""
        place = self._segment.path if self._segment else self._data_dir
        remedy = REMEDIES.get(error.errno or 0, "check the disk of gateway.data_dir")
        text = f"recording to {place} stopped: {error.strerror or error}; {remedy}"
        stopped = RecorderError(text, self._unsynced_messages, self._unsynced_samples)
        if self._segment is not None:
            self._segment.abandon()
        self._end_segment()
        return stopped

    def _end_segment(self) -> None:
        if self._segment is not None and self._uncompacted is not None:
            self._uncompacted.append(self._segment.path)
        self._segment = None
        self._unsynced_messages = self._unsynced_samples = 0
