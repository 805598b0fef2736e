"""What the verbs of `plumbline record` say of files that they cannot use: one line, exit code 2, nothing written."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer

from gateway.cli.main import main
from tests.gateway.recording.recorded_crane import RecordedCrane

VERBS = {
    "info": [],
    "verify": [],
    "recover": ["--out", "{out}"],
    "export": ["--csv", "{out}"],
    "replay": [],
    "play": ["--speed", "1000"],
    "incident": ["--out", "{out}"],
}


def write_nothing(path: Path) -> None:
    """No file of that name."""


def write_empty(path: Path) -> None:
    path.write_bytes(b"")


def write_text(path: Path) -> None:
    path.write_text("time_s,ax_g,ay_g,az_g\n")


def write_start(path: Path) -> None:
    """The first bytes of an MCAP file."""
    path.write_bytes(b"\x89MCAP0\r\n\x01\x05")


def write_foreign(path: Path) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("Twist", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("/cmd_vel", "json", schema)
        writer.add_message(channel, 10**9, json.dumps({"x": 1.0}).encode(), 10**9)
        writer.finish()


UNUSABLE = {
    "none.mcap": (write_nothing, "none.mcap: no such file or directory; check the path"),
    "empty.mcap": (write_empty, "empty.mcap: is empty; choose another recording"),
    "table.mcap": (write_text, "table.mcap: is not an MCAP file"),
    "start.mcap": (write_start, "start.mcap: "),
}


CASES = [(verb, name) for verb in VERBS for name in UNUSABLE if (verb, name) != ("verify", "start.mcap")]
"""To `verify`, a file that ends after its first bytes is a cut tail, which it names with exit code 1."""


@pytest.mark.slow
@pytest.mark.parametrize(("verb", "name"), CASES)
def test_unusable_file_is_one_line_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str, name: str
) -> None:
    write, text = UNUSABLE[name]
    path, out = tmp_path / name, tmp_path / "out"
    write(path)
    before = sorted(tmp_path.iterdir())
    assert main(["record", verb, str(path), *(part.format(out=out) for part in VERBS[verb])]) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("verb", "text"),
    [
        ("export", "foreign.mcap: has no samples"),
        ("replay", "foreign.mcap: has no samples"),
        ("play", "foreign.mcap: names no gateway"),
        ("incident", "foreign.mcap: "),
    ],
)
def test_foreign_file_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str, text: str) -> None:
    path, out = tmp_path / "foreign.mcap", tmp_path / "out"
    write_foreign(path)
    assert main(["record", verb, str(path), *(part.format(out=out) for part in VERBS[verb])]) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_info_of_a_foreign_file_lists_its_topics(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_foreign(tmp_path / "foreign.mcap")
    assert main(["record", "info", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "gateway        not recorded" in printed
    assert "/cmd_vel" in printed


def as_it_is_written(path: Path) -> None:
    """Leave a file as it is."""


def tear(path: Path) -> None:
    os.truncate(path, path.stat().st_size - 700)


@pytest.mark.slow
@pytest.mark.parametrize("damage", [as_it_is_written, tear])
@pytest.mark.parametrize("verb", ["info", "export", "replay"])
def test_file_that_is_being_written_or_was_torn_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str, damage: Callable[[Path], None]
) -> None:
    crane = RecordedCrane(tmp_path / "data", segment_s=600.0)
    crane.record(4)
    (path,) = crane.folder.glob("*.mcap")
    copy, out = tmp_path / "copy.mcap", tmp_path / "out"
    copy.write_bytes(path.read_bytes())
    crane.close()
    damage(copy)
    assert main(["record", verb, str(copy), *(part.format(out=out) for part in VERBS[verb])]) == 0
    capsys.readouterr()
