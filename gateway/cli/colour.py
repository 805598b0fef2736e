"""Colours of a terminal, where there is one that has them (https://no-color.org)."""

import os
import sys
from typing import Literal, TextIO

Style = Literal["good", "note", "warning", "bad"]
CODES: dict[Style, str] = {"good": "32", "note": "36", "warning": "33", "bad": "1;31"}


def has_colours(stream: TextIO) -> bool:
    """Return whether a stream is a terminal with colours, and its user wants them."""
    return stream.isatty() and "NO_COLOR" not in os.environ and os.environ.get("TERM", "dumb") != "dumb"


def paint(text: str, style: Style, stream: TextIO | None = None) -> str:
    """Return a text in the colour of a style; as it is where the stream (standard output) has none."""
    return f"\x1b[{CODES[style]}m{text}\x1b[0m" if has_colours(stream or sys.stdout) else text
