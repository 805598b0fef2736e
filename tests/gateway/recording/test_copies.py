"""A file that this program made of recordings is told as such: never as signed, and not as a forgery."""

import shutil
from pathlib import Path

import pytest

from gateway.cli.main import main
from gateway.incident.record_verdict import judge_recordings
from gateway.pki.signing_key import read_public_key
from gateway.recording.format.content import COPIES, CUT, ORIGIN, RECOVERED
from gateway.recording.format.mcap_writer import DENSE, McapWriter
from gateway.recording.format.salvage import SalvageReport, open_mcap, read_records
from gateway.recording.segments.copying import RecordCopier
from tests.clocks import START_NS
from tests.gateway.recording.conftest import Record

HEADER_BYTES = 80
"""So many bytes at least of a file have no metadata."""
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def folder(record: Record) -> Path:
    return record(START_NS, segments=2)[0].parent


def copy_of(source: Path, path: Path, name: str = CUT) -> Path:
    """A copy as `record incident` makes it of recordings of two runs, which says twice whose it is."""
    losses = SalvageReport()
    with path.open("wb") as target, open_mcap(source) as file:
        writer = McapWriter(target, DENSE)
        copier = RecordCopier(writer, losses)
        copier.copy(read_records(file, losses))
        copier.add_metadata(ORIGIN, {"boot_id": "another"})
        copier.add_metadata(name, {})
        writer.finish()
    return path


def verify(capsys: Capture, folder: Path, *paths: Path) -> tuple[int, str]:
    code = main(["record", "verify", *map(str, paths), "--key", read_public_key(str(folder / "signing-key.pem.pub"))])
    return code, capsys.readouterr().out.rstrip()


@pytest.mark.parametrize("name", COPIES)
def test_a_copy_is_told_as_such(folder: Path, tmp_path: Path, capsys: Capture, name: str) -> None:
    path = copy_of(min(folder.glob("*.mcap")), tmp_path / "incident.mcap", name)
    code, text = verify(capsys, folder, path)
    assert (code, text.splitlines()) == (
        3,
        [
            f"{path}: {COPIES[name]}",
            f"incident.mcap: {COPIES[name]}, not signed by the gateway: compare it with the originals",
        ],
    )


def test_a_copy_beside_recordings_accuses_none_of_them(folder: Path, capsys: Capture) -> None:
    copy_of(min(folder.glob("*.mcap")), folder / "incident.mcap")
    code, text = verify(capsys, folder, folder)
    assert (code, text.count("compare it with the originals")) == (3, 1)
    assert "\ngenuine: everything is as the gateway's key signed" in text


def test_a_report_of_recordings_with_a_copy_among_them_does_not_call_them_genuine(folder: Path) -> None:
    path = min(folder.glob("*.mcap"))
    key = read_public_key(str(folder / "signing-key.pem.pub"))
    assert judge_recordings([path], key).kind == "genuine"
    assert judge_recordings([path, copy_of(path, folder / "incident.mcap")], key).kind == "open"


def test_a_recording_that_was_made_a_copy_is_missed(folder: Path, capsys: Capture) -> None:
    for place, path in enumerate(sorted(folder.glob("*.mcap")), 1):
        kept = path.read_bytes()
        shutil.move(copy_of(path, folder / "copy"), path)
        code, text = verify(capsys, folder, folder)
        assert (code, f"REMOVED: segment {place} is missing" in text) == (1, True), text
        path.write_bytes(kept)


def test_a_signed_recording_that_says_that_it_is_a_copy_is_none(folder: Path, capsys: Capture) -> None:
    path = min(folder.glob("*.mcap"))
    content = path.read_bytes()
    place = content.index(ORIGIN.encode(), HEADER_BYTES)
    path.write_bytes(content[:place] + RECOVERED.encode() + content[place + len(ORIGIN) :])
    code, text = verify(capsys, folder, folder)
    assert (code, "compare it" in text, "ALTERED" in text) == (1, False, True), text


def test_an_altered_copy_differs(folder: Path, tmp_path: Path, capsys: Capture) -> None:
    path = copy_of(min(folder.glob("*.mcap")), tmp_path / "incident.mcap")
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 1
    path.write_bytes(content)
    code, text = verify(capsys, folder, path)
    assert (code, "ALTERED" in text) == (1, True), text
    end_of_cut = content.index(b"\x03\x00\x00\x00cut") + 11
    path.write_bytes(content[: end_of_cut + 1])
    code, text = verify(capsys, folder, path)
    assert (code, "CUT or ALTERED: from byte" in text) == (1, True), text
