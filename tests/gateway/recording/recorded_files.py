"""What a recorder wrote, read from its folder."""

import json
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.chain.chain_verification import ChainVerification
from gateway.recording.export.recording_info import RecordingInfo, summarise_timeline
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.reading.timeline import open_timeline
from gateway.recording.segments.recorder import Recorder
from tests.clocks import START_NS
from tests.gateway.conftest import make_samples


def contents(path: Path) -> list[tuple[str, dict[str, Any]]]:
    """Topics and contents of a closed file, by the reader of the public package."""
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        return [(channel.topic, json.loads(message.data)) for _, channel, message in found]


def summarise(path: Path) -> RecordingInfo:
    """The contents of one recording, complete or not."""
    return summarise_timeline(open_timeline([path]))


BLOCK_NS = 32_000_000


def segments(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.mcap"))


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def record_blocks(recorder: Recorder, numbers: range) -> None:
    for number in numbers:
        now_ns = START_NS + number * BLOCK_NS
        recorder.write(encode_message("samples", make_samples(number), now_ns))
        recorder.tick(now_ns)


def problems(found: ChainVerification) -> list[str]:
    """What differs, of all files and between them."""
    return [text for file in found.files for text in file.problems] + list(found.problems)


def sample_sequences(path: Path) -> list[int]:
    return [message.sequence for message in open_recording(path).messages() if message.topic == "/samples"]
