"""The conditions of a recording, judged window by window with the motion filter and the gates of the live pipeline."""

import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gateway.measurement.source import Source
from gateway.motion.motion_monitor import MotionMonitor
from gateway.numerics.array import Array
from gateway.pipeline.motion_stage import motion_context
from gateway.stages.conditions.gates import MotionContext
from gateway.stages.conditions.verdict import ConditionResult, judge_condition
from gateway.stages.conditions.window import ConditionWindow

BLOCK_S = 0.1
"""Length of the blocks in which samples enter window and motion filter. Basis: as live, `device_factory.BLOCK_S`."""
BLOCKS_PER_VERDICT = 5
"""Definition: two verdicts per second, as live."""
NOT_KNOWN = MotionContext(state="unknown", reasons=("where the housing is on the rope is not known",))


@dataclass(frozen=True, slots=True)
class ConditionSummary:
    """The most frequent verdict of a recording."""

    verdict: str
    cause: str | None
    """The most frequent cause of that verdict."""
    reasons: tuple[str, ...]
    """Reasons of the first window with that verdict and cause, and with the most frequent reasons among these."""
    windows: dict[str, int]
    """Number of windows by verdict."""


def summarise_conditions(source: Source) -> ConditionSummary:
    """Judge every window of a recording and return the most frequent verdict."""
    by_verdict: dict[str, list[ConditionResult]] = defaultdict(list)
    windows_judged = list(_judge_windows(source))
    later = [result for result in windows_judged if result.gates.get("enough_data", True)]
    for result in later or windows_judged:  # the first windows of a recording are always too short
        by_verdict[result.verdict].append(result)
    if not by_verdict:
        return ConditionSummary("unknown", None, ("less than a second of data",), {})
    verdict = max(by_verdict, key=lambda verdict: len(by_verdict[verdict]))
    kinds = Counter((result.cause, _without_numbers(result.reasons)) for result in by_verdict[verdict])
    (cause, wording), _ = kinds.most_common(1)[0]
    first = next(
        result for result in by_verdict[verdict] if (result.cause, _without_numbers(result.reasons)) == (cause, wording)
    )
    windows = {name: len(results) for name, results in by_verdict.items()}
    return ConditionSummary(verdict, cause, first.reasons, windows)


def _without_numbers(reasons: Sequence[str]) -> tuple[str, ...]:
    """Return reasons so that those of several windows are the same, whatever their numbers."""
    return tuple(re.sub(r"[-+]?\d[\d.]*", "#", reason) for reason in reasons)


def _judge_windows(source: Source) -> Iterator[ConditionResult]:
    recording = source.recording
    noise_g = None if source.noise_g is None else float(np.max(source.noise_g))
    window, monitor = ConditionWindow(), _motion_monitor(source, noise_g)
    clipped = source.find_clipped()
    block_samples = max(1, round(BLOCK_S * recording.rate_hz))
    for number, start in enumerate(range(0, len(recording), block_samples), start=1):
        block = slice(start, start + block_samples)
        time_s, force_g = recording.time_s[block], source.force_g[block]
        is_clipped = clipped[block]
        window.update(
            time_s,
            force_g,
            int(np.count_nonzero(is_clipped)),
            int(recording.lost_before[block].sum() + recording.unusable_before[block].sum()),
            _turning(source, monitor, block),
        )
        motion = NOT_KNOWN
        if monitor is not None:
            monitor.update(time_s, force_g, is_clipped, None if source.rate_rad_s is None else source.rate_rad_s[block])
            estimate = monitor.estimate(float(time_s[-1]))
            motion = motion_context(estimate, source.housing, is_explained=monitor.is_explained)
        if number % BLOCKS_PER_VERDICT == 0:
            yield judge_condition(window, motion, noise_g, source.permissible_norm_error_g)


def _motion_monitor(source: Source, noise_g: float | None) -> MotionMonitor | None:
    if source.housing is None:
        return None
    return MotionMonitor(source.housing, mount_u_rad=source.mount_u_rad, noise_g=noise_g, gyro=source.gyro)


def _turning(source: Source, monitor: MotionMonitor | None, block: slice) -> Array | None:
    """Return the angular rates of a block without the gyroscope's bias; as read where that is not known."""
    if source.rate_rad_s is None:
        return None
    bias_rad_s = None if monitor is None else monitor.gyro_bias_rad_s()
    rate_rad_s = source.rate_rad_s[block]
    return rate_rad_s if bias_rad_s is None else rate_rad_s - bias_rad_s
