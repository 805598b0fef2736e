"""Blunders with temperature ramps."""

from collections.abc import Callable

import numpy as np

from tests.gateway.bench.blunders.faces import UNIT, Row
from tests.gateway.bench.blunders.session import Session
from tests.gateway.bench.planted.thermal import Values

Ramp = tuple[Values, Values]


def every(change: Callable[[int, Values, Values], Ramp], unit: str = "g") -> Callable[[Session], list[str]]:
    return lambda session: session.ramps(change, unit)


def one(change: Callable[[Values, Values], Ramp], face: int = 2) -> Callable[[Session], list[str]]:
    return every(lambda number, raw, known_c: change(raw, known_c) if number == face else (raw, known_c))


def slipped(raw: Values, known_c: Values) -> Ramp:
    moved = raw.copy()
    moved[len(raw) // 2 :] += [np.sin(np.radians(3.0)), 0.0, 0.0]
    return moved, known_c


def same_file_twice(session: Session) -> list[str]:
    command = session.ramps()
    return [*command[:7], command[6], *command[8:]]


def one_file_missing(session: Session) -> list[str]:
    command = session.ramps()
    return [*command[:4], *command[5:]]


ROWS: dict[str, list[Row]] = {
    "thermal": [
        ("m/s² under a header that says g", UNIT, every(lambda _, raw, known_c: (raw * 9.80665, known_c))),
        ("no temperatures", r"has no temperature", lambda session: session.ramps(temperature=False)),
        (
            "a thermometer that stands still",
            r"temperature changes by",
            every(lambda _, raw, known_c: (raw, known_c * 0 + 21)),
        ),
        ("a face forgotten", r"no ramp with", one_file_missing),
        ("one ramp given twice, another never", r"no ramp with", same_file_twice),
        ("one ramp in °F", r"ramps disagree|share no range", one(lambda raw, known_c: (raw, known_c * 1.8 + 32))),
        ("the sensor slipped by 3° in a ramp", r"was moved", one(slipped)),
        (
            "a ramp of which half was lost: 5 °C",
            r"temperature changes by|range",
            one(lambda raw, known_c: (raw[:240], known_c[:240] * 0.1 + 20), 4),
        ),
        (
            "the housing between two faces",
            r"lies on no face",
            one(lambda raw, known_c: (raw @ np.array([[0.7, 0.7, 0], [-0.7, 0.7, 0], [0, 0, 1]]), known_c)),
        ),
    ],
}
