"""The line of progress: share and time left in a terminal, nothing elsewhere."""

import io

from gateway.cli.terminal.progress import Progress
from tests.gateway.cli.terminal import TerminalText


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
