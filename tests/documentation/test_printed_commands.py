"""Every command that the documentation prints is typed as a reader would, and prints what is shown below it."""

import re
import shlex
from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

import pytest

from gateway.cli.main import parser
from tests.command_lines import command_words
from tests.documentation.examples import ROOT, Command, is_as_shown, pages, sections
from tests.documentation.not_run import BY_BEGINNING, BY_SECTION, ELSEWHERE, parts_to_run
from tests.documentation.reader import Reader
from tests.documentation.worlds import WORLDS, World, world_of

PLUMBLINE = re.compile(r"(?:sudo )?(?:-u \w+ )?plumbline (?=\w)")
PATHS_OF_THE_CHECKOUT = ("config/", "deploy/", "docs/", "script/", "tests/")


def printed() -> list[tuple[str, Path, str, Command]]:
    """Return each command that is printed in a block, with its page and section."""
    return [
        (f"{page.relative_to(ROOT)}#{section}", page, section, command)
        for page in sorted(pages())
        for section, commands in sections(page).items()
        for command in commands
    ]


def readings() -> dict[str, tuple[World, list[Command]]]:
    """Return what is typed one after the other: what a page prints between two changes of what exists."""
    found: dict[str, tuple[World, list[Command]]] = {}
    for (page, world), group in groupby(printed(), key=lambda each: (each[1], world_of(each[1], each[2]))):
        several = list(group)
        typed = [
            Command(command.place, part, command.shown)
            for name, _, _, command in several
            for part in parts_to_run(command, name)
        ]
        if typed:
            found[f"{page.relative_to(ROOT)}#{several[0][2]}"] = world, typed
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", readings())
def test_commands_do_what_the_page_says(name: str, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    world, commands = readings()[name]
    reader = Reader(tmp_path, tmp_path_factory.getbasetemp() / "pages")
    with reader.stack:
        world(reader)
        for command in commands:
            reader.type(command)


def test_what_is_not_run_is_listed_for_a_command_that_is_printed() -> None:
    names = {name for name, *_ in printed()}
    assert set(BY_SECTION) - names == set()
    beginnings = {each for each in BY_BEGINNING for *_, command in printed() if each in command.text}
    assert set(BY_BEGINNING) - beginnings == set()
    places = names | {name.partition("#")[0] for name in names}
    assert set(WORLDS) - places == set()


def test_what_is_run_elsewhere_is_printed_there_in_the_same_words() -> None:
    def typed(commands: Iterable[Command]) -> set[str]:
        return {command.text.partition(" #")[0].strip() for command in commands}

    for page, beginnings in ELSEWHERE.items():
        shown = typed(command for name, *_, command in printed() if name.startswith(f"{page}#"))
        for beginning, place in beginnings.items():
            here = {text for text in shown if text.startswith(beginning)}
            run = typed(
                each for name, (_, several) in readings().items() if name.startswith(f"{place}#") for each in several
            )
            assert here, beginning
            assert here <= run


def test_what_is_not_run_names_files_that_exist() -> None:
    for *_, command in printed():
        named = [word for word in command.text.split() if word.startswith(PATHS_OF_THE_CHECKOUT)]
        assert [name for name in named if not (ROOT / name).exists()] == [], command


@pytest.mark.slow
def test_every_command_in_a_text_is_understood(capsys: pytest.CaptureFixture[str]) -> None:
    """Those between backquotes, which may leave out what they are given, and those in blocks that are not run."""
    refused, whole = [], parser()
    for page in pages():
        quoted = re.findall(r"`([^`\n]+)`", re.sub(r"^ *```.*?^ *```", "", page.read_text(), flags=re.M | re.S))
        blocks = [command.text.replace("\\\n", " ") for commands in sections(page).values() for command in commands]
        for part in (part for text in [*quoted, *blocks] for part in text.split(" && ") if PLUMBLINE.match(part)):
            words = command_words(PLUMBLINE.sub("plumbline ", part, count=1))
            try:
                whole.parse_args(words[1:])
            except SystemExit as ended:
                said = capsys.readouterr().err
                cut_short = part in quoted and "the following arguments are required" in said
                if ended.code and not cut_short and not {"...", "COMMAND"} & set(words):
                    refused.append(f"{page.relative_to(ROOT)}: {said}")
    assert refused == []


def test_commands_stand_in_fenced_blocks() -> None:
    """A command in an indented block would be neither marked for a reader nor run."""
    for page in pages():
        text = re.sub(r"^ *```.*?^ *```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
        assert re.findall(r"^ {4,}(?:sudo|plumbline|\.venv/bin/\w+|script/\w+) .*$", text, re.MULTILINE) == [], page


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("angle 3.1", "angle 3.1\n", True),
        ("angle 3.1", "angle 3.2\n", False),
        ("angle ... deg", "angle 3.2 deg\n", True),
        ("angle ... deg", "angle 3.2 deg\nmore\n", False),
        ("...\nend", "one\ntwo\nend\n", True),
        ("...\nend", "end\n", True),
        ("...\nend", "one\ntwo\n", False),
        ("a.b", "axb\n", False),
    ],
)
def test_placeholders_stand_for_a_part_of_a_line_or_for_lines(shown: str, printed: str, same: bool) -> None:
    assert is_as_shown(shown, printed) is same


def test_a_command_goes_on_over_lines_and_has_its_input(tmp_path: Path) -> None:
    page = ROOT / "docs" / "guides" / "investigator" / "twin.md"
    first = sections(page)["Try it"][0]
    assert first.text.startswith("cat > rig.toml <<'END'\n[rope]")
    assert shlex.split(first.text.splitlines()[-1]) == ["END"]
