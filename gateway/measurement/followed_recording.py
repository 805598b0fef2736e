"""A recording taken through the motion monitor of the live pipeline: the conditions of its windows, and its smoothed motion."""

import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gateway.measurement.source import Source
from gateway.messages.header import Reason
from gateway.motion.history import MotionHistory
from gateway.motion.motion_monitor import MotionMonitor
from gateway.motion.motion_tracker import MotionTracker
from gateway.motion.smoother import Smoother
from gateway.numerics.array import Array
from gateway.pipeline.motion_stage import motion_context
from gateway.stages.condition import DRIVEN_STATES, ConditionResult, MotionContext, judge_condition
from gateway.stages.condition_window import ConditionWindow

BLOCK_S = 0.1
"""Length of the blocks in which samples enter the window. Basis: as live, `device_factory.BLOCK_S`."""
BLOCKS_PER_VERDICT = 5
"""Blocks that the motion monitor takes at once, before a verdict. Definition: two verdicts per second, as live."""
NOT_KNOWN = MotionContext(
    state="unknown", reasons=(Reason("not_configured", "where the housing is on the rope is not known"),)
)


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


@dataclass(frozen=True, slots=True)
class SmoothedMotion:
    """The smoothed motion of a recording."""

    plain: MotionHistory
    """By the accelerometer alone."""
    sharpened: MotionHistory | None
    """With a gyroscope; None: there is none, or it contradicts the accelerometer."""
    fault_s: float
    """Time for which the sensor was at fault, and nothing is known."""


@dataclass(frozen=True, slots=True)
class FollowedRecording:
    """What the live pipeline finds in a recording, and what is known of it from its end."""

    conditions: ConditionSummary
    motion: SmoothedMotion | None
    """None: not asked for, the place of the housing is not known, or no reading could be used."""


class _Smoothing:
    """Smooths what the trackers of a monitor find, while they go on."""

    def __init__(self, monitor: MotionMonitor, gravity_m_s2: float) -> None:
        self._monitor = monitor
        self._plain, self._tracker = Smoother(gravity_m_s2), monitor.tracker
        self._sharpened: Smoother | None = None
        self._with_gyro: MotionTracker | None = None
        if monitor.sharpened is not None:
            self._sharpened, self._with_gyro = Smoother(gravity_m_s2), monitor.sharpened.tracker
        self._fault_s = 0.0

    def follow(self) -> None:
        """Take what the monitor found in the newest part."""
        if self._monitor.has_fault:
            self._fault_s += BLOCKS_PER_VERDICT * BLOCK_S
        if self._monitor.tracker is not self._tracker:
            self._plain.close(self._tracker)
            self._tracker = self._monitor.tracker
        self._plain.take(self._tracker)
        if self._sharpened is None or self._monitor.sharpened is None:
            return
        if self._monitor.sharpened.tracker is not self._with_gyro:
            self._sharpened = None  # it has been renewed, because the rates contradict the forces
        else:
            self._sharpened.take(self._with_gyro)

    def finish(self) -> SmoothedMotion | None:
        """Return the motion from the beginning to the end; None where no reading could be used."""
        self._plain.close(self._tracker)
        plain, sharpened = self._plain.history(), None
        if self._sharpened is not None and self._with_gyro is not None and not self._is_gyro_at_fault:
            self._sharpened.close(self._with_gyro)
            sharpened = self._sharpened.history()
        return None if plain is None else SmoothedMotion(plain, sharpened, self._fault_s)

    @property
    def _is_gyro_at_fault(self) -> bool:
        return self._monitor.sharpened is None or self._monitor.sharpened.check.fault is not None


def follow_recording(source: Source, *, swings_freely: bool = False, smooths: bool = False) -> FollowedRecording:
    """Judge every window of a recording, and smooth its motion where `smooths`.

    `swings_freely`: one free swing explains the whole recording, so that nothing else acts in any window.
    """
    recording = source.recording
    noise_g = None if source.noise_g is None else float(np.max(source.noise_g))
    window, monitor = ConditionWindow(), _motion_monitor(source, noise_g, keeps_steps=smooths)
    smoothing = None
    if smooths and monitor is not None and source.housing is not None:
        smoothing = _Smoothing(monitor, source.housing.gravity_m_s2)
    clipped, results = source.find_clipped(), list[ConditionResult]()
    block_samples = max(1, round(BLOCK_S * recording.rate_hz))
    part_samples = BLOCKS_PER_VERDICT * block_samples
    for start in range(0, len(recording), part_samples):
        part = slice(start, min(start + part_samples, len(recording)))
        for begin in range(start, part.stop, block_samples):
            block = slice(begin, min(begin + block_samples, part.stop))
            window.update(
                recording.time_s[block],
                source.force_g[block],
                int(np.count_nonzero(clipped[block])),
                int(recording.lost_before[block].sum() + recording.unusable_before[block].sum()),
                _turning(source, monitor, block),
            )
        time_s = recording.time_s[part]
        if monitor is not None:
            rate_rad_s = None if source.rate_rad_s is None else source.rate_rad_s[part]
            monitor.update(time_s, source.force_g[part], clipped[part], rate_rad_s)
        if smoothing is not None:
            smoothing.follow()
        if len(time_s) == part_samples:
            motion = _motion_at(float(time_s[-1]), monitor, source, swings_freely)
            results.append(judge_condition(window, motion, noise_g, source.permissible_norm_error_g))
    return FollowedRecording(summarise_conditions(results), None if smoothing is None else smoothing.finish())


def summarise_conditions(windows_judged: Sequence[ConditionResult]) -> ConditionSummary:
    """Return the most frequent verdict of the windows of a recording."""
    by_verdict: dict[str, list[ConditionResult]] = defaultdict(list)
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


def _motion_at(time_s: float, monitor: MotionMonitor | None, source: Source, swings_freely: bool) -> MotionContext:
    if monitor is None:
        return NOT_KNOWN
    motion = motion_context(monitor.estimate(time_s), source.housing, is_explained=monitor.is_explained)
    is_free = swings_freely and motion.state in DRIVEN_STATES
    return replace(motion, state="free", reasons=()) if is_free else motion


def _motion_monitor(source: Source, noise_g: float | None, *, keeps_steps: bool) -> MotionMonitor | None:
    if source.housing is None:
        return None
    return MotionMonitor(
        source.housing, mount_u_rad=source.mount_u_rad, noise_g=noise_g, gyro=source.gyro, keeps_steps=keeps_steps
    )


def _turning(source: Source, monitor: MotionMonitor | None, block: slice) -> Array | None:
    """Return the angular rates of a block without the gyroscope's bias; as read where that is not known."""
    if source.rate_rad_s is None:
        return None
    bias_rad_s = None if monitor is None else monitor.gyro_bias_rad_s()
    rate_rad_s = source.rate_rad_s[block]
    return rate_rad_s if bias_rad_s is None else rate_rad_s - bias_rad_s
