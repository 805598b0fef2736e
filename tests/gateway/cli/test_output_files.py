"""Files that a command writes are checked before its work begins, and a calibration record is not replaced."""

import re
from pathlib import Path

import pytest

from gateway.cli.calibrate.calibrate_record import new_record
from gateway.cli.main import main
from gateway.cli.output import output_file
from tests.gateway.cli.test_help import COMMANDS

WRITES = re.compile(r"^(also )?write ")
OTHERS = {"plumbline calibrate laser --overlay"}
"""A folder, which is made."""


@pytest.mark.parametrize("name", COMMANDS)
def test_an_option_of_a_file_to_write_is_checked_while_it_is_read(name: str) -> None:
    options = [action for action in COMMANDS[name]._actions if action.option_strings and action.nargs != 0]
    written = {f"{name} {a.option_strings[-1]}" for a in options if WRITES.match(a.help or "")}
    checked = {f"{name} {a.option_strings[-1]}" for a in options if a.type in (output_file, new_record)}
    assert written - checked - OTHERS == set()


@pytest.mark.parametrize(("place", "said"), [("no/x.json", "there is no directory no"), (".", "it is a directory")])
def test_what_cannot_be_written_is_refused_before_the_recording_is_read(
    place: str, said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit, match="2"):
        main(["measure", "missing.csv", "--json", place])
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"plumbline measure: error: argument --json: {place}: cannot be written ({said})")


def test_the_standard_output_is_no_file() -> None:
    assert output_file("-") == Path("-")


def test_a_record_that_exists_is_not_replaced(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("record.json").write_text("kept")
    with pytest.raises(SystemExit, match="2"):
        main(["calibrate", "norm-fit", "session.csv", "--json", "record.json"])
    assert "record.json: exists, and a record is never changed; choose another name" in capsys.readouterr().err
    assert Path("record.json").read_text() == "kept"
