"""What commands print: colours, a progress bar, and with `--json -` JSON and nothing else."""

import io
import json
from pathlib import Path

import pytest

from gateway.cli.main import main
from gateway.cli.output import paint
from gateway.cli.progress import Progress
from tests.gateway.cli.terminal import TerminalText

SESSION = Path(__file__).parents[2] / "data" / "calibration" / "six_faces_session.csv"


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
