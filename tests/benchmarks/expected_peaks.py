"""How often the interval of an expected peak holds the next maximum of the rope's angle, by what acts until then.

Only peaks that the operator's page announces count: above the present angle, and of 2 degrees or more.
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from gateway.motion.estimate import MotionEstimate, PeakEstimate
from gateway.numerics.array import Array
from gateway.numerics.stats import NORMAL_975
from tests.benchmarks.motion import table
from tests.benchmarks.real_cranes import Case, Followed, follow, generated, read_case

LEAST_DEG = 2.0
SOON_S = 0.05
ACTS = ("driven", "hoisting", "gust")
LOOK_PERIODS = 0.75
"""The next maximum comes within half a period; pumping by a drive shifts it."""


def announced(estimate: MotionEstimate) -> PeakEstimate | None:
    """Return the peak that the page shows; None where it shows the present angle."""
    peak = estimate.expected_peak
    if peak is None or estimate.angle_rad is None or peak.in_s <= SOON_S:
        return None
    return peak if peak.angle_rad > max(estimate.angle_rad, math.radians(LEAST_DEG)) else None


def outcomes(followed: Followed) -> Iterator[tuple[str, bool, float]]:
    """Yield of each announced peak what acted until the next maximum, whether it held that, and its half width in deg."""
    time_s, true_deg = followed.case.true_time_s, followed.case.true_deg
    for estimate in followed.estimates:
        peak, period_s = announced(estimate), estimate.period_s
        if peak is None or period_s is None or estimate.time_s + period_s > time_s[-1]:
            continue
        begin, end = np.searchsorted(time_s, [estimate.time_s, estimate.time_s + LOOK_PERIODS * period_s])
        place = begin + _first_maximum(true_deg[begin:end])
        half_deg = NORMAL_975 * math.degrees(peak.u_rad)
        error_deg = abs(float(true_deg[place]) - math.degrees(peak.angle_rad))
        yield _acting(followed.case, begin, place), error_deg <= half_deg, half_deg


def _first_maximum(angle_deg: Array) -> int:
    inner = (angle_deg[1:-1] >= angle_deg[:-2]) & (angle_deg[1:-1] > angle_deg[2:])
    return int(inner.argmax()) + 1 if inner.any() else int(angle_deg.argmax())


def _acting(case: Case, begin: int, end: int) -> str:
    signals = [case.truth[name][begin : end + 1] > 0.5 for name in ACTS]
    if any((signal[1:] & ~signal[:-1]).any() for signal in signals):
        return "a drive, a hoist or a gust begins"
    return "one acts, and none begins" if any(signal.any() for signal in signals) else "none acts"


def main(arguments: Sequence[str] = ()) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="script/bench expected_peaks", description=__doc__)
    parser.add_argument("--recordings", type=Path, nargs="+", default=[], help="folders with log.csv and truth.csv")
    parser.add_argument("--seed", type=int, default=91)
    chosen = parser.parse_args(arguments)
    cases = [read_case(folder) for folder in chosen.recordings] or generated(chosen.seed, 3, 120.0)
    found = [outcome for case in cases for outcome in outcomes(follow(case))]
    body = []
    for acting in sorted({acting for acting, _, _ in found}):
        held, half_deg = np.array([(held, half_deg) for each, held, half_deg in found if each == acting]).T
        body.append((acting, str(len(held)), f"{100 * held.mean():.0f} %", f"{np.median(half_deg):.2f}"))
    print(table(("until the next maximum", "estimates", "inside the interval", "half width, deg"), body))
