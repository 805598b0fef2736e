"""A recorder writes every topic into a file that states its origin, and is small."""

import itertools
import json
import tomllib
from collections.abc import Callable

import pytest
from mcap.reader import make_reader

from devices.block import DeviceInfo
from gateway import messages
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.format.content import RecordingHeader, encode_recorded
from gateway.topics import TOPICS, adapter
from tests.gateway.recording.conftest import MakeRecorder
from tests.gateway.recording.recorded_files import SECOND_NS, contents, record_blocks


def test_the_mcap_reader_reads_every_topic(
    make_recorder: MakeRecorder, every_message: dict[str, messages.Message | messages.Log], start_ns: int
) -> None:
    recorder = make_recorder()
    path = recorder.start(start_ns)
    for topic, message in every_message.items():
        recorder.write(encode_message(topic, message, start_ns + 99))
    recorder.close()
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = {channel.topic: (schema, channel, message) for schema, channel, message in reader.iter_messages()}
        summary = reader.get_summary()
    assert set(found) == {topic.path for topic in TOPICS.values() if topic.logged}
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(every_message)
    for topic, message in every_message.items():
        schema, channel, recorded = found[f"/{topic}"]
        assert schema is not None
        assert (schema.encoding, schema.name, channel.message_encoding) == (
            "jsonschema",
            TOPICS[topic].schema_name,
            "json",
        )
        assert json.loads(schema.data)["type"] == "object"
        assert recorded.data == encode_recorded(message)
        assert adapter(topic).validate_json(recorded.data) == message
        assert recorded.log_time == start_ns + 99
        stamp = (0, start_ns + 5) if isinstance(message, messages.Log) else (message.sequence, message.time_ns)
        assert (recorded.sequence, recorded.publish_time) == stamp


def test_a_file_states_its_origin(
    make_recorder: MakeRecorder, device: DeviceInfo, header: RecordingHeader, start_ns: int
) -> None:
    recorder = make_recorder()
    recorder.set_device(device, start_ns)
    path = recorder.start(start_ns)
    recorder.close()
    assert path.name == "yard-crane-2-hook-20260101T000000Z.mcap"
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "plumbline"
        assert "plumbline 0.1.0" in reader.get_header().library
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        (attachment,) = reader.iter_attachments()
    assert metadata["plumbline"].items() >= {"software": "0.1.0", "boot_id": "b00t", "crane": "crane-2"}.items()
    assert metadata["device"].items() >= {"device_id": device.device_id, "units_per_g": "256000.0"}.items()
    assert (attachment.name, attachment.media_type) == ("configuration.toml", "application/toml")
    assert tomllib.loads(attachment.data.decode()) == {"gateway": {"site": "yard"}}


@pytest.mark.parametrize("log_time_ns", [-1, 2**63])
def test_an_impossible_time_is_refused(
    make_recorder: MakeRecorder, make_samples: Callable[..., messages.Samples], start_ns: int, log_time_ns: int
) -> None:
    recorder = make_recorder()
    path = recorder.start(start_ns)
    recorder.write(encode_message("samples", make_samples(0), start_ns))
    with pytest.raises(ValueError, match="/samples"):
        recorder.write(encode_message("samples", make_samples(1), log_time_ns))
    recorder.write(encode_message("samples", make_samples(2), start_ns))
    recorder.close()
    assert [content["sequence"] for _, content in contents(path)] == [0, 2]


@pytest.mark.slow
def test_bytes_per_sample_of_an_adxl355_at_rest(
    make_recorder: MakeRecorder, make_samples: Callable[..., messages.Samples], start_ns: int
) -> None:
    recorder = make_recorder()
    path = recorder.start(start_ns)
    sizes = [path.stat().st_size]
    for second in range(3):
        blocks = range(second * 320, (second + 1) * 320)  # 10.24 s
        record_blocks(recorder, make_samples, blocks, start_ns)
        recorder.tick(start_ns + round((second + 1) * 10.24e9) + SECOND_NS)
        sizes.append(path.stat().st_size)
    recorder.close()
    steady = [(after - before) / 10_240 for before, after in itertools.pairwise(sizes[1:])]
    assert max(steady) <= 8.0
