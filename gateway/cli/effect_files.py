"""The option `--effects-from`, and the effects of installed packages."""

import argparse
from pathlib import Path


def add_effects_from(command: argparse.ArgumentParser) -> None:
    """Add the option to a command."""
    command.add_argument(
        "--effects-from",
        action="append",
        default=[],
        type=Path,
        metavar="FILE.py",
        help="add effects of your own; the file is executed; several times for several files",
    )


def load_user_effects(arguments: argparse.Namespace) -> None:
    """Add the effects of installed packages and of the given files to the vocabulary. Raises `InputError`."""
    from gateway.twin.effect_loading import load_effect_file, load_installed_effects

    load_installed_effects()
    for path in arguments.effects_from:
        load_effect_file(path)
