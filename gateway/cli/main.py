"""`plumbline`: finds the command, and turns bad input into one line and an exit code."""

import argparse
import os
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from typing import Never

from devices.errors import DeviceError
from gateway import __version__
from gateway.cli.terminal.output import paint
from gateway.errors import BAD_INPUT, PlumblineError, printable

AXES_FROM_MINUS = re.compile(r"-[xyz],.+")
"""A value of --axes that `argparse` takes for an option."""


class Parser(argparse.ArgumentParser):
    """A parser that says what is wrong before all else."""

    def error(self, message: str) -> Never:
        """Print the error alone: several lines of usage would hide it."""
        self.exit(BAD_INPUT, f"{self.prog}: error: {message}; see {self.prog} --help\n")


@dataclass(frozen=True, slots=True)
class CommandGroup:
    """A command that has verbs: its texts, and the modules that add the verbs, in the order of the help.

    Without modules, the one that has the command's name adds all of them.
    """

    help: str
    example: str
    modules: tuple[str, ...] = ()
    description: str | None = None
    """None: the help as a sentence."""
    part: str = "verb"

    def add_to(self, name: str, commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
        """Add the command with its verbs."""
        sentence = f"{self.help[0].upper()}{self.help[1:]}."
        command = commands.add_parser(
            name, help=self.help, description=self.description or sentence, epilog=f"example: plumbline {self.example}"
        )
        verbs = command.add_subparsers(dest=self.part, metavar=self.part.upper(), required=True)
        for module in self.modules:
            import_module(f"gateway.cli.{name}.{module}").add_to(verbs)
        if not self.modules:
            import_module(f"gateway.cli.{name}").add_to(verbs)


COMMANDS: dict[str, str | CommandGroup] = {
    "run": "machine",
    "measure": "analysis",
    "calibrate": CommandGroup(
        "calibrate or align a sensor from recordings",
        "calibrate six-position faces.csv --device-id adxl355-1d-0042 --json record.json",
        (
            "calibrate_poses",
            "calibrate_rotation",
            "calibrate_single_parameter",
            "calibrate_laser",
            "calibrate_thermal",
            "calibrate_align",
        ),
        "Calibrate or align a sensor from recordings, by one of several methods; most of them make a calibration record.",
        "method",
    ),
    "record": CommandGroup(
        "show what is in recordings, and recover incomplete ones",
        "record info plumbline-data",
        (
            "record_info",
            "record_verify",
            "record_recover",
            "record_export",
            "record_replay",
            "record_play",
            "record_incident",
        ),
    ),
    "remote": CommandGroup(
        "read and control a gateway over the bus: its state, its messages, its recalibration",
        "remote watch --topics swing,alert",
        ("remote_status", "remote_watch", "remote_session", "remote_align", "remote_fetch", "remote_config"),
    ),
    "fleet": CommandGroup(
        "many sensors and gateways: their state, which to calibrate next, what several measure together",
        "fleet status --expect gateways.txt",
        ("fleet_status", "fleet_servers", "fleet_router", "fleet_drift", "fleet_deflection"),
    ),
    "bridge": CommandGroup(
        "give the values of a gateway to a plant by its own protocols",
        "bridge mqtt --gateway plumbline/v1/yard/crane-1/hook --settings bridge.toml",
        part="protocol",
    ),
    "archive": CommandGroup(
        "many gateways' recordings of years: index them into open tables, ask questions, upload, compute",
        "archive index /srv/recordings --into /srv/archive",
        ("archive_index", "archive_query", "archive_report", "archive_upload", "archive_compute", "archive_delete"),
    ),
    "simulate": "analysis",
    "reconcile": "analysis",
    "effects": "analysis",
    "config": "machine",
    "setup": "machine",
    "doctor": "machine",
    "completion": "machine",
    "keys": "machine",
}
"""The commands in the order of the help; of one without verbs, the folder of the module with its name."""


def parser(only: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of the whole command line, or of one command `only`, so that no other is imported.

    Commands import what they need when they run, so that help is quick.
    """
    top: argparse.ArgumentParser = Parser(
        prog="plumbline",
        description="Measure how far the load of a crane swings, and whether the reading can be trusted.",
        epilog="example: plumbline run    (a simulated crane, no configuration needed)",
    )
    top.add_argument("--version", action="version", version=f"plumbline {__version__}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, place in COMMANDS.items() if only is None else [(only, COMMANDS[only])]:
        if isinstance(place, CommandGroup):
            place.add_to(name, commands)
        else:
            import_module(f"gateway.cli.{place}.{name}").add_to(commands)
    return top


def join_axes(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with `--axes -y,x,z` as one."""
    values = {
        i for i, (name, value) in enumerate(pairwise(arguments)) if name == "--axes" and AXES_FROM_MINUS.match(value)
    }
    joined = [f"{one}={arguments[i + 1]}" if i in values else one for i, one in enumerate(arguments)]
    return [one for i, one in enumerate(joined) if i - 1 not in values]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return 0: done, 1: the answer is no, 2: wrong usage or input, 3: done with losses."""
    # Before the library of linear algebra is loaded: its threads double the cost of small matrices.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    given = join_axes(sys.argv[1:] if arguments is None else arguments)
    chosen = parser(given[0] if given and given[0] in COMMANDS else None).parse_args(given)
    try:
        code: int = chosen.run(chosen)
    except (PlumblineError, DeviceError) as error:
        code = error.exit_code if isinstance(error, PlumblineError) else BAD_INPUT
        return _refuse(chosen.command, str(error), code)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of the output has ended
        return BAD_INPUT
    except OSError as error:
        return _refuse(chosen.command, f"{error.filename}: {error.strerror}" if error.filename else str(error))
    except KeyboardInterrupt:
        return 130
    return code


def _refuse(command: str, why: str, code: int = BAD_INPUT) -> int:
    print(paint(f"plumbline {command}:", "bad", sys.stderr), printable(why), file=sys.stderr)
    return code
