"""`plumbline setup`: from questions, or a file of answers, to a checked configuration and a sensor that delivers samples."""

import argparse
import os
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command import command, option

if TYPE_CHECKING:
    from gateway.configuration.model import Configuration

NOT_DONE = 1


@command(
    "setup",
    "make the configuration of this machine by questions, and try the sensor",
    "Ask for sensor, housing, rope, limits and names, write a checked configuration, and try the sensor. "
    "Exit code 0: written, and the sensor delivers samples; 1: not written, or the sensor does not.",
    "examples: plumbline setup | plumbline setup --out crane.toml | plumbline setup --from answers.toml --replace",
    option(
        "--from",
        dest="answers",
        type=Path,
        metavar="FILE",
        help="ask nothing: take the answers from a TOML file with the keys of the configuration",
    ),
    option("--out", type=Path, metavar="FILE", help="configuration to write (default: that of the service)"),
    option(
        "--replace", action="store_true", help="replace an existing configuration; the former one is kept beside it"
    ),
    option("--no-check", action="store_true", help="do not try the sensor"),
)
def run_setup(arguments: argparse.Namespace) -> int:
    """Ask, write and check."""
    from gateway.cli.machine.setup_dialogue import ask_all, confirm
    from gateway.configuration.loading import SETTINGS, Answers, load_text, read_table, require_sensor
    from gateway.errors import InputError

    path = arguments.out or SETTINGS
    replace, asking = arguments.replace, arguments.answers is None
    question = f"{path} exists. Replace it? The former one is kept beside it."
    if path.exists() and not replace and not (asking and confirm(question, default=False)):
        raise InputError(f"{path} exists and stays; --replace replaces it, and keeps the former one beside it")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{path.parent}: cannot be written; as root for the service, or name another place with --out")
    answers = Answers() if asking else Answers(read_table(arguments.answers))
    if asking:
        ask_all(answers)
    where = str(path if asking else arguments.answers)
    configuration = answers.complete(where)
    require_sensor(configuration, where)
    text = f"# Written by plumbline setup; plumbline config show {path} prints all keys.\n\n{answers.to_toml()}"
    load_text(text, where)  # the very text that is written
    if asking:
        print(f"\n{text}")
        if not confirm(f"Write this to {path}?", default=True):
            print("nothing was written")
            return NOT_DONE
    _write(path, text)
    return 0 if arguments.no_check else _check(path, configuration)


def _write(path: Path, text: str) -> None:
    """Write a configuration in one step; the former one is kept beside it. Raises `InputError`."""
    from gateway.cli.output import write_text

    if path.exists():
        kept = path.with_name(f"{path.name}.until-{datetime.now(UTC):%Y%m%dT%H%M%SZ}")
        write_text(kept, path.read_text(encoding="utf-8"))
        print(f"the former configuration is kept: {kept}")
    write_text(path, text)
    print(f"{path}: written")


def _check(path: Path, configuration: "Configuration") -> int:
    """Try the sensor: samples arrive, and which face is up."""
    from gateway.cli.machine.doctor import print_result
    from gateway.configuration.loading import SETTINGS, load, load_installed
    from gateway.daemon.doctor.checks import examine_sensor

    configuration = load_installed() if path == SETTINGS else load(path)
    print("Trying the sensor; it must rest ...")
    good = True
    for result in examine_sensor(configuration):
        print_result(result)
        good &= result.grade != "bad"
    start = "sudo systemctl restart plumbline" if path == SETTINGS else f"plumbline run --config {path}"
    print(
        f"next: {start}, then plumbline doctor"
        if good
        else f"correct this, then: plumbline doctor --device --config {path}"
    )
    sys.stdout.flush()
    return 0 if good else NOT_DONE
