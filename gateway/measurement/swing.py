"""The swing of a recording that may have long gaps: the estimates of its parts, combined into one.

Where a recording begins or ends under a hand, only the part that swings freely counts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gateway.measurement.source import Source
from gateway.swing.detection.free_swing import FreeSwing, Interval, find_free_swing
from gateway.swing.estimate import SwingEstimate
from gateway.swing.offline import estimate_planar_swing, estimate_swing
from gateway.swing.rig import MountedHousing

MAX_JOINED_GAP_PERIODS = 8.0
"""Gap up to which one estimate covers both sides, in periods of a small swing. Beyond it the phase of the swing is not known, and
nothing is gained from a fit across the gap, whose cost grows with its length. Basis: a choice; the phase of the swing is lost
beyond it, and the cost of the fit grows with it."""
MAX_UNESTIMATED_PERIODS = 0.5
"""Length of a part without an estimate up to which it leaves the uncertainty as it is, in periods of a small swing. Basis: an
angle reaches its largest value twice in a period."""
MAX_SEARCHED_S = 1800.0
"""Longest recording that is searched. Basis: hands hold test set-ups; what is longer comes from a crane."""


def estimate_source_swing(source: Source) -> SwingEstimate:
    """Return the swing of a recording; not known where the position of the housing is not."""
    time_s, housing = source.recording.time_s, source.housing
    if housing is None:
        reason = "where the housing is on the rope is not known: give --rig"
        return SwingEstimate(from_s=float(time_s[0]), to_s=float(time_s[-1]), swinging=None, reasons=(reason,))
    gap_s = MAX_JOINED_GAP_PERIODS * housing.small_swing_period_s
    bounds = [0, *(np.flatnonzero(np.diff(time_s) > gap_s) + 1).tolist(), len(time_s)]
    estimate_part = estimate_planar_swing if source.is_planar else estimate_swing
    parts = [
        estimate_part(time_s[start:stop], source.force_g[start:stop], rig=housing, noise_g=source.noise_g)
        for start, stop in pairwise(bounds)
    ]
    estimate = parts[0] if len(parts) == 1 else combine_parts(parts, housing)
    return replace(estimate, reasons=(*estimate.reasons, *source.temperature_warnings))


def combine_parts(parts: Sequence[SwingEstimate], housing: MountedHousing) -> SwingEstimate:
    """Return the estimate of all parts together: that of the largest swing, with an interval that covers every part.

    The interval is missing where that of a part is, unless the part is very short.
    """
    negligible_s = MAX_UNESTIMATED_PERIODS * housing.small_swing_period_s
    relevant = [part for part in parts if part.coverage95_rad is not None or part.to_s - part.from_s > negligible_s]
    unknown = [part for part in relevant if part.coverage95_rad is None]
    largest = max(relevant or parts, key=lambda part: (part.swinging is True, part.phi_max_rad or 0.0))
    coverage95_rad = None if unknown else _joint_coverage_rad(relevant)
    swinging = largest.swinging if largest.swinging or not unknown else None
    return replace(
        largest,
        from_s=parts[0].from_s,
        to_s=parts[-1].to_s,
        swinging=swinging,
        u_rad=_joint_u_rad(largest, coverage95_rad),
        coverage95_rad=coverage95_rad,
        hoists_s=tuple(hoist_s for part in parts for hoist_s in part.hoists_s),
        swings=tuple(peak for part in parts for peak in part.swings),
        reasons=(
            f"estimated in {len(parts)} parts between long gaps",
            *(_describe_unknown(part) for part in unknown),
            *(() if largest in unknown else largest.reasons),
        ),
    )


def _describe_unknown(part: SwingEstimate) -> str:
    return f"uncertainty unknown at {part.from_s:.0f}-{part.to_s:.0f} s: {', '.join(part.reasons) or 'no estimate'}"


def _joint_coverage_rad(parts: Sequence[SwingEstimate]) -> tuple[float, float] | None:
    """Return the interval of the largest angle of all parts, any of which may have it."""
    coverages_rad = [part.coverage95_rad for part in parts if part.coverage95_rad is not None]
    if not coverages_rad:
        return None
    return max(low for low, _ in coverages_rad), max(high for _, high in coverages_rad)


def _joint_u_rad(largest: SwingEstimate, coverage95_rad: tuple[float, float] | None) -> float | None:
    """Return the uncertainty of the largest part, enlarged as the joint interval is above it."""
    own_rad, phi_max_rad, u_rad = largest.coverage95_rad, largest.phi_max_rad, largest.u_rad
    if coverage95_rad is None or own_rad is None or phi_max_rad is None or u_rad is None or own_rad[1] <= phi_max_rad:
        return None if coverage95_rad is None else u_rad
    return u_rad * (coverage95_rad[1] - phi_max_rad) / (own_rad[1] - phi_max_rad)


@dataclass(frozen=True, slots=True)
class CutSource:
    """A recording, cut to its longest free swing."""

    source: Source
    free_swing: FreeSwing | None
    """None: nothing was held, the whole recording is judged."""


def cut_to_free_swing(source: Source) -> CutSource:
    """Return a recording without what was held or moved by hand, with a remark that says so."""
    time_s = source.recording.time_s
    if float(time_s[-1] - time_s[0]) > MAX_SEARCHED_S:
        return CutSource(source, None)
    found = find_free_swing(time_s, source.force_g, source.noise_g)
    longest = found.longest
    start, stop = time_s.searchsorted([longest.from_s, longest.to_s]).tolist()
    stop = min(stop + 1, len(time_s))
    if found.is_whole or stop - start < 2:
        return CutSource(source, None)
    cut = source.keeping(
        slice(start, stop),
        source.recording.part(start, stop),
        describe_free_swing(source, found),
        held_rows=None if source.held_rows is None else source.held_rows.part(start, stop),
    )
    return CutSource(cut, found)


def describe_free_swing(source: Source, found: FreeSwing) -> str:
    """Return one line that says what is judged and what is not; times from the start of the recording."""
    left_out = ", ".join(_text(source, each) for each in not_judged(found))
    return (
        f"only the longest free swing is judged, {_text(source, found.longest)}; not judged: {left_out}, where the load was held "
        "or moved by hand, or swung in another way than one pendulum: its angle may have been larger there"
    )


def not_judged(found: FreeSwing) -> tuple[Interval, ...]:
    """Return what lies beside the longest free swing, in order of time: what was held, and shorter free swings."""
    others = [each for each in found.intervals if each != found.longest]
    return tuple(sorted([*found.held, *others], key=lambda each: each.from_s))


def relative_s(source: Source, interval: Interval) -> tuple[float, float]:
    """Return an interval in seconds from the start of the recording."""
    return interval.from_s - source.extent.first_s, interval.to_s - source.extent.first_s


def _text(source: Source, interval: Interval) -> str:
    from_s, to_s = relative_s(source, interval)
    return f"{from_s:.1f} to {to_s:.1f} s"
