"""The part of a recording that swings freely, where it begins or ends under a hand."""

from dataclasses import dataclass, replace

from gateway.measurement.source import Source
from gateway.swing.detection.free_swing import FreeSwing, Interval, find_free_swing

MAX_SEARCHED_S = 1800.0
"""Longest recording that is searched. Basis: hands hold test set-ups; what is longer comes from a crane."""


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
    kept = slice(start, stop)
    cut = replace(
        source,
        recording=source.recording.part(start, stop),
        force_g=source.force_g[kept],
        held_rows=None if source.held_rows is None else source.held_rows.part(start, stop),
        rate_rad_s=None if source.rate_rad_s is None else source.rate_rad_s[kept],
        remarks=(*source.remarks, describe_free_swing(source, found)),
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
