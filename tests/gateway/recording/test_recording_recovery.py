from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from devices.errors import RecordingError
from gateway.cli.main import main
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.export.info_text import info_text
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.reading.samples import read_samples
from gateway.recording.segments.copying import recover, recovered_path
from tests.clocks import START_NS
from tests.gateway.conftest import make_samples
from tests.gateway.recording.conftest import DEVICE, EVERY_MESSAGE, MakeRecorder
from tests.gateway.recording.recorded_files import summarise
from tests.values import present


@pytest.fixture
def torn(make_recorder: MakeRecorder) -> Path:
    """A recording that ends in the middle of its last chunk."""
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    path = recorder.start(START_NS)
    for topic in ("calibration", "log"):
        recorder.write(encode_message(topic, EVERY_MESSAGE[topic], START_NS))
    for number in range(100):
        now_ns = START_NS + number * 32_000_000
        recorder.write(encode_message("samples", make_samples(number), now_ns))
        recorder.tick(now_ns)
    recorder.close()
    path.write_bytes(path.read_bytes()[:-30_000])
    return path


def test_an_incomplete_recording_becomes_a_complete_one(torn: Path, tmp_path: Path) -> None:
    before = torn.read_bytes()
    out = tmp_path / "whole.mcap"
    recovered = recover(torn, out)
    assert torn.read_bytes() == before
    kept = list(open_recording(torn).messages())
    assert recovered.messages == len(kept)
    assert recovered.losses.torn_bytes > 0
    with out.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = [
            (
                present(schema).name,
                channel.topic,
                message.data,
                message.log_time,
                message.publish_time,
                message.sequence,
            )
            for schema, channel, message in reader.iter_messages(log_time_order=False)
        ]
        assert {record.name for record in reader.iter_metadata()} == {"plumbline", "device", "recovered"}
        assert [attachment.name for attachment in reader.iter_attachments()] == ["configuration.toml"]
        assert reader.get_header().profile == "plumbline"
    assert [entry[1:] for entry in found] == [
        (message.topic, message.data, message.log_time_ns, message.publish_time_ns, message.sequence)
        for message in kept
    ]
    run, source = read_samples([out]), read_samples([torn])
    (copy,), (original,) = run.files, source.files
    assert (run.device, copy.configuration_toml) == (source.device, original.configuration_toml)
    assert copy.metadata["plumbline"] == original.metadata["plumbline"]
    np.testing.assert_array_equal(run.samples.time_ns, source.samples.time_ns)
    assert run.losses.closed
    assert f"recovered      from {torn.name}, closed false" in info_text(summarise(out))


def test_a_foreign_file_keeps_its_channels_for_any_schema_ids(tmp_path: Path) -> None:
    path, out = tmp_path / "foreign.mcap", tmp_path / "out.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        unused = writer.register_schema("unused", "ros2msg", b"u")
        schema = writer.register_schema("Imu", "ros2msg", b"float64 x")
        writer.register_channel("/silent", "cdr", unused)
        imu = writer.register_channel("/imu", "cdr", schema, {"frame": "hook"})
        plain = writer.register_channel("/plain", "json", 0)
        for channel in (plain, imu):
            writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    assert recover(path, out).messages == 2
    with out.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    told = {
        channel.topic: (summary.schemas[channel.schema_id].name if channel.schema_id else None, channel.metadata)
        for channel in summary.channels.values()
    }
    assert told == {"/silent": ("unused", {}), "/imu": ("Imu", {"frame": "hook"}), "/plain": (None, {})}


def test_an_existing_file_is_never_replaced(torn: Path) -> None:
    before = torn.read_bytes()
    with pytest.raises(RecordingError, match="exists already; choose another name"):
        recover(torn, torn)
    assert torn.read_bytes() == before


def test_no_file_is_left_if_nothing_can_be_recovered(make_recorder: MakeRecorder, tmp_path: Path) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    recorder.close()
    folder = tmp_path / "out"
    folder.mkdir()
    with pytest.raises(RecordingError, match="before its first message"):
        recover(path, folder / "out.mcap")
    assert list(folder.iterdir()) == []


def test_a_path_that_cannot_be_written_is_reported(torn: Path, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"absent/out\.mcap: cannot be written: No such file"):
        recover(torn, tmp_path / "absent" / "out.mcap")


def test_a_segment_that_a_kill_ended_before_its_first_message_is_no_error(
    make_recorder: MakeRecorder, capsys: pytest.CaptureFixture[str]
) -> None:
    path = make_recorder().start(START_NS)
    assert main(["record", "recover", str(path)]) == 0
    assert "ended before its first message; nothing is lost" in capsys.readouterr().out
    assert not recovered_path(path).exists()
