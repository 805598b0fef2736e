"""`plumbline`: finds the command, and turns bad input into one line and an exit code."""

import argparse
import os
import re
import sys
import traceback
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Never, NoReturn

from devices.errors import DeviceError
from gateway import __version__
from gateway.cli.command import Command, declared
from gateway.cli.output import paint
from gateway.errors import ANSWER_IS_NO, BAD_INPUT, PlumblineError, printable

AXES_FROM_MINUS = re.compile(r"-[xyz],.+")
"""A value of --axes that `argparse` takes for an option."""


class Parser(argparse.ArgumentParser):
    """A parser that says what is wrong before all else."""

    def error(self, message: str) -> Never:
        """Print the error alone: several lines of usage would hide it."""
        self.exit(BAD_INPUT, f"{self.prog}: error: {message}; see {self.prog} --help\n")


COMMANDS: dict[str, str | Command] = {
    "run": "machine.run",
    "measure": "measure",
    "calibrate": Command(
        name="calibrate",
        help="calibrate or align a sensor from recordings",
        epilog="example: plumbline calibrate six-position faces.csv --device-id adxl355-1d-0042 --json record.json",
        modules=(
            "calibrate.calibrate_poses",
            "calibrate.calibrate_single_parameter",
            "calibrate.calibrate_thermal",
            "calibrate.calibrate_installed",
            "calibrate.calibrate_propose",
            "calibrate.calibrate_align",
        ),
        description="Calibrate or align a sensor from recordings, by one of several methods; most of them make "
        "a calibration record.",
        part="method",
    ),
    "record": Command(
        name="record",
        help="show what is in recordings, and recover incomplete ones",
        epilog="example: plumbline record info plumbline-data",
        modules=(
            "record.record_info",
            "record.record_verify",
            "record.record_export",
            "record.record_replay",
            "record.record_incident",
        ),
    ),
    "remote": Command(
        name="remote",
        help="read and control a gateway over the bus: its state, its messages, its recalibration",
        epilog="example: plumbline remote watch --topics swing,alert",
        modules=(
            "remote.remote_status",
            "remote.remote_watch",
            "remote.remote_session",
            "remote.remote_align",
            "remote.remote_fetch",
            "remote.remote_config",
        ),
    ),
    "fleet": Command(
        name="fleet",
        help="many sensors and gateways: their state, which to calibrate next, what several measure together",
        epilog="example: plumbline fleet status --expect gateways.txt",
        modules=(
            "fleet.fleet_status",
            "fleet.fleet_servers",
            "fleet.fleet_router",
            "fleet.fleet_drift",
            "fleet.fleet_deflection",
        ),
    ),
    "bridge": Command(
        name="bridge",
        help="give the values of a gateway to a plant by its own protocols",
        epilog="example: plumbline bridge mqtt --gateway plumbline/v1/yard/crane-1/hook --settings bridge.toml",
        modules=("bridge",),
        part="protocol",
    ),
    "archive": Command(
        name="archive",
        help="many gateways' recordings of years: index them into open tables, ask questions, upload, compute",
        epilog="example: plumbline archive index /srv/recordings --into /srv/archive",
        modules=(
            "archive.archive_index",
            "archive.archive_report",
            "archive.archive_upload",
            "archive.archive_compute",
            "archive.archive_delete",
        ),
    ),
    "simulate": "simulate",
    "reconcile": "reconcile",
    "effects": "simulate",
    "config": Command(
        name="config",
        help="show, check or describe the configuration",
        epilog="examples: plumbline config show > my.toml | plumbline config check my.toml | plumbline config schema",
        modules=("machine.config",),
        description="Show, check or describe the configuration of the gateway.",
    ),
    "setup": "machine.setup",
    "doctor": "machine.doctor",
    "completion": "machine.completion",
    "keys": Command(
        name="keys",
        help="make, list, renew and revoke the certificates of a site",
        epilog="example: plumbline keys init --site yard && plumbline keys issue service ann",
        modules=("machine.keys",),
        description="Make, list, renew and revoke the certificates of a site (docs/guides/service/security.md). Keep the folder "
        "on a machine of your own, not on a gateway: who has it can command every gateway of the site.",
    ),
}
"""The commands in the order of the help. Of one without verbs, the module below `gateway.cli` that declares it."""


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
    for name in COMMANDS if only is None else [only]:
        place = COMMANDS[name]
        command = place if isinstance(place, Command) else declared(place)[name]
        command.add_to(commands)
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
        if sys.stdout is not None:
            sys.stdout.flush()
    except (PlumblineError, DeviceError) as error:
        code = error.exit_code if isinstance(error, PlumblineError) else BAD_INPUT
        return _refuse(chosen.command, str(error), code)
    except BrokenPipeError:  # the reader of the output has ended
        return BAD_INPUT
    except OSError as error:
        return _refuse(
            chosen.command, f"{error.filename}: {error.strerror}" if error.filename else error.strerror or str(error)
        )
    except KeyboardInterrupt:
        return 130
    return code


def run_program() -> NoReturn:
    """Run the command of this process, and end it as it stands.

    Threads of the bus library outlive its session, and an interpreter that ends under them hangs or aborts.
    """
    code = ANSWER_IS_NO  # what an error that nobody expected ends with
    try:
        code = main()
    except SystemExit as end:  # of the argument parser, which has printed why
        code = end.code if isinstance(end.code, int) else BAD_INPUT
    finally:
        if sys.exception() is not None:
            traceback.print_exc()
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, AttributeError):  # the reader has ended, or there was none
                stream.flush()
        os._exit(code)


def _refuse(command: str, why: str, code: int = BAD_INPUT) -> int:
    print(paint(f"plumbline {command}:", "bad", sys.stderr), printable(why), file=sys.stderr)
    return code
