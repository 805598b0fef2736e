"""What the daemon reads of a device's store: the correction, the recording's files, and the drift watch with its state."""

import json
import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.block import DeviceInfo
from gateway.atomic_io import write_durably
from gateway.calibration.drift.rest_monitor import NS_PER_HOUR
from gateway.calibration.record import CalibrationRecord
from gateway.calibration.store import CalibrationStore
from gateway.daemon.runtime.worker import FaultRegister
from gateway.daemon.storage.calibration_provider import CalibrationProvider, DriftStateStore
from gateway.daemon.storage.recording_worker import CalibrationChange, RecordingWorker
from gateway.pipeline.drift_monitor import DriftMonitor
from gateway.recording.segments.recorder import Recorder, RecorderError
from gateway.recording.segments.segment import CalibrationFiles, calibration_files
from tests.gateway.conftest import record_content
from tests.values import present

INFO = DeviceInfo(kind="test", device_id="part-7", unit="counts", odr_hz=100.0, units_per_g=1000.0)
AXES = ((0, 1), (1, 1), (2, 1))
MADE_NS = 1_767_225_600_000_000_000
"""2026-01-01 00:00:00 UTC."""
PutRecord = Callable[..., CalibrationRecord]
REST = dict.fromkeys(("complete", "not_clipped", "no_impact", "axes_alive", "quiet", "still", "steady"), True)


@pytest.fixture
def put(tmp_path: Path) -> PutRecord:
    """Puts a record in force; its id is its name."""
    store = CalibrationStore(tmp_path, INFO.device_id)

    def _put(name: str, **changes: Any) -> CalibrationRecord:
        made = CalibrationRecord.model_validate(record_content(id=name, **changes))
        store.add(made)
        store.put_in_force(name, by="ann", reason="", request="request-1", time_utc="2026-01-01T00:00:00Z")
        return made

    return _put


@pytest.fixture
def provider(tmp_path: Path) -> CalibrationProvider:
    return CalibrationProvider(tmp_path, AXES)


@pytest.fixture
def store(tmp_path: Path) -> DriftStateStore:
    return DriftStateStore(tmp_path, write_durably)


def monitored(provider: CalibrationProvider) -> DriftMonitor:
    """The monitor of the record in force, with the state that is on the disk."""
    return provider.drift_monitor(INFO, provider.correction(INFO))


def rest(store: DriftStateStore, hours: int, first: int = 0) -> None:
    for hour in range(first, first + hours):
        for number in range(40):
            store.monitor.update(REST, MADE_NS + hour * NS_PER_HOUR + number, np.array([0.0, 0.0, 1.001]), 20.0)
            store.save_if_evaluated()


def kept(tmp_path: Path) -> dict[str, Any] | None:
    path = CalibrationStore(tmp_path, INFO.device_id).folder / "drift.json"
    return json.loads(path.read_text()) if path.exists() else None


def test_recordings_contain_the_record_and_a_certificate_with_the_change_since_its_parent(
    provider: CalibrationProvider, put: PutRecord
) -> None:
    put("r0", created_utc="2025-01-01T00:00:00Z")
    put("r1", created_utc="2026-01-01T00:00:00Z", parent="r0")
    files = present(provider.files(INFO, provider.correction(INFO)))
    assert (files.device_id, files.record_id) == ("part-7", "r1")
    certificate = next(file.data.decode() for file in files.files if file.name.endswith(".html"))
    assert "Change since the parent record r0" in certificate


def test_the_forecast_of_a_certificate_counts_no_record_that_was_withdrawn(
    provider: CalibrationProvider, put: PutRecord, tmp_path: Path
) -> None:
    known = {"covariance": np.diag([1e-12] * 9 + [1.0, 4.0, 9.0]).tolist()}
    first = put("r0", created_utc="2025-01-01T00:00:00Z", **known)
    wrong = put("wrong", created_utc="2025-06-01T00:00:00Z", parent="r0", offset=[40.0, -20.0, 30.0], **known)
    CalibrationStore(tmp_path, "part-7").put_in_force(
        "r0", by="ann", reason="wrong part", request="request-2", time_utc="2025-06-02T00:00:00Z"
    )
    last = put("r1", created_utc="2026-01-01T00:00:00Z", parent="r0", offset=[13.0, -20.0, 30.0], **known)
    assert provider.files(INFO, provider.correction(INFO)) == calibration_files(last, first)
    assert calibration_files(last, first) != calibration_files(last, first, [wrong])


@pytest.mark.parametrize("parent", [None, "r0"])
def test_a_damaged_older_record_is_reported_and_does_not_affect_the_new_one(
    provider: CalibrationProvider,
    put: PutRecord,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    parent: str | None,
) -> None:
    put("r0", created_utc="2025-01-01T00:00:00Z")
    put("r1", parent=parent)
    (CalibrationStore(tmp_path, "part-7").folder / "records" / "r0.json").write_text("{}")
    with caplog.at_level(logging.ERROR, "plumbline"):
        assert present(provider.files(INFO, provider.correction(INFO))).record_id == "r1"
    assert "r0.json" in caplog.text


def test_the_factorys_record_is_a_parent_too(provider: CalibrationProvider, put: PutRecord) -> None:
    put("r1", parent="factory-1")
    info = replace(INFO, factory_calibration=record_content(id="factory-1"))
    files = present(provider.files(info, provider.correction(info)))
    assert any(b"Change since the parent record factory-1" in file.data for file in files.files)


def test_without_a_record_there_are_no_attachments_and_no_drift_monitor(provider: CalibrationProvider) -> None:
    correction = provider.correction(INFO)
    assert correction.status == "uncalibrated"
    assert provider.files(INFO, correction) is None
    assert monitored(provider).status_json is None


def test_a_drift_monitor_continues_after_a_restart_and_is_saved_once_an_hour(
    provider: CalibrationProvider, put: PutRecord, store: DriftStateStore, tmp_path: Path
) -> None:
    put("r1")
    store.open("part-7", monitored(provider))
    assert kept(tmp_path) is None
    rest(store, 2)
    assert len(present(kept(tmp_path))["hours"]) == 1
    store.save()
    again = DriftStateStore(tmp_path, write_durably)
    again.open("part-7", monitored(provider))
    rest(again, 2, first=2)
    assert len(present(kept(tmp_path))["hours"]) == 3
    assert present(again.monitor.status_json)["norm_error_mg"] == pytest.approx(1.0, abs=0.01)


def test_each_record_has_its_own_drift_monitor(
    provider: CalibrationProvider, put: PutRecord, store: DriftStateStore, tmp_path: Path
) -> None:
    put("r1")
    first = store.open("part-7", monitored(provider))
    assert store.open("part-7", monitored(provider)) is first
    rest(store, 2)
    put("r2")
    second = store.open("part-7", monitored(provider))
    assert second is not first
    assert present(kept(tmp_path))["calibration_id"] == "r1"
    assert present(second.status_json)["state"] == "no_rest"


@pytest.mark.parametrize("text", ["", "[]", '{"format": 2}', "\x00"])
def test_an_unreadable_state_is_ignored(
    provider: CalibrationProvider, put: PutRecord, store: DriftStateStore, tmp_path: Path, text: str
) -> None:
    put("r1")
    (CalibrationStore(tmp_path, "part-7").folder / "drift.json").write_text(text)
    assert present(store.open("part-7", monitored(provider)).status_json)["state"] == "no_rest"


def test_a_record_without_a_valid_time_is_not_monitored(
    provider: CalibrationProvider, put: PutRecord, store: DriftStateStore, caplog: pytest.LogCaptureFixture
) -> None:
    put("r1", created_utc="in spring")
    with caplog.at_level(logging.ERROR, "plumbline"):
        assert store.open("part-7", monitored(provider)).status_json is None
    assert "not monitored" in caplog.text


class FullDisk(Recorder):
    path = None
    chain_loss = None

    def __init__(self) -> None:
        pass

    def start(self, _now_ns: int) -> Path:
        return Path()

    def set_calibration(self, _files: CalibrationFiles | None, _now_ns: int) -> None:
        raise RecorderError("full", 3, 40)

    def take_uncompacted(self) -> list[Path]:
        return []

    def take_segments_to_trim(self) -> list[Path]:
        return []


def test_a_record_that_cannot_be_written_stops_the_recording() -> None:
    faults = FaultRegister()
    worker = RecordingWorker(
        FullDisk(), now_ns=lambda: 0, rewrite=print, data_dir=Path(), claim_folder=lambda: None, faults=faults
    )
    worker.handle(CalibrationChange(None))
    assert (list(faults.standing), worker.samples_lost) == (["recording"], 40)
