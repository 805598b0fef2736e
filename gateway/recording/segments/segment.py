"""One MCAP file that is being written, with its attachments for the calibration; everything up to the last `sync` survives."""

import hashlib
import json
import os
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mcap.well_known import MessageEncoding, SchemaEncoding

from devices.block import DeviceInfo
from gateway.atomic_io import partial_of, sync_folder
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.pipeline.outgoing_message import EncodedMessage
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.chain.statements import DELETIONS, SIGNATURE
from gateway.recording.format import content as names
from gateway.recording.format.content import (
    RecordingHeader,
    device_metadata,
    encode_recorded,
    logged_topics,
    schema_bytes,
)
from gateway.recording.format.mcap_writer import McapWriter
from gateway.recording.format.segment_summary import SUMMARY, SUMMARY_MEDIA_TYPE, encode_summary
from gateway.recording.format.summary_builder import SummaryBuilder
from gateway.recording.segments.events import uncompacted_marker
from gateway.topics import TOPICS

FORBIDDEN_IN_NAME = re.compile(r"[^A-Za-z0-9._-]")
MAX_ID_CHARACTERS = 80
"""Characters of an id in a file name. Basis: a choice; an id is shorter, and a file system takes 255 bytes."""
CHECKPOINT_NS = 10_000_000_000
"""Distance of the signatures in a segment that is being written. Basis: a choice; at a power failure so much is not signed, and
each signature takes room in the recording."""
SEQUENCE_MASK = 0xFFFF_FFFF
"""MCAP's sequence numbers have 32 bits."""


@dataclass(frozen=True, slots=True)
class AttachedFile:
    """A file inside a recording."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class CalibrationFiles:
    """The attachments for the calibration in force."""

    device_id: str
    """Segments of another device do not contain them."""
    record_id: str
    files: tuple[AttachedFile, ...]


def calibration_files(
    record: CalibrationRecord, parent: CalibrationRecord | None, earlier: Sequence[CalibrationRecord] = ()
) -> CalibrationFiles:
    """Return the record as JSON and its certificates: some 20 to 60 kB, made in a few milliseconds.

    A record that no digital certificate can state has none.
    """
    from gateway.certificate.digital_certificate import render_digital_certificate
    from gateway.certificate.page import render_certificate

    name = FORBIDDEN_IN_NAME.sub("_", record.id)[:MAX_ID_CHARACTERS]  # an attachment is extracted by its name
    content = json.dumps(record.model_dump(mode="json"), indent=1, allow_nan=False) + "\n"
    parts = [
        (names.CALIBRATION, names.CALIBRATION_MEDIA_TYPE, content),
        (names.CERTIFICATE, names.CERTIFICATE_MEDIA_TYPE, render_certificate(record, parent, earlier)),
    ]
    with suppress(CalibrationError):
        parts.append(
            (names.DIGITAL_CERTIFICATE, names.DIGITAL_CERTIFICATE_MEDIA_TYPE, render_digital_certificate(record))
        )
    files = tuple(
        AttachedFile(pattern.format(id=name), media_type, text.encode()) for pattern, media_type, text in parts
    )
    return CalibrationFiles(device_id=record.device_id, record_id=record.id, files=files)


class SyncedFile:
    """A new file in which each sync is complete or absent: the part of it that fits on a full disk is removed again.

    A chunk is followed by its index. Both are held back until the sync, so that the file has both or neither, and the number of
    lost messages is known.
    """

    def __init__(self, path: Path) -> None:
        """Create the file. Raises `OSError`, including `FileExistsError`."""
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        self._size = 0
        self._held = bytearray()
        self._hash = hashlib.sha256()

    def write(self, data: bytes) -> int:
        """Append data, which are written at the next sync."""
        self._held += data
        self._hash.update(data)
        return len(data)

    @property
    def sha256(self) -> str:
        """Hash of all data, in hexadecimal digits."""
        return self._hash.hexdigest()

    def tell(self) -> int:
        """Return the number of bytes, including those that are not written yet."""
        return self._size + len(self._held)

    def sync(self) -> None:
        """Write everything to the disk. Raises `OSError`."""
        held, self._held = self._held, bytearray()
        rest = memoryview(held)
        try:
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._descriptor, self._size)
            raise
        self._size += len(held)
        os.fsync(self._descriptor)

    def is_at(self, path: Path) -> bool:
        """Return whether a path leads to this file. Raises `OSError`."""
        return os.path.samestat(os.fstat(self._descriptor), path.stat())

    def close(self) -> None:
        """Close the file; to be called once. Raises `OSError`."""
        descriptor, self._descriptor = self._descriptor, -1
        os.close(descriptor)


class Segment:
    """A recording from its creation to its end, complete in itself. Every method may raise `OSError`."""

    def __init__(
        self,
        path: Path,
        header: RecordingHeader,
        device: DeviceInfo | None,
        start_ns: int,
        repeated: Iterable[EncodedMessage],
        files: Iterable[AttachedFile] = (),
        chain: SegmentChain | None = None,
    ) -> None:
        """Create the file with everything that makes it complete, including `repeated` messages and `files`, or no file at all.

        The file gets its name last, so that a kill leaves no recording that cannot be opened.
        """
        self.path = path
        self.start_ns = start_ns
        self._summary = SummaryBuilder()
        self._chain = chain
        self._number = 0 if chain is None else chain.next_segment
        self._deletions: dict[str, str] = {}
        self._newest_ns = self._signed_ns = start_ns
        partial = partial_of(path)
        self._file = SyncedFile(partial)
        try:
            self._writer = McapWriter(self._file)
            self._channels = self._begin(header, device)
            self._attach(files, start_ns)
            for message in repeated:
                self.write(message, start_ns)
            self._writer.flush()
            self._sign()
            self._file.sync()
            uncompacted_marker(path).touch()
            partial.replace(path)
            sync_folder(path.parent)
            if chain is not None:
                chain.note_segment(self._number)
        except OSError:
            self.abandon()
            with suppress(OSError):
                partial.unlink(missing_ok=True)
                path.unlink(missing_ok=True)
                uncompacted_marker(path).unlink(missing_ok=True)
            raise

    @property
    def size_bytes(self) -> int:
        """Bytes in the file, without the open chunk."""
        return self._file.tell()

    def write(self, message: EncodedMessage, log_time_ns: int) -> None:
        """Add a message to the open chunk."""
        payload = encode_recorded(message.message)
        self._newest_ns = max(self._newest_ns, log_time_ns)
        self._summary.count(TOPICS[message.topic].path, log_time_ns, len(payload))
        self._summary.add(message.message, log_time_ns)
        self._writer.add_message(
            self._channels[message.topic],
            message.sequence & SEQUENCE_MASK,
            log_time_ns,
            message.publish_time_ns,
            payload,
        )

    def add_device(self, device: DeviceInfo) -> None:
        """Add the description of the device."""
        self._writer.add_metadata(names.DEVICE, device_metadata(device))

    def attach(self, files: Iterable[AttachedFile], now_ns: int) -> None:
        """Add attachments after everything written so far, and write all to the disk."""
        self._writer.flush()  # an attachment must not overtake the open chunk
        self._attach(files, now_ns)
        self._file.sync()

    def sync(self, *, signs: bool = False) -> None:
        """Close the chunk and write it to the disk, with a checkpoint where one is due; `signs`: in any case."""
        self._writer.flush()
        if signs or self._newest_ns - self._signed_ns >= CHECKPOINT_NS or self._deletes:
            self._sign()
        self._file.sync()

    @property
    def _deletes(self) -> bool:
        """Whether a segment is deleted, and this one does not state it yet."""
        return self._chain is not None and self._chain.deletions != self._deletions

    @property
    def has_vanished(self) -> bool:
        """Whether the file was deleted or moved away, so that what is written is lost."""
        try:
            return not self._file.is_at(self.path)
        except FileNotFoundError:
            return True

    def close(self) -> None:
        """Write the summaries, of the recording and of the MCAP file, and close the file."""
        self._writer.flush()
        summary = self._summary.summary()  # also without a message: the signature behind it is the last one
        content = b"null" if summary is None else encode_summary(summary)
        self._attach([AttachedFile(SUMMARY, SUMMARY_MEDIA_TYPE, content)], self._newest_ns)
        self._sign()
        self._writer.finish()
        self._file.sync()
        self._file.close()

    def abandon(self) -> None:
        """Close a file that can no longer be written; what is on the disk stays readable. Never raises."""
        with suppress(OSError):
            self._file.close()

    def _begin(self, header: RecordingHeader, device: DeviceInfo | None) -> dict[str, int]:
        self._writer.start(profile=names.PROFILE, library=header.library)
        number = {names.SEGMENT: str(self._number)} if self._number else {}
        self._writer.add_metadata(names.ORIGIN, {**header.origin(), **number})
        configuration, voucher = header.configuration_toml.encode(), header.voucher()
        self._attach([AttachedFile(names.CONFIGURATION, names.CONFIGURATION_MEDIA_TYPE, configuration)], self.start_ns)
        if voucher is not None:
            self._attach([AttachedFile(names.VOUCHER, names.VOUCHER_MEDIA_TYPE, voucher.encode())], self.start_ns)
        if device is not None:
            self.add_device(device)
        return {topic: self._register(topic) for topic in logged_topics()}

    def _sign(self) -> None:
        """Add the signature of everything before."""
        if self._chain is None:
            return
        if self._deletes:
            self._deletions = self._chain.deletions
            self._writer.add_metadata(DELETIONS, self._deletions)
        signature = self._chain.sign(
            "checkpoint",
            segment=self._number,
            name=self.path.name,
            n_bytes=self._file.tell(),
            sha256=self._file.sha256,
            from_ns=self.start_ns,
            to_ns=self._newest_ns,
        )
        self._writer.add_metadata(SIGNATURE, signature)
        self._signed_ns = self._newest_ns

    def _attach(self, files: Iterable[AttachedFile], now_ns: int) -> None:
        for file in files:
            self._writer.add_attachment(
                create_time=now_ns, log_time=now_ns, name=file.name, media_type=file.media_type, data=file.data
            )

    def _register(self, topic: str) -> int:
        row = TOPICS[topic]
        schema_id = self._writer.register_schema(
            name=row.schema_name, encoding=SchemaEncoding.JSONSchema, data=schema_bytes(topic)
        )
        return self._writer.register_channel(topic=row.path, message_encoding=MessageEncoding.JSON, schema_id=schema_id)
