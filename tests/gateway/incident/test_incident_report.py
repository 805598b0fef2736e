"""The report of an incident over recordings of a simulated crane: its sentences hold the numbers of the recording."""

import json
import re
import shutil
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from gateway.cli.main import main
from gateway.errors import InputError
from gateway.incident.incident_report import IncidentReport, write_report
from gateway.incident.incident_selection import IncidentChoice, choose_window, read_incidents
from gateway.incident.record_verdict import judge_recordings
from gateway.messages import Motion
from gateway.pki.signing_key import fingerprint, read_public_key
from gateway.recording.format.mcap_writer import McapWriter
from gateway.recording.format.salvage import SalvageReport, open_mcap, read_records
from gateway.recording.reading.interval import iso_utc, parse_recording_time
from gateway.recording.reading.timeline import open_timeline
from gateway.recording.segments.copying import RecordCopier
from tests.gateway.incident.conftest import MakeReport, text_of, write_report_of
from tests.gateway.recorded_crane import LIMITS, SEGMENT_S, START_S, RecordedCrane
from tests.gateway.recording.recorded_crane import BOOT_ID
from tests.values import present

pytestmark = pytest.mark.slow


RECORDED_DEG = 0.00051
"""Recorded angles have three decimals."""


def test_the_sentences_state_the_numbers_of_the_recording(recorded: RecordedCrane, report: IncidentReport) -> None:
    text = " ".join(report.sentences)
    tripped = next(change for change in recorded.changes if change.event == "raised" and change.limit_deg == 5.0)
    cleared = recorded.changes[-1]
    largest = recorded.largest
    assert cleared.event == "cleared"
    assert f"raised to trip (limit {LIMITS['trip_deg']:.1f}°) at {when(tripped.time_ns)} UTC" in text
    assert f"It cleared at {when(cleared.time_ns)} UTC" in text
    assert f"was {present(largest.angle_deg):.1f}°" in text
    assert f"at {when(largest.time_ns)} UTC" in text
    low_deg, high_deg = (
        max(present(each.angle_deg) + sign * 1.96 * present(each.u_deg) for each in recorded.known_motions)
        for sign in (-1, 1)
    )
    assert f"({low_deg:.1f}° to {high_deg:.1f}° at 95 %)" in text
    (value_deg,) = {active.value_deg for active in tripped.active}
    assert f"The {present(value_deg):.1f}° that raised it were the upper bound of a peak that was expected" in text
    assert "trolley, bridge or jib accelerated" in text
    assert text in text_of(report.folder / "incident.html")


def when(time_ns: int) -> str:
    return iso_utc(time_ns)[:-3].replace("T", " ")


def test_the_incident_begins_in_one_file_and_ends_in_another(recorded: RecordedCrane, report: IncidentReport) -> None:
    content = json.loads((report.folder / "incident.json").read_text())
    begin_s, end_s = (seconds_of_day(content["utc"][name]) for name in ("raised", "cleared"))
    assert begin_s // SEGMENT_S != end_s // SEGMENT_S
    assert content["incident"] == f"{BOOT_ID}-1"
    assert [source["file"] for source in content["sources"]] == [path.name for path in recorded.files]
    assert content["samples"]["gaps"] == 0


def seconds_of_day(utc: str) -> float:
    return float(utc[17:-1]) + 60 * float(utc[14:16])


def test_the_move_before_the_peak_is_the_trolley(report: IncidentReport) -> None:
    (move,) = report.content["moves"]
    assert move["state"] == "driven"
    assert seconds_of_day(move["from"]) == pytest.approx(START_S, abs=1.0)


def test_the_command_states_the_smoothed_move_in_the_summary_and_in_its_section(
    recorded: RecordedCrane, tmp_path: Path
) -> None:
    assert main(["record", "incident", str(recorded.folder), "--out", str(tmp_path / "report")]) == 3  # without the key
    content = json.loads((tmp_path / "report" / "incident.json").read_text())
    (move,) = content["moves"]
    assert (content["moves_are_smoothed"], move["state"]) == (True, "driven")
    assert seconds_of_day(move["from"]) == pytest.approx(START_S, abs=1.0)
    assert move["probability"] > 0.6
    page = text_of(tmp_path / "report" / "incident.html")
    assert page.count("Before the peak, trolley, bridge or jib accelerated") == 2
    assert page.count("s of the 20 s before the peak are not known (the gateway was started).") == 2
    assert "live estimate " not in page


@pytest.mark.parametrize(
    ("configuration", "said"),
    [
        (b"not TOML \xff", "its configuration is not TOML"),
        (b"a=" + b"[" * 50_000, "its configuration is not TOML"),
        (b'[device]\naxes_map = "x,x,z"\n', "its configuration: device.axes_map"),
        (b"[server]\nport = 1\n", None),
    ],
)
def test_a_damaged_or_foreign_configuration_costs_its_section_alone(
    recorded: RecordedCrane, make_report: MakeReport, tmp_path: Path, configuration: bytes, said: str | None
) -> None:
    for source in recorded.files:
        with_configuration(source, tmp_path / source.name, configuration)
    report = make_report(sorted(tmp_path.glob("*.mcap")))
    assert report.sentences
    shown = text_of(report.folder / "incident.html")
    assert ("the readings are shown in the axes of the sensor" in shown) == (said is not None)
    assert said is None or said in shown


def with_configuration(source: Path, to: Path, configuration: bytes) -> None:
    """Copy a recording with another configuration in it."""
    with source.open("rb") as stream, to.open("wb") as target:
        reader, writer, channels = make_reader(stream), Writer(target), dict[int, int]()
        writer.start(profile="plumbline", library="forged")
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        for each in reader.iter_attachments():
            data = configuration if each.name == "configuration.toml" else each.data
            writer.add_attachment(each.create_time, each.log_time, each.name, each.media_type, data)
        for schema, channel, message in reader.iter_messages():
            if channel.id not in channels:
                made = present(schema)
                schema_id = writer.register_schema(made.name, made.encoding, made.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, schema_id)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()


def test_live_and_torn_recordings_are_reported_up_to_their_end(
    recorded: RecordedCrane, make_report: MakeReport, tmp_path: Path
) -> None:
    folder = tmp_path / "torn"
    folder.mkdir()
    for path in recorded.files[:3]:
        (folder / path.name).write_bytes(path.read_bytes())
    last = folder / recorded.files[2].name
    last.write_bytes(last.read_bytes()[: last.stat().st_size // 2])
    report = make_report([folder])
    ended = next(place for place, words in enumerate(report.sentences) if words.endswith(", after which they end."))
    assert report.sentences[ended + 1].startswith(f"The last recording ends at {report.content['utc']['to'][:10]} ")
    assert "Nothing says that the gateway was stopped: it was killed, lost its power" in report.sentences[ended + 1]
    page = text_of(report.folder / "incident.html")
    assert "not closed" in page
    assert "alert The swing alert stands where the recordings end [incident" in page
    assert "recordings Nothing says that the gateway was stopped" in page
    assert report.content["peak"]["angle_deg"] == pytest.approx(recorded.largest.angle_deg, abs=RECORDED_DEG)


def test_the_page_asks_the_network_for_nothing_and_a_second_report_replaces_none(
    recorded: RecordedCrane, report: IncidentReport
) -> None:
    page = (report.folder / "incident.html").read_text()
    assert "default-src 'none'" in page
    assert not re.search(r'(src|href)="https?:', page)
    with pytest.raises(InputError, match="exists; choose another --out"):
        write_report_of([recorded.folder], folder=report.folder)


def test_the_largest_angle_is_that_of_the_messages(recorded: RecordedCrane, report: IncidentReport) -> None:
    peak = report.content["peak"]
    motions = [each.message for each in recorded.messages if isinstance(each.message, Motion)]
    largest_deg = max(present(each.angle_deg) for each in motions if each.angle_deg is not None)
    assert peak["angle_deg"] == pytest.approx(largest_deg, abs=RECORDED_DEG)
    assert open_timeline([recorded.folder]).span().wall_offset_ns == 250_000_000


def test_a_recording_of_samples_alone_is_reported_without_an_angle(
    recorded: RecordedCrane, make_report: MakeReport, tmp_path: Path
) -> None:
    source, path = recorded.files[0], tmp_path / "samples.mcap"
    kept = {"/samples", "/clock", "/calibration"}
    losses = SalvageReport()
    with path.open("wb") as target, open_mcap(source) as file:
        writer = McapWriter(target)
        RecordCopier(writer, losses, lambda topic, _: topic in kept).copy(read_records(file, losses))
        writer.finish()
    report = make_report([path], IncidentChoice(around=parse_recording_time("5")))
    assert "The angle was not known at any time of it." in report.sentences
    assert report.content["specific_force_g"] is not None


def test_no_folder_is_left_where_its_parent_is_missing(recorded: RecordedCrane, tmp_path: Path) -> None:
    timeline = open_timeline([recorded.folder])
    window = choose_window(timeline, read_incidents(timeline), IncidentChoice(), 1.0)
    with pytest.raises(InputError, match="there is no folder"):
        write_report(
            timeline, window, tmp_path / "a" / "b", verify=lambda sources: judge_recordings(sources, None), computed={}
        )
    assert list(tmp_path.iterdir()) == []


def test_a_report_of_a_simulated_crane_says_so_in_its_first_lines_whatever_the_name(
    report: IncidentReport,
) -> None:
    assert report.sentences[0].startswith("SIMULATION: this crane is simulated")
    assert report.content["gateway"] == "yard/crane-2/hook"
    assert (report.content["source"], report.content["device"]["kind"]) == ("simulation", "simulated")
    page = text_of(report.folder / "incident.html")
    assert page.index("SIMULATION: Trip, swing SIMULATION: this crane is simulated") < page.index("was raised to trip")
    assert "<title>Incident report: SIMULATION, yard/crane-2/hook" in (report.folder / "incident.html").read_text()
    assert "genuine" not in page.lower()


@pytest.mark.parametrize(
    ("change", "with_key", "with_state", "code", "verdict", "said"),
    [
        (0, True, True, 0, "genuine", "Recordings: nothing differs from what the gateway signed (key {key})"),
        (0, True, False, 3, "open", "Recordings: nothing differs from what the gateway signed (key {key})"),
        (0, False, True, 3, "open", "Recordings: consistent in themselves only."),
        (1, True, True, 1, "differs", "Recordings: THEY DIFFER FROM WHAT THE GATEWAY SIGNED."),
    ],
)
def test_the_verdict_on_the_recordings_is_printed_and_is_the_exit_code(
    recorded: RecordedCrane,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: int,
    with_key: bool,
    with_state: bool,
    code: int,
    verdict: str,
    said: str,
) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    for path in recorded.files:
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= change * (path == recorded.files[1])
        (folder / path.name).write_bytes(content)
    if with_state:
        shutil.copy(recorded.folder / "chain.json", folder)
    key_file = str(recorded.folder / "signing-key.pem.pub")
    arguments = ["--margin", "1", *(["--key", key_file] if with_key else []), "--out", str(tmp_path / "report")]
    assert main(["record", "incident", str(folder), *arguments]) == code
    printed = capsys.readouterr().out
    (line,) = (each for each in printed.splitlines() if each.startswith("Recordings: "))
    assert (f"\n  {recorded.files[1].name}: ALTERED: bytes " in printed) == (code == 1)
    assert line.startswith(said.format(key=fingerprint(read_public_key(key_file))))
    assert line.endswith("Checked: the 4 files that this report is made from; the other 1 was not.")
    page = text_of(tmp_path / "report" / "incident.html")
    assert line in page
    assert ("Recordings altered, damaged or incomplete: " in page) == (code == 1)
    assert (page.index(line) < page.index("The swing alert was raised")) == (code == 1)
    assert json.loads((tmp_path / "report" / "incident.json").read_text())["verification"]["verdict"] == verdict


def test_the_time_of_the_trip_stands_beside_that_of_the_warning(
    recorded: RecordedCrane, report: IncidentReport
) -> None:
    utc = report.content["utc"]
    tripped = next(change for change in recorded.changes if change.event == "raised" and change.limit_deg == 5.0)
    assert utc["level_raised"] == iso_utc(tripped.time_ns)
    assert utc["raised"] == iso_utc(recorded.changes[0].time_ns) < utc["level_raised"]


def test_without_the_key_nothing_is_called_genuine(report: IncidentReport) -> None:
    verification = report.content["verification"]
    assert verification["verdict"] == "open"
    assert "Whoever wrote the recordings may have signed them" in verification["remarks"][0]


def test_what_moved_the_load_is_answered_on_request(
    recorded: RecordedCrane, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Of the free swing alone: too short for a comparison, which the answer says."""
    arguments = ["--from", "16", "--to", "30", "--reconcile", "--out", str(tmp_path / "report")]
    assert main(["record", "incident", str(recorded.folder), *arguments]) == 3  # without the key
    assert "report: " in capsys.readouterr().out
    page = text_of(tmp_path / "report" / "incident.html")
    assert "Against a free swing in the simulation: the data cannot be used. " in page
    assert "What moved the load" in (tmp_path / "report" / "cause.html").read_text()
