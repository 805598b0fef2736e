"""Small files next to segments: the time around events in them, and which have short chunks still."""

from dataclasses import dataclass
from pathlib import Path

import msgspec

from gateway.atomic_io import append_durably, write_durably
from gateway.file_input import decode_json

MARKER = ".event"
UNCOMPACTED = ".live"
TRIMMED = b"trimmed\n"
"""First line of the marker of a segment that has the time around events only."""


@dataclass(frozen=True, slots=True, order=True)
class Stretch:
    """Gateway times between which messages are kept."""

    from_ns: int
    to_ns: int


def marker_path(path: Path) -> Path:
    """Return the path of the file that marks a segment with an event."""
    return path.with_name(path.name + MARKER)


def uncompacted_marker(path: Path) -> Path:
    """Return the path of the empty file that marks a segment whose chunks are short, see `gateway.recording.compaction`."""
    return path.with_name(path.name + UNCOMPACTED)


def append_stretch(path: Path, stretch: Stretch) -> None:
    """Note the time around an event in a segment. Raises `OSError`."""
    append_durably(marker_path(path), msgspec.json.encode(stretch))


def read_stretches(path: Path) -> list[Stretch]:
    """Return the times around the events of a segment, in order and without overlap. Raises `OSError`."""
    merged: list[Stretch] = []
    for stretch in sorted(_parse(marker_path(path).read_bytes())):
        if merged and stretch.from_ns <= merged[-1].to_ns:
            merged[-1] = Stretch(merged[-1].from_ns, max(merged[-1].to_ns, stretch.to_ns))
        else:
            merged.append(stretch)
    return merged


def _parse(content: bytes) -> list[Stretch]:
    stretches = []
    for line in content.splitlines():
        try:
            stretches.append(decode_json(line, Stretch))
        except ValueError:
            continue  # the mark of a trimmed segment, or a line that a power failure cut off
    return stretches


def is_trimmed(path: Path) -> bool:
    """Return whether a marked segment has been trimmed. Raises `OSError`."""
    return marker_path(path).read_bytes().startswith(TRIMMED)


def note_trimmed(path: Path) -> None:
    """Note that a segment has been trimmed, so that it is not trimmed again. Raises `OSError`."""
    write_durably(marker_path(path), TRIMMED)
