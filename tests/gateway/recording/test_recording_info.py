import json
import time
from dataclasses import replace
from pathlib import Path

import pytest

from devices.errors import RecordingError
from gateway import messages
from gateway.errors import InputError
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.export.info_text import info_text
from gateway.recording.export.recording_info import TopicInfo, summarise_timeline
from gateway.recording.format.segment_summary import RecordedPeak
from gateway.recording.reading.interval import RecordingInterval, parse_recording_time
from gateway.recording.reading.timeline import open_timeline
from gateway.recording.segments.copying import recover
from gateway.recording.segments.recorder import Recorder
from tests.clocks import START_NS
from tests.gateway.conftest import make_samples
from tests.gateway.recording.conftest import (
    DEVICE,
    EVERY_MESSAGE,
    HEADER,
    SECOND_NS,
    MakeRecorder,
    Record,
    make_alert,
    make_swing,
)
from tests.gateway.recording.recorded_crane import RecordedCrane
from tests.gateway.recording.recorded_files import summarise


@pytest.fixture
def recorded(make_recorder: MakeRecorder) -> Path:
    """Ten seconds at 1 kHz with a hole of 64 ms, three swings and an alert that came and went."""
    recorder = make_recorder()
    recorder.set_device(DEVICE, START_NS)
    path = recorder.start(START_NS)
    recorder.write(encode_message("calibration", EVERY_MESSAGE["calibration"], START_NS))
    for number in (n for n in range(313) if n not in (100, 101)):
        message = make_samples(number, period_ns=1e6, lost=64 if number == 102 else 0)
        recorder.write(encode_message("samples", message, message.time_ns))
        recorder.tick(message.time_ns)
    for second, phi_max_deg in enumerate([2.0, 4.25, None, 3.0]):
        recorder.write(
            encode_message("swing", make_swing(phi_max_deg, START_NS + second), START_NS + second * SECOND_NS)
        )
    for event in ("raised", "standing", "standing", "cleared"):
        recorder.write(encode_message("alert", make_alert(event), START_NS + SECOND_NS))
    clock = EVERY_MESSAGE["clock"]
    assert isinstance(clock, messages.ClockOffset)
    clock = replace(clock, wall_offset_ns=2 * SECOND_NS, stepped=True)
    recorder.write(encode_message("clock", clock, START_NS + SECOND_NS))
    recorder.close()
    return path


def test_info_states_the_whole_content_of_a_recording(recorded: Path) -> None:
    info = summarise(recorded)
    assert info.closed
    assert info.samples.count == 311 * 32
    assert info.samples.rate_hz == pytest.approx(1000.0)
    assert (info.samples.lost, info.samples.gaps, info.samples.missing_blocks) == (64, 1, 2)
    assert info.samples.longest_gap_s == pytest.approx(0.065)
    swing = next(topic for topic in info.topics if topic.topic == "/swing")
    assert swing == TopicInfo("/swing", "plumbline.Swing", 4, swing.rate_hz, swing.bytes)
    assert swing.rate_hz == pytest.approx(4 / info.duration_s)
    assert info.largest_swing == RecordedPeak(START_NS + 1, 4.25, 0.05)
    assert [(alert.rule, alert.level, alert.ended) for alert in info.alerts] == [("swing", "trip", "cleared")]
    assert (info.calibration_id, info.calibration_status) == ("c-1", "calibrated")
    assert (info.origin["software"], info.device["device_id"]) == ("0.1.0", DEVICE.device_id)
    assert info.configuration
    assert info.size_bytes == recorded.stat().st_size
    assert info.bytes_per_sample == info.size_bytes / info.samples.count
    assert info.duration_s == pytest.approx(313 * 0.032 - 0.001)
    assert info.from_utc_ns == START_NS + 2 * SECOND_NS
    assert info.clock is not None
    assert (info.clock.quality, info.clock.wall_offset_s, info.clock.steps) == ("synchronised", 2.0, 1)


def test_text_and_json_have_the_same_content(recorded: Path) -> None:
    info = summarise(recorded)
    content = json.loads(json.dumps(info.as_json()))
    assert content["samples"]["count"] == 9952
    assert content["losses"]["torn_bytes"] == 0
    lines = info_text(info).splitlines()
    labels = [line[:15].strip() for line in lines[: lines.index("")]]
    assert labels == [
        "recording",
        "time",
        "clock",
        "gateway",
        "device",
        "calibration",
        "configuration",
        "samples",
        "largest angle",
        "largest swing",
    ]
    text = "\n".join(lines)
    for part in (
        "closed properly",
        "2026-01-01 00:00:02.000 to 2026-01-01 00:00:12.015 UTC, 10.0 s",
        "yard/crane-2/hook, software 0.1.0",
        "9952 at 1000.000 Hz, 64 lost, 0 invalid, 1 gap (longest 0.065 s), 2 blocks missing",
        "4.250 deg (u 0.050 deg)",
        "alerts: 1, of them 1 trip",
        "TRIP swing",
    ):
        assert part in text


def test_info_reports_an_incomplete_recording(recorded: Path) -> None:
    recorded.write_bytes(recorded.read_bytes()[:-40_000])
    info = summarise(recorded)
    assert not info.closed
    assert 0 < info.samples.count < 9952
    assert "not closed: incomplete, or still being written" in info_text(info)


def test_blocks_of_one_sample_have_a_rate_and_gaps(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    for number in (0, 1, 2, 3, 7, 8):
        message = make_samples(number, length=1, period_ns=1e7)
        recorder.write(encode_message("samples", message, message.time_ns))
    recorder.close()
    samples = summarise(path).samples
    assert samples.rate_hz == pytest.approx(100.0)
    assert samples.gaps == 1
    assert samples.longest_gap_s == pytest.approx(0.04)


def test_info_omits_what_a_recording_does_not_have(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    recorder.write(encode_message("log", EVERY_MESSAGE["log"], START_NS))
    recorder.close()
    text = info_text(summarise(path))
    assert "samples        none" in text
    assert "device         not recorded" in text
    assert "alerts: 0" in text


def test_a_recording_without_a_message_is_refused(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    recorder.close()
    with pytest.raises(RecordingError, match="has no message"):
        summarise(path)


@pytest.mark.slow
def test_gaps_between_segments_are_stated_with_their_cause(tmp_path: Path) -> None:
    crane = RecordedCrane(tmp_path, segment_s=4.0)
    crane.record(13)
    crane.close()
    paths = sorted(tmp_path.glob("*.mcap"))
    assert len(paths) == 4
    assert summarise_timeline(open_timeline(paths)).gaps == []
    info = summarise_timeline(open_timeline([paths[0], paths[2], paths[3]]))
    (gap,) = info.gaps
    second = summarise(paths[1])
    assert (gap.cause, gap.missing, info.samples.gaps) == ("not in these files", second.samples.count, 1)
    assert info.samples.missing_blocks == second.samples.count / 10
    assert "samples: not in these files" in info_text(info)


def test_segments_that_overlap_are_remarked(recorded: Path, tmp_path: Path) -> None:
    folder = tmp_path / "twice"
    folder.mkdir()
    content = bytearray(recorded.read_bytes())
    (folder / "a.mcap").write_bytes(content)
    content[-20] ^= 1  # a copy of the same bytes is left out
    (folder / "b.mcap").write_bytes(content)
    info = summarise_timeline(open_timeline([folder]))
    (remark,) = info.remarks
    assert remark.startswith("b.mcap: overlaps a.mcap by 10.015 s; its samples are counted twice")
    assert remark in info_text(info)


@pytest.mark.slow
def test_interval_is_summarised_as_if_the_rest_were_not_there(tmp_path: Path) -> None:
    crane = RecordedCrane(tmp_path, segment_s=4.0)
    crane.record(13)
    crane.close()
    timeline = open_timeline([tmp_path])
    part = RecordingInterval(parse_recording_time("2"), parse_recording_time("11"))
    info = summarise_timeline(timeline, part)
    assert info.samples.count == pytest.approx(900, abs=10)
    assert info.duration_s == pytest.approx(9.0, abs=0.2)
    assert [topic.count for topic in info.topics if topic.topic == "/motion"] == [90]
    with pytest.raises(InputError, match="--from 60: is after the recording"):
        summarise_timeline(timeline, RecordingInterval(parse_recording_time("60")))


def test_fault_is_listed_when_its_count_changes_and_added_up_over_restarts(tmp_path: Path) -> None:
    health = EVERY_MESSAGE["health"]
    assert isinstance(health, messages.Health)
    for start, counts in enumerate([[0, 0, 0, 0, 0, 3, 3, 3, 3, 4], [5, 5, 6]]):
        begin_ns = START_NS + start * 60 * SECOND_NS
        recorder = Recorder(
            tmp_path, replace(HEADER, boot_id=f"boot-{start}"), segment_s=2.0, fsync_s=0.5, quota_mb=100.0
        )
        recorder.start(begin_ns)
        for second, count in enumerate(counts):
            now_ns = begin_ns + second * SECOND_NS
            message = replace(health, time_ns=now_ns, sequence=second, faults={"overrun": count})
            recorder.write(encode_message("health", message, now_ns))
            recorder.tick(now_ns)
        recorder.close()
    info = summarise_timeline(open_timeline([tmp_path]))
    assert len(info.files) > 4
    seconds = [((fault.utc_ns - START_NS) // SECOND_NS, fault.count) for fault in info.faults]
    assert seconds == [(5, 3), (9, 4), (60, 9), (62, 10)]
    assert "overrun: 10, first at" in info_text(info)


def test_marks_are_listed(make_recorder: MakeRecorder) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    mark = EVERY_MESSAGE["mark"]
    assert isinstance(mark, messages.Mark)
    recorder.write(encode_message("mark", mark, START_NS))
    recorder.write(encode_message("mark", replace(mark, reason="call at 10:05"), START_NS))
    recorder.close()
    said = info_text(summarise(path))
    assert f"{mark.text} ({mark.by})" in said
    assert f"{mark.text} ({mark.by}: call at 10:05)" in said


def test_changes_of_the_configuration_have_a_heading_and_other_lines_stay_in_the_log(
    make_recorder: MakeRecorder,
) -> None:
    recorder = make_recorder()
    path = recorder.start(START_NS)
    entry = {"event": "applied", "id": "a", "by": "ann", "reason": "sling", "changes": ["alerts.trip_deg: 6.0 -> 5.0"]}
    for name, text in (
        ("plumbline.configuration", f"audit {json.dumps(entry)}"),
        (
            "plumbline.configuration",
            f"audit {json.dumps(entry | {'event': 'rolled_back', 'changes': [], 'why': 'no samples'})}",
        ),
        ("plumbline.configuration", "audit [1]"),
        ("plumbline", f"audit {json.dumps(entry)}"),
    ):
        line = messages.Log(
            timestamp=messages.FoxgloveTime(sec=START_NS // SECOND_NS, nsec=0), level=3, message=text, name=name
        )
        recorder.write(encode_message("log", line, START_NS))
    recorder.close()
    said = info_text(summarise(path))
    assert "configuration: 1 change applied over the bus, 2 steps in all\n" in said
    assert "  applied by ann (sling): alerts.trip_deg: 6.0 -> 5.0\n" in said
    assert "  change by ann rolled back by the gateway (sling): no samples\n" in said
    assert "log: 2 warnings and errors\n" in said


def test_a_file_that_was_cut_off_and_completed_says_so(record: Record) -> None:
    (whole,) = record(START_NS, segments=1)
    assert "cut off" not in info_text(summarise(whole))
    record(START_NS + 60 * SECOND_NS, segments=1, compacted=False, closed=False)
    paths = record(START_NS + 120 * SECOND_NS, segments=1)
    info = summarise_timeline(open_timeline(paths))
    assert [file.repaired for file in info.files] == [False, True, False]
    assert f", {paths[1].name} cut off by a kill or a power failure and completed at the next start" in info_text(info)
    assert "closed properly, cut off by a kill" in info_text(summarise(paths[1]))


@pytest.mark.slow
def test_files_without_a_summary_say_the_same(recorded: Path, tmp_path: Path) -> None:
    without = tmp_path / "without.mcap"
    recover(recorded, without)
    written, read = summarise(recorded).as_json(), summarise(without).as_json()
    same = set(written) - {"path", "files", "size_bytes", "bytes_per_sample", "attachments", "recovered"}
    assert {name: read[name] for name in same} == {name: written[name] for name in same}


@pytest.mark.slow
def test_local_times_are_those_of_the_zone_of_this_computer(recorded: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "JST-9")
    time.tzset()
    try:
        text = info_text(summarise(recorded), is_local=True)
    finally:
        monkeypatch.undo()
        time.tzset()
    assert "2026-01-01 09:00:02.000 to 2026-01-01 09:00:12.015 JST" in text
