"""A command as data: its name, texts, options and function. The parser, its help, completion and the reference follow from it."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

Run = Callable[[argparse.Namespace], int]
"""What a command does; it returns the exit code."""
AddTo = Callable[[argparse.ArgumentParser], object]
"""Adds one or more options to the parser of a command."""
Option = Callable[[argparse._ActionsContainer], object]
"""Adds one option, to a group of them too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """A command, a verb of it, or a command with verbs."""

    name: str
    help: str
    epilog: str
    """Examples. With several lines, description and epilog are printed as they are."""
    description: str | None = None
    """None: the help as a sentence."""
    options: Sequence[AddTo] = ()
    run: Run | None = None
    """None: it has verbs."""
    verbs: Sequence["Command"] = ()
    modules: Sequence[str] = ()
    """Modules below `gateway.cli` that declare further verbs, in the order of the help; loaded with the parser alone."""
    part: str = "verb"
    """What its verbs are called."""

    def add_to(self, commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
        """Add the command to others."""
        parser = commands.add_parser(
            self.name,
            help=self.help,
            description=self.description or f"{self.help[0].upper()}{self.help[1:]}.",
            epilog=self.epilog,
            formatter_class=argparse.RawDescriptionHelpFormatter if "\n" in self.epilog else argparse.HelpFormatter,
        )
        for add in self.options:
            add(parser)
        if self.run is not None:
            parser.set_defaults(run=self.run)
            return
        verbs = parser.add_subparsers(dest=self.part, metavar=self.part.upper(), required=True)
        for verb in (*self.verbs, *(each for module in self.modules for each in declared(module).values())):
            verb.add_to(verbs)


def declared(module: str) -> dict[str, Command]:
    """Return the commands that a module below `gateway.cli` declares, by name, in order."""
    content = vars(import_module(f"gateway.cli.{module}")).values()
    return {each.name: each for each in content if isinstance(each, Command)}


def command(name: str, summary: str, description: str | None, epilog: str, *options: AddTo) -> Callable[[Run], Command]:
    """Return the decorator of the function that a command runs."""

    def declare(run: Run) -> Command:
        return Command(name=name, help=summary, epilog=epilog, description=description, options=options, run=run)

    return declare


def option(*names: str, **settings: Any) -> Option:
    """Return an argument or an option, with the settings of `argparse`."""
    return lambda parser: parser.add_argument(*names, **settings)


def one_of(*options: Option, required: bool = False) -> AddTo:
    """Return options of which at most one may be given."""

    def add(parser: argparse.ArgumentParser) -> None:
        group = parser.add_mutually_exclusive_group(required=required)
        for each in options:
            each(group)

    return add
