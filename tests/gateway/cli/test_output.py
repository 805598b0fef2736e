"""What commands print and write, and how options are read: refused before the work begins, with what is allowed."""

import argparse
import io
import json
import re
from pathlib import Path

import pytest

from gateway.cli.argument_types import above_zero, key_fingerprint, recording_time, whole_number
from gateway.cli.calibrate.calibrate_record import new_record
from gateway.cli.main import main
from gateway.cli.output import output_file, paint
from gateway.cli.progress import Progress
from tests.gateway.cli.terminal import TerminalText
from tests.gateway.cli.test_help import COMMANDS

SESSION = Path(__file__).parents[2] / "data" / "calibration" / "six_faces_session.csv"
WRITES = re.compile(r"^(also )?write ")
OTHERS = {"plumbline calibrate laser --overlay"}
"""A folder, which is made."""


@pytest.mark.parametrize(
    ("stream", "environment", "is_painted"),
    [
        (TerminalText(), {"TERM": "xterm-256color"}, True),
        (TerminalText(), {"TERM": "dumb"}, False),
        (TerminalText(), {}, False),
        (TerminalText(), {"TERM": "xterm", "NO_COLOR": ""}, False),
        (io.StringIO(), {"TERM": "xterm"}, False),
    ],
)
def test_text_is_painted_in_a_terminal_alone(
    monkeypatch: pytest.MonkeyPatch, stream: io.StringIO, environment: dict[str, str], is_painted: bool
) -> None:
    for name in ("TERM", "NO_COLOR"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert paint("BAD", "bad", stream) == ("\x1b[1;31mBAD\x1b[0m" if is_painted else "BAD")


def test_steps_of_unknown_number_are_counted() -> None:
    stream = TerminalText()
    with Progress(stream) as progress:
        progress.tick("baseline")
        progress.tick("baseline")
    assert "baseline, step 2" in stream.getvalue()
    assert stream.getvalue().endswith(" \r")


def test_a_share_is_shown_with_the_longest_time_left() -> None:
    stream = TerminalText()
    with Progress(stream) as progress:
        progress.tick("search", 0.25)
    assert "search, 25%, at most 0 s left" in stream.getvalue()


def test_nothing_is_written_where_nobody_looks() -> None:
    stream = io.StringIO()
    with Progress(stream) as progress:
        progress.tick("search", 0.5)
    assert stream.getvalue() == ""


def test_a_calibration_record_on_the_standard_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["calibrate", "six-position", str(SESSION), "--rate", "100", "--unit", "counts"]
    assert main([*arguments, "--json", "-"]) in (0, 1)
    record = json.loads(capsys.readouterr().out)
    assert record["method"] == "six-position"
    assert list(tmp_path.iterdir()) == []


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


def test_a_number_above_zero_is_accepted() -> None:
    assert above_zero("2.5") == 2.5


@pytest.mark.parametrize("text", ["0", "-1", "inf", "nan", "ten", ""])
def test_other_values_are_refused_with_what_is_allowed(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="is not a number above 0"):
        above_zero(text)


def test_only_whole_numbers_are_accepted() -> None:
    assert whole_number("0") == 0
    for text in ("-1", "1.5", "²", "x", ""):
        with pytest.raises(argparse.ArgumentTypeError, match="is not a whole number from 0"):
            whole_number(text)


def test_other_texts_are_refused_with_the_forms_of_a_time() -> None:
    assert recording_time("1:30").value_ns == 90 * 10**9
    with pytest.raises(argparse.ArgumentTypeError, match=r"soon is neither seconds from the start .* nor UTC"):
        recording_time("soon")


def test_a_fingerprint_has_the_form_that_the_gateway_prints() -> None:
    assert key_fingerprint("2693-bcf2-69b1-0e1d") == "2693-bcf2-69b1-0e1d"
    for text in ("zz", "2693bcf269b10e1d", "2693-BCF2-69B1-0E1D", ""):
        with pytest.raises(argparse.ArgumentTypeError, match="is not a fingerprint"):
            key_fingerprint(text)
