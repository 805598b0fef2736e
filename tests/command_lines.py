"""Command lines as help and documents show them, and commands that are run in this process."""

import re
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from gateway.cli.main import main
from gateway.errors import BAD_INPUT

REMARK = r"\s+#\s|\s{3,}\("
SHELL = r" \|\|? | && | >{1,2} "


def command_words(line: str) -> list[str]:
    """The words of a command, without a remark behind it, and without what the shell does after it or with its output."""
    return shlex.split(re.split(f"{REMARK}|{SHELL}", line.strip())[0])


def run_here(
    words: Sequence[str], environment: Mapping[str, str | None] | None = None, folder: Path | None = None
) -> "subprocess.CompletedProcess[str]":
    """Run a command of `plumbline` in this process: to start another takes longer than most of them."""
    out, err = StringIO(), StringIO()
    with pytest.MonkeyPatch.context() as patched, redirect_stdout(out), redirect_stderr(err):
        if folder is not None:
            patched.chdir(folder)
        for name, value in (environment or {}).items():
            patched.delenv(name, raising=False) if value is None else patched.setenv(name, value)
        try:
            code = main(words)
        except SystemExit as end:  # of the argument parser, which has printed why
            code = end.code if isinstance(end.code, int) else BAD_INPUT
    return subprocess.CompletedProcess(list(words), code, out.getvalue(), err.getvalue())
