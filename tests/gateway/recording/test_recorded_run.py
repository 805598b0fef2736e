"""What was recorded is read back: every block, calibration and correction.

The axes of a recording need nothing else of its configuration, which may be of another version or another program.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Attachment
from mcap.writer import Writer

from devices.axes_map import SAME_AXES, parse_axes_map
from devices.block import SampleBlock
from devices.errors import RecordingError
from gateway import messages
from gateway.packing import pack
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.format.content import CONFIGURATION, ORIGIN
from gateway.recording.reading.recording_file import RecordingFile, open_recording
from gateway.recording.reading.sample_calibration import recorded_axes
from gateway.recording.reading.samples import read_samples
from gateway.recording.segments.recorder import Recorder
from tests.clocks import START_NS
from tests.gateway.conftest import make_block, make_samples
from tests.gateway.recording.conftest import DEVICE, EVERY_MESSAGE, HEADER, MakeRecorder, make_calibration


def record(recorder: Recorder, blocks: list[SampleBlock]) -> Path:
    path = recorder.start(int(blocks[0].time_ns[0]))
    for number, block in enumerate(blocks):
        last_ns = int(block.time_ns[-1])
        message = pack(block, time_ns=last_ns, clock="synchronised", sequence=number, calibration_id=None)
        recorder.write(encode_message("samples", message, last_ns))
    recorder.close()
    return path


def test_a_recording_is_read_back_block_by_block(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    recorder.start(START_NS)
    standing = EVERY_MESSAGE["calibration"]
    recorder.write(encode_message("calibration", standing, START_NS))
    blocks = [make_block(0), make_block(4, length=8, lost=9), make_block(12, length=5)]
    path = record(recorder, blocks)
    run = read_samples([path])
    samples = run.samples
    np.testing.assert_array_equal(samples.time_ns, np.concatenate([block.time_ns for block in blocks]))
    np.testing.assert_array_equal(samples.raw, np.concatenate([block.raw for block in blocks]))
    assert samples.raw.dtype == np.int32
    assert samples.length.tolist() == [len(block) for block in blocks]
    assert samples.temperature_c.tolist() == [block.temperature_c for block in blocks]
    assert samples.lost.tolist() == [block.lost for block in blocks]
    assert run.device == DEVICE
    assert run.files[0].configuration_toml == HEADER.configuration_toml
    assert run.files[0].metadata[ORIGIN]["boot_id"] == "b00t"
    assert [calibration.message for calibration in run.calibrations] == [standing]
    assert run.losses.closed


def test_each_calibration_is_listed_once_in_order(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    path = recorder.start(START_NS)
    recorder.write(encode_message("samples", make_samples(0), START_NS))
    for step, name in enumerate(["a", "a", "b", "a"]):
        recorder.write(encode_message("calibration", make_calibration(name), START_NS + step))
    recorder.close()
    told = [(found.log_time_ns - START_NS, found.message.calibration_id) for found in read_samples([path]).calibrations]
    assert told == [(0, "a"), (2, "b"), (3, "a")]


def test_all_samples_are_joined_with_the_losses(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    blocks = [make_block(0, period_ns=1e6), make_block(1, period_ns=1e6, lost=2), make_block(4, period_ns=1e6)]
    path = record(recorder, blocks)
    recording = read_samples([path]).recording()
    assert (recording.unit, recording.origin_ns) == ("counts", START_NS)
    assert recording.raw.shape == (96, 3)
    np.testing.assert_array_equal(recording.raw[32:64], blocks[1].raw)
    np.testing.assert_allclose(recording.time_s[[0, 1, 31, 64]], [0.0, 0.001, 0.031, 0.128], rtol=0, atol=1e-12)
    expected = np.zeros(96)
    expected[[32, 64]] = 2, 64  # told by the device; seen in the times
    np.testing.assert_array_equal(recording.lost_before, expected)
    assert recording.temperature_c is not None
    assert (recording.temperature_c[[0, 31, 32]] == [25.0, 25.0, 25 + 1 / 64]).all()


def test_repeated_and_backward_times_are_counted(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    again = make_block(5, length=4, period_ns=1e6)
    late = replace(again, time_ns=again.time_ns[:3] + 500_000, raw=again.raw[:3])
    path = record(recorder, [make_block(0, period_ns=1e6), again, late, make_block(1, period_ns=1e6)])
    recording = read_samples([path]).recording()
    assert (len(recording), recording.repeated, recording.backward) == (64, 4, 3)
    assert (np.diff(recording.time_s) > 0).all()


def test_readings_in_g_are_read_back_exactly(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    recorder.set_device(type(DEVICE)(kind="replay", device_id="r", unit="g", odr_hz=10, units_per_g=1.0), START_NS)
    rng = np.random.default_rng(1)
    block = SampleBlock(START_NS + np.arange(5) * 100, rng.normal(size=(5, 3)))
    back = read_samples([record(recorder, [block])]).samples
    assert back.raw.tobytes() == block.raw.tobytes()


def test_a_file_that_is_not_a_recording_is_refused(tmp_path: Path) -> None:
    cases = {"empty.mcap": b"", "text.mcap": b"time_s,ax_g\n0,0\n", "cut.mcap": b"\x89MCAP"}
    for name, content in cases.items():
        (tmp_path / name).write_bytes(content)
    for name, said in {
        "missing.mcap": "no such file",
        "empty.mcap": "is empty",
        "text.mcap": "is not an MCAP file",
        "cut.mcap": "is not an MCAP file",
        ".": "is a directory",
    }.items():
        with pytest.raises(RecordingError, match=f"{tmp_path / name}: {said}"):
            open_recording(tmp_path / name)


def test_a_recording_without_samples_is_refused(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    recorder.write(encode_message("health", EVERY_MESSAGE["health"], START_NS))
    recorder.close()
    with pytest.raises(RecordingError, match="has no samples; the gateway was stopped or lost its device"):
        read_samples([path])


def test_a_foreign_file_is_refused_with_its_topics(tmp_path: Path) -> None:
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", b"")
        for topic in ("/imu/data", "/odom"):
            writer.add_message(writer.register_channel(topic, "cdr", schema), 1, b"\x00\x01", 1)
        writer.finish()
    with pytest.raises(RecordingError, match=r"has no topic /samples, .* its topics: /imu/data, /odom"):
        read_samples([path])


def test_samples_without_a_device_description_are_refused(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    recorder.write(encode_message("samples", make_samples(0), START_NS))
    recorder.close()
    with pytest.raises(RecordingError, match="no metadata 'device'"):
        read_samples([path])


def test_samples_in_another_unit_than_the_device_are_refused(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    path = record(recorder, [SampleBlock(np.array([START_NS]), np.array([[0.0, 0.0, 1.0]]))])
    with pytest.raises(RecordingError, match="samples in g from a device in counts"):
        read_samples([path])


def test_messages_that_do_not_decode_are_counted(tmp_path: Path, make_recorder: MakeRecorder) -> None:
    path = tmp_path / "odd.mcap"
    good = messages.Samples.__name__
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("plumbline")
        schema = writer.register_schema(f"plumbline.{good}", "jsonschema", b"{}")
        channel = writer.register_channel("/samples", "json", schema)
        for data in (b"{", json.dumps({"x": [1]}).encode()):
            writer.add_message(channel, 1, data, 1)
        writer.finish()
    file_read = open_recording(path)
    assert [file_read.decode(message) for message in file_read.messages()] == [None, None]
    assert file_read.losses.unreadable_messages == 2


def recording(configuration: str | None) -> RecordingFile:
    file = RecordingFile(Path("a.mcap"))
    if configuration is not None:
        content = Attachment(0, 0, CONFIGURATION, "application/toml", configuration.encode())
        file.attachments[CONFIGURATION] = content
    return file


@pytest.mark.parametrize(
    ("configuration", "axes"),
    [
        (None, "x,y,z"),
        ("other = 1\n", "x,y,z"),
        ("device = 3\n", "x,y,z"),
        ('[device]\nkind = "of a later version"\naxes_map = "-y,x,z"\n[rope]\nlength_m = -1\n', "-y,x,z"),
    ],
)
def test_the_axes_are_known_whatever_else_the_configuration_has(configuration: str | None, axes: str) -> None:
    assert recorded_axes(recording(configuration)) == (SAME_AXES if axes == "x,y,z" else parse_axes_map(axes))


@pytest.mark.parametrize("configuration", ["not TOML", '[device]\naxes_map = "x,x,z"\n'])
def test_axes_that_are_not_known_are_not_guessed(configuration: str) -> None:
    with pytest.raises(RecordingError, match=r"a\.mcap: its configuration"):
        recorded_axes(recording(configuration))
