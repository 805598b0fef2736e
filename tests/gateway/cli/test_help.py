"""The help of every command: what it does in a sentence that stands alone, and an example."""

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.cli.main import join_axes, main, parser
from gateway.errors import BAD_INPUT
from tests.command_lines import command_words
from tests.waiting import PATIENCE_S


def commands(node: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    yield node
    for action in node._actions:
        if isinstance(action, argparse._SubParsersAction):
            for child in action.choices.values():
                yield from commands(child)


COMMANDS = {command.prog: command for command in commands(parser())}


@pytest.mark.parametrize("name", COMMANDS)
def test_help_begins_with_a_sentence_and_ends_with_an_example(name: str) -> None:
    description, epilog = COMMANDS[name].description or "", COMMANDS[name].epilog or ""
    assert description[:1].isupper(), name
    assert description.endswith("."), name
    assert epilog.startswith(("example: plumbline", "examples: plumbline", "examples:\n  plumbline")), name


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_every_example_is_a_command_that_is_understood(name: str) -> None:
    examples = re.split(r"\n| \| | && ", re.sub(r"^examples?:\s*", "", COMMANDS[name].epilog or ""))
    for program, *arguments in map(command_words, examples):
        assert program == "plumbline"
        parser().parse_args(arguments)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_is_in_the_imperative(name: str) -> None:
    assert not (COMMANDS[name].description or "").split()[0].endswith("s")


@pytest.mark.parametrize("name", COMMANDS)
def test_every_argument_is_explained(name: str) -> None:
    unexplained = [
        action.dest
        for action in COMMANDS[name]._actions
        if not isinstance(action, argparse._SubParsersAction) and not action.help
    ]
    assert unexplained == [], name


def test_the_gateway_starts_without_the_modules_of_other_commands() -> None:
    code = "import sys; from gateway.cli.main import main; sys.argv[1:] = ['run', '--help']; main()"
    loaded = subprocess.run([sys.executable, "-v", "-c", code], capture_output=True, text=True, check=True).stderr
    assert "import 'gateway.cli.machine.run'" in loaded
    assert "import 'gateway.cli.record'" not in loaded


def test_a_thread_that_outlives_a_command_does_not_hold_the_program() -> None:
    """A thread of the bus library can take an interpreter that ends with it, or keep it for ever."""
    code = (
        "import sys, threading; from gateway.cli.main import run_program; sys.argv[1:] = ['--version']; "
        "threading.Thread(target=threading.Event().wait).start(); run_program()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=PATIENCE_S)
    assert done.stdout.startswith("plumbline ")


def test_output_that_cannot_be_written_is_an_error() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "gateway", "config", "show"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )
    assert (done.returncode, done.stderr) == (BAD_INPUT, "plumbline config: No space left on device\n")


def test_an_error_of_usage_is_one_line_that_names_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["record"])
    assert ended.value.code == BAD_INPUT
    said = capsys.readouterr().err
    assert said == (
        "plumbline record: error: the following arguments are required: VERB; see plumbline record --help\n"
    )


@pytest.mark.parametrize(
    ("given", "parsed"),
    [
        (["measure", "--axes", "-y,x,z", "a.csv"], ["measure", "--axes=-y,x,z", "a.csv"]),
        (["measure", "--axes", "y,-x,z"], ["measure", "--axes", "y,-x,z"]),
        (["measure", "--axes", "--rig"], ["measure", "--axes", "--rig"]),
        (["measure", "a.csv", "--axes"], ["measure", "a.csv", "--axes"]),
    ],
)
def test_axes_may_begin_with_a_minus_sign(given: list[str], parsed: list[str]) -> None:
    assert join_axes(given) == parsed


def test_a_folder_that_cannot_be_made_is_told_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "file"
    file.write_text("")
    assert main(["keys", "init", "--site", "yard", "--folder", str(file / "keys")]) == BAD_INPUT
    assert capsys.readouterr().err == f"plumbline keys: {file}: File exists\n"
