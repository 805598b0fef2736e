"""Examples of the documentation: blocks `sh` of commands alone, and blocks `console` of commands with what they print.

In a block `console` a command stands behind `$ `, and what it prints below it. There `...` stands for any text of a line, and a
line of `...` alone for any lines: times, paths and measured numbers that differ from run to run. All else is compared.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from textwrap import dedent

ROOT = Path(__file__).parents[2]
GENERATED = "docs/reference/commands.md"
"""Its examples are those of the help; their form is tested in `tests/gateway/cli/test_help.py`."""
_BLOCK = re.compile(r"^( *)```(sh|console)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
_PROMPT = "$ "


@dataclass(frozen=True)
class Command:
    """A command of a page, over several lines where a line goes on or contains its input, and what is shown below it."""

    place: str
    """Page and line."""
    text: str
    shown: str | None = None


def pages() -> list[Path]:
    """Return the pages that people read: those of the documentation and of the root."""
    return [path for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")] if path != ROOT / GENERATED]


def sections(page: Path) -> dict[str, list[Command]]:
    """Return the commands in the blocks of each section of a page."""
    text = page.read_text()
    found: dict[str, list[Command]] = {}
    for block in _BLOCK.finditer(text):
        before = text[: block.start(3)]
        heading = re.findall(r"^#+ (.+)$", re.sub(r"^```.*?^```", "", before, flags=re.M | re.S), re.M)[-1]
        lines = dedent(block[3]).splitlines()
        read = _with_output if block[2] == "console" else _alone
        found.setdefault(heading, []).extend(read(lines, f"{page.relative_to(ROOT)}:{before.count(chr(10)) + 1}"))
    return found


def _alone(lines: list[str], place: str) -> Iterator[Command]:
    while lines:
        text, lines = _first_command(lines)
        yield Command(place, text)


def _with_output(lines: list[str], place: str) -> Iterator[Command]:
    while lines:
        assert lines[0].startswith(_PROMPT), place
        text, rest = _first_command([lines[0].removeprefix(_PROMPT), *lines[1:]])
        shown = list(takewhile(lambda line: not line.startswith(_PROMPT), rest))
        yield Command(place, text, "\n".join(shown))
        lines = rest[len(shown) :]


def _first_command(lines: list[str]) -> tuple[str, list[str]]:
    """Return the command that the first line begins, and the lines after it."""
    count = 1
    while lines[count - 1].endswith("\\"):
        count += 1
    if here := re.search(r"<<'(\w+)'", lines[0]):
        count = lines.index(here[1]) + 1
    return "\n".join(lines[:count]), lines[count:]


def is_as_shown(shown: str, printed: str) -> bool:
    """Is this what the page shows, but for its placeholders?"""
    pattern = "".join(
        r"(?:.*\n)*" if line == "..." else r"[^\n]*".join(map(re.escape, line.split("..."))) + r" *\n"
        for line in shown.splitlines()
    )
    return re.fullmatch(pattern, printed.rstrip("\n") + "\n" if printed else "") is not None
