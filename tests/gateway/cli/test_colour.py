"""Colours: in a terminal that has them, and nowhere else."""

import io

import pytest

from gateway.cli.terminal.output import paint
from tests.gateway.cli.terminal import TerminalText


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
