"""How often the condition is right, over simulated recordings that the gates were not tuned on.

What is right for the window of two seconds that ends at a verdict:

- An impact or a clipped sample in it: disturbed, with that cause.
- Driven by trolley, wind or hoist with at least `PUSH_G` at the housing for at least `DRIVEN_S`, now and since `DETECTED_S`:
  driven, with that cause; unknown is accepted too.
- Driven more weakly or for less: everything is accepted but static, and static too where the specific force without noise
  keeps within `SEEN_G`. These windows are counted apart, and only for the second and third rates.
- The first second: unknown; from then until the window is full: not counted.
- Until one period of free motion (and `SETTLE_S` for the filter) has passed since the start or since the drive: unknown or
  swinging (at rest: unknown or static); driven too while the window still holds the drive.
- Free: static where the specific force without noise keeps within `LEAST_G` over the last period, swinging where it moves by
  more than `SEEN_G`, either in between. Vibration about rest: quasi-static; its first and last window also static.
"""

from collections import Counter
from multiprocessing import Pool

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.correction import correction_for
from gateway.configuration.loading import validate
from gateway.messages import Condition
from gateway.pipeline.outgoing_message import ClockState, HeaderMaker
from gateway.pipeline.pipeline import Pipeline
from tests.benchmarks.condition_recordings import START_NS, WINDOW_S, Recording, make

Mask = NDArray[np.bool_]
Truth = tuple[str, frozenset[str], str | None, bool]
"""What a window is, the verdicts that are right, the cause that is right, and whether it counts for the first rate."""
Judged = tuple[str, frozenset[str], str | None, bool, str, str | None]
"""A window's truth, and the verdict and the cause that were said."""

TUNING = range(96)
HELD_OUT = range(10_000, 10_240)
PUSH_G, SEEN_G, LEAST_G = 0.004, 0.0025, 0.0001
DRIVEN_S, DETECTED_S, SETTLE_S, EDGE_S = 0.75, 0.5, 3.0, 0.25
INSTANT = ("clipped", "impact")
ANY = frozenset({"static", "quasi_static", "swinging", "driven", "disturbed", "unknown"})


def main() -> None:
    """Print the confusion on the recordings that were tuned on and on those held out."""
    with Pool(2) as pool:
        for name, seeds in (("tuning", TUNING), ("held out", HELD_OUT)):
            judged = [row for rows in pool.imap(verdicts, seeds, chunksize=4) for row in rows]
            print(f"conditions: {name}, {len(seeds)} recordings, {len(judged)} windows")
            print(summary(judged))


def verdicts(seed: int) -> list[Judged]:
    """Return for each window of the recording of a seed: what is true, what is accepted, whether it counts, the verdict."""
    return judge(make(seed))


def judge(recording: Recording) -> list[Judged]:
    """Return for each window of a recording: what is true, what is accepted, whether it counts, the verdict and its cause."""
    configuration = validate(recording.table, "benchmark")
    correction = correction_for(recording.info, configuration.device.axes, None)
    pipeline = Pipeline(configuration, recording.info, correction, HeaderMaker())
    clock = ClockState("synchronised", 0)
    said = [
        emission.message
        for block in recording.blocks
        for emission in pipeline.process(block, clock).messages
        if isinstance(emission.message, Condition)
    ]
    return [(*truth(recording, (message.time_ns - START_NS) / 1e9), message.verdict, message.cause) for message in said]


def truth(recording: Recording, now_s: float) -> Truth:
    """What a window is, the verdicts that are right, the cause that is right, and whether it counts for the first rate."""
    time_s = recording.time_s
    window = (time_s > now_s - WINDOW_S - EDGE_S) & (time_s <= now_s)
    sure = (time_s > now_s - WINDOW_S + EDGE_S) & (time_s <= now_s - EDGE_S)
    if now_s < WINDOW_S + EDGE_S:
        return _start(recording, now_s, window)
    for cause in INSTANT:
        if recording.driven[cause][sure].any():
            return cause, frozenset({"disturbed"}), cause, True
        if recording.driven[cause][window].any():
            return "edge", ANY, None, False
    free_s = 0.0
    for cause in ("hoisting", "trolley", "wind"):
        acts = recording.driven[cause] & (time_s <= now_s)
        if acts[window].any():
            return _driven(recording, window, acts, cause)
        if acts.any():
            free_s = float(time_s[acts][-1])
    if recording.driven["vibration"][window].any():
        steady = bool(recording.driven["vibration"][window].all())
        right = {"quasi_static"} if steady else {"quasi_static", "static", "disturbed", "unknown"}
        return "vibration" if steady else "edge", frozenset(right), "vibration" if steady else None, steady
    return _free(recording, now_s, free_s)


def _start(recording: Recording, now_s: float, window: Mask) -> Truth:
    if now_s < 1.0:
        return "start", frozenset({"unknown"}), None, True
    return "start", ANY - {"static"} if _moves_g(recording, window) > SEEN_G else ANY, None, False


def _driven(recording: Recording, window: Mask, acts: Mask, cause: str) -> Truth:
    rate_hz = 1 / (recording.time_s[1] - recording.time_s[0])
    hard_s = np.count_nonzero(window & acts & (recording.push_g > PUSH_G)) / rate_hz
    acts_still = acts[recording.time_s <= float(recording.time_s[window][-1]) - DETECTED_S][-1]
    if hard_s >= DRIVEN_S and acts[window][-1] and acts_still:
        return cause, frozenset({"driven", "unknown"}), cause, True
    return "weakly driven", ANY - {"static"} if _moves_g(recording, window) > SEEN_G else ANY, None, False


def _free(recording: Recording, now_s: float, free_s: float) -> Truth:
    time_s = recording.time_s
    moves_g = _moves_g(recording, (time_s <= now_s) & (time_s > max(free_s, now_s - 1.05 * recording.period_s)))
    kind = "rest" if moves_g < LEAST_G else "faint" if moves_g < SEEN_G else "swing"
    right = {"rest": {"static"}, "faint": {"static", "swinging"}, "swing": {"swinging"}}[kind]
    if now_s < free_s + recording.period_s + SETTLE_S:
        straddles = free_s > 0 and now_s < free_s + WINDOW_S + EDGE_S
        early = right | {"unknown"} | ({"driven"} if straddles else set())
        return (
            ("rest", frozenset(early), None, True)
            if kind == "rest"
            else ("settling", frozenset(early | {"swinging"}), None, True)
        )
    return kind, frozenset(right), None, True


def _moves_g(recording: Recording, window: Mask) -> float:
    return float(np.ptp(recording.force_g[window], axis=0).max()) if window.any() else 0.0


def summary(judged: list[Judged]) -> str:
    """The confusion and the three rates."""
    table = Counter((kind, verdict, cause or "-") for kind, _, _, _, verdict, cause in judged)
    lines = [
        f"  {kind:<14} {verdict:<13} {cause:<10} {count:6d}" for (kind, verdict, cause), count in sorted(table.items())
    ]
    counted = [row for row in judged if row[3]]
    right = sum(row[4] in row[1] for row in counted)
    named = [row for row in counted if row[2] is not None and row[4] in ("driven", "disturbed")]
    at_rest = [row for row in judged if row[0] == "rest"]
    wrongly = sum(row[4] == "swinging" for row in at_rest)
    moved = [row for row in judged if "static" not in row[1] and row[0] not in ("swing", "settling", "start")]
    missed = sum(row[4] in ("static", "quasi_static") and row[4] not in row[1] for row in moved)
    return "\n".join(
        [
            *lines,
            f"  right {right}/{len(counted)} = {right / len(counted):.2%}",
            f"  static called swinging {wrongly}/{len(at_rest)}; driven or disturbed called static {missed}/{len(moved)}",
            f"  cause right {sum(row[5] == row[2] for row in named)}/{len(named)}",
        ]
    )
