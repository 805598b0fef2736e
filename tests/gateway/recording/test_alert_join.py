"""Alerts from raised to cleared, over segments."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import pytest

from gateway.alert_periods import AlertState
from gateway.incident.incident_selection import read_incidents
from gateway.messages import ActiveAlert, Level
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.format.content import RecordingHeader
from gateway.recording.format.segment_summary import SegmentSummary
from gateway.recording.format.summary_builder import SummaryBuilder, join_alerts, unknown_s
from gateway.recording.reading.timeline import open_timeline
from gateway.recording.segments.recorder import Recorder
from tests.clocks import START_NS
from tests.gateway.conftest import make_samples
from tests.gateway.incident import stated
from tests.gateway.recording.conftest import DEVICE, SECOND_NS
from tests.values import present

OFFSET_NS = 7 * SECOND_NS
"""UTC minus gateway time."""


def active(
    rule: str, level: Level, since_s: float, value_deg: float | None, incident: str | None = None
) -> ActiveAlert:
    return ActiveAlert(
        rule=rule,
        level=level,
        since_ns=round(since_s * 1e9),
        value_deg=value_deg,
        limit_deg=6.0,
        incident=incident,
        text=f"{rule} {level}",
    )


def state(time_s: float, event: str, rule: str | None, *alerts: ActiveAlert, **values: Any) -> AlertState:
    time_ns = round(time_s * 1e9)
    return AlertState(time_ns, time_ns + OFFSET_NS, event, rule, list(alerts), **values)


def summary(*states: AlertState, to_s: float = 100.0) -> SegmentSummary:
    builder = SummaryBuilder()
    builder.count("/alert", 0, 1)
    return replace(present(builder.summary()), alerts=list(states), to_ns=round(to_s * 1e9))


def utc(time_s: float) -> int:
    return round(time_s * 1e9) + OFFSET_NS


def test_a_warning_that_was_corrected_says_nothing_of_the_trip_that_follows() -> None:
    segment = summary(
        state(2, "raised", "swing", active("swing", "warn", 2, 4.5)),
        state(3, "corrected", "swing", active("swing", "warn", 2, 3.0)),
        state(5, "raised", "swing", active("swing", "trip", 5, 6.5)),
        state(9, "cleared", "swing", largest_deg=6.4, largest_upper_deg=6.6),
    )
    (alert,) = join_alerts([("boot", segment)])
    assert (alert.level, alert.is_corrected) == ("trip", False)


def test_warning_that_becomes_a_trip_is_one_alert_with_the_largest_values() -> None:
    segment = summary(
        state(1, "standing", None),
        state(10, "raised", "swing", active("swing", "warn", 10, 4.5)),
        state(12, "raised", "swing", active("swing", "trip", 12, 7.5)),
        state(30, "changed", "swing", active("swing", "warn", 30, 4.0)),
        state(40, "cleared", "swing", largest_deg=6.8, largest_upper_deg=7.6),
    )
    (alert,) = join_alerts([("boot", segment)])
    assert (alert.level, alert.ended, alert.is_raised_before) == ("trip", "cleared", False)
    assert (alert.from_utc_ns, alert.to_utc_ns) == (utc(10), utc(40))
    assert (alert.largest_deg, alert.largest_upper_deg, alert.text) == (6.8, 7.6, "swing trip")


def test_trip_that_begins_in_one_segment_and_ends_in_another_is_one() -> None:
    trip = active("swing", "trip", 50, 7.0, "boot-1")
    segments = [
        summary(state(50, "raised", "swing", trip), to_s=60),
        summary(state(61, "standing", None, replace(trip, value_deg=12.0, largest_upper_deg=9.0)), to_s=120),
        summary(state(121, "standing", None, trip), state(130, "cleared", "swing"), to_s=180),
    ]
    (alert,) = join_alerts([("boot", segment) for segment in segments])
    assert (alert.from_utc_ns, alert.to_utc_ns, alert.ended) == (utc(50), utc(130), "cleared")
    assert (alert.largest_upper_deg, alert.incident) == (9.0, "boot-1")
    (beginning,) = join_alerts([("boot", segments[0])])
    assert (beginning.to_utc_ns, beginning.ended) == (None, "standing")
    (end,) = join_alerts([("boot", segments[2])])
    assert (end.from_utc_ns, end.is_raised_before) == (utc(50), True)


def test_an_alert_whose_level_is_not_known_at_the_end_is_not_said_to_stand() -> None:
    raised = state(10, "raised", "swing", active("swing", "trip", 10, 7.5, "boot-1"))
    unknown = state(20, "changed", "swing", active("swing", "unknown", 10, None, "boot-1"))
    (alert,) = join_alerts([("boot", summary(raised, unknown))])
    assert (alert.level, alert.to_utc_ns, alert.ended) == ("trip", None, "unknown")


@pytest.mark.parametrize(("upper_deg", "is_corrected"), [(5.9, True), (6.1, False)])
def test_an_alert_that_clears_before_its_bound_is_checked_was_a_bound_all_the_same(
    upper_deg: float, is_corrected: bool
) -> None:
    raised = state(10, "raised", "swing", active("swing", "warn", 10, 6.5, "boot-1"))
    cleared = state(13, "cleared", "swing", incident="boot-1", largest_deg=2.0, largest_upper_deg=upper_deg)
    (alert,) = join_alerts([("boot", summary(raised, cleared))])
    assert alert.is_corrected == is_corrected
    (alert,) = join_alerts([("boot", summary(state(9, "standing", None, raised.active[0]), cleared))])
    assert not alert.is_corrected  # nobody knows what it was before


def test_rules_are_apart() -> None:
    swing, lean = active("swing", "warn", 10, 4.5), active("lean", "trip", 20, 8.0)
    segment = summary(
        state(10, "raised", "swing", swing),
        state(20, "raised", "lean", swing, lean),
        state(30, "cleared", "swing", lean),
        state(40, "cleared", "lean"),
    )
    alerts = join_alerts([("boot", segment)])
    assert [(alert.rule, alert.from_utc_ns, alert.to_utc_ns) for alert in alerts] == [
        ("swing", utc(10), utc(30)),
        ("lean", utc(20), utc(40)),
    ]


def test_two_rules_that_clear_at_one_time_are_both_cleared() -> None:
    swing, lean = active("swing", "warn", 10, 4.5, "b-1"), active("lean", "trip", 10, 8.0, "b-2")
    segment = summary(
        state(10, "raised", "swing", swing, lean, incident="b-1"),
        state(10, "raised", "lean", swing, lean, incident="b-2"),
        state(30, "cleared", "swing", incident="b-1"),
        state(30, "cleared", "lean", incident="b-2", largest_deg=8.5),
    )
    alerts = join_alerts([("boot", segment)])
    assert [(alert.rule, alert.ended, alert.to_utc_ns) for alert in alerts] == [
        ("swing", "cleared", utc(30)),
        ("lean", "cleared", utc(30)),
    ]
    assert alerts[1].largest_deg == 8.5


def test_restart_of_the_gateway_ends_an_alert() -> None:
    trip = active("swing", "trip", 50, 7.0)
    first, second = summary(state(50, "raised", "swing", trip), to_s=60), summary(state(90, "raised", "swing", trip))
    alerts = join_alerts([("boot", first), ("another", second)])
    assert [alert.ended for alert in alerts] == ["gateway ended", "standing"]


def test_another_incident_after_a_gap_is_another_alert() -> None:
    first = summary(state(50, "raised", "swing", active("swing", "trip", 50, 7.0, "boot-1")))
    later = summary(state(900, "standing", None, active("swing", "trip", 880, 7.5, "boot-4")))
    alerts = join_alerts([("boot", first), ("boot", later)])
    assert [(alert.incident, alert.ended) for alert in alerts] == [("boot-1", "not recorded"), ("boot-4", "standing")]


@pytest.mark.parametrize(("incident", "expected"), [(None, 2), ("boot-1", 1)])
def test_suspension_ends_an_alert_unless_its_incident_goes_on(incident: str | None, expected: int) -> None:
    level: Literal["trip"] = "trip"
    segment = summary(
        state(10, "raised", "swing", active("swing", level, 10, 7.0, incident)),
        state(20, "changed", "swing", active("swing", "unknown", 20, None, incident)),
        state(50, "raised", "swing", active("swing", level, 50, 7.0, incident)),
    )
    assert len(join_alerts([("boot", segment)])) == expected


def test_time_without_a_statement_is_added_up() -> None:
    segment = summary(
        state(0, "standing", None, active("swing", "unknown", 0, None)),
        state(4, "cleared", "swing"),
        state(90, "changed", "swing", active("swing", "unknown", 90, None)),
        to_s=100,
    )
    assert unknown_s([segment, segment]) == pytest.approx(28.0)


def test_an_alert_has_its_acknowledgement_also_one_that_came_after_its_end() -> None:
    swing = active("swing", "trip", 10, 7.5, "b-1")
    segment = summary(
        state(10, "raised", "swing", swing, incident="b-1"),
        state(40, "cleared", "swing", incident="b-1"),
        state(50, "acknowledged", "swing", incident="b-1", acknowledged_by="ann"),
    )
    (alert,) = join_alerts([("boot", segment)])
    assert (alert.ended, alert.to_utc_ns) == ("cleared", utc(40))
    assert (alert.acknowledged_by, alert.acknowledged_utc_ns) == ("ann", utc(50))


@pytest.mark.slow
def test_an_incident_whose_alert_is_suspended_goes_on_in_later_segments(
    header: RecordingHeader, tmp_path: Path
) -> None:
    recorder = Recorder(
        tmp_path, header, segment_s=10, fsync_s=1.0, quota_mb=100.0, chain=SegmentChain(tmp_path, "a/b/c", None)
    )
    recorder.set_device(DEVICE, START_NS)
    recorder.start(START_NS)
    for second in range(35):
        now_ns = START_NS + second * SECOND_NS
        recorder.write(encode_message("samples", make_samples(second), now_ns))
        stands = stated.active("swing", "trip" if second < 5 else "unknown", "b-1")
        told = stated.alert("standing", None, stands)
        if second == 0:
            told = stated.alert("raised", "swing", stands, incident="b-1")
        recorder.write(encode_message("alert", told, now_ns))
        recorder.tick(now_ns)
    recorder.close()
    assert len(list(tmp_path.glob("*.mcap"))) > 2
    (found,) = read_incidents(open_timeline([tmp_path]))
    assert (found.id, found.last_ns) == ("b-1", START_NS + 34 * SECOND_NS)
