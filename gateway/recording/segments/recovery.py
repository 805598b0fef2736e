"""Recovery of a complete file from an incomplete one."""

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

from devices.errors import RecordingError
from gateway.atomic_io import replace_file
from gateway.recording.format.header import ORIGIN, RECOVERED
from gateway.recording.format.mcap_writer import DENSE, McapWriter
from gateway.recording.format.salvage import SalvageReport, is_damaged, open_mcap, read_records
from gateway.recording.segments.copying import RecordCopier


class NothingRecordedError(RecordingError):
    """A recording was begun and ended before its first message: nothing was lost, and nothing can be recovered."""


@dataclass(frozen=True, slots=True)
class RecoveryResult:
    """The number of messages that were recovered, and the losses."""

    messages: int
    losses: SalvageReport


def recovered_path(path: Path) -> Path:
    """Return the name of a recovered copy beside its source."""
    return path.with_name(f"{path.name.removesuffix('.mcap')}.recovered.mcap")


def recover(path: Path | str, out: Path | str) -> RecoveryResult:
    """Write everything readable of a recording into the new file `out`, indexed and closed properly.

    The source does not change, and `out` appears completely or not at all. Raises `RecordingError` where the source has no
    message, `out` exists already, or it cannot be written.
    """
    path, out = Path(path), Path(out)
    open_mcap(path).close()
    if out.exists():
        raise RecordingError(f"{out}: exists already; choose another name")
    losses = SalvageReport()
    try:
        with replace_file(out) as descriptor, os.fdopen(descriptor, "wb", closefd=False) as file:
            messages = _copy(path, McapWriter(file, DENSE), losses)
    except OSError as error:
        raise RecordingError(f"{out}: cannot be written: {error.strerror or error}; choose another place") from error
    return RecoveryResult(messages, losses)


def _copy(path: Path, writer: McapWriter, losses: SalvageReport) -> int:
    copier = RecordCopier(writer, losses)
    with open_mcap(path) as source:
        copier.copy(read_records(source, losses))
    if not copier.messages:
        if ORIGIN in copier.metadata and not is_damaged(losses):
            raise NothingRecordedError(
                f"{path}: was begun, and the gateway ended before its first message; nothing is lost"
            )
        raise RecordingError(f"{path}: contains no readable message; there is nothing to recover")
    lost = {name: json.dumps(value) for name, value in asdict(losses).items()}
    writer.add_metadata(RECOVERED, {"from": path.name, **lost})
    writer.finish()
    return copier.messages
