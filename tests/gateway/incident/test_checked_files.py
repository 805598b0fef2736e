"""Which files a report is made from, and whether it says so: each of them is checked, listed, and in the cut."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from gateway.cli.main import main
from gateway.incident.incident_report import IncidentReport, write_report
from gateway.incident.incident_selection import IncidentChoice, choose_window, find_incidents, read_incidents
from gateway.incident.record_verdict import AlterableEnd, RecordVerdict, judge_recordings, scope_text
from gateway.messages import Alert
from gateway.pipeline.outgoing_message import OutgoingMessage
from gateway.pki.signing_key import read_public_key
from gateway.recording.reading.recording_file import open_recording
from gateway.recording.reading.timeline import open_timeline
from gateway.recording.segments.compaction import compact
from tests.gateway.incident.conftest import text_of, write_report_of
from tests.gateway.recorded_crane import HastyCrane, RecordedCrane
from tests.gateway.recording.recorded_crane import BOOT_ID

pytestmark = pytest.mark.slow

MARGIN_S = 3.0
"""The report ends in the fourth file; the acknowledgement is in the sixth."""
ACKNOWLEDGED_S, END_S = 52.0, 58.0


@pytest.fixture(scope="module")
def compacted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recordings of an incident that somebody acknowledges twenty seconds after its end, each file signed as a whole."""
    folder = tmp_path_factory.mktemp("acknowledged") / "data"
    crane = HastyCrane(folder)
    crane.record(ACKNOWLEDGED_S)
    cleared = [each.message for each in crane.sent if isinstance(each.message, Alert)]
    ended = next(each for each in reversed(cleared) if each.event == "cleared" and each.incident == f"{BOOT_ID}-1")
    known = replace(
        ended, event="acknowledged", acknowledged_by="Bob Crane", reason="seen from the cab", change="known"
    )
    crane.write(OutgoingMessage("alert", crane.newest_ns, known))
    crane.record(END_S - ACKNOWLEDGED_S)
    crane.close()
    shutil.copytree(folder, as_closed(folder))
    for path in crane.recorder.take_uncompacted():
        compact(path, crane.chain)
    return folder


def as_closed(folder: Path) -> Path:
    return folder.with_name("as closed")


@pytest.fixture(scope="module")
def acknowledged(compacted: Path) -> Path:
    """The same as the gateway closed them, without the state of their chain."""
    return as_closed(compacted)


Change = Callable[[list[Path]], None]


@pytest.fixture
def report_of(acknowledged: Path, tmp_path: Path) -> Callable[..., IncidentReport]:
    """Return the report of a copy of the recordings that was changed."""

    def make(change: Change = lambda _: None, margin_s: float = MARGIN_S) -> IncidentReport:
        copy = shutil.copytree(acknowledged, tmp_path / "copy")
        change(sorted(copy.glob("*.mcap")))
        key = read_public_key(str(acknowledged / "signing-key.pem.pub"))
        return write_report_of([copy], folder=tmp_path / "report", margin_s=margin_s, key=key)

    return make


def acknowledgements(report: IncidentReport) -> list[str]:
    return [each for each in report.sentences if "acknowledged" in each]


def flip_byte(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def test_the_file_of_a_late_acknowledgement_is_checked_listed_and_in_the_cut(
    report_of: Callable[..., IncidentReport],
) -> None:
    report = report_of()
    assert any("acknowledged at 2026-01-01 00:00:52" in each and "Bob Crane" in each for each in report.sentences)
    assert (report.content["verification"]["verdict"], len(report.content["sources"])) == ("genuine", 6)
    file = open_recording(report.folder / "incident.mcap")
    alerts = [(each.log_time_ns, file.decode(each)) for each in file.messages() if each.topic == "/alert"]
    (incident,) = find_incidents(alerts)
    assert [each.acknowledged_by for each in incident.acknowledgements] == ["Bob Crane"]
    again = write_report_of([report.folder / "incident.mcap"], folder=report.folder / "again", margin_s=MARGIN_S)
    assert set(acknowledgements(again)) == set(acknowledgements(report)) != set()


@pytest.mark.parametrize("place", [4, 5])
def test_a_change_between_the_incident_and_its_acknowledgement_is_a_difference(
    report_of: Callable[..., IncidentReport], place: int
) -> None:
    report = report_of(lambda files: flip_byte(files[place]))
    assert report.verification.kind == "differs"
    assert "ALTERED" in " ".join(report.verification.problems)


def test_no_acknowledgement_is_stated_up_to_the_end_of_what_was_checked(
    report_of: Callable[..., IncidentReport],
) -> None:
    report = report_of(lambda files: files[5].unlink())
    (told,) = (each for each in report.sentences if "acknowledgement" in each)
    assert told == (
        "The recordings state no acknowledgement of it up to 2026-01-01 00:00:40.3 UTC, as far as they were read and checked."
    )
    assert len(report.content["sources"]) == 4


def remove_two(files: list[Path]) -> None:
    files[3].unlink()
    files[5].unlink()


@pytest.mark.parametrize("margin_s", [3.0, 20.0])
def test_a_segment_that_is_missing_inside_the_time_of_a_report_is_a_difference(
    report_of: Callable[..., IncidentReport], margin_s: float
) -> None:
    """Also where the report ends before the hole does."""
    report = report_of(remove_two, margin_s=margin_s)
    assert report.verification.kind == "differs"
    assert report.verification.problems[0].startswith("REMOVED: segment 4 is missing in the middle")


def test_another_key_than_the_one_given_is_called_so(recorded: RecordedCrane) -> None:
    verdict = judge_recordings(recorded.files, "0" * 64)
    assert (verdict.kind, verdict.label) == ("differs", "SIGNED BY ANOTHER KEY THAN THE ONE GIVEN")
    assert verdict.alarm == "Recordings signed by another key"


@pytest.fixture
def damaged_copies(acknowledged: Path, tmp_path: Path) -> dict[str, Path]:
    """Copies of the recordings: whole, without the second segment, and with one bit flipped."""
    copies = {name: shutil.copytree(acknowledged, tmp_path / name) for name in ("whole", "hole", "flipped")}
    files = {name: sorted(copy.glob("*.mcap")) for name, copy in copies.items()}
    files["hole"][1].unlink()
    flip_byte(files["flipped"][1])
    return copies


REMOVED_INSIDE = "REMOVED: segment 2 is missing in the middle"
DAMAGED = "1 damaged record left out"


@pytest.mark.parametrize(
    ("name", "code", "words"), [("whole", 0, ""), ("hole", 3, REMOVED_INSIDE), ("flipped", 3, DAMAGED)]
)
@pytest.mark.parametrize("command", [("incident", "--list"), ("export", "--csv", "samples.csv")])
def test_each_command_says_what_is_hidden_from_it(
    damaged_copies: dict[str, Path],
    command: tuple[str, ...],
    name: str,
    code: int,
    words: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["record", command[0], str(damaged_copies[name]), *command[1:]]) == code
    printed = capsys.readouterr()
    assert words in printed.out + printed.err


@pytest.mark.parametrize("name", ["whole", "hole", "flipped"])
def test_a_report_says_that_other_incidents_may_be_hidden(
    damaged_copies: dict[str, Path], name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    main(["record", "incident", str(damaged_copies[name]), "--margin", "1", "--out", str(tmp_path / "report")])
    said = "other incidents may have been"
    printed, page = capsys.readouterr().out, text_of(tmp_path / "report" / "incident.html")
    assert (said in printed, said in page) == (name != "whole", name != "whole")


def test_a_report_says_that_its_largest_angle_was_not_signed_in_time(recorded: RecordedCrane, tmp_path: Path) -> None:
    peak_ns = recorded.largest.time_ns
    timeline = open_timeline([recorded.folder])
    window = choose_window(timeline, read_incidents(timeline), IncidentChoice(), 1.0)

    def scope(from_ns: int, folder: Path) -> str:
        end = AlterableEnd(from_ns, from_ns + 3_000_000_000, "at the end of a file that are not signed")
        verdict = RecordVerdict("open", "not signed", (), alterable=(end,))
        return write_report(timeline, window, folder, verify=lambda _: verdict, computed={}).verification.scope

    assert " The largest angle lies in the 3.0 s at the end of a file that are not signed: " in scope(
        peak_ns - 1_000_000_000, tmp_path / "in it"
    )
    assert "largest" not in scope(peak_ns + 1_000_000_000, tmp_path / "before it")


@pytest.mark.parametrize(
    ("files", "has_state", "said"),
    [
        (slice(0, None), True, "from the gateway’s first one to its newest"),
        (slice(0, None), False, "whether later ones are missing was not"),
        (slice(1, None), True, "whether earlier ones are missing was not"),
        (slice(1, None), False, "whether others are missing was not"),
    ],
)
def test_a_report_says_which_files_it_would_have_missed(
    recorded: RecordedCrane, files: slice, has_state: bool, said: str
) -> None:
    paths = recorded.files[files]
    verdict = judge_recordings(paths, None, ends_in=recorded.folder if has_state else None)
    assert said in scope_text(len(paths), len(paths), verdict)


@pytest.mark.parametrize(("name", "words"), [("hole", REMOVED_INSIDE), ("flipped", DAMAGED)])
def test_a_replay_says_what_was_not_replayed(
    damaged_copies: dict[str, Path], name: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["record", "replay", str(damaged_copies[name]), "--to", "50"]) == 3
    assert words in next(line for line in capsys.readouterr().out.splitlines() if "not replayed: " in line)


@pytest.fixture
def copy(compacted: Path, tmp_path: Path) -> Path:
    return shutil.copytree(compacted, tmp_path / "data")


@pytest.fixture
def key(compacted: Path) -> str:
    return read_public_key(str(compacted / "signing-key.pem.pub"))


DESTROYED = "DESTROYED: is empty, and nothing of what was recorded is left in it"
LOST = {
    "no first": (0, "REMOVED: segment 1 is missing at the beginning", ""),
    "no last": (-1, "REMOVED: segment 6 is missing at the end", "segment 6 is missing."),
    "emptied": (-1, DESTROYED, "{name}, segment 6, is destroyed"),
    "emptied first": (0, DESTROYED, ""),
    "emptied inside": (1, DESTROYED, ""),
}


@pytest.mark.parametrize("name", LOST)
def test_all_commands_tell_the_same_of_what_is_removed_or_emptied(
    copy: Path, key: str, name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    place, said, said_of_the_end = LOST[name]
    lost = sorted(copy.glob("*.mcap"))[place]
    if said == DESTROYED:
        lost.write_bytes(b"")
    else:
        lost.unlink()
    commands = {
        ("verify", str(copy), "--key", key): 1,
        ("incident", str(copy), "--list"): 3,
        ("info", str(copy)): 3,
        ("replay", str(copy)): 3,
        ("incident", str(copy), "--margin", "60", "--key", key, "--out", str(tmp_path / "report")): 1,
    }
    printed = ""
    for command, code in commands.items():
        assert main(["record", *command]) == code, command
        printed = capsys.readouterr().out
        assert said in printed, command
        assert ("REMOVED" in printed) == ("REMOVED" in said), printed
    assert "from the gateway’s first one to its newest" not in printed
    assert "other incidents may have been" in printed
    page = text_of(tmp_path / "report" / "incident.html")
    assert f"The recordings went on: {said_of_the_end.format(name=lost.name)}" in page or not said_of_the_end


@pytest.mark.parametrize(
    ("places", "code", "words"),
    [
        ((4,), 1, "THEY DIFFER FROM WHAT THE GATEWAY SIGNED"),  # before the acknowledgement
        ((3, 5), 1, "REMOVED: segment 4 is missing in the middle"),  # directly behind the last one
        ((0,), 1, "THEY DIFFER FROM WHAT THE GATEWAY SIGNED"),  # directly before the first one
        ((0, 5), 1, "REMOVED: segment 1 is missing at the beginning"),
        ((5,), 3, "; of the other files: REMOVED: segment 6 is missing at the end"),  # with a file in between
        ((), 0, "nothing differs from what the gateway signed"),
    ],
)
def test_a_report_beside_a_removed_file_is_not_as_of_all_files(
    copy: Path, key: str, places: tuple[int, ...], code: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is made from the second and the third file, up to the sixth where the acknowledgement is there."""
    files = sorted(copy.glob("*.mcap"))
    for place in places:
        files[place].unlink()
    first_s = 0.0 if 0 in places else 10.0
    command = ["record", "incident", str(copy), "--from", f"{first_s + 4}", "--to", f"{first_s + 25}", "--key", key]
    assert main([*command, "--out", str(copy.parent / "report")]) == code
    printed = capsys.readouterr().out
    verdict = printed.partition("Recordings: ")[2]
    assert words in verdict
    assert ("REMOVED" in verdict) == bool(places)
    kind = json.loads((copy.parent / "report" / "incident.json").read_text())["verification"]["verdict"]
    assert kind == {0: "genuine", 1: "differs", 3: "open"}[code]


def test_of_an_incident_of_which_an_acknowledgement_is_left_nothing_else_is_said(
    copy: Path, key: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for path in sorted(copy.glob("*.mcap"))[:-1]:
        path.unlink()
    report = copy.parent / "report"
    assert main(["record", "incident", str(copy), "--key", key, "--out", str(report)]) == 1
    printed = capsys.readouterr().out
    said = next(line for line in printed.splitlines() if f"{BOOT_ID}-1" in line)
    assert said.startswith(f"Of incident {BOOT_ID}-1 only an acknowledgement is in these files (2026-01-01 00:00:52.")
    assert said.endswith(" UTC, Bob Crane); the alert itself is not. Its level, times and angle are not known.")
    for word in ("°", " stood", "did not reach", "after its end", "no gap", "The recordings "):
        assert word not in printed
    content = json.loads((report / "incident.json").read_text())
    assert (content["peak"], content["utc"]["raised"], content["limit_answer"], content["rises"]) == (None,) * 3 + ([],)
    assert " stood " not in text_of(report / "incident.html")
    assert main(["record", "incident", str(copy), "--list"]) == 3
    assert f"{BOOT_ID}-1, only an acknowledgement is in the recordings\n" in capsys.readouterr().out


@pytest.mark.parametrize("is_absent", [False, True])
def test_a_report_does_not_know_of_later_files_without_a_sound_state(
    copy: Path, key: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, *, is_absent: bool
) -> None:
    state = copy / "chain.json"
    max(copy.glob("*.mcap")).unlink()
    state.write_text(state.read_text().replace('_segment":6', '_segment":5'))
    why = "chain.json is damaged, or was changed: its checksum is wrong"
    if is_absent:
        state.unlink()
        why = "the folder has no chain.json"
    report = str(tmp_path / "report")
    assert main(["record", "incident", str(copy), "--margin", "60", "--key", key, "--out", report]) == 3
    printed = capsys.readouterr().out
    assert f"; whether later ones are missing cannot be told ({why})." in printed
    assert "its newest" not in printed


def test_what_is_missing_behind_an_interval_is_nothing_to_it(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    max(copy.glob("*.mcap")).unlink()
    assert main(["record", "info", str(copy), "--to", "20"]) == 0
    assert "REMOVED" not in capsys.readouterr().out


def test_info_counts_at_least_the_alerts_that_can_be_read(
    damaged_copies: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    for name, least in (("whole", ""), ("flipped", "at least "), ("hole", "at least ")):
        assert main(["record", "info", str(damaged_copies[name])]) == (3 if least else 0)
        (counted,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("alerts: "))
        assert counted.startswith(f"alerts: {least}")
        assert f", of them {least}" in counted
