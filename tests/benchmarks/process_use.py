"""Processor time and memory of processes, and the slope of memory with an uncertainty that heeds how slowly the rest changes."""

import os
import statistics
from itertools import pairwise
from pathlib import Path

WARM_SHARE = 0.25
"""Share of the time at the beginning in which caches fill."""


def cpu_s(process_id: int) -> float:
    """Return the processor time of a process so far, s."""
    fields = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident_mib(process_id: int) -> float:
    """Return the resident memory of a process, MiB."""
    return int(Path(f"/proc/{process_id}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def describe_slope(points: list[tuple[float, float]], unit: str) -> str:
    """Return first and last memory, and the slope behind the warm-up, in a unit, of (time or number; memory, MiB).

    The residuals are not independent: their number is reduced by their autocorrelation r at one step, (1 - r)/(1 + r).
    """
    warm = points[round(WARM_SHARE * len(points)) :]
    places, values = [place for place, _ in warm], [value for _, value in warm]
    said = f"{points[0][1]:.1f} MiB at first, {points[-1][1]:.1f} at the end"
    if len(warm) < 4 or len(set(values)) == 1:
        return f"{said}, no change behind the warm-up"
    fit = statistics.linear_regression(places, values)
    rest = [value - fit.intercept - fit.slope * place for place, value in zip(places, values, strict=True)]
    spread = sum((place - statistics.fmean(places)) ** 2 for place in places)
    square = sum(each**2 for each in rest)
    r = min(max(sum(a * b for a, b in pairwise(rest)) / square, 0.0), 0.98) if square else 0.0
    u = (square / (len(warm) - 2) / spread * (1 + r) / (1 - r)) ** 0.5
    return f"{said}, behind the warm-up {fit.slope:.2g} {unit}, u {u:.1g} (n {len(warm)}, r {r:.2f})"
