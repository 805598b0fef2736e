"""Results computed again from the samples of a recording, and compared with the recorded ones."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from devices.block import SampleBlock
from devices.simulated.accelerometer import MAX_COUNT
from devices.simulated.device import SimulatedCrane
from gateway import __version__
from gateway.calibration.correction import correction_for
from gateway.calibration.record import content_hash
from gateway.cli.main import main
from gateway.configuration.loading import to_toml
from gateway.messages import NO_SESSION, Motion
from gateway.pipeline.incidents import Acknowledgement, past_incident
from gateway.pipeline.outgoing_message import MessageTime, OutgoingMessage
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.reading.samples import read_samples
from gateway.recording.replay import replay_run as replay_result
from gateway.recording.replay.replay_pipeline import RECOMPUTED_PATHS
from tests.clocks import START_NS, SleeplessClock
from tests.gateway.recorded_crane import HastyCrane
from tests.gateway.recording.recorded_crane import (
    CLOCK,
    SECOND_NS,
    RecordedCrane,
    announce,
    begin_pipeline,
    new_record,
    recalibrated,
)
from tests.gateway.recording.replaying import replay


@pytest.fixture(scope="module")
def crane(tmp_path_factory: pytest.TempPathFactory) -> RecordedCrane:
    """32 s of the simulated crane in two segments, with an alert."""
    crane = RecordedCrane(tmp_path_factory.mktemp("data"))
    crane.record(32)
    crane.close()
    return crane


@pytest.mark.slow
def test_results_are_the_same_to_the_byte(crane: RecordedCrane, capsys: pytest.CaptureFixture[str]) -> None:
    code, result = replay(crane.folder, capsys)
    assert (code, result["equal"], result["notes"], result["differing"]) == (0, True, [], {})
    assert set(result["compared"]) == RECOMPUTED_PATHS
    assert result["compared"]["/motion"] == result["compared"]["/samples"] == 320
    assert "0 differ (byte for byte)" in capsys.readouterr().out


@pytest.mark.slow
def test_part_is_compared_after_the_run_was_replayed_from_its_beginning(
    crane: RecordedCrane, capsys: pytest.CaptureFixture[str]
) -> None:
    code, result = replay(crane.folder, capsys, "--from", "25", "--to", "30")
    assert (code, result["notes"]) == (0, [])
    assert result["compared"]["/motion"] == 50


class ForgingCrane(RecordedCrane):
    """Writes another angle in one message."""

    def write(self, message: OutgoingMessage) -> None:
        content = message.message
        if isinstance(content, Motion) and content.sequence == 120:
            message = replace(message, message=replace(content, angle_deg=(content.angle_deg or 0.0) + 0.002))
        super().write(message)


@pytest.mark.slow
def test_first_difference_names_topic_time_field_and_values(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    forged = ForgingCrane(tmp_path)
    forged.record(15)
    forged.close()
    code, result = replay(tmp_path, capsys)
    assert code == 1
    assert result["differing"] == {"/motion": 1}
    first = result["first_difference"]
    assert (first["topic"], first["field"]) == ("/motion", "angle_deg")
    assert first["recorded"] == pytest.approx(first["recomputed"] + 0.002, abs=1e-9)
    assert first["utc_ns"] - first["log_time_ns"] == CLOCK.wall_offset_ns
    assert "first difference: /motion at 2026-01-01 00:00:12.3" in capsys.readouterr().out


@pytest.mark.slow
def test_message_that_was_left_out_is_a_difference(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    class ForgetfulCrane(RecordedCrane):
        def write(self, message: OutgoingMessage) -> None:
            if not (message.topic == "condition" and message.message.sequence == 11):  # type: ignore[union-attr]
                super().write(message)

    crane = ForgetfulCrane(tmp_path)
    crane.record(10)
    crane.close()
    code, result = replay(tmp_path, capsys)
    assert (code, result["differing"]) == (1, {"/condition": 1})
    assert (result["first_difference"]["recorded"], result["first_difference"]["recomputed"]) == (
        "(none)",
        "recomputed",
    )


class SaturatingCrane(RecordedCrane):
    """One sample in each fifth block is at the end of the range."""

    blocks = 0

    def process(self, block: SampleBlock) -> None:
        self.blocks += 1
        if self.blocks % 5 == 0:
            raw, saturated = block.raw.copy(), np.zeros(len(block), dtype=np.bool_)
            raw[3, 0], saturated[3] = MAX_COUNT, True
            block = replace(block, raw=raw, saturated=saturated)
        super().process(block)


@pytest.mark.slow
def test_saturated_samples_are_replayed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    crane = SaturatingCrane(tmp_path)
    crane.record(20)
    crane.close()
    code, result = replay(tmp_path, capsys)
    assert (code, result["differing"]) == (0, {})
    recorded = read_samples([next(tmp_path.glob("*.mcap"))]).recording()
    assert recorded.saturated is not None
    assert np.array_equal(recorded.saturated, recorded.raw[:, 0] == MAX_COUNT)
    assert recorded.saturated.sum() == len(recorded) // 50


class TurningCrane(RecordedCrane):
    """With a gyroscope of 16 bits whose readings are noise about a bias; one of them is at the end of its range."""

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(5)
        super().__post_init__()
        self.info = replace(self.info, gyro_rad_s_per_count=1e-4, gyro_bias_rad_s=0.1)
        self.recorder.set_device(self.info, START_NS)
        self.pipeline = self.make_pipeline()

    def process(self, block: SampleBlock) -> None:
        counts = self.random.integers(95, 106, (len(block), 3)).astype(np.int32)
        counts[0, 1] = 32767 if self.random.random() < 0.05 else counts[0, 1]
        super().process(replace(block, gyro_counts=counts))


@pytest.mark.slow
def test_a_gyroscope_is_recorded_and_replayed_to_the_byte(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    crane = TurningCrane(tmp_path)
    crane.record(25)
    crane.close()
    code, result = replay(tmp_path, capsys)
    assert (code, result["differing"]) == (0, {})
    gyro_dps = read_samples(sorted(tmp_path.glob("*.mcap"))[:1]).recording().gyro_dps
    assert gyro_dps is not None
    assert np.nanmean(np.radians(gyro_dps)) == pytest.approx(0.01, rel=0.01)
    assert 0 < np.isnan(gyro_dps).sum() < 20


@pytest.mark.slow
def test_time_without_samples_is_replayed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    crane = RecordedCrane(tmp_path)
    crane.record(12)
    newest_ns = crane.next_second_ns
    for number in range(30):
        for message in crane.pipeline.idle(newest_ns + number * 130_000_000, CLOCK).messages:
            crane.write(message)
    crane.device.read()
    crane.record(8)
    crane.close()
    code, result = replay(tmp_path, capsys)
    assert (code, result["differing"]) == (0, {})


def acknowledge(crane: RecordedCrane, time_ns: int) -> None:
    (incident,) = crane.incidents.unacknowledged()
    given = Acknowledgement(incident, "ann", "load set down")
    (change,) = crane.pipeline.acknowledge(given, MessageTime(time_ns, CLOCK))
    crane.write(change)


@pytest.mark.slow
def test_an_acknowledgement_and_the_numbers_of_changes_are_replayed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    crane = HastyCrane(tmp_path)
    crane.incidents.last_number = 41  # of the start before
    crane.incidents.remember([past_incident("former-1", "swing", 6.0, crane.start_ns - SECOND_NS)])
    crane.record(1)
    acknowledge(crane, crane.newest_ns)
    while not list(crane.incidents.unacknowledged()):
        crane.record(0.1)
    acknowledge(crane, crane.newest_ns)
    while not list(crane.incidents.unacknowledged()):  # raised to a higher level
        crane.record(0.1)
    crane.device.read()
    idle_ns = crane.newest_ns + 130_000_000
    for message in crane.pipeline.idle(idle_ns, CLOCK).messages:
        crane.write(message)
    acknowledge(crane, idle_ns)
    crane.record(5)
    crane.close()
    code, result = replay(tmp_path, capsys)
    assert (code, result["differing"]) == (0, {})
    alerts = [
        file.decode(message)
        for file in map(open_recording, sorted(tmp_path.glob("*.mcap")))
        for message in file.messages()
        if message.topic == "/alert"
    ]
    changes = [alert.alert_number for alert in alerts if alert.rule is not None]
    assert changes == list(range(42, 42 + len(changes)))
    assert [alert.acknowledged_by for alert in alerts if alert.event == "acknowledged"] == ["ann"] * 3
    assert alerts[-1].alert_number == changes[-1]


def test_a_long_first_block_in_a_recalibration_is_replayed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A restart in a session: the sensor has kept samples, and what follows from the first of them comes before their block."""
    crane = RecordedCrane(tmp_path)
    collecting = replace(NO_SESSION, id="r-1", phase="collecting", method="six_position", by="ann", suspended=True)
    crane.pipeline.set_session(collecting)
    kept = [block for _ in range(3) if isinstance(block := crane.device.read(), SampleBlock)]
    time_ns = np.concatenate([block.time_ns for block in kept])
    crane.process(SampleBlock(time_ns=time_ns, raw=np.concatenate([block.raw for block in kept])))
    crane.record(3)
    crane.close()
    code, result = replay(tmp_path, capsys)
    assert (code, result["differing"]) == (0, {})


@pytest.mark.slow
def test_a_stale_reading_in_a_recalibration_is_replayed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The pipeline is new with the session, and tells first that it has no sample yet."""
    crane = RecordedCrane(tmp_path)
    crane.record(3)
    begin_pipeline(crane, correction_for(crane.info, crane.configuration.device.axes, None))
    crane.pipeline.set_session(replace(NO_SESSION, id="r-1", phase="collecting", method="x", by="ann", suspended=True))
    announce(crane)
    for message in crane.pipeline.idle(crane.newest_ns + 1_000_000, CLOCK).messages:
        crane.write(message)
    crane.record(3)
    crane.close()
    code, result = replay(tmp_path, capsys)
    assert (code, result["differing"]) == (0, {})


@pytest.mark.slow
def test_an_alert_that_the_end_of_a_run_cut_does_not_last_into_the_next_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for boot_id, start_ns in (("b00t", START_NS), ("b00t-2", START_NS + 600 * SECOND_NS)):
        clock = SleeplessClock(start_ns)
        device = SimulatedCrane(odr_hz=100, block_samples=10, length_m=12.0, position_m=9.0, clock=clock)
        crane = RecordedCrane(tmp_path, boot_id=boot_id, start_ns=start_ns, device=device)
        crane.record(33)
        crane.close()
    code, result = replay(tmp_path, capsys)
    assert (code, result["differing"]) == (0, {})
    first, second = (each for each in result["recomputed"]["alerts"] if each["rule"] == "swing")
    assert first["ended"] == "gateway ended"
    assert first["to_utc_ns"] < second["from_utc_ns"] - 500 * SECOND_NS


@pytest.mark.slow
def test_recalibration_within_the_recording_is_replayed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    crane = RecordedCrane(tmp_path)
    recalibrated(crane)
    code, result = replay(tmp_path, capsys)
    assert (code, result["differing"]) == (0, {})
    verdicts = {row["quantity"]: row["recorded"] for row in result["table"]}
    assert "unknown" in verdicts


@pytest.mark.slow
def test_another_configuration_tells_what_it_would_have_said(
    crane: RecordedCrane, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    same, other = tmp_path / "same.toml", tmp_path / "other.toml"
    same.write_text(to_toml(crane.configuration))
    other.write_text(to_toml(crane.configuration).replace("trip_deg = 4.0", "trip_deg = 40.0"))
    code, result = replay(crane.folder, capsys, "--config", same)
    assert (code, result["mode"], result["equal"]) == (0, "other", True)
    code, result = replay(crane.folder, capsys, "--config", other)
    (alert,) = (row for row in result["table"] if row["quantity"] == "swing alert")
    assert (code, alert["differs"]) == (1, True)
    assert alert["recorded"].startswith("trip at 2026-01-01 00:00:")
    assert alert["recomputed"].startswith("warn at 2026-01-01 00:00:")


@pytest.mark.slow
def test_another_calibration_tells_what_it_would_have_said(
    crane: RecordedCrane, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "record.json"
    content = json.loads(new_record(crane).model_dump_json())
    content["correction_matrix"] = (1.1 * np.array(content["correction_matrix"])).tolist()
    del content["sha256"]
    path.write_text(json.dumps({**content, "sha256": content_hash(content)}))
    code, result = replay(crane.folder, capsys, "--calibration", path)
    assert (code, result["mode"]) == (1, "other")
    assert {row["quantity"] for row in result["table"] if row["differs"]} & {
        "swing alert",
        "swing unknown",
        "largest angle",
    }


@pytest.mark.slow
def test_recording_of_another_version_is_compared_within_a_tolerance(
    crane: RecordedCrane, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_result, "__version__", "9.9.9")
    code, result = replay(crane.folder, capsys)
    assert code == 0
    assert result["notes"] == [
        f"recorded with software {__version__}, here 9.9.9: "
        "compared within two units of the last recorded digit, without texts"
    ]


def test_bad_input_is_one_line(crane: RecordedCrane, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "notes.json").write_text("[]")
    for arguments, text in (
        (["--calibration", tmp_path / "notes.json"], "notes.json: is no calibration record"),
        (["--config", tmp_path / "none.toml"], "none.toml: "),
        (["--warm-up", "10"], "--warm-up: is for a part of the recording; give --from or --last too"),
    ):
        assert main(["record", "replay", str(crane.folder), *map(str, arguments)]) == 2
        error = capsys.readouterr().err
        assert text in error
        assert error.count("\n") == 1


@pytest.mark.slow
def test_session_without_a_suspension_is_an_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    crane = RecordedCrane(tmp_path)
    crane.record(3)
    crane.pipeline.set_session(replace(NO_SESSION, id="r-9", phase="rejected", text="timed out"))
    announce(crane)
    crane.record(9)
    crane.close()
    code, result = replay(tmp_path, capsys)
    assert (code, result["differing"]) == (0, {})
