"""The incidents in messages of alerts: they have ids or none, and may be raised before the recordings begin."""

from dataclasses import replace
from pathlib import Path

import pytest

from gateway.incident.incident_selection import STANDING, find_incidents, read_incidents
from gateway.pipeline.outgoing_message import encode_message
from gateway.recording.reading.timeline import open_timeline
from gateway.recording.segments.recorder import Recorder
from tests.gateway.conftest import make_samples
from tests.gateway.incident.stated import ORIGIN_NS, active, alert
from tests.gateway.recording.conftest import HEADER, AlertEvent, make_alert


def test_changes_are_joined_by_their_id_and_numbered_in_order_of_time() -> None:
    swing, lean = active("swing", "trip", "b-1"), active("lean", "trip", "b-2")
    first, second = find_incidents(
        [
            (10, alert("raised", "swing", swing, incident="b-1")),
            (20, alert("raised", "lean", swing, lean, incident="b-2")),
            (30, alert("standing", None, swing, lean)),
            (40, alert("cleared", "swing", lean, incident="b-1")),
        ]
    )
    assert (first.number, first.id, first.rule, first.raised_ns, first.cleared_ns) == (1, "b-1", "swing", 10, 40)
    assert (second.number, second.id, second.rule, second.raised_ns, second.cleared_ns) == (2, "b-2", "lean", 20, None)


def test_the_highest_change_is_the_first_one_at_the_highest_level() -> None:
    (found,) = find_incidents(
        [
            (10, alert("raised", "swing", active("swing", "warn", "b-1"), incident="b-1")),
            (20, alert("raised", "swing", active("swing", "trip", "b-1"), incident="b-1")),
            (30, alert("changed", "swing", active("swing", "warn", "b-1"), incident="b-1")),
            (40, alert("cleared", "swing", incident="b-1")),
        ]
    )
    assert (found.level, found.highest.time_ns, found.highest.limit_deg) == ("trip", 20, 6.0)


def test_an_incident_that_is_unknown_in_the_recordings_is_not_normal() -> None:
    (found,) = find_incidents(
        [
            (10, alert("acknowledged", "swing", incident="b-1")),
            (20, alert("changed", "swing", active("swing", "unknown", "b-1"), incident="b-1")),
            (30, alert("cleared", "swing", incident="b-1")),
        ]
    )
    assert (found.level, found.highest.time_ns) == ("unknown", 20)


def test_an_alert_that_stands_when_the_recordings_begin_is_an_incident() -> None:
    standing = active("swing", "trip", "b-7")
    (found,) = find_incidents(
        [(10, alert("standing", None, standing)), (20, alert("cleared", "swing", incident="b-7"))]
    )
    assert [change.event for change in found.changes] == [STANDING, "cleared"]
    assert (found.level, found.highest.limit_deg) == ("trip", 6.0)


def test_an_incident_without_an_end_stood_until_its_last_message() -> None:
    standing = active("swing", "trip", "b-1")
    first, second = find_incidents(
        [
            (10, alert("raised", "swing", standing, incident="b-1")),
            (20, alert("standing", None, standing)),
            (99, alert("raised", "swing", active("swing", "trip", "c-1"), incident="c-1")),  # after a restart
        ]
    )
    assert (first.cleared_ns, first.last_ns) == (None, 20)
    assert second.raised_ns == 99


def test_changes_without_an_incident_are_none() -> None:
    assert find_incidents([(10, alert("changed", "swing")), (20, alert("standing", None))]) == []


def test_old_recordings_without_ids_are_joined_by_rule() -> None:
    trip = active("swing", "trip", None)
    first, second = find_incidents(
        [
            (10, alert("raised", "swing", trip)),
            (20, alert("cleared", "swing")),
            (30, alert("changed", "swing")),
            (40, alert("raised", "swing", trip)),
        ]
    )
    assert (first.raised_ns, first.cleared_ns) == (10, 20)
    assert (second.raised_ns, second.cleared_ns) == (40, None)


def test_an_acknowledgement_after_the_end_changes_neither_the_end_nor_the_level() -> None:
    known = replace(alert("acknowledged", "swing", incident="b-1"), acknowledged_by="ann", reason="load set down")
    found, _ = find_incidents(
        [
            (10, alert("raised", "swing", active("swing", "warn", "b-1"), incident="b-1")),
            (40, alert("cleared", "swing", incident="b-1")),
            (8000, alert("raised", "swing", active("swing", "trip", "b-2"), incident="b-2")),
            (9000, replace(known, active=[active("swing", "trip", "b-2")])),
        ]
    )
    assert (found.cleared_ns, found.last_ns, found.level) == (40, 40, "warn")
    assert [(each.time_ns, each.acknowledged_by) for each in found.acknowledgements] == [(9000, "ann")]


@pytest.mark.parametrize(
    ("last", "said"),
    [(1, []), (2, ["change 2 of alerts is missing"]), (3, ["changes 2 to 3 of alerts are missing"])],
)
def test_changes_of_alerts_that_are_missing_in_a_recording_are_told(tmp_path: Path, last: int, said: list[str]) -> None:
    """The first heartbeat after them has the number of the last change."""
    recorder = Recorder(tmp_path, HEADER, segment_s=600.0, fsync_s=1.0, quota_mb=100.0)
    recorder.start(ORIGIN_NS)
    recorder.write(encode_message("samples", make_samples(), ORIGIN_NS))
    told: list[tuple[AlertEvent, str | None, int]] = [
        ("standing", None, 0),
        ("raised", "swing", 1),
        ("standing", None, last),
    ]
    for second, (event, rule, number) in enumerate([*told, told[-1]]):
        stated = replace(make_alert(event), alert_number=number, rule=rule)
        recorder.write(encode_message("alert", stated, ORIGIN_NS + second * 10**9))
    recorder.close()
    hidden: list[str] = []
    read_incidents(open_timeline([tmp_path]), hidden=hidden)
    assert [each.partition(": ")[2].partition(" before ")[0] for each in hidden] == said
