"""Blunders with rests on faces and in poses."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gateway.cli.main import main
from tests.gateway.bench.blunders.session import Session
from tests.gateway.bench.planted import workshop
from tests.gateway.bench.planted.thermal import UP, Values
from tests.gateway.bench.planted.workshop import FACE_NAMES, RATE_HZ, rest, write_readings

Row = tuple[str, str, Callable[[Session], list[str]]]
Rests = dict[str, Values]


def in_unit(factor: float, unit: str, method: str = "six-position", *more: str) -> Callable[[Session], list[str]]:
    """Return a session whose readings are multiplied and stand under the name of another unit."""

    def make(session: Session) -> list[str]:
        rests = session.faces() if method == "six-position" else session.poses()
        return session.rests(
            {name: np.rint(raw * factor) if unit == "counts" else raw * factor for name, raw in rests.items()},
            method,
            unit,
            *more,
        )

    return make


def changed(
    change: Callable[[Session, Rests], Rests | None], method: str = "six-position"
) -> Callable[[Session], list[str]]:
    """Return a session whose rests a person changes."""

    def make(session: Session) -> list[str]:
        rests = session.faces() if method == "six-position" else session.poses()
        return session.rests(change(session, rests) or rests, method)

    return make


def laid_off(degrees: float, face: str = "py") -> Callable[[Session, Rests], None]:
    """Lay one face on dirt."""

    def change(session: Session, rests: Rests) -> None:
        up = UP[FACE_NAMES.index(face)]
        about = np.roll(np.abs(up), 1)
        lifted = up * np.cos(np.radians(degrees)) + np.cross(about, up) * np.sin(np.radians(degrees))
        rests[face] = rest(session.random, session.sensor, lifted)

    return change


def drop(*names: str) -> Callable[[Session, Rests], Rests]:
    return lambda _, rests: {name: raw for name, raw in rests.items() if name not in names}


def copy_face(source: str, to: str) -> Callable[[Session, Rests], None]:
    def change(_: Session, rests: Rests) -> None:
        rests[to] = rests[source]

    return change


def columns(order: tuple[int, int, int], signs: tuple[int, int, int], *names: str) -> Callable[[Session, Rests], None]:
    """Exchange or negate the columns of some files, of all without names."""

    def change(_: Session, rests: Rests) -> None:
        for name in names or tuple(rests):
            rests[name] = rests[name][:, list(order)] * signs

    return change


def knocked(session: Session, rests: Rests) -> None:
    """The housing slips by a degree in the middle of a rest."""
    up = UP[2]
    slipped = up + np.cross([np.radians(1.0), 0, 0], up)
    both = [rest(session.random, session.sensor, one, 2.5) for one in (up, slipped)]
    rests["py"] = np.vstack(both)


def shaken(amplitude_g: float) -> Callable[[Session, Rests], None]:
    """A truck passes, or a hand holds the housing, in every rest."""

    def change(session: Session, rests: Rests) -> None:
        for name, raw in rests.items():
            time_s = np.arange(len(raw)) / RATE_HZ
            hertz = session.random.uniform(3, 9, 3)
            rests[name] = raw + amplitude_g * np.sin(2 * np.pi * np.outer(time_s, hertz))

    return change


def other_part(*names: str) -> Callable[[Session, Rests], None]:
    """Some files are those of another part."""

    def change(session: Session, rests: Rests) -> None:
        other = session.other()
        for name in names:
            rests[name] = rest(session.random, other, UP[FACE_NAMES.index(name)])

    return change


def clipped(limit_g: float) -> Callable[[Session, Rests], None]:
    def change(_: Session, rests: Rests) -> None:
        for name, raw in rests.items():
            rests[name] = np.clip(raw, -limit_g, limit_g)

    return change


def dead_axis(_: Session, rests: Rests) -> None:
    for raw in rests.values():
        raw[:, 1] = 0.013


def slipped_magnet(session: Session, rests: Rests) -> None:
    """The housing turns by two degrees under its magnet before the last three faces."""
    turn = np.radians(2.0)
    for name in FACE_NAMES[3:]:
        up = UP[FACE_NAMES.index(name)]
        rests[name] = rest(session.random, session.sensor, up + np.cross([0, 0, turn], up) + np.cross([turn, 0, 0], up))


def short(_: Session, rests: Rests) -> Rests:
    return {name: raw[:20] for name, raw in rests.items()}


def with_parent(change: Callable[[Session], None], method: str = "six-position") -> Callable[[Session], list[str]]:
    """Return a session after a good one whose record is the parent."""

    def make(session: Session) -> list[str]:
        parent = session.folder / "parent.json"
        main([*session.rests(session.faces(), "six-position"), "--json", str(parent)])
        change(session)
        rests = session.faces() if method == "six-position" else session.poses()
        return session.rests(rests, method, "g", "--parent", str(parent))

    return make


def swap_part(session: Session) -> None:
    session.sensor = session.other()


def mirror(session: Session) -> None:
    session.sensor = replace(
        session.sensor,
        axes=np.diag([1, 1, -1]) @ session.sensor.axes,
        offset_g=session.sensor.offset_g + np.array([0, 0, 0.06]),
    )


def turn_in_housing(session: Session) -> None:
    angle = np.radians(4.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    session.sensor = replace(session.sensor, axes=session.sensor.axes @ turn)


def shocked(session: Session) -> None:
    session.sensor = replace(session.sensor, offset_g=session.sensor.offset_g + np.array([0.0, 0.035, 0.0]))


same_part_again = with_parent(lambda session: None)
norm_fit_after_six_positions = with_parent(lambda session: None, "norm-fit")


def other_device(session: Session) -> list[str]:
    arguments = same_part_again(session)
    place = arguments.index("--device-id")
    return [*arguments[: place + 1], "part-8", *arguments[place + 2 :]]


def clock(change: Callable[[Session, Values], Values]) -> Callable[[Session], list[str]]:
    """Return a session whose files have changed times."""

    def make(session: Session) -> list[str]:
        arguments = session.rests(session.faces(), "six-position")
        for name, raw in session.faces().items():
            times = change(session, np.arange(len(raw)) / RATE_HZ)
            write_readings(session.folder / f"{name}.csv", raw, time_s=times)
        return arguments

    return make


def decimal_comma(session: Session) -> list[str]:
    arguments = session.rests(session.faces(), "six-position")
    for name in FACE_NAMES:
        path = session.folder / f"{name}.csv"
        head, *rows = path.read_text().splitlines()
        path.write_text("\n".join([head, *(row.replace(".", ",") for row in rows)]) + "\n")
    return arguments


def in_one_plane(session: Session) -> list[str]:
    rests = {}
    for number, angle in enumerate(np.radians(np.arange(0, 360, 26))):
        rests[f"pose{number}"] = rest(session.random, session.sensor, np.array([np.cos(angle), np.sin(angle), 0.0]))
    return session.rests(rests, "norm-fit")


def one_other(change: Callable[[Session, Values], Values]) -> Callable[[Session, Rests], None]:
    """Change two poses of a norm fit."""

    def apply(session: Session, rests: Rests) -> None:
        for name in ("pose03", "pose10"):
            rests[name] = change(session, rests[name])

    return apply


def pose_of_other_part(session: Session, rests: Rests) -> None:
    other = workshop.draw_sensor(session.random)
    for name in ("pose03", "pose07", "pose10", "pose12"):
        up = np.linalg.solve(session.sensor.axes, rests[name].mean(axis=0) - session.sensor.offset_g)
        rests[name] = rest(session.random, other, up)


UNIT = r"gravity reads|unit"
OFF = r"stands .* off|lay worse|missing|moved"
ROWS: dict[str, list[Row]] = {
    "six-position": [
        ("m/s² under a header that says g", UNIT, in_unit(9.80665, "g")),
        ("mg under a header that says g", UNIT, in_unit(1000.0, "g")),
        ("volts under a header that says g", UNIT, in_unit(0.3, "g")),
        ("g under a header that says m/s²", UNIT, in_unit(1.0, "ms2")),
        (
            "half the nominal sensitivity",
            r"missing|sensitivity|units",
            in_unit(16384.0, "counts", "six-position", "--units-per-g", "8192"),
        ),
        ("a face forgotten", r"missing", changed(drop("nz"))),
        ("two faces forgotten", r"missing", changed(drop("nz", "px"))),
        ("one face recorded twice, its opposite never", r"missing", changed(copy_face("px", "nx"))),
        ("one face recorded twice, another never", r"missing", changed(copy_face("px", "py"))),
        (
            "one recording under all six names",
            r"missing",
            changed(lambda _, rests: dict.fromkeys(FACE_NAMES, rests["pz"])),
        ),
        ("a face on dirt, 1.5°", OFF, changed(laid_off(1.5))),
        ("a face on dirt, 3°", OFF, changed(laid_off(3.0))),
        ("a face on its edge, 8°", OFF, changed(laid_off(8.0, "nz"))),
        ("columns x and y exchanged in one file", r"missing|stands", changed(columns((1, 0, 2), (1, 1, 1), "px"))),
        ("a column negated in one file", r"missing|stands", changed(columns((0, 1, 2), (-1, 1, 1), "px"))),
        ("the housing knocked by 1° in a rest", r"rests are used|stands", changed(knocked)),
        ("a machine runs, 60 mg", r"missing|no new pose|rest", changed(shaken(0.06))),
        ("files of two parts mixed", r"stands|lay worse", changed(other_part("nx", "ny"))),
        ("the range set to 1 g: readings clip", r"clip|stands|lay worse|non-linear", changed(clipped(0.9))),
        ("an axis dead", r"missing|dead|sensitivity", changed(dead_axis)),
        ("the housing slipped under its magnet, 2°", r"stands|lay worse", changed(slipped_magnet)),
        ("rests of 0.4 s", r"missing|too short", changed(short)),
        ("milliseconds under time_s", r"missing|no new pose|rate|clock|time", clock(lambda _, time_s: 1000 * time_s)),
        ("times that run backwards", r"time|missing|backward", clock(lambda _, time_s: time_s[::-1].copy())),
        (
            "times in random order",
            r"time|missing|backward",
            clock(lambda session, time_s: session.random.permutation(time_s)),
        ),
        ("one time for all rows", r"time|missing", clock(lambda _, time_s: 0 * time_s)),
        ("decimal commas", r"column|cells|number|missing|line", decimal_comma),
        ("the wrong part", r"offset . has moved|scale . has changed|turned|moved by", with_parent(swap_part)),
        ("z negated since the record before", r"moved|turned|changed", with_parent(mirror)),
        ("the sensor turned in its housing, 4°", r"turned", with_parent(turn_in_housing)),
        ("the sensor fell: 35 mg", r"offset . has moved", with_parent(shocked)),
        ("the record of another part as parent", r"belongs to", other_device),
    ],
    "norm-fit": [
        ("m/s² under a header that says g", UNIT, in_unit(9.80665, "g", "norm-fit")),
        ("mg under a header that says g", UNIT, in_unit(1000.0, "g", "norm-fit")),
        ("eight poses", r"poses for 9 unknowns", changed(drop(*(f"pose{n:02d}" for n in range(8, 14))), "norm-fit")),
        ("all poses in one plane", r"determine|condition|unknown|poses", in_one_plane),
        (
            "two poses in m/s²",
            r"scatter|no new pose found",
            changed(one_other(lambda _, raw: raw * 9.80665), "norm-fit"),
        ),
        ("two poses pulled by a hand, 20 mg", r"scatter", changed(one_other(lambda _, raw: raw * 1.02), "norm-fit")),
        (
            "two poses with x and y exchanged",
            r"scatter|too near|unused",
            changed(one_other(lambda _, raw: raw[:, [1, 0, 2]]), "norm-fit"),
        ),
        ("four poses of another part", r"scatter", changed(pose_of_other_part, "norm-fit")),
        ("a machine runs, 60 mg", r"poses for 9 unknowns|rest", changed(shaken(0.06), "norm-fit")),
        (
            "the range set to 1 g: readings clip",
            r"scatter|clip|converge|sensitivity",
            changed(clipped(0.9), "norm-fit"),
        ),
        ("an axis dead", r"determine|poses|converge|scatter|axis", changed(dead_axis, "norm-fit")),
        ("the wrong part", r"has moved|has changed|turned", with_parent(swap_part, "norm-fit")),
        ("the sensor fell: 35 mg", r"offset . has moved", with_parent(shocked, "norm-fit")),
    ],
}
