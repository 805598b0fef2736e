"""`plumbline`: finds the command, and turns bad input into one line and an exit code."""

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module

from devices.errors import DeviceError
from gateway import __version__
from gateway.cli.colour import paint
from gateway.errors import PlumblineError
from gateway.text import printable

COMMANDS = (
    "run",
    "measure",
    "calibrate",
    "record",
    "remote",
    "fleet",
    "simulate",
    "reconcile",
    "effects",
    "config",
    "setup",
    "doctor",
    "completion",
    "keys",
)
BAD_INPUT = 2


def parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line. Commands import what they need when they run, so that help is quick."""
    top = argparse.ArgumentParser(
        prog="plumbline",
        description="Measure how far the load of a crane swings, and whether the reading can be trusted.",
        epilog="example: plumbline run    (a simulated crane, no configuration needed)",
    )
    top.add_argument("--version", action="version", version=f"plumbline {__version__}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        import_module(f"gateway.cli.{name}").add_to(commands)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return 0: done, 1: the answer is no, 2: wrong usage or input, 3: done with losses."""
    chosen = parser().parse_args(arguments)
    try:
        code: int = chosen.run(chosen)
    except (PlumblineError, DeviceError) as error:
        print(paint(f"plumbline {chosen.command}:", "bad", sys.stderr), printable(str(error)), file=sys.stderr)
        return error.exit_code if isinstance(error, PlumblineError) else BAD_INPUT
    except BrokenPipeError:
        sys.stderr.close()  # the reader of the output has ended
        return BAD_INPUT
    except KeyboardInterrupt:
        return 130
    return code
