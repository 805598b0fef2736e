"""The conditions of a recording, judged window by window with the gates of the live pipeline."""

from collections import Counter, defaultdict
from dataclasses import dataclass, replace

import numpy as np

from gateway.measurement.source import Source
from gateway.stages.clipping import count_clipped
from gateway.stages.conditions.gates import SwingContext
from gateway.stages.conditions.verdict import ConditionResult, judge_condition
from gateway.stages.conditions.window import WINDOW_S, ConditionWindow
from gateway.swing.estimate import SwingEstimate

BLOCK_S = 0.1
"""Length of the blocks in which samples enter the window."""
BLOCKS_PER_VERDICT = 5


@dataclass(frozen=True, slots=True)
class ConditionSummary:
    """The most frequent verdict of a recording."""

    verdict: str
    cause: str | None
    """The most frequent cause of that verdict."""
    reasons: tuple[str, ...]
    """Reasons of the first window with that verdict and cause."""
    windows: dict[str, int]
    """Number of windows by verdict."""


def summarise_conditions(source: Source, swing: SwingEstimate) -> ConditionSummary:
    """Judge every window of a recording and return the most frequent verdict."""
    by_verdict: dict[str, list[ConditionResult]] = defaultdict(list)
    for result in _judge_windows(source, swing):
        by_verdict[result.verdict].append(result)
    if not by_verdict:
        return ConditionSummary("unknown", None, ("less than a second of data",), {})
    verdict = max(by_verdict, key=lambda verdict: len(by_verdict[verdict]))
    cause = Counter(result.cause for result in by_verdict[verdict]).most_common(1)[0][0]
    first = next(result for result in by_verdict[verdict] if result.cause == cause)
    windows = {name: len(results) for name, results in by_verdict.items()}
    return ConditionSummary(verdict, cause, first.reasons, windows)


def _judge_windows(source: Source, swing: SwingEstimate) -> list[ConditionResult]:
    recording, context = source.recording, _swing_context(source, swing)
    noise_g = None if source.noise_g is None else float(np.max(source.noise_g))
    window = ConditionWindow()
    results = []
    block_samples = max(1, round(BLOCK_S * recording.rate_hz))
    for number, start in enumerate(range(0, len(recording), block_samples), start=1):
        block = slice(start, start + block_samples)
        window.update(
            recording.time_s[block],
            source.force_g[block],
            count_clipped(source.force_g[block], source.full_scale_g),
            int(recording.lost_before[block].sum() + recording.unusable_before[block].sum()),
            None if recording.gyro_dps is None else np.radians(recording.gyro_dps[block]),
        )
        if number % BLOCKS_PER_VERDICT == 0:
            now = replace(context, hoisting=_is_hoisting(swing, float(recording.time_s[block][-1])))
            results.append(judge_condition(window, now, noise_g, source.permissible_norm_error_g))
    return results


def _swing_context(source: Source, swing: SwingEstimate) -> SwingContext:
    housing = source.housing
    return SwingContext(
        swing.swinging,
        swing.phi_max_rad,
        consistent=swing.coverage95_rad is not None,
        rho=None if housing is None or swing.length_m is None else housing.rho_at(swing.length_m),
        period_s=swing.period_s,
        lean_g=swing.lean_g,
    )


def _is_hoisting(swing: SwingEstimate, now_s: float) -> bool:
    """Return whether the rope's length changed within the window that ends now."""
    return any(begin_s < now_s and end_s > now_s - WINDOW_S for begin_s, end_s in swing.hoists_s)
