"""The table of blunders: what a person does wrong, with which method, and the suspicion that the command must state."""

from collections.abc import Callable
from dataclasses import dataclass

from tests.gateway.bench.blunders import angles, faces, photographs, temperature
from tests.gateway.bench.blunders.session import Session


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
