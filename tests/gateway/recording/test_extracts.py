"""Each gateway is judged by itself, and an extract is no accusation; what was taken from a data folder is named as ever."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.bus.known_gateways import remember_statement
from gateway.cli.main import main
from gateway.cli.record.known_key import key_of_recordings
from gateway.incident.record_verdict import judge_recordings
from gateway.messages import NewestStatement
from gateway.pki.signing_key import read_public_key
from gateway.recording.chain.chain_state import read_state
from tests.clocks import START_NS
from tests.gateway.pki.site import Site
from tests.gateway.recording.conftest import GATEWAY, SECOND_NS, Record
from tests.values import present

Verify = Callable[..., tuple[int, str, Any]]


@pytest.fixture
def verify(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Verify:
    """The exit code, the text and the JSON of the command, of a user with a home of its own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))

    def run(*arguments: Path | str) -> tuple[int, str, Any]:
        written = tmp_path / "found.json"
        code = main(["record", "verify", *map(str, arguments)])
        said = capsys.readouterr()
        main(["record", "verify", *map(str, arguments), "--json", str(written)])
        capsys.readouterr()
        return code, said.out + said.err, json.loads(written.read_text()) if written.exists() else None

    return run


@pytest.fixture
def segments(record: Record) -> list[Path]:
    return record(START_NS)


@pytest.fixture
def key(segments: list[Path]) -> str:
    return read_public_key(str(segments[0].with_name("signing-key.pem.pub")))


@pytest.fixture
def other(record: Record, tmp_path: Path) -> Path:
    """The data folder of another gateway, with one segment."""
    return record(START_NS + 7 * SECOND_NS, folder=tmp_path / "other", segments=1, gateway="yard/crane-1/hook")[
        0
    ].parent


def extract(to: Path, *paths: Path) -> Path:
    to.mkdir()
    for path in paths:
        shutil.copy(path, to)
    return to


def hear_newest(folder: Path, key: str) -> None:
    """Remember what the gateway says of its newest segment, as `remote status` does."""
    state = present(read_state(folder))
    heard = NewestStatement(gateway=GATEWAY, segment=state.final_segment, sha256=state.final_sha256, public_key=key)
    assert remember_statement(heard) is None


def test_two_gateways_have_a_verdict_each(segments: list[Path], other: Path, verify: Verify, tmp_path: Path) -> None:
    code, text, found = verify(segments[0].parent, other)
    assert code == 3
    assert [(each["gateways"], each["answer"]) for each in found] == [
        ([GATEWAY], "consistent"),
        (["yard/crane-1/hook"], "consistent"),
    ]
    assert "yard/crane-1/hook:\n" in text
    mixed = extract(tmp_path / "mixed", *segments, *other.glob("*.mcap"))
    assert [each["problems"] for each in verify(mixed)[2]] == [[], []]
    segments[1].unlink()
    code, text, found = verify(segments[0].parent, other)
    assert (code, [each["answer"] for each in found]) == (1, ["differs", "consistent"])


def test_a_segment_of_another_gateway_in_a_data_folder_is_a_difference(
    segments: list[Path], other: Path, verify: Verify
) -> None:
    shutil.copy(next(other.glob("*.mcap")), segments[1])
    code, _, (own, strange) = verify(segments[0].parent)
    assert code == 1
    assert [text.partition(":")[0] for text in own["problems"]] == ["REMOVED"]
    assert [text.partition(":")[0] for text in strange["problems"]] == ["FOREIGN"]


def test_a_file_of_another_gateway_beside_the_own_ones_accuses_none_of_them(
    segments: list[Path], key: str, other: Path, verify: Verify
) -> None:
    shutil.copy(next(other.glob("*.mcap")), segments[0].parent)
    code, text, (strange, own) = verify(segments[0].parent, "--key", key)
    assert (code, own["answer"], strange["gateways"]) == (1, "genuine", ["yard/crane-1/hook"])
    assert f"FOREIGN: another gateway has written most of {segments[0].parent}, in which this lies" in text
    assert "COPIED" not in text


def test_a_key_that_lies_with_the_recordings_proves_nothing(segments: list[Path], key: str, verify: Verify) -> None:
    beside = segments[0].with_name("signing-key.pem.pub")
    code, text, found = verify(segments[0].parent, "--key", beside)
    assert (code, found["answer"]) == (3, "consistent")
    assert f"the key {beside} lies with the recordings, and proves nothing of who wrote both: keep it apart" in text
    assert verify(segments[0].parent, "--key", key)[0] == 0
    assert key_of_recordings(str(beside), None, segments).public_key is None
    assert key_of_recordings(key, None, segments).public_key == key


def test_a_second_key_is_refused(segments: list[Path], key: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        main(["record", "verify", str(segments[0].parent), "--key", key, "--key", key])
    assert refused.value.code == 2
    assert "--key is given twice; verify the recordings of each gateway by themselves" in capsys.readouterr().err


def test_an_extract_in_a_folder_is_genuine_as_far_as_it_goes(
    segments: list[Path], key: str, verify: Verify, tmp_path: Path
) -> None:
    folder = extract(tmp_path / "extract", segments[1])
    code, text, found = verify(folder, "--key", key)
    assert code == 3  # never 0: a folder from which somebody took all else looks the same
    assert "an extract: segment 2, and not those from 1 on" in text
    assert "REMOVED" not in text
    assert (found["answer"], found["genuine"], found["extract_of"]) == ("extract", False, 2)
    assert [(each["first"], each["last"], each["reason"]) for each in found["missing"]] == [(1, 1, "not_given")]
    hear_newest(segments[0].parent, key)
    code, text, found = verify(folder)
    assert (code, "an extract: segment 2 of 1 to 3" in text, found["extract_of"]) == (3, True, 3), text


def test_a_named_file_is_an_extract_whoever_asks(segments: list[Path], key: str, verify: Verify) -> None:
    code, text, _ = verify(segments[1], "--key", key)
    assert (code, "an extract: segment 2, and not" in text) == (3, True), text
    hear_newest(segments[0].parent, key)
    code, text, _ = verify(segments[1])
    assert (code, "an extract: segment 2 of 1 to 3" in text) == (3, True), text
    assert "cannot tell (key " in text
    assert text.endswith(", pinned: this user heard it from the gateway at the first contact)\n")


def test_all_files_of_a_folder_by_name_are_an_extract_and_the_folder_is_not(
    segments: list[Path], key: str, verify: Verify
) -> None:
    code, text, found = verify(*segments, "--key", key)
    assert (code, found["answer"], found["genuine"]) == (3, "extract", False)
    assert "whether others were removed, an extract cannot tell (key " in text
    assert verify(segments[0].parent, "--key", key)[0] == 0
    segments[2].unlink()
    assert verify(*segments[:2], "--key", key)[0] == 3  # nobody is accused, and nothing is called whole
    assert verify(segments[0].parent, "--key", key)[0] == 1


def test_a_gap_inside_an_extract_is_a_removal(segments: list[Path], key: str, verify: Verify, tmp_path: Path) -> None:
    for given in ([extract(tmp_path / "extract", segments[0], segments[2])], [segments[0], segments[2]]):
        code, text, _ = verify(*given, "--key", key)
        assert (code, "REMOVED: segment 2 is missing in the middle" in text) == (1, True), text


def test_what_is_missing_of_a_data_folder_was_removed_whatever_else_was_removed_with_it(
    segments: list[Path], key: str, verify: Verify
) -> None:
    folder = segments[0].parent
    hear_newest(folder, key)
    segments[2].unlink()
    (folder / "chain.json").unlink()
    for given in ([folder], segments[:2]):
        code, text, _ = verify(*given)
        assert (code, "REMOVED: segment 3 is missing at the end" in text) == (1, True), text
    segments[0].unlink()
    code, text, _ = verify(folder)
    assert (code, "REMOVED: segment 1 is missing at the beginning" in text) == (1, True), text
    for path in folder.iterdir():  # even so it is not genuine
        if path.suffix != ".mcap":
            path.unlink()
    for given in ([folder], [segments[1]]):
        code, text, found = verify(*given)
        assert (code, found["answer"], "an extract: segment 2 of 1 to 3" in text) == (3, "extract", True), text


def test_what_somebody_gives_as_heard_must_be_in_an_extract_too(
    segments: list[Path], key: str, verify: Verify, tmp_path: Path
) -> None:
    hear_newest(segments[0].parent, key)
    (kept,) = (tmp_path / "state").rglob("*.json")
    heard = tmp_path / "heard.json"
    heard.write_text(json.dumps({"newest_statement": json.loads(kept.read_text())}))
    for given in (extract(tmp_path / "extract", segments[0]), segments[0]):
        code, text, _ = verify(given, "--heard", heard)
        assert (code, "REMOVED: segments 2 to 3 are missing at the end" in text) == (1, True), text


@pytest.mark.parametrize(("content", "reason"), [(b"", "is empty"), (bytes(1000), "is not an MCAP file")])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_destroyed_file_is_one_difference_and_the_others_are_judged(
    segments: list[Path], key: str, verify: Verify, content: bytes, reason: str, place: int
) -> None:
    segments[place].write_bytes(content)
    code, text, found = verify(segments[0].parent, "--key", key)
    assert code == 1
    assert f"{segments[place]}: segment {place + 1}, nothing signed\n  DESTROYED: {reason}" in text
    assert (found["problems"], found["missing"]) == ([], [])
    assert [bool(each["problems"]) for each in found["files"]] == [number == place for number in range(3)]


def test_neighbouring_destroyed_files_have_the_numbers_of_their_places(
    segments: list[Path], key: str, verify: Verify
) -> None:
    for path in segments[:2]:
        path.write_bytes(b"")
    _, _, found = verify(segments[0].parent, "--key", key)
    assert [each["segment"] for each in found["files"]] == [1, 2, 3]
    segments[2].write_bytes(b"")
    assert main(["record", "verify", str(segments[0].parent)]) == 2


@pytest.mark.parametrize("name", ["0.mcap", "note.mcap"])
def test_a_file_of_text_beside_the_recordings_is_none_of_them(
    segments: list[Path], key: str, verify: Verify, name: str
) -> None:
    folder = segments[0].parent
    (folder / name).write_text("hello")
    code, text, found = verify(folder, "--key", key)
    assert code == 0, text
    assert f"{folder / name}: not a recording: " in text
    assert "the files are segments 1 to 3\n" in text
    assert [each["path"] for each in found["files"] if not each["is_recording"]] == [str(folder / name)]
    assert verify(*folder.glob("*.mcap"), "--key", key)[0] == 3
    segments[1].unlink()
    code, text, _ = verify(folder, "--key", key)
    assert (code, "REMOVED: segment 2 is missing in the middle" in text) == (1, True), text
    (folder / name).rename(segments[1])  # in the place of a recording it is what is left of it
    code, text, _ = verify(folder, "--key", key)
    assert (code, f"{segments[1]}: segment 2, nothing signed\n  DESTROYED" in text) == (1, True), text


def test_what_chain_json_does_not_tell_may_be_a_destroyed_recording(
    segments: list[Path], key: str, verify: Verify
) -> None:
    segments[2].write_text("hello")
    (segments[0].parent / "chain.json").unlink()
    code, text, _ = verify(segments[0].parent, "--key", key)
    assert (code, "segment 3, nothing signed\n  DESTROYED" in text) == (1, True), text


def test_a_ca_that_does_not_vouch_is_said(segments: list[Path], verify: Verify, tmp_path: Path) -> None:
    ca = Site(tmp_path / "keys").folder.path / "ca.pem"
    code, text, _ = verify(segments[0].parent, "--ca", ca)
    assert (code, "the site's CA does not vouch for the key that signed these" in text) == (3, True), text


def test_a_report_misses_the_newest_segment_of_a_folder_that_is_given(segments: list[Path], key: str) -> None:
    folder = segments[0].parent
    assert judge_recordings(segments[1:], key, ends_in=folder).kind == "genuine"
    segments[-1].unlink()
    assert judge_recordings(segments[1:-1], key).kind == "genuine"
    verdict = judge_recordings(segments[1:-1], key, ends_in=folder)
    assert (verdict.kind, verdict.problems[0].split(";")[0]) == ("differs", "REMOVED: segment 3 is missing at the end")
