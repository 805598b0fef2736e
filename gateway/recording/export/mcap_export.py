"""An MCAP file for viewers: the calibrated samples at full rate, beside every other message of the recordings."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from mcap.well_known import MessageEncoding, SchemaEncoding

from gateway.recording.export.tables import new_file
from gateway.recording.format.content import EXPORTED
from gateway.recording.format.mcap_writer import McapWriter
from gateway.recording.reading.recording_file import Selection
from gateway.recording.reading.sample_calibration import NEEDED_TOPICS, CalibratedBlock, CalibratedReader
from gateway.recording.reading.timeline import SAMPLES, ReportProgress, Timeline, ignore_progress
from gateway.recording.segments.copying import RecordCopier

TOPIC = "/acceleration_samples"
SCHEMA_NAME = "plumbline.AccelerationSample"
SCHEMA = {
    "title": SCHEMA_NAME,
    "description": "One sample of the specific force in the housing frame, calibrated.",
    "type": "object",
    "properties": {
        "ax_g": {"type": "number", "description": "along x of the housing, g"},
        "ay_g": {"type": "number"},
        "az_g": {"type": "number", "description": "at rest, hanging: +1"},
        "norm_g": {"type": "number", "description": "magnitude"},
        "temperature_c": {"type": "number", "description": "left out where it is not known"},
    },
    "required": ["ax_g", "ay_g", "az_g", "norm_g"],
}


def write_mcap(
    path: Path,
    timeline: Timeline,
    selection: Selection,
    reader: CalibratedReader,
    description: Mapping[str, str],
    report: ReportProgress = ignore_progress,
) -> int:
    """Write the samples of a selection as plain numbers, and all other messages as they are; return the number of samples.

    Raises `InputError` where the file cannot be written, `RecordingError` where the recordings cannot be read.
    """
    count = 0
    with new_file(path) as file:
        writer = McapWriter(file)
        writer.start(profile="", library=description["software"])
        writer.add_metadata(EXPORTED, description)
        copier = RecordCopier(writer)
        schema_id = writer.register_schema(SCHEMA_NAME, SchemaEncoding.JSONSchema, json.dumps(SCHEMA).encode())
        channel_id = writer.register_channel(TOPIC, MessageEncoding.JSON, schema_id)
        for message in timeline.messages(replace(reader.wanted, topics=None), report):
            copier.attach(message.file)
            block = reader.add(message) if message.recorded.topic in NEEDED_TOPICS else None
            if block is not None:
                _write_samples(writer, channel_id, block, count)
                count += len(block.block)
            recorded = message.recorded
            if recorded.topic != SAMPLES and selection.contains(recorded.topic, recorded.log_time_ns):
                copier.add_message(recorded, message.file.schemas.get(recorded.channel.schema_id))
        writer.finish()
    return count


def _write_samples(writer: McapWriter, channel_id: int, block: CalibratedBlock, sequence: int) -> None:
    temperature_c = block.block.temperature_c
    end = "}" if temperature_c is None else f',"temperature_c":{temperature_c:.6g}}}'
    times_ns: list[int] = block.block.time_ns.tolist()
    rows: list[list[float]] = block.force_g.tolist()
    for number, (time_ns, (x_g, y_g, z_g)) in enumerate(zip(times_ns, rows, strict=True)):
        norm_g = (x_g * x_g + y_g * y_g + z_g * z_g) ** 0.5
        payload = f'{{"ax_g":{x_g:.9g},"ay_g":{y_g:.9g},"az_g":{z_g:.9g},"norm_g":{norm_g:.9g}{end}'
        number_in_file = (sequence + number) & 0xFFFF_FFFF
        writer.add_message(channel_id, number_in_file, time_ns, time_ns + block.wall_offset_ns, payload.encode())
