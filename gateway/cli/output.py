"""Output of commands: files written completely or not at all, JSON, colours, and a status line in a terminal.

Colours are used where a terminal has some (https://no-color.org); the status line is overwritten in place.
"""

import argparse
import json
import os
import shutil
import sys
from pathlib import Path
from typing import Literal, TextIO

from gateway.atomic_io import replace_file
from gateway.cli.command import option
from gateway.errors import InputError, printable

STANDARD_OUTPUT = Path("-")
"""The value of `--json` for the standard output."""
Style = Literal["good", "note", "warning", "bad"]
CODES: dict[Style, str] = {"good": "32", "note": "36", "warning": "33", "bad": "1;31"}
MAX_LINE_CHARACTERS = 118
"""Characters of a line. Basis: a choice; a terminal of 120 columns less the ends."""


def output_file(text: str) -> Path:
    """Parse the name of a file to write, `-` for the standard output; what cannot be written is refused before the work."""
    path = Path(text)
    fault = "" if text == "-" else _fault_of_output(path)
    if fault:
        raise argparse.ArgumentTypeError(f"{text}: cannot be written ({fault}); choose another place")
    return path


def _fault_of_output(path: Path) -> str:
    if path.is_dir():
        return "it is a directory"
    if not path.parent.is_dir():
        return f"there is no directory {path.parent}"
    return "" if os.access(path.parent, os.W_OK) else f"no permission in {path.parent}"


JSON_OPTION = option(
    "--json", type=output_file, metavar="FILE", help="also write the result as JSON; -: print it instead of the text"
)
"""The option `--json`; `show` obeys it."""


def show(text: str, content: object, json_path: Path | None) -> None:
    """Print a result as text, and write it as JSON too where a path is given; `-`: print it as JSON in place of the text.

    Raises `InputError` where the file cannot be written.
    """
    if json_path is not None:
        encoded = json.dumps(content, indent=1, allow_nan=False) + "\n"
        if json_path == STANDARD_OUTPUT:
            print(encoded, end="")
            return
        write_text(json_path, encoded)
    print("\n".join(map(printable, text.split("\n"))))  # a file may contain what steers a terminal


def write_text(path: Path, text: str) -> None:
    """Write a text file in one step. Raises `InputError` where it cannot be written."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file in one step. Raises `InputError` where it cannot be written."""
    try:
        with replace_file(path) as descriptor, os.fdopen(descriptor, "wb", closefd=False) as file:
            file.write(content)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); choose another place") from error


def has_colours(stream: TextIO) -> bool:
    """Return whether a stream is a terminal with colours, and its user wants them."""
    return stream.isatty() and "NO_COLOR" not in os.environ and os.environ.get("TERM", "dumb") != "dumb"


def paint(text: str, style: Style, stream: TextIO | None = None) -> str:
    """Return a text in the colour of a style; as it is where the stream (standard output) has none."""
    return f"\x1b[{CODES[style]}m{text}\x1b[0m" if has_colours(stream or sys.stdout) else text


class StatusLine:
    """One line of text, never longer than the terminal, because a wrapped line cannot be overwritten."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._key = ""
        self.is_terminal = out.isatty()

    def update(self, text: str, key: str) -> None:
        """Show a text now; outside a terminal only if its key differs from that of the last text."""
        text = printable(text)
        if self.is_terminal:
            self._out.write(f"\r\x1b[K{text[: min(MAX_LINE_CHARACTERS, self._columns() - 1)]}")
            self._out.flush()
        elif key != self._key:
            self._key = key
            self.commit(text)

    def commit(self, text: str) -> None:
        """Write a line that is not overwritten."""
        text = printable(text)
        self._out.write(f"\r\x1b[K{text}\n" if self.is_terminal else f"{text}\n")
        self._out.flush()

    def _columns(self) -> int:
        """Return the present width of the terminal."""
        try:
            return os.get_terminal_size(self._out.fileno()).columns or MAX_LINE_CHARACTERS + 1
        except OSError:  # not a terminal
            return shutil.get_terminal_size((MAX_LINE_CHARACTERS + 1, 24)).columns
