"""The table of the recordings of real pendulums, and its counts."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np

from tests.benchmarks.real_angles import Angles
from tests.benchmarks.real_manifest import RealRecording

MEASURE_COLUMNS = ("recording", "known, deg", "`measure`, deg", "s")
RECONCILE_COLUMNS = (
    "recording",
    "verdict",
    "effects",
    "plausible",
    "gap of the test part",
    "s",
    "least squares of everything",
    "pysindy",
)
AROUND_S = 0.05
"""The angle at a time is compared with those within this, the error of two clocks: it can be one that the load passes."""
Answers = Mapping[str, Mapping[str, Any]]
"""By method: JSON, with `wall_s` and `cpu_s` added."""


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the table."""

    recording: RealRecording
    angles: Angles | None
    answers: Answers

    @property
    def measured(self) -> Mapping[str, Any]:
        """The answer of `measure`."""
        return self.answers.get("measure", {})

    @property
    def reconciled(self) -> Mapping[str, Any]:
        """The answer of `reconcile`."""
        return self.answers.get("reconcile", {})

    @property
    def names(self) -> list[str]:
        """Effects that `reconcile` names."""
        return [effect["name"] for effect in self.reconciled.get("effects", [])]

    @property
    def strange_names(self) -> list[str]:
        """Those that are not plausible."""
        return [name for name in self.names if name not in self.recording.plausible]

    @property
    def known_deg(self) -> tuple[float, float]:
        """Largest angle of the part that `measure` judges, and its standard uncertainty."""
        free = self.measured.get("free_swing")
        if free is None:
            return self.recording.known_deg
        began_s = 0.0 if self.angles is None else float(self.angles[0][0])
        return self._largest_within(began_s + free["from_s"], began_s + free["to_s"])

    @property
    def interval(self) -> tuple[float, tuple[float, float]] | None:
        """Angle of the whole free swing and its 95 % interval, deg; None where it is unknown."""
        swing = self.measured.get("swing") or {}
        return (swing["phi_max_deg"], tuple(swing["coverage95_deg"])) if swing.get("coverage95_deg") else None

    @property
    def smoothed_interval(self) -> tuple[float, tuple[float, float]] | None:
        """Largest known angle of the smoothed motion and its 95 % interval, deg."""
        largest = (self.measured.get("motion") or {}).get("largest") or {}
        return (largest["angle_deg"], tuple(largest["coverage95_deg"])) if largest.get("coverage95_deg") else None

    @property
    def holds(self) -> bool | None:
        """Whether the interval contains the known angle within its own uncertainty; None without an interval."""
        if self.interval is not None:
            return _holds(self.interval[1], (self.known_deg[0], self.known_deg[0]), self.known_deg[1])
        if self.smoothed_interval is None:
            return None
        return _holds(self.smoothed_interval[1], self._known_then_deg(), self.known_deg[1])

    def _known_then_deg(self) -> tuple[float, float]:
        """Smallest and largest known angle at the time of the largest one of the smoothed motion."""
        if self.angles is None:
            return self.known_deg[0], self.known_deg[0]
        at_s = self.measured["motion"]["largest"]["time_s"]
        time_s, angle_rad = self.angles
        then_deg = np.degrees(
            np.append(angle_rad[np.abs(time_s - at_s) <= AROUND_S], np.interp(at_s, time_s, angle_rad))
        )
        return float(then_deg.min()), float(then_deg.max())

    def _largest_within(self, from_s: float, to_s: float) -> tuple[float, float]:
        """Largest known angle between two time stamps; no more than that of the whole, of which a single reading can be wrong."""
        whole_deg, uncertainty_deg = self.recording.known_deg
        if self.angles is None:
            return whole_deg, uncertainty_deg
        time_s, angle_rad = self.angles
        part_rad = angle_rad[(time_s >= from_s) & (time_s <= to_s)]
        return min(float(np.degrees(part_rad.max(initial=0.0))), whole_deg), uncertainty_deg


def tables(rows: Sequence[Row]) -> str:
    """What `measure` answers, and what `reconcile` and the simpler methods do; without those that must be refused."""
    usable = [row for row in rows if not row.recording.refused_because]
    parts = [
        *_table(MEASURE_COLUMNS, map(measure_cells, rows)),
        "",
        *_table(RECONCILE_COLUMNS, map(reconcile_cells, usable)),
    ]
    return "\n".join([*parts, "", counts(rows), ""])


def _table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    return [markdown(columns), "|---" * len(columns) + "|", *map(markdown, rows)]


def markdown(cells: Sequence[str]) -> str:
    """A line of a table."""
    return "| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |"


def measure_cells(row: Row) -> tuple[str, ...]:
    """The line of what `measure` answers."""
    return _name(row), _known(row), _angle(row), _seconds(row, "measure")


def reconcile_cells(row: Row) -> tuple[str, ...]:
    """The line of what is missing from the model."""
    return (
        _name(row),
        row.reconciled.get("verdict", "refused" if "error" in row.reconciled else "-"),
        _effects(row.reconciled),
        _plausible(row),
        _gap(row.reconciled),
        _seconds(row, "reconcile"),
        _baseline(row.answers.get("everything")),
        _baseline(row.answers.get("sparse")),
    )


def counts(rows: Sequence[Row]) -> str:
    """One sentence of counts for each kind of recording."""
    usable = [row for row in rows if not row.recording.refused_because]
    refused = [row for row in rows if row.recording.refused_because]
    whole = [row for row in usable if row.interval is not None]
    smoothed = [row for row in usable if row.interval is None and row.smoothed_interval is not None]
    named = [row for row in usable if row.names]
    plausible = [row for row in named if not row.strange_names]
    verdicts = [row.reconciled.get("verdict", "refused") for row in usable if row.reconciled]
    taken_s = [row.reconciled["wall_s"] for row in usable if "verdict" in row.reconciled] or [float("nan")]
    told = ", ".join(f"{verdicts.count(each)} {each}" for each in sorted(set(verdicts)))
    return (
        f"`measure`: of {len(usable)} recordings {len(whole)} have an interval, {sum(bool(r.holds) for r in whole)} hold. "
        f"{len(smoothed)} more have one while the smoothed motion is known; {sum(bool(r.holds) for r in smoothed)} hold. "
        f"Without gravity: {sum('error' in r.measured for r in refused)} of {len(refused)} refused. "
        f"`reconcile`: {told}; effects named in {len(named)}, all of them plausible in {len(plausible)}; "
        f"{median(taken_s):.0f} s at the median, {max(taken_s):.0f} s at most."
    )


def _holds(low_high_deg: tuple[float, float], known_deg: tuple[float, float], uncertainty_deg: float) -> bool:
    """Whether an interval meets what is known, from the smallest to the largest, within two standard uncertainties."""
    return (
        low_high_deg[0] - 2 * uncertainty_deg <= known_deg[1] and known_deg[0] <= low_high_deg[1] + 2 * uncertainty_deg
    )


def _name(row: Row) -> str:
    return f"*{row.recording.name}*" if row.recording.is_asked_once else row.recording.name


def _seconds(row: Row, method: str) -> str:
    return f"{row.answers[method]['wall_s']:.0f}" if method in row.answers else "-"


def _known(row: Row) -> str:
    if row.recording.refused_because:
        return row.recording.refused_because
    (known, uncertainty), (whole, _) = row.known_deg, row.recording.known_deg
    judged = f"{known:.1f} ± {2 * uncertainty:g}"
    return judged if abs(known - whole) < uncertainty else f"{judged} of the part judged, {whole:g} of all"


def _angle(row: Row) -> str:
    """The interval, and whether it holds; else that of the smoothed motion."""
    if row.interval is not None:
        return _interval(row.interval, row.holds)
    if row.smoothed_interval is not None:
        percent = row.measured["motion"]["known_percent"]
        said = _interval(row.smoothed_interval, row.holds)
        return f"unknown; while the angle is known ({percent:.0f} %) {said}"
    if "error" in row.measured:
        return f"refused: {row.measured['error']}"
    return "unknown: " + ("; ".join(row.measured.get("swing_reasons", [])) or "-")


def _interval(interval: tuple[float, tuple[float, float]], holds: bool | None) -> str:
    angle_deg, (low, high) = interval
    return f"{angle_deg:.2f} ({low:.2f} to {high:.2f})" + ("" if holds else " **misses**")


def _plausible(row: Row) -> str:
    if not row.names:
        return "-"
    return "no: " + ", ".join(row.strange_names) if row.strange_names else "yes"


def _effects(reconciled: Mapping[str, Any]) -> str:
    said = [f"{effect['name']} ({_sizes(effect['parameters'])})" for effect in reconciled.get("effects", [])]
    groups = [reconciled.get("candidates", []), *reconciled.get("also_one_of", [])]
    said += [f"one of {', '.join(group)}" for group in groups if group]
    laws = [each["text"] for each in (reconciled.get("equation") or {}).get("terms", []) if "text" in each]
    why = reconciled.get("error") or (
        reconciled.get("reason", "") if reconciled.get("verdict") == "data_unusable" else "-"
    )
    return "; ".join([*said, *laws]) or str(why)


def _sizes(parameters: Mapping[str, Any]) -> str:
    numbers = {key: each["value"] for key, each in parameters.items()}
    return ", ".join(
        f"{key} {[float(_number(one)) for one in value]}" if isinstance(value, list) else f"{key} {_number(value)}"
        for key, value in numbers.items()
    )


def _gap(answer: Mapping[str, Any]) -> str:
    gap = answer.get("gap") or {}
    if not gap.get("before") or gap["before"].get("test") is None:
        return "-"
    return f"{_number(gap['before']['test'])} → {_number(gap['after']['test'])}"


def _baseline(answer: Mapping[str, Any] | None) -> str:
    if answer is None:
        return "-"
    if "error" in answer:
        return "as `reconcile`: cannot be used" if answer.get("refused") else str(answer["error"])
    names = ", ".join(each["name"] for each in answer["effects"]) or "nothing"
    return f"{names}; {_gap(answer)}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
