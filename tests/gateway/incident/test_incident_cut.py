"""The recording that a report cuts out: complete in itself, and the same to every command."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import ChunkIndex

from gateway.cli.main import main
from gateway.incident.incident_report import IncidentReport
from gateway.incident.record_verdict import judge_recordings
from gateway.messages import Calibration, Health, Samples
from gateway.packing import unpack
from gateway.recording.reading.recording_file import Selection, open_recording
from gateway.recording.reading.sample_calibration import recorded_configuration
from gateway.recording.reading.samples import read_samples
from tests.clocks import START_NS
from tests.gateway.incident.conftest import MakeReport
from tests.gateway.recorded_crane import RecordedCrane
from tests.gateway.recording.recorded_crane import BOOT_ID
from tests.gateway.restarted_crane import FORMER_TRIP_DEG, SECOND_BOOT, THIRD_BOOT
from tests.values import present

pytestmark = pytest.mark.slow


def test_the_recording_that_was_cut_out_has_every_message_of_its_time(
    recorded: RecordedCrane, make_report: MakeReport
) -> None:
    report = make_report([recorded.folder], margin_s=3.0)
    path = report.folder / "incident.mcap"
    with path.open("rb") as stream:
        reader = make_reader(stream)
        found = [(channel.topic, message.log_time) for _, channel, message in reader.iter_messages()]
        assert {each.name for each in reader.iter_attachments()} >= {"configuration.toml"}
    samples = sorted(time for topic, time in found if topic == "/samples")
    raised_ns, cleared_ns = (message_time(recorded, place) for place in (0, -1))
    assert samples[0] >= raised_ns - 3.0e9 > samples[0] - 0.2e9
    assert samples[-1] <= cleared_ns + 3.0e9 < samples[-1] + 0.2e9
    sent = [each for each in recorded.messages if samples[0] <= each.log_time_ns <= samples[-1]]
    for topic in ("samples", "motion", "alert", "log"):
        times = sorted(time for name, time in found if name == f"/{topic}")
        assert times == sorted(each.log_time_ns for each in sent if each.topic == topic), topic
    blocks = [unpack(each.message) for each in sent if isinstance(each.message, Samples)]
    run = read_samples([path])
    assert np.array_equal(np.concatenate([block.raw for block in blocks]), run.samples.raw)
    assert run.files[0].configuration_toml is not None
    assert isinstance(run.calibrations[0].message, Calibration)


@pytest.fixture
def cut(report_of_restarts: IncidentReport) -> Path:
    return report_of_restarts.folder / "incident.mcap"


@pytest.mark.parametrize(
    "command",
    [
        ["measure", "{cut}"],
        ["record", "export", "{cut}", "--csv", "{out}"],
        ["record", "export", "{cut}", "--mcap", "{out}"],
        ["record", "replay", "{cut}"],
        ["record", "incident", "{cut}", "--out", "{out}"],
        ["record", "incident", "{cut}", "--list"],
        ["record", "info", "{cut}"],
        ["record", "recover", "{cut}"],
    ],
)
def test_every_command_reads_the_recording_that_was_cut_out(cut: Path, tmp_path: Path, command: list[str]) -> None:
    assert len(chunks_of(cut)) > 3
    assert main([part.format(cut=cut, out=tmp_path / "out") for part in command]) in (0, 3)


def chunks_of(path: Path) -> list[ChunkIndex]:
    with path.open("rb") as stream:
        return present(make_reader(stream).get_summary()).chunk_indexes


def test_each_message_of_the_cut_stands_behind_the_configuration_and_the_boot_that_it_is_of(cut: Path) -> None:
    file, found = open_recording(cut), set()
    for message in file.messages():
        content = file.decode(message)
        if isinstance(content, Health):
            assert file.boot_id == content.boot_id
            found.add((file.boot_id, present(recorded_configuration(file)).alerts.trip_deg))
    assert found == {(BOOT_ID, FORMER_TRIP_DEG), (SECOND_BOOT, 5.0), (THIRD_BOOT, 5.0)}


def test_a_part_of_the_cut_has_every_topic_of_its_time(cut: Path) -> None:
    """Whose first chunks, with the first messages of all topics but some, are skipped."""
    file = open_recording(cut)
    everything = [each for each in file.messages() if each.log_time_ns >= START_NS + 18 * 10**9]
    part = open_recording(cut).messages(Selection(START_NS + 18 * 10**9))
    assert Counter(each.topic for each in part) == Counter(each.topic for each in everything)


def message_time(recorded: RecordedCrane, place: int) -> int:
    changes = [each for each in recorded.messages if each.message in recorded.changes]
    return changes[place].log_time_ns


def test_a_report_of_the_cut_out_recording_is_the_same(report: IncidentReport, make_report: MakeReport) -> None:
    again = make_report([report.folder / "incident.mcap"]).sentences
    differing = [each for each, other in zip(again, report.sentences, strict=True) if each != other]
    assert [each[:45] for each in differing] == ["The recordings state no acknowledgement of it"]  # to its own end


def test_the_recording_that_was_cut_out_claims_no_signature(report: IncidentReport) -> None:
    verdict = judge_recordings([report.folder / "incident.mcap"], None)
    assert (verdict.kind, verdict.label) == ("open", "not signed")
