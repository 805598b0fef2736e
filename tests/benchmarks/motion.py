"""Accuracy of the motion filter while the crane works, against formulas, a complementary filter and a bound.

`script/bench motion --recordings FOLDER...` reads recordings instead of making them, `--write PAGE` replaces the tables of a
page, `--figure FILE.svg` draws the worst recording.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.motion.motion_tracker import MotionTracker
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from tests.benchmarks import motion_plot
from tests.benchmarks.motion_baselines import (
    EQUATIONS,
    LEAKS_IN_PERIODS,
    complementary_angle,
    formula_angles,
    largest_of_last_period,
)
from tests.benchmarks.motion_bound import bound_rad
from tests.benchmarks.motion_recordings import MANOEUVRES, MOUNT_U_RAD, Mask, WorkRecording, generate, read

BLOCK = 5
"""Samples between two estimates: 0.1 s."""
DRIVES = (1, 3)
"""Places in `MANOEUVRES` of those that the bound is for; a hoist's course would have to be known."""


@dataclass(frozen=True, slots=True)
class Rows:
    """One row per estimate after the first period; angles in deg, NaN where not known."""

    recording: NDArray[np.intp]
    rho: Array
    noise_g: Array
    manoeuvre: NDArray[np.intp]
    error: Array
    u: Array
    bound: Array
    largest_error: Array
    """Of the largest angle of the last period."""
    formula_errors: Array
    """The same of the four formulas, shape (rows, 4)."""
    complementary_errors: Array
    """Of the angle by the complementary filter with each leak, shape (rows, leaks)."""

    @property
    def moving(self) -> Mask:
        return self.manoeuvre > 0


@dataclass(frozen=True, slots=True)
class Followed:
    """What the filter stated of one recording."""

    recording: WorkRecording
    time_s: Array
    angle_deg: Array
    u_deg: Array
    largest_deg: Array
    states: Sequence[str]


def main(arguments: Sequence[str] = ()) -> None:
    """Print the tables; write them into a page and draw the worst recording where wanted."""
    parser = argparse.ArgumentParser(prog="script/bench motion", description=__doc__)
    parser.add_argument("--recordings", type=Path, nargs="+", default=[], help="folders with log.csv and truth.csv")
    parser.add_argument("--kind", default="plain", help="of the recordings that are made")
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--write", type=Path, metavar="PAGE", help="replace the tables of this page")
    parser.add_argument("--figure", type=Path, metavar="SVG", help="draw the worst recording into this file")
    chosen = parser.parse_args(arguments)
    recordings = [read(folder) for folder in chosen.recordings] or generate(chosen.kind, chosen.seed, chosen.count)
    followed = [follow(recording) for recording in recordings]
    rows = judge(followed)
    tables = {
        "rho": by_condition("rho", rows, rows.rho, "{:g}"),
        "noise": by_condition("noise, mg", rows, 1e3 * rows.noise_g, "{:g}"),
        "manoeuvre": by_manoeuvre(rows),
        "baselines": by_baseline(rows),
        "bound": by_bound(rows),
        "worst": worst_line(followed, rows),
    }
    for name, table in tables.items():
        print(f"motion, {name}\n{table}\n")
    if chosen.write is not None:
        chosen.write.write_text(replace_tables(chosen.write.read_text(), tables))
    if chosen.figure is not None:
        worst = followed[worst_recording(rows)]
        drawing = motion_plot.svg(worst.recording, worst.time_s, worst.angle_deg, worst.u_deg, worst.states)
        chosen.figure.write_text(drawing)


def follow(recording: WorkRecording) -> Followed:
    """Return what a live filter states at every tenth of a second, without knowledge of the noise."""
    tracker = MotionTracker(recording.rig, mount_u_rad=MOUNT_U_RAD)
    rows, states = [], []
    for begin in range(0, len(recording.time_s), BLOCK):
        time_s = recording.time_s[begin : begin + BLOCK]
        tracker.update(time_s, recording.force_g[begin : begin + BLOCK])
        e = tracker.estimate(float(time_s[-1]))
        largest_rad = None if e.last_peak is None else e.last_peak.angle_rad
        rows.append((e.time_s, e.angle_rad, e.u_rad, largest_rad))
        states.append(e.state)
    time, angle, u, largest = np.array(rows, dtype=np.float64).T
    return Followed(recording, time, np.degrees(angle), np.degrees(u), np.degrees(largest), states)


def judge(followed: Sequence[Followed]) -> Rows:
    """Return all estimates after the first period with their errors."""
    parts = [list(_judged(place, each)) for place, each in enumerate(followed)]
    return Rows(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _judged(place: int, followed: Followed) -> Iterator[NDArray[np.float64] | NDArray[np.intp]]:
    """Yield the columns of `Rows` for one recording."""
    recording = followed.recording
    counted = followed.time_s > recording.period_s
    time_s = followed.time_s[counted]
    true_deg, true_largest_deg = recording.true("angle_deg", time_s), largest_of_last_period(recording, time_s)
    bound_s, bound = bound_rad(recording)
    leaks_s = [share * recording.period_s for share in LEAKS_IN_PERIODS]
    complementary = [np.degrees(complementary_angle(recording, leak_s, time_s)) - true_deg for leak_s in leaks_s]
    yield np.full(len(time_s), place)
    yield np.full(len(time_s), recording.rho)
    yield np.full(len(time_s), recording.noise_g)
    yield recording.manoeuvre(time_s)
    yield followed.angle_deg[counted] - true_deg
    yield followed.u_deg[counted]
    yield np.degrees(np.interp(time_s, bound_s, bound))
    yield followed.largest_deg[counted] - true_largest_deg
    yield np.degrees(formula_angles(recording, time_s)) - true_largest_deg[:, None]
    yield np.column_stack(complementary)


def by_condition(name: str, rows: Rows, values: Array, form: str) -> str:
    """Return a table with a row for each value of a condition."""
    header = (name, "recordings", "known", "rms moving", "rms free", "inside 95 %", "half width")
    body = [_condition_row(form.format(value), rows, values == value) for value in np.unique(values)]
    return table(header, [*body, _condition_row("all", rows, np.ones(len(values), dtype=bool))])


def _condition_row(name: str, rows: Rows, at: Mask) -> tuple[str, ...]:
    moving, free = rms(rows.error[at & rows.moving]), rms(rows.error[at & ~rows.moving])
    return (name, str(len(np.unique(rows.recording[at]))), known(rows, at), moving, free, *interval(rows, at))


def by_manoeuvre(rows: Rows) -> str:
    """Return a table with a row for each manoeuvre."""
    header = ("manoeuvre", "share of the time", "known", "rms", "inside 95 %", "half width")
    body = []
    for place, name in enumerate(MANOEUVRES):
        at = rows.manoeuvre == place
        if at.any():
            body.append((name, percent(at.mean()), known(rows, at), rms(rows.error[at]), *interval(rows, at)))
    return table(header, body)


def by_baseline(rows: Rows) -> str:
    """Return a table of rms errors: filter and complementary filter by the angle, filter and formulas by the largest one."""
    best = int(np.argmin(np.sqrt(np.mean(rows.complementary_errors**2, axis=0))))
    header = ("manoeuvre", "angle: filter", "complementary", "largest angle: filter", *EQUATIONS)
    body = []
    for place, name in enumerate([*MANOEUVRES, "all"]):
        at = rows.manoeuvre == place if name != "all" else np.ones(len(rows.rho), dtype=bool)
        if at.any():
            angle = (rms(rows.error[at]), rms(rows.complementary_errors[at, best]))
            body.append((name, *angle, rms(rows.largest_error[at]), *map(rms, rows.formula_errors[at].T)))
    return table(header, body) + f"\n\nBest leak of the complementary filter: {LEAKS_IN_PERIODS[best]:g} periods."


def by_bound(rows: Rows) -> str:
    """Return a table of the error in drives without a hoist over the bound."""
    body = []
    for value in [*np.unique(rows.rho), None]:
        at = (rows.manoeuvre == 1) & ~np.isnan(rows.error)
        if value is not None:
            at &= rows.rho == value
        if at.any():
            filtered, least = (float(np.sqrt(np.mean(each[at] ** 2))) for each in (rows.error, rows.bound))
            name = "all" if value is None else f"{value:g}"
            body.append((name, f"{least:.3f}", f"{filtered:.3f}", f"{filtered / least:.1f}"))
    return table(("rho", "bound", "rms of the filter", "ratio"), body)


def worst_recording(rows: Rows) -> int:
    """Return the place of the recording with the largest rms error."""
    errors = [np.sqrt(np.nanmean(rows.error[rows.recording == place] ** 2)) for place in np.unique(rows.recording)]
    return int(np.argmax(errors))


def worst_line(followed: Sequence[Followed], rows: Rows) -> str:
    """Return a sentence about the worst recording."""
    place = worst_recording(rows)
    at, recording = rows.recording == place, followed[place].recording
    largest = np.nanmax(np.abs(rows.error[at]))
    return (
        f"The worst recording ({recording.name}: rho {recording.rho:g}, noise {1e3 * recording.noise_g:g} mg) has an rms error\n"
        f"of {rms(rows.error[at])}° and a largest error of {largest:.2f}°; {interval(rows, at)[0]} of its intervals hold."
    )


def replace_tables(page: str, tables: dict[str, str], benchmark: str = "motion") -> str:
    """Return the page with each table between its two comments. Raises `ValueError` where the page has no such place."""
    for name, content in tables.items():
        begin, end = f"<!-- script/bench {benchmark}: {name} -->", "<!-- end -->"
        before, found, rest = page.partition(begin)
        if not found:
            raise ValueError(f"the page has no place for the table {name}: {begin} ... {end}")
        page = f"{before}{begin}\n\n{content}\n\n{end}{rest.partition(end)[2]}"
    return page


def table(header: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [header, ["---"] * len(header), *body]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def known(rows: Rows, at: Mask) -> str:
    """Return the share of estimates with an angle."""
    return percent(np.mean(~np.isnan(rows.error[at])))


def interval(rows: Rows, at: Mask) -> tuple[str, str]:
    """Return the share of 95 % intervals that hold the truth, and their median half width."""
    half = NORMAL_975 * rows.u[at]
    error, answered = rows.error[at], ~np.isnan(half)
    if not answered.any():
        return "none", "none"
    return percent(np.mean(np.abs(error[answered]) < half[answered])), f"{np.median(half[answered]):.3f}"


def rms(errors: Array) -> str:
    """Return the rms of what there is, and the share of what there is not where it is over 1 %."""
    if np.isnan(errors).all():
        return "none"
    missing = float(np.mean(np.isnan(errors)))
    without = f" ({percent(missing)} none)" if missing > 0.01 else ""
    return f"{np.sqrt(np.nanmean(errors**2)):.3f}{without}"


def percent(share: float | np.floating) -> str:
    return f"{100 * float(share):.1f} %"
