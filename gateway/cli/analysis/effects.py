"""`plumbline effects`: the vocabulary of physical causes that the twin can simulate and name."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command import command, option

if TYPE_CHECKING:
    from gateway.twin.effects import Effect, Parameter


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


@command(
    "effects",
    "list the effects that simulation and reconciliation know",
    "List the effects, or describe one: equation, parameters, and how to separate it from others.",
    "examples: plumbline effects | plumbline effects wind_gust",
    option("name", nargs="?", metavar="NAME", help="describe this effect"),
    add_effects_from,
)
def run_effects(arguments: argparse.Namespace) -> int:
    """Print the list, or one description."""
    from gateway.extras import require_extra

    require_extra("twin")
    from gateway.errors import InputError
    from gateway.twin.effects import EFFECTS

    load_user_effects(arguments)
    if arguments.name is None:
        width = max(map(len, EFFECTS))
        print("\n".join(f"{name:<{width}}  {effect.explains}" for name, effect in EFFECTS.items()))
        return 0
    if arguments.name not in EFFECTS:
        raise InputError(f"{arguments.name!r} is no effect; known are {', '.join(sorted(EFFECTS))}")
    print("\n".join(_describe(EFFECTS[arguments.name])))
    return 0


def _describe(effect: "Effect") -> Iterator[str]:
    yield f"{effect.name}: {effect.explains}"
    yield f"equation     {effect.equation}"
    yield f"acts on      {effect.enters}{' for a limited time' if effect.transient else ''}"
    yield f"source       {effect.reference}"
    yield f"to separate  {effect.discriminating_experiment}"
    yield "parameters"
    for parameter in effect.parameters:
        yield f"  {_describe_parameter(parameter)}"


def _describe_parameter(p: "Parameter") -> str:
    components = f" [{', '.join(p.components)}]" if p.components else ""
    typical = ",".join(f"{each:g}" for each in p.typical) if isinstance(p.typical, tuple) else f"{p.typical:g}"
    unit = "" if p.unit == "1" else f" {p.unit}"
    return f"{p.name}{components}: {p.meaning}; {p.lower:g} to {p.upper:g}{unit}, typical {typical}"


def load_user_effects(arguments: argparse.Namespace) -> None:
    """Add the effects of installed packages and of the given files to the vocabulary. Raises `InputError`."""
    from gateway.twin.effect_loading import load_effect_file, load_installed_effects

    load_installed_effects()
    for path in arguments.effects_from:
        load_effect_file(path)
