"""Ticks stand at round times of UTC."""

import numpy as np
import pytest

from gateway.incident.course import CourseBuilder
from gateway.incident.timeline_figure import ReportClock, tick_label, tick_times

ORIGIN_NS = 1_767_225_607_130_000_123
"""2026-01-01 00:00:07.130 UTC."""


@pytest.mark.parametrize(
    ("span_s", "labels"),
    [
        (90.0, ["00:00:15", "00:00:30", "00:00:45", "00:01:00", "00:01:15", "00:01:30"]),
        (3600.0, ["00:10:00", "00:20:00", "00:30:00", "00:40:00", "00:50:00"]),
        (3.0, ["00:00:07.5", "00:00:08.0", "00:00:08.5", "00:00:09.0", "00:00:09.5", "00:00:10.0"]),
    ],
)
def test_ticks_stand_at_round_times(span_s: float, labels: list[str]) -> None:
    clock = ReportClock(CourseBuilder(ORIGIN_NS).course(ORIGIN_NS, ORIGIN_NS + round(span_s * 1e9)))
    ticks_s = tick_times(clock, 0.0, span_s)
    assert [tick_label(clock, tick_s, span_s) for tick_s in ticks_s] == labels
    assert np.ptp(np.diff(ticks_s)) < 1e-6
