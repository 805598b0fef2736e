"""What an answer of `plumbline reconcile` is worth when the truth is known.

A case is right when the verdict names every hidden effect and no other; or answers `one_of` with a group that holds the effect
and stays within what physics cannot separate; or `none_missing` where nothing is hidden; or `unmodelled`, or true names with
a remainder, where the effect is outside the catalogue. A confident wrong name is a name that is not in the data.
"""

import csv
import statistics
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tests.blind.mechanics import Array
from tests.blind.plan import CATALOGUE

INSEPARABLE = (
    {"axis_offset", "mount_misalignment", "steady_wind", "cross_axis"},
    {"axis_offset", "scale_error", "housing_position"},
    {"rope_length", "load_inertia", "rope_mass", "clock_drift", "housing_position"},
    {"viscous_damping", "quadratic_drag", "coulomb_friction", "pivot_friction"},
    {"wind_gust", "trolley_acceleration", "impact", "hoisting"},
    {"slewing", "housing_spin"},
    {"scale_error", "housing_position", "housing_rocking"},
)
LARGEST_GROUP = 4
SEEN_THE_DATA = 0.85
"""A prediction closer to the held-out recording than this (reduced chi-square) has seen its noise."""
A_GAP = 1.02
"""Below this reduced chi-square there is no gap to close."""
RIGHT, RIGHT_GROUP = "right", "right_group"
CONFIDENT_WRONG = ("wrong_name", "extra_name")
CRASH, TIMEOUT = "crash", "timeout"


@dataclass(frozen=True, slots=True)
class Answer:
    """Of a `reconcile --json`, what is scored."""

    verdict: str
    named: frozenset[str]
    group: frozenset[str]
    equivalents: Mapping[str, str]
    """Effects that are stated to give the same samples, each with the one of the answer that it stands beside."""
    before: float | None
    """Reduced chi-square on the held-out recording before anything is added, as reported."""


def answer_of(report: Mapping[str, Any]) -> Answer:
    """From the report's fields."""
    return Answer(
        verdict=report["verdict"],
        named=frozenset(effect["name"] for effect in report.get("effects") or []),
        group=frozenset(report.get("candidates") or []),
        equivalents={each["name"]: each["of"] for each in report.get("equivalents") or []},
        before=report.get("gap", {}).get("before", {}).get("held_out"),
    )


def judge(truth: frozenset[str], answer: Answer) -> str:
    """One word: right, right_group, beside_group, wrong_group, partly, wrong_name, extra_name, false_alarm or missed.

    `beside_group` is not counted as right: some names are certain and right, and the rest is in the group of the others.
    """
    if not truth:
        return RIGHT if answer.verdict == "none_missing" else "false_alarm"
    if truth - CATALOGUE.keys():
        return _judge_outside(truth, answer)
    answer = _with_equivalents(truth, answer)
    if answer.verdict == "one_of":
        return _judge_group(truth, answer)
    if answer.verdict in ("named", "named_with_remainder"):
        return _judge_names(truth, answer.named)
    return "missed"


def _with_equivalents(truth: frozenset[str], answer: Answer) -> Answer:
    """The group that an answer states by an equivalent of one of its effects, where that is what is hidden."""
    of = {answer.equivalents[name] for name in truth - answer.named if name in answer.equivalents}
    if not of:
        return answer
    beside = {name for name, each in answer.equivalents.items() if each in of}
    group = answer.group | of | beside
    return replace(answer, verdict="one_of", named=answer.named - of, group=frozenset(group))


def _judge_outside(truth: frozenset[str], answer: Answer) -> str:
    if answer.verdict in ("unmodelled", "named_with_remainder") and answer.named <= truth:
        return RIGHT
    return "wrong_name" if answer.named else "missed"


def _judge_group(truth: frozenset[str], answer: Answer) -> str:
    if answer.named - truth:
        return _judge_names(truth, answer.named)
    hidden = truth - answer.named
    inside = any(hidden | answer.group <= group for group in INSEPARABLE) and len(answer.group) <= LARGEST_GROUP
    if not inside:
        return "wrong_group"
    return "beside_group" if answer.named else RIGHT_GROUP


def _judge_names(truth: frozenset[str], named: frozenset[str]) -> str:
    if named == truth:
        return RIGHT
    if named < truth:
        return "partly"
    return "extra_name" if named & truth else "wrong_name"


def held_out_chi2(case: Path, prediction: Path, full_scale_g: float | None = None) -> float:
    """Reduced chi-square of a prediction of the held-out recording; raises `ValueError` when it does not fit row by row.

    Readings at a `full_scale_g` carry no noise, so they count only where the prediction misses them.
    """
    noise_g = tomllib.loads((case / "rig.toml").read_text())["sensor"]["noise_g"]
    measured, predicted = read_force_g(case / "held_out.csv"), read_force_g(prediction)
    if measured.shape != predicted.shape:
        raise ValueError(f"the prediction has {len(predicted)} rows, the recording {len(measured)}")
    squares = ((measured - predicted) / noise_g) ** 2
    if full_scale_g is None:
        return float(squares.mean())
    counted = (np.abs(measured) < full_scale_g - 1e-6) | (squares > 1.0)
    return float(squares[counted].mean())


def closed_percent(before: float | None, after: float | None) -> float | None:
    """How much of the gap above the noise is gone; none where there was none."""
    if before is None or after is None or before <= A_GAP:
        return None
    return 100 * (before - after) / (before - 1)


def read_force_g(path: Path) -> Array:
    """The three columns of specific force, g, shape (n, 3)."""
    with path.open(newline="") as file:
        return np.array([[float(row[name]) for name in ("ax_g", "ay_g", "az_g")] for row in csv.DictReader(file)])


def summary(rows: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """The figures of a campaign."""
    rows = list(rows)
    nulls = [row for row in rows if not row["truth"]]
    closed = sorted(row["closed_percent"] for row in rows if row["closed_percent"] is not None)
    on_test = sorted(each for row in rows if (each := row.get("closed_test_percent")) is not None)
    return {
        "cases": len(rows),
        "right_percent": _percent(rows, (RIGHT, RIGHT_GROUP)),
        "named_exactly_percent": _percent(rows, (RIGHT,)),
        "confident_wrong_percent": _percent(rows, CONFIDENT_WRONG),
        "false_alarms": sum(row["score"] == "false_alarm" for row in nulls),
        "nulls": len(nulls),
        "median_gap_closed_percent": statistics.median(closed) if closed else None,
        "p10_gap_closed_percent": closed[len(closed) // 10] if closed else None,
        "median_test_gap_closed_percent": statistics.median(on_test) if on_test else None,
        "p10_test_gap_closed_percent": on_test[len(on_test) // 10] if on_test else None,
        "median_seconds": statistics.median(row["seconds"] for row in rows) if rows else None,
        "slowest_seconds": max((row["seconds"] for row in rows), default=None),
        "median_cpu_s": statistics.median(row["cpu_s"] for row in rows) if rows else None,
        "largest_cpu_s": max((row["cpu_s"] for row in rows), default=None),
        "peak_mib": max((row["peak_mib"] for row in rows), default=None),
        "crashed": sum(row["score"] == CRASH for row in rows),
        "out_of_time": sum(row["score"] == TIMEOUT for row in rows),
    }


def _percent(rows: list[Mapping[str, Any]], scores: tuple[str, ...]) -> float | None:
    return 100 * sum(row["score"] in scores for row in rows) / len(rows) if rows else None
