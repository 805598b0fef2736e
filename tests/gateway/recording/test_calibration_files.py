"""The record in force and its certificates inside recordings."""

import errno
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from gateway.calibration.record import CalibrationRecord, content_hash
from gateway.cli.main import main
from gateway.pipeline.outgoing_message import encode_message
from gateway.pki.signing_key import load_or_create_key, read_public_key
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.segments.copying import recover
from gateway.recording.segments.recorder import Recorder, RecorderError
from gateway.recording.segments.segment import CalibrationFiles, calibration_files
from tests.clocks import START_NS
from tests.gateway.conftest import make_samples
from tests.gateway.recording.conftest import DEVICE, GATEWAY, HEADER, SECOND_NS, MakeRecorder
from tests.gateway.recording.recorded_files import record_blocks, segments, summarise
from tests.values import present

CERTIFICATES_OF_R1 = ("calibration-r1.json", "calibration-r1.html", "calibration-r1.xml")


def make_record(record_id: str, device_id: str = "adxl355-0x1d-label7") -> CalibrationRecord:
    content = {
        "format": 1,
        "id": record_id,
        "device_id": device_id,
        "method": "norm-fit",
        "created_utc": "2026-01-01T00:00:00Z",
        "software": "0.1.0",
        "by": "Größe",
        "parent": None,
        "unit": "counts",
        "offset": [0, 0.5, 1e-17],
        "correction_matrix": (np.eye(3) / 256_000).tolist(),
        "covariance": (1e-12 * np.eye(12)).tolist(),
        "prediction_interval_g": 0.003,
        "temperature_c": None,
    }
    return CalibrationRecord.model_validate(content | {"sha256": content_hash(content)})


@pytest.fixture
def files() -> CalibrationFiles:
    return calibration_files(make_record("r1"), None)


def attachments(path: Path) -> dict[str, bytes]:
    """Of a closed file, by the reader of the public package."""
    with path.open("rb") as file:
        found = {attachment.name: attachment for attachment in make_reader(file, validate_crcs=True).iter_attachments()}
    return {name: attachment.data for name, attachment in found.items()}


def test_every_segment_contains_the_record_and_its_certificate(
    make_recorder: MakeRecorder, files: CalibrationFiles
) -> None:
    recorder = make_recorder(segment_s=2.0)
    recorder.set_device(DEVICE, START_NS)
    folder = recorder.start(START_NS).parent
    recorder.set_calibration(files, START_NS)
    record_blocks(recorder, range(150))
    recorder.close()
    assert len(segments(folder)) == 3
    for path in segments(folder):
        found = attachments(path)
        assert set(found) == {"configuration.toml", *CERTIFICATES_OF_R1, "summary.json"}
        record = CalibrationRecord.model_validate(json.loads(found["calibration-r1.json"]))  # its hash holds
        assert record == make_record("r1")
        page = found["calibration-r1.html"].decode()
        assert page.startswith("<!DOCTYPE html>")
        assert record.sha256 in page
        assert summarise(path).attachments == sorted(found)


def test_a_new_record_is_on_the_disk_at_once_after_earlier_messages(
    make_recorder: MakeRecorder, files: CalibrationFiles
) -> None:
    recorder = make_recorder(fsync_s=3600.0)
    recorder.set_device(DEVICE, START_NS)
    path = recorder.start(START_NS)
    recorder.write(encode_message("samples", make_samples(0), START_NS))
    recorder.set_calibration(files, START_NS + 5)
    recorder.set_calibration(calibration_files(make_record("r2"), make_record("r1")), START_NS + 6)
    as_killed = open_recording(path)
    assert [message.topic for message in as_killed.messages()] == ["/samples"]  # an attachment alone would overtake it
    assert set(as_killed.attachments) >= {"calibration-r1.json", "calibration-r2.json", "calibration-r2.html"}
    assert as_killed.attachments["calibration-r2.json"].log_time == START_NS + 6
    recorder.close()
    assert set(attachments(path)) == {*as_killed.attachments, "summary.json"}


def test_the_same_record_is_not_written_twice(make_recorder: MakeRecorder, files: CalibrationFiles) -> None:
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    first = recorder.start(START_NS)
    recorder.set_calibration(files, START_NS)
    size = first.stat().st_size
    recorder.set_calibration(calibration_files(make_record("r1"), None), START_NS + 1)
    assert first.stat().st_size == size
    recorder.set_calibration(None, START_NS + 2)
    second = recorder.start(START_NS + SECOND_NS)
    recorder.close()
    assert "calibration-r1.json" in attachments(first)
    assert set(attachments(present(second))) == {"configuration.toml", "summary.json"}


def test_a_swapped_sensor_does_not_inherit_the_record(make_recorder: MakeRecorder, files: CalibrationFiles) -> None:
    recorder = make_recorder()
    recorder.set_calibration(files, START_NS)
    recorder.set_device(DEVICE, START_NS)
    first = recorder.start(START_NS)
    recorder.set_device(replace(DEVICE, device_id="adxl355-0x53-label8"), START_NS + SECOND_NS)
    second = recorder.path
    recorder.set_calibration(calibration_files(make_record("r9", "adxl355-0x53-label8"), None), START_NS + SECOND_NS)
    recorder.close()
    assert set(attachments(first)) == {"configuration.toml", "summary.json", *CERTIFICATES_OF_R1}
    assert set(attachments(present(second))) == {
        "configuration.toml",
        "summary.json",
        *(name.replace("r1", "r9") for name in CERTIFICATES_OF_R1),
    }


def test_a_record_is_written_when_the_recording_starts(make_recorder: MakeRecorder, files: CalibrationFiles) -> None:
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    recorder.set_calibration(files, START_NS)
    path = recorder.start(START_NS)
    recorder.close()
    assert "calibration-r1.html" in attachments(path)


def test_recovery_keeps_the_attachments(make_recorder: MakeRecorder, files: CalibrationFiles, tmp_path: Path) -> None:
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    path = recorder.start(START_NS)
    recorder.set_calibration(files, START_NS)
    recorder.write(encode_message("samples", make_samples(0), START_NS))
    recorder.tick(START_NS + 2 * SECOND_NS)
    torn, whole = tmp_path / "torn", tmp_path / "whole.mcap"
    torn.write_bytes(path.read_bytes())
    recorder.close()
    recover(torn, whole)
    expected = attachments(path)
    del expected["summary.json"]  # that of the complete segment
    assert attachments(whole) == expected


def test_a_record_is_in_the_recording_after_a_disk_failure(
    make_recorder: MakeRecorder, files: CalibrationFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    recorder.start(START_NS)
    recorder.write(encode_message("samples", make_samples(0), START_NS))
    recorder.set_calibration(calibration_files(make_record("r0"), None), START_NS)
    recorder.write(encode_message("samples", make_samples(1), START_NS))

    def full(descriptor: int, data: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as broken:
        broken.setattr(os, "write", full)
        with pytest.raises(RecorderError, match="free space on the disk") as caught:
            recorder.set_calibration(files, START_NS)
    assert (caught.value.lost_messages, caught.value.lost_samples) == (1, 32)
    assert recorder.path is None
    path = recorder.start(START_NS + SECOND_NS)
    recorder.close()
    assert "calibration-r1.html" in attachments(path)


def test_an_id_becomes_a_valid_file_name() -> None:
    made = calibration_files(make_record("../../etc/<b>\n" + "x" * 300), None)
    assert [file.name for file in made.files] == [
        f"calibration-.._.._etc__b__{'x' * 66}.json",
        f"calibration-.._.._etc__b__{'x' * 66}.html",
        f"calibration-.._.._etc__b__{'x' * 66}.xml",
    ]


def test_a_record_without_a_date_has_no_digital_certificate() -> None:
    content = make_record("r1").model_dump(mode="json") | {"created_utc": "yesterday"}
    undated = CalibrationRecord.model_validate(content | {"sha256": content_hash(content)})
    assert [file.name for file in calibration_files(undated, None).files] == list(CERTIFICATES_OF_R1[:2])


def test_record_verify_names_a_changed_digital_certificate(
    files: CalibrationFiles, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chain = SegmentChain(tmp_path, GATEWAY, load_or_create_key(tmp_path / "signing-key.pem"))
    recorder = Recorder(tmp_path, HEADER, segment_s=600.0, fsync_s=1.0, quota_mb=100.0, chain=chain)
    recorder.set_device(DEVICE, START_NS)
    path = recorder.start(START_NS)
    recorder.set_calibration(files, START_NS)
    recorder.close()
    assert (
        main(["record", "verify", str(path), "--key", read_public_key(str(path.with_name("signing-key.pem.pub")))]) == 3
    )  # an extract
    content = path.read_bytes()
    assert content.count(b"<dcc:role>operator<") == 1
    path.write_bytes(content.replace(b"<dcc:role>operator<", b"<dcc:role>examiner<"))
    capsys.readouterr()
    assert main(["record", "verify", str(path)]) == 1
    assert "ALTERED" in capsys.readouterr().out
