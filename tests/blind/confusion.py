"""A campaign's results as Markdown: figures, by kind, the whole confusion matrix, and every case that is not right."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from tests.blind import score

Row = Mapping[str, Any]
NOTHING = "none"
BINS = (0.1, 0.3, 1.0, 3.0, 10.0, 100.0, float("inf"))


def markdown(rows: list[Row]) -> str:
    """The whole page."""
    parts = [_figures(score.summary(rows)), _kinds(rows), _sizes(rows), _matrix(rows), _pairs(rows), _misses(rows)]
    return "\n\n".join(part for part in parts if part) + "\n"


def truth_of(row: Row) -> str:
    """What is hidden, in one word."""
    return " + ".join(row["truth"]) or NOTHING


def said_of(row: Row) -> str:
    """What was answered, in one word."""
    if row["score"] == score.CRASH:
        return "crashed"
    if row["score"] == score.TIMEOUT:
        return "out of time"
    if row["verdict"] == "one_of":
        return "one of " + ", ".join(row["group"])
    names = " + ".join(row["named"])
    if row["verdict"] == "named_with_remainder":
        return f"{names} + remainder"
    return names if row["verdict"] == "named" else str(row["verdict"])


def _figures(figures: Mapping[str, Any]) -> str:
    lines = [
        ("right", figures["right_percent"], "%"),
        ("exactly named", figures["named_exactly_percent"], "%"),
        ("confident wrong name", figures["confident_wrong_percent"], "%"),
        ("held-out gap closed, median", figures["median_gap_closed_percent"], "%"),
        ("held-out gap closed, 10th percentile", figures["p10_gap_closed_percent"], "%"),
        ("gap closed on the test part, median", figures["median_test_gap_closed_percent"], "%"),
        ("gap closed on the test part, 10th percentile", figures["p10_test_gap_closed_percent"], "%"),
        ("median time", figures["median_seconds"], "s"),
        ("longest time", figures["slowest_seconds"], "s"),
        ("median CPU time", figures["median_cpu_s"], "s"),
        ("largest CPU time", figures["largest_cpu_s"], "s"),
        ("peak memory", figures["peak_mib"], "MiB"),
    ]
    told = [(name, "-" if value is None else f"{value:.1f} {unit}") for name, value, unit in lines]
    told.insert(3, ("false alarms", f"{figures['false_alarms']} of {figures['nulls']}"))
    told += [("crashed", str(figures["crashed"])), ("out of time", str(figures["out_of_time"]))]
    return _table(["of all cases", str(figures["cases"])], told)


def _kinds(rows: list[Row]) -> str:
    """By kind of case; nulls by the kind of their noise."""

    def kind(row: Row) -> str:
        noise = [word for word in ("coloured", "jittered", "small") if row[word] and (row["truth"] or word != "small")]
        return f"{row['kind']}, {' and '.join(noise)}" if noise else str(row["kind"])

    return _shares("kind", rows, kind)


def _sizes(rows: list[Row]) -> str:
    """By what the hidden effects do to the reduced chi-square of the log."""

    def size(row: Row) -> str:
        excess = min(row["excess"].values())
        top = next(edge for edge in BINS if excess < edge)
        return f"below {top:g}" if top < BINS[-1] else f"{BINS[-2]:g} or more"

    hidden = sorted((row for row in rows if row["excess"]), key=lambda row: min(row["excess"].values()))
    return _shares("least excess of the log's reduced chi-square by a hidden effect", hidden, size, in_order=True)


def _shares(title: str, rows: list[Row], group: Callable[[Row], str], *, in_order: bool = False) -> str:
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(group(row), []).append(row)
    names = list(groups) if in_order else sorted(groups)
    lines = []
    for name in names:
        figures = score.summary(groups[name])
        wrong = sum(row["score"] in score.CONFIDENT_WRONG for row in groups[name])
        percents = (f"{figures[key]:.0f} %" for key in ("right_percent", "named_exactly_percent"))
        lines.append((name, str(len(groups[name])), *percents, str(wrong), str(figures["false_alarms"])))
    return _table([title, "cases", "right", "exactly", "confident wrong", "false alarms"], lines) if lines else ""


def _matrix(rows: list[Row]) -> str:
    """Hidden (rows) against said (columns); cases with two hidden effects stand apart."""
    singles = [row for row in rows if row["kind"] != "pair"]
    counts = Counter((truth_of(row), said_of(row)) for row in singles)
    said = sorted({said for _, said in counts})
    lines = [(t, *(str(counts[t, s] or "") for s in said)) for t in sorted({truth for truth, _ in counts})]
    return "Hidden in the rows, said in the columns:\n\n" + _table(["hidden", *said], lines) if lines else ""


def _pairs(rows: list[Row]) -> str:
    pairs = sorted((row for row in rows if row["kind"] == "pair"), key=truth_of)
    lines = [(truth_of(row), said_of(row), str(row["score"])) for row in pairs]
    return _table(["two hidden", "said", "score"], lines) if lines else ""


def _misses(rows: Iterable[Row]) -> str:
    wrong = [row for row in rows if row["score"] not in (score.RIGHT, score.RIGHT_GROUP)]
    lines = []
    for row in sorted(wrong, key=lambda row: (row["score"], truth_of(row))):
        gap = " → ".join("-" if row[key] is None else f"{row[key]:.2f}" for key in ("chi2_before", "chi2_after"))
        excess = ", ".join(f"{value:.2g}" for value in row["excess"].values())
        lines.append(
            (row["case"], str(row["seed"]), row["score"], truth_of(row), excess, said_of(row), gap, row["why"])
        )
    titles = ["case", "seed", "score", "hidden", "excess", "said", "held-out gap", "why"]
    return _table(titles, lines) if lines else ""


def _table(titles: list[str], lines: Iterable[tuple[str, ...]]) -> str:
    rows = [titles, ["---"] * len(titles), *lines]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "/").replace("\n", " ") for cell in row) + " |" for row in rows
    )
