"""`plumbline completion`: commands, options and files after a press of the Tab key."""

import argparse

from gateway.cli.command import command, option

SHELLS = ("bash", "zsh", "tcsh")
EXAMPLE = """examples:
  plumbline completion bash > ~/.local/share/bash-completion/completions/plumbline
  plumbline completion zsh > ~/.zfunc/_plumbline      (with fpath+=~/.zfunc before compinit in ~/.zshrc)
  plumbline completion tcsh >> ~/.tcshrc"""


@command(
    "completion",
    "print the completion of commands and options for a shell",
    "Print the completion of commands, options and files for a shell.",
    EXAMPLE,
    option("shell", choices=SHELLS, metavar="SHELL", help=", ".join(SHELLS)),
)
def run_completion(arguments: argparse.Namespace) -> int:
    """Print the completion."""
    import shtab

    from gateway.cli.main import parser

    top = parser()
    _complete_files(top, shtab.FILE)
    print(shtab.complete(top, arguments.shell))
    return 0


def _complete_files(parser: argparse.ArgumentParser, files: object) -> None:
    """Let every argument that is a path be completed with files."""
    from pathlib import Path

    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for verb in action.choices.values():
                _complete_files(verb, files)
        elif action.type is Path:
            action.complete = files  # type: ignore[attr-defined]
