"""Accuracy of the motion on cranes as they are, by kind, and what an alert costs: exceedances announced, trips without cause.

`script/bench real_cranes` makes recordings with `tests.working_crane.real`; `--recordings FOLDER...` reads folders with
`log.csv`, `truth.csv`, `gateway.toml` and `case.json`; `--write PAGE` replaces the tables of a page.
"""

import argparse
import csv
import json
import math
import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.configuration.model import Configuration
from gateway.motion.estimate import MotionEstimate
from gateway.motion.motion_monitor import MotionMonitor
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from gateway.stages.alerts import DECISION_FACTOR, Limits, RuleState, decision_factor, judge
from gateway.swing.rig import MountedHousing
from tests.benchmarks import motion_plot
from tests.benchmarks.motion import replace_tables, table
from tests.benchmarks.motion_baselines import LEAKS_IN_PERIODS, complementary
from tests.benchmarks.motion_bound import Instruments, bound_rad
from tests.benchmarks.motion_recordings import WorkRecording
from tests.working_crane.real.kinds import KINDS
from tests.working_crane.real.recording import make
from tests.working_crane.real.write import write_recording

BLOCK_S = 0.1
FACTORS = (0.0, DECISION_FACTOR, 1.0, NORMAL_975)
"""At the present angle."""
TRIPS_DEG = (3.0, 4.5, 6.0, 10.0)
QUIET_PERIODS = 2.0
"""An exceedance counts after so long below the limit; a trip is without cause where nothing near it came within this time."""
NEAR_LIMIT = 0.8
POSITION_U_M = 0.05
SPREADER, MOVING_BASE = "d", "i"
"""Kinds: a housing on a spreader or on one of its ropes reads something else than the bound assumes; on a moving base the pivot
never rests."""
APART = 0.4
"""Distance of a second housing, over the rope's length."""
TRUE_COLUMNS = ("time_s", "angle_deg", "azimuth_deg", "length_m", "driven", "hoisting", "gust")


@dataclass(frozen=True, slots=True)
class Case:
    """A recording with its truth and what the gateway was told."""

    name: str
    kind: str
    time_s: Array
    force_g: Array
    truth: dict[str, Array]
    rho: float
    noise_g: float
    rig: MountedHousing
    mount_u_rad: float
    period_s: float
    true_length_m: float

    @property
    def true_time_s(self) -> Array:
        """Times of the truth."""
        return self.truth["time_s"]

    @property
    def true_deg(self) -> Array:
        """The rope's true angle."""
        return self.truth["angle_deg"]

    @property
    def is_busy(self) -> Array:
        """1 where trolley, bridge, winch or a gust acts."""
        busy: Array = np.maximum(np.maximum(self.truth["driven"], self.truth["hoisting"]), self.truth["gust"])
        return busy

    def complementary_deg(self, leak_periods: float) -> Array:
        """Return the angle at the truth's times by a complementary filter that is told the true length at the beginning."""
        above_m = self.rig.above_load_m
        if above_m is None:
            above_m = self.true_length_m - (self.rig.position_m or 0.0)
        leak_s = leak_periods * self.period_s
        angle_rad = complementary(self.time_s, self.force_g, above_m, self.true_length_m, leak_s, self.true_time_s)
        return np.degrees(angle_rad)


@dataclass(frozen=True, slots=True)
class Followed:
    """What the gateway stated of a case after the first period; angles in deg, NaN where not known."""

    case: Case
    time_s: Array
    error: Array
    u: Array
    is_busy: Array
    estimates: Sequence[MotionEstimate]

    @property
    def holds(self) -> NDArray[np.bool_]:
        known = np.isfinite(self.u)
        held: NDArray[np.bool_] = np.abs(self.error[known]) <= NORMAL_975 * self.u[known]
        return held

    def longest_wrong_s(self) -> float:
        """Longest time in which the angle is wrong by more than three of its own uncertainties."""
        longest = run = 0.0
        steps = np.diff(self.time_s, prepend=self.time_s[0])
        for wrong, step_s in zip(np.abs(self.error) > 3 * self.u, steps, strict=True):
            run = run + step_s if wrong else 0.0
            longest = max(longest, run)
        return longest


def read_case(folder: Path) -> Case:
    """Return the case of a folder."""
    with (folder / "log.csv").open() as file:
        rows = [[float(cell) if cell else math.nan for cell in row[:4]] for row in list(csv.reader(file))[1:]]
    log = np.array(rows)
    log = log[np.isfinite(log).all(axis=1)]
    with (folder / "truth.csv").open() as file:
        truth = list(csv.DictReader(file))
    info = json.loads((folder / "case.json").read_text())
    stated = Configuration.model_validate(tomllib.loads((folder / "gateway.toml").read_text()))
    above_m, position_m = stated.housing.above_load_m, stated.housing.position_m
    gravity_m_s2 = stated.site.local_gravity_m_s2
    rig = MountedHousing(
        length_m=max(stated.rope.length_m, 1.02 * (above_m or 0.0)),
        position_m=position_m,
        above_load_m=above_m,
        position_u_m=POSITION_U_M,
        gravity_m_s2=gravity_m_s2,
    )
    return Case(
        name=folder.name,
        kind=str(info["kind"]),
        time_s=log[:, 0],
        force_g=log[:, 1:],
        truth={name: np.array([float(row[name]) for row in truth]) for name in TRUE_COLUMNS},
        rho=float(info["rho"]),
        noise_g=float(info["noise_g"]),
        rig=rig,
        mount_u_rad=math.radians(stated.housing.mount_u_deg),
        period_s=2 * math.pi * math.sqrt(info["length_m"] / gravity_m_s2),
        true_length_m=float(info["length_m"]),
    )


def follow(case: Case) -> Followed:
    """Return what a live gateway states at every tenth of a second."""
    monitor = MotionMonitor(case.rig, mount_u_rad=case.mount_u_rad)
    block = max(1, round(BLOCK_S / float(np.median(np.diff(case.time_s)))))
    estimates = []
    for begin in range(0, len(case.time_s), block):
        part = slice(begin, begin + block)
        monitor.update(case.time_s[part], case.force_g[part])
        estimates.append(monitor.estimate(float(case.time_s[part][-1])))
    counted = [one for one in estimates if one.time_s > case.period_s]
    time_s = np.array([one.time_s for one in counted])
    angle = np.degrees([math.nan if one.angle_rad is None else one.angle_rad for one in counted])
    u = np.degrees([math.nan if one.u_rad is None else one.u_rad for one in counted])
    error = angle - np.interp(time_s, case.true_time_s, case.true_deg)
    is_busy = np.interp(time_s, case.true_time_s, case.is_busy) > 0.5
    return Followed(case, time_s, error, u, is_busy, counted)


def alert_cost(followed: Followed, trip_deg: float, factor: float) -> tuple[int, int, list[float], float]:
    """Return exceedances, those announced, their lead times in s, and the share of the time of trips without cause."""
    case, limits = followed.case, _limits(trip_deg)
    state, levels = RuleState("unknown", 0.0), []
    for one in followed.estimates:
        state = judge(state, _value_rad(one, factor), limits, one.time_s)
        levels.append(state.level == "trip")
    trips, quiet_s = np.array(levels), QUIET_PERIODS * case.period_s
    without_cause = 0
    for at in np.flatnonzero(trips):
        near = np.abs(case.true_time_s - followed.time_s[at]) < quiet_s
        without_cause += bool(case.true_deg[near].max() < NEAR_LIMIT * trip_deg)
    exceedances, leads, over_s = 0, [], -math.inf
    for time_s in case.true_time_s[case.true_deg > 1.02 * trip_deg]:
        if time_s - over_s > quiet_s and time_s > case.period_s:
            exceedances += 1
            last = int(np.searchsorted(followed.time_s, time_s, side="right")) - 1
            if last >= 0 and trips[last]:
                first = last - int(np.argmin(trips[last::-1])) if not trips[: last + 1].all() else -1
                leads.append(min(float(time_s - followed.time_s[first + 1]), quiet_s))
        over_s = time_s
    return exceedances, len(leads), leads, without_cause / max(1, len(trips))


def _limits(trip_deg: float) -> Limits:
    trip_rad = math.radians(trip_deg)
    return Limits(trip_rad=trip_rad, clear_rad=trip_rad / 2, hold_s=3.0, warn_rad=trip_rad * 2 / 3)


def _value_rad(one: MotionEstimate, factor: float) -> float | None:
    if one.angle_rad is None or one.u_rad is None:
        return None
    peak, now_rad = one.expected_peak, one.angle_rad + factor * one.u_rad
    if peak is None or one.period_s is None:
        return now_rad
    return max(now_rad, peak.upper_rad(decision_factor(peak.in_s / one.period_s, factor)))


def accuracy(all_followed: Sequence[Followed]) -> str:
    """Return the table by kind."""
    header = (
        "kind",
        "recordings",
        "known",
        "rms moving",
        "complementary",
        "rms free",
        "inside 95 %",
        "half width",
        "longest wrong, s",
    )
    return table(header, [_accuracy_row(name, chosen) for name, chosen in _by_kind(all_followed)])


def _by_kind(all_followed: Sequence[Followed]) -> list[tuple[str, Sequence[Followed]]]:
    kinds = sorted({one.case.kind for one in all_followed})
    chosen = [[one for one in all_followed if one.case.kind == kind] for kind in kinds]
    return [*zip(kinds, chosen, strict=True), ("all", all_followed)]


def _complementary_rms(chosen: Sequence[Followed]) -> float:
    """Return the rms error while moving of a complementary filter with the best of its time constants, deg."""
    found = []
    for leak in LEAKS_IN_PERIODS:
        errors = [one.case.complementary_deg(leak) - one.case.true_deg for one in chosen]
        counted = [(one.case.true_time_s > one.case.period_s) & (one.case.is_busy > 0.5) for one in chosen]
        found.append(_rms(np.concatenate([error[at] for error, at in zip(errors, counted, strict=True)])))
    return min(found)


def _accuracy_row(name: str, chosen: Sequence[Followed]) -> tuple[str, ...]:
    error, busy = np.concatenate([one.error for one in chosen]), np.concatenate([one.is_busy for one in chosen])
    half = np.concatenate([NORMAL_975 * one.u for one in chosen])
    return (
        _title(name),
        str(len(chosen)),
        f"{100 * np.mean(np.isfinite(error)):.1f} %",
        f"{_rms(error[busy]):.2f}",
        f"{_complementary_rms(chosen):.2f}",
        f"{_rms(error[~busy]):.2f}",
        f"{100 * np.mean([one.holds.mean() for one in chosen]):.1f} %",
        f"{np.nanmedian(half):.2f}",
        f"{max(one.longest_wrong_s() for one in chosen):.1f}",
    )


def _rms(values: Array) -> float:
    known = values[np.isfinite(values)]
    return math.sqrt(float(np.mean(known**2))) if len(known) else math.nan


def costs(all_followed: Sequence[Followed]) -> str:
    """Return the table of announced exceedances and trips without cause by limit and decision factor."""
    header = ("limit, deg", *(f"{factor:.3g} u" for factor in FACTORS))
    body = [(f"{trip_deg:g}", *(_cost(all_followed, trip_deg, factor) for factor in FACTORS)) for trip_deg in TRIPS_DEG]
    return table(header, body)


def costs_by_kind(all_followed: Sequence[Followed]) -> str:
    """Return the table of announced exceedances and trips without cause by kind of crane and limit, as the gateway decides."""
    header = ("kind", *(f"{trip_deg:g} deg" for trip_deg in TRIPS_DEG))
    return table(
        header,
        [
            (_title(name), *(_cost(chosen, trip_deg, DECISION_FACTOR) for trip_deg in TRIPS_DEG))
            for name, chosen in _by_kind(all_followed)
        ],
    )


def _cost(chosen: Sequence[Followed], trip_deg: float, factor: float) -> str:
    found = [alert_cost(one, trip_deg, factor) for one in chosen]
    exceedances, announced = sum(one[0] for one in found), sum(one[1] for one in found)
    leads = [lead_s for one in found for lead_s in one[2]]
    lead = f", {np.median(leads):.1f} s before" if leads else ""
    return f"{announced} of {exceedances}{lead}; {100 * np.mean([one[3] for one in found]):.1f} %"


def _title(kind: str) -> str:
    return KINDS[kind][0] if kind in KINDS else kind


def generated(seed: int, count: int, duration_s: float) -> list[Case]:
    """Return cases of every kind; the engine draws them."""
    cases = []
    with tempfile.TemporaryDirectory() as folder:
        for kind, index in product(KINDS, range(count)):
            place = Path(folder) / f"{kind}{index}"
            try:
                write_recording(make(kind, seed, index, duration_s, 50.0), place)
            except RuntimeError as error:
                print(f"left out: {error}")
                continue
            cases.append(read_case(place))
    return cases


def bounds(all_followed: Sequence[Followed]) -> str:
    """Return the table of what can be known by one housing, with a gyroscope and with a second housing, and what is reached."""
    header = ("kind", "one housing", "reached", "with a gyroscope", "with a second housing")
    rows = []
    for name, chosen in _by_kind([one for one in all_followed if one.case.kind != SPREADER]):
        least = np.concatenate([_bounds_deg(one) for one in chosen], axis=1)
        reached = _rms(np.concatenate([one.error[one.is_busy] for one in chosen]))
        alone, gyro, second = (_rms(each) for each in least)
        rows.append((_title(name), f"{alone:.2f}", f"{reached:.2f}", f"{gyro:.2f}", f"{second:.2f}"))
    return table(header, rows)


def _bounds_deg(followed: Followed) -> Array:
    """Return the bounds while moving, deg, shape (3, n): of one housing, with a gyroscope, with a second housing."""
    recording = _as_work(followed.case)
    rho_2 = followed.case.rho + (APART if followed.case.rho < 0.5 else -APART)
    second = Instruments(second_above_load_m=(1 - rho_2) * followed.case.true_length_m)
    found = []
    for instruments in (Instruments(), Instruments(has_gyro=True), second):
        time_s, bound = bound_rad(recording, instruments, has_moving_base=followed.case.kind == MOVING_BASE)
        found.append(np.degrees(np.interp(followed.time_s[followed.is_busy], time_s, bound)))
    return np.array(found)


def _as_work(case: Case) -> WorkRecording:
    above_m = case.rig.above_load_m
    return WorkRecording(
        name=f"{case.name.removeprefix('work_')}, {_title(case.kind)}",
        rho=case.rho,
        noise_g=case.noise_g,
        believed_length_m=case.rig.length_m,
        above_load_m=(1 - case.rho) * case.true_length_m if above_m is None else above_m,
        time_s=case.time_s,
        force_g=case.force_g,
        truth=case.truth,
    )


def drawing(followed: Followed) -> str:
    """Return the drawing of a recording, its truth and what was stated."""
    recording = _as_work(followed.case)
    stated_deg = followed.error + recording.true("angle_deg", followed.time_s)
    states = [one.state for one in followed.estimates]
    return motion_plot.svg(recording, followed.time_s, stated_deg, followed.u, states)


def main(arguments: Sequence[str] = ()) -> None:
    """Print the tables; write them into a page where wanted."""
    parser = argparse.ArgumentParser(prog="script/bench real_cranes", description=__doc__)
    parser.add_argument("--recordings", type=Path, nargs="+", default=[], help="folders with log.csv and truth.csv")
    parser.add_argument("--count", type=int, default=3, help="recordings of each kind that are made")
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--duration", type=float, default=120.0, help="of each, s")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="replace the tables of this page")
    parser.add_argument(
        "--unseen", action="store_true", help="only the tables of recordings not used before: accuracy and bound"
    )
    parser.add_argument("--figures", type=Path, metavar="FOLDER", help="draw the worst recording of each kind")
    chosen = parser.parse_args(arguments)
    cases = [read_case(folder) for folder in chosen.recordings]
    all_followed = [follow(case) for case in cases or generated(chosen.seed, chosen.count, chosen.duration)]
    if chosen.unseen:
        tables = {"unseen": accuracy(all_followed), "bound": bounds(all_followed)}
    else:
        tables = {
            "real cranes": accuracy(all_followed),
            "alerts": costs(all_followed),
            "alerts by kind": costs_by_kind(all_followed),
        }
    if chosen.figures is not None:
        chosen.figures.mkdir(parents=True, exist_ok=True)
        for kind, of_kind in _by_kind(all_followed)[:-1]:
            worst = max(of_kind, key=lambda one: _rms(one.error))
            (chosen.figures / f"{kind}.svg").write_text(drawing(worst))
    for name, content in tables.items():
        print(f"{name}\n{content}\n")
    if chosen.write is not None:
        chosen.write.write_text(replace_tables(chosen.write.read_text(), tables, "real_cranes"))
