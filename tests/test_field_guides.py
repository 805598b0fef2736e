"""The guides for the field: every command in them is one that the program takes, every message one that it prints."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.cli.main import parser

ROOT = Path(__file__).parents[1]
GUIDES = ("installation", "README", "recovery")
FOLDER = ROOT / "docs" / "guides" / "service"
PARTS = ("gateway", "devices")


def _commands(text: str) -> Iterator[str]:
    """Yield the commands of `plumbline` in code blocks and between backquotes."""
    code = re.findall(r"^    (.+)$", text, re.MULTILINE) + re.findall(r"`([^`]+)`", text)
    for line in code:
        for part in re.split(r"&&|;|\|", line):
            words = part.split("#")[0].strip().removeprefix("sudo ")
            if words.startswith("plumbline "):
                yield re.sub(r" > \S+", "", words)


@pytest.mark.slow
@pytest.mark.parametrize("name", GUIDES)
def test_every_command_is_accepted(name: str) -> None:
    commands = list(_commands((FOLDER / f"{name}.md").read_text()))
    assert len(commands) > 4
    for command in commands:
        arguments = shlex.split(command)[1:]
        if not any(word.isupper() for word in arguments if word not in ("ID", "FILE", "NAME")):
            arguments += ["--by", "ann"] if arguments[:2] == ["remote", "config"] and "--by" not in arguments else []
            try:
                parser().parse_args(arguments)
            except SystemExit as refused:
                pytest.fail(f"{command}: exit code {refused.code}")


def test_every_message_of_the_recovery_table_is_one_of_the_program() -> None:
    text = (FOLDER / "recovery.md").read_text()
    code = "\n".join(path.read_text() for part in PARTS for path in sorted((ROOT / part).rglob("*.py")))
    messages = [
        message
        for row in re.findall(r"^\| (.+?) \| .+ \| .+ \|$", text, re.MULTILINE)
        for message in re.findall(r"`([^`]+)`", row)
        if message != "install.sh"
    ]
    assert len(messages) > 5
    assert [message for message in messages if message not in code] == []


def test_every_file_that_the_guides_name_is_installed() -> None:
    script = (ROOT / "script" / "deb").read_text()
    for name in GUIDES:
        named = re.findall(r"/opt/plumbline/current/(deploy/[\w./-]+)", (FOLDER / f"{name}.md").read_text())
        assert [path for path in named if not (ROOT / path).exists()] == []
    assert "for part in config deploy" in script
