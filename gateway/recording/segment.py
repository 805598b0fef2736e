"""One MCAP file being written: everything that reached `sync` survives."""

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import IO, cast

from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer

from devices.block import DeviceInfo
from gateway.atomic_io import partial_of, sync_folder
from gateway.pipeline.outgoing_message import EncodedMessage
from gateway.recording import header as names
from gateway.recording.calibration_files import AttachedFile
from gateway.recording.header import RecordingHeader, device_metadata
from gateway.recording.schemas import logged_topics, schema_bytes
from gateway.topics import TOPICS

SEQUENCE_MASK = 0xFFFF_FFFF
"""MCAP's sequence numbers have 32 bits."""


class SyncedFile:
    """A new file whose syncs are whole or not at all: what a full disk let through of one is cut off again.

    A chunk is followed by its index: held back until the sync, both are in the file or neither, and what was lost is known.
    """

    def __init__(self, path: Path) -> None:
        """Create the file. Raises `OSError`, `FileExistsError` among them."""
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        self._size = 0
        self._held = bytearray()

    def write(self, data: bytes) -> int:
        """Append; in the file from the next sync on."""
        self._held += data
        return len(data)

    def tell(self) -> int:
        """Bytes written so far, those not in the file yet included."""
        return self._size + len(self._held)

    def flush(self) -> None:
        """The sync decides."""

    def sync(self) -> None:
        """Wait until everything written is on the disk. Raises `OSError`."""
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

    def close(self) -> None:
        """Let go of the file, once. Raises `OSError`."""
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
        standing: Iterable[EncodedMessage],
        files: Iterable[AttachedFile] = (),
    ) -> None:
        """Create the file with what makes it complete, `standing` messages and `files` included, on the disk; or none at all.

        It has its name only then: whoever is killed before leaves no recording that cannot be opened.
        """
        self.path = path
        self.start_ns = start_ns
        partial = partial_of(path)
        self._file = SyncedFile(partial)
        try:
            self._writer = Writer(cast(IO[bytes], self._file), compression=CompressionType.ZSTD, enable_data_crcs=True)
            self._channels = self._begin(header, device)
            self._attach(files, start_ns)
            for message in standing:
                self.write(message, start_ns)
            self.sync()
            partial.rename(path)
            sync_folder(path.parent)
        except OSError:
            self.abandon()
            with suppress(OSError):
                partial.unlink(missing_ok=True)
                path.unlink(missing_ok=True)
            raise

    @property
    def size_bytes(self) -> int:
        """Bytes in the file; the open chunk is not among them."""
        return self._file.tell()

    def write(self, message: EncodedMessage, log_time_ns: int) -> None:
        """Add to the open chunk."""
        self._writer.add_message(
            channel_id=self._channels[message.topic],
            log_time=log_time_ns,
            data=message.payload,
            publish_time=message.publish_time_ns,
            sequence=message.sequence & SEQUENCE_MASK,
        )

    def add_device(self, device: DeviceInfo) -> None:
        """Say which device the samples come from."""
        self._writer.add_metadata(names.DEVICE, device_metadata(device))

    def attach(self, files: Iterable[AttachedFile], now_ns: int) -> None:
        """Add files behind everything written so far, on the disk when this returns."""
        self._writer.flush()  # an attachment goes past the open chunk, which comes first
        self._attach(files, now_ns)
        self._file.sync()

    def sync(self) -> None:
        """Close the chunk and wait until it is on the disk."""
        self._writer.flush()
        self._file.sync()

    def close(self) -> None:
        """Write the summary and close the file."""
        self._writer.finish()
        self._file.sync()
        self._file.close()

    def abandon(self) -> None:
        """Let go of a file that can no longer be written; what is on the disk stays readable. Never raises."""
        with suppress(OSError):
            self._file.close()

    def _begin(self, header: RecordingHeader, device: DeviceInfo | None) -> dict[str, int]:
        self._writer.start(profile=names.PROFILE, library=header.library)
        self._writer.add_metadata(names.ORIGIN, header.origin())
        configuration = header.configuration_toml.encode()
        self._attach([AttachedFile(names.CONFIGURATION, names.CONFIGURATION_MEDIA_TYPE, configuration)], self.start_ns)
        if device is not None:
            self.add_device(device)
        return {topic: self._register(topic) for topic in logged_topics()}

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
