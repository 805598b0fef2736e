"""Blunders and good sessions, run through the command line in this process: what is refused or flagged.

A blunder is what a person does wrong, with which method, and the suspicion that the command must state.
"""

import io
import re
import tempfile
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gateway.bench.single_parameter_output import NOT_MEASURED
from gateway.cli.main import main
from tests.gateway.bench.blunders import angles, faces, photographs, temperature
from tests.gateway.bench.blunders.session import Session
from tests.gateway.bench.planted.workshop import draw_sensor

SOUND: dict[str, Callable[[Session], list[str]]] = {
    "six-position": lambda session: session.rests(session.faces(), "six-position"),
    "norm-fit": lambda session: session.rests(session.poses(), "norm-fit"),
    "rotation": lambda session: session.turns(),
    "single-parameter": lambda session: session.pairs(),
    "thermal": lambda session: session.ramps(),
    "girder": lambda session: session.girder(),
    "laser": photographs.sound,
    "norm-fit after six-position": faces.norm_fit_after_six_positions,
    "six-position after six-position": faces.same_part_again,
}
"""Good sessions, which are to be neither refused nor flagged."""
FLAGS = re.compile(r"\s*(warning:|needs a reason:|not acceptable:|note: .*(rests are used|no new pose found))")


@dataclass(frozen=True, slots=True)
class Blunder:
    """One row."""

    method: str
    text: str
    suspicion: str
    """Pattern that the refusal or the warning matches."""
    make: Callable[[Session], list[str]]
    """Writes the files and returns the arguments of the command."""


BLUNDERS = tuple(
    Blunder(method, *row)
    for module in (faces, angles, temperature, photographs)
    for method, rows in module.ROWS.items()
    for row in rows
)


@dataclass(frozen=True, slots=True)
class Answer:
    """What a command said."""

    code: int
    """Exit code."""
    said: str
    """Refusal, or lines that flag."""
    line: str
    """The last line of all, for the report."""

    @property
    def is_objection(self) -> bool:
        """Whether the command refused or flagged."""
        return self.code != 0 or bool(self.said)

    def names(self, suspicion: str) -> bool:
        """Return whether it refused or flagged in one clear message with this suspicion."""
        return self.is_objection and re.search(suspicion, self.said, re.IGNORECASE) is not None


def run(make: Callable[[Session], list[str]], seed: int, label: str) -> Answer:
    """Return the answer to a session drawn from a seed."""
    random = np.random.default_rng([seed, *label.encode()])
    out, err = io.StringIO(), io.StringIO()
    with tempfile.TemporaryDirectory() as folder:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            command = make(Session(random, Path(folder), draw_sensor(random)))
        try:
            with redirect_stdout(out), redirect_stderr(err):
                code = main(command)
        except SystemExit as exit_:
            code = int(exit_.code or 0)
    flags = [line for line in out.getvalue().splitlines() if FLAGS.match(line) and NOT_MEASURED not in line]
    said = "\n".join([out.getvalue() if code else "", *flags, err.getvalue()]).strip()
    lines = (said or out.getvalue()).strip().splitlines()
    return Answer(code, said, lines[-1] if lines else "")
