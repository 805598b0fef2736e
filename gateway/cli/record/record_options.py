"""The options that the verbs of `plumbline record` share: which recordings, which interval, which time zone, JSON."""

import argparse
from pathlib import Path

from gateway.cli.options.recording_interval import add_interval, add_local


def add_paths(verb: argparse.ArgumentParser) -> None:
    """Add the recordings, as `paths`."""
    verb.add_argument(
        "paths", type=Path, nargs="+", metavar="PATH", help=".mcap files written by the gateway, and folders of them"
    )


def add_selection(verb: argparse.ArgumentParser) -> None:
    """Add the recordings and the interval of them; `gateway.cli.options.recording_interval.interval` returns it."""
    add_paths(verb)
    add_interval(verb)
    add_local(verb)


def add_json(verb: argparse.ArgumentParser) -> None:
    """Add the option `--json`; `gateway.cli.terminal.output.show` obeys it."""
    verb.add_argument(
        "--json", type=Path, metavar="FILE", help="also write the result as JSON; -: print it in place of the text"
    )
