"""Blunders with turns on a rig, laser pairs and girder ends."""

from collections.abc import Callable

import numpy as np

from tests.gateway.bench.blunders.faces import UNIT, Row
from tests.gateway.bench.blunders.session import Session
from tests.gateway.bench.planted import workshop
from tests.gateway.bench.planted.thermal import Values

Table = tuple[Values, Values]


def turned(change: Callable[[int, Values, Values], Table]) -> Callable[[Session], list[str]]:
    return lambda session: session.turns(change)


def angles(change: Callable[[Values], Values]) -> Callable[[Session], list[str]]:
    return turned(lambda _, angle_deg, raw: (change(angle_deg), raw))


def half_turn(_: int, angle_deg: Values, raw: Values) -> Table:
    return angle_deg[:19], raw[:19]


def mistyped(_: int, angle_deg: Values, raw: Values) -> Table:
    wrong = angle_deg.copy()
    wrong[7] += 4.0
    return wrong, raw


def exchanged(_: int, angle_deg: Values, raw: Values) -> Table:
    return angle_deg, raw[:, [1, 2, 0]] if _ else raw[:, [2, 1, 0]]


def shuffled(_: int, angle_deg: Values, raw: Values) -> Table:
    return np.roll(angle_deg, 9), raw


def same_turn_twice(session: Session) -> list[str]:
    command = session.turns()
    return [*command[:3], command[2], *command[4:]]


def same_axis_twice(session: Session) -> list[str]:
    files = [
        str(session.turn_file(name, *workshop.turn(session.random, session.sensor, 1))) for name in ("first", "second")
    ]
    return ["calibrate", "rotation", *files, "--device-id", "part-7"]


def two_parts(session: Session) -> list[str]:
    command = session.turns()
    session.turn_file("x", *workshop.turn(session.random, session.other(), 0))
    return command


def missing_cell(session: Session) -> list[str]:
    command = session.turns()
    path = session.folder / "about_x.csv"
    path.write_text(path.read_text().replace("\n30,", "\n30,,", 1))
    return command


def both(factors: tuple[float, float]) -> Callable[[Session], list[str]]:
    """Return pairs whose displacements and angles are multiplied."""
    return lambda session: session.pairs(lambda rows: rows * factors)


def stated(factor: float) -> Callable[[Session], list[str]]:
    return lambda session: session.pairs(distance_factor=factor)


def zero_forgotten(rows: Values) -> Values:
    return np.asarray(rows + np.array([0.0, 0.6]))


def one_mixed_up(rows: Values) -> Values:
    mixed = rows.copy()
    mixed[[1, 2], 1] = mixed[[2, 1], 1]
    return mixed


def slipped_end(name: str, time_s: Values, raw: Values) -> Values:
    moved = raw.copy()
    if name == "right":
        moved[time_s > 20, 0] += np.sin(np.radians(2.0))
    return moved


def too_far(rows: Values) -> Values:
    return rows * 2.2


ROWS: dict[str, list[Row]] = {
    "rotation": [
        ("m/s² under a header that says g", UNIT, lambda session: session.turns(lambda _, a, raw: (a, raw * 9.80665))),
        ("mg under a header that says g", UNIT, lambda session: session.turns(lambda _, a, raw: (a, raw * 1000))),
        ("radians under angle_deg", r"full circle|no reading", angles(np.radians)),
        ("gon under angle_deg", r"phase|residual|stays|angle|turn", angles(lambda angle_deg: angle_deg / 0.9)),
        ("the angle counted the other way", r"phase|negate", angles(lambda angle_deg: -angle_deg)),
        ("zero of the angle a quarter turn off", r"phase|shift", angles(lambda angle_deg: angle_deg + 90)),
        ("angles one stop late, 90°", r"phase|shift", turned(shuffled)),
        ("half a turn", r"full circle|no reading", turned(half_turn)),
        ("one angle mistyped by 4°", r"residual|stands|off its curve|differs|angle", turned(mistyped)),
        ("one turn given twice", r"turns about|different axes", same_turn_twice),
        ("two turns about one axis", r"turns about|different axes", same_axis_twice),
        ("turns of two parts", r"differs|off the horizontal", two_parts),
        ("the rig 4° off level", r"level|horizontal", lambda session: session.turns(level_deg=4.0)),
        ("columns exchanged in the files", r"phase|stays|turns about", turned(exchanged)),
        ("a cell left empty", r"line \d+", missing_cell),
        ("stops at every 40° only", r"different angles", lambda session: session.turns(step_deg=40.0)),
    ],
    "single-parameter": [
        ("displacements in cm", r"which no sensor errs by", both((0.1, 1.0))),
        ("displacements in m", r"which no sensor errs by", both((0.001, 1.0))),
        ("displacements in µm", r"beyond|no sensor", both((1000.0, 1.0))),
        ("angles in radians", r"which no sensor errs by", both((1.0, np.pi / 180))),
        ("angles in minutes of arc", r"which no sensor errs by", both((1.0, 60.0))),
        ("twice the angle, as by a mirror", r"which no sensor errs by", both((1.0, 2.0))),
        ("the distance 15 % short", r"measure the distance twice", stated(0.85)),
        ("the distance 15 % long", r"measure the distance twice", stated(1.15)),
        ("the distance in cm", r"beyond|no sensor", stated(0.1)),
        ("the distance in inches", r"beyond|no sensor", stated(1 / 25.4)),
        ("the sign of one column", r"one sign", both((-1.0, 1.0))),
        ("columns exchanged", r"beyond|no sensor", lambda session: session.pairs(lambda rows: rows[:, ::-1])),
        ("angles not counted from the zero", r"scatter|one sign", lambda session: session.pairs(zero_forgotten)),
        ("two angles in the wrong rows", r"scatter|no sensor", lambda session: session.pairs(one_mixed_up)),
        ("tilts of 9°", r"beyond", lambda session: session.pairs(too_far)),
    ],
    "girder": [
        ("the right axis the wrong way round", r"opposite senses", lambda s: s.girder((1, 1.0), (1, 1.0))),
        ("the left axis the wrong way round", r"opposite senses", lambda s: s.girder((-1, 1.0), (-1, 1.0))),
        ("both recordings exchanged", r"rises|upwards|exchanged", lambda s: s.girder((-1, 1.0), (1, 1.0))),
        ("the zero taken under load", r"rises|upwards|under load", lambda s: s.girder((1, -1.0), (-1, -1.0))),
        (
            "an axis across the girder stated",
            r"off mid-span|opposite",
            lambda s: s.girder((1, 1.0), (-1, 1.0), "--left-axis", "+y"),
        ),
        (
            "a sensor slipped by 2° when the load came",
            r"off mid-span|opposite|slipped",
            lambda s: s.girder(change=slipped_end),
        ),
        ("recordings of different times", r"share", lambda s: s.girder(late_s=100.0)),
        (
            "wheels outside the supports",
            r"load-offset",
            lambda s: s.girder((1, 1.0), (-1, 1.0), "--load-offset-m", "6"),
        ),
    ],
}
