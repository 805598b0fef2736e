"""What was raised before a start of the gateway waits for an acknowledgement still."""

import math
from collections.abc import Iterable
from dataclasses import replace

import pytest

from gateway.alert_periods import MAX_ENDED_INCIDENTS, SHIFT_NS
from gateway.messages import Alert
from gateway.pipeline.incidents import IncidentRegister, unacknowledged_incidents
from tests.gateway.incident.stated import active, alert

S = 10**9


def stored(*runs: tuple[str, Iterable[tuple[float, Alert]]]) -> list[Alert]:
    """Changes of runs, as the outbox has them."""
    return [
        replace(each, boot_id=boot_id, time_ns=round(time_s * S), alert_number=number)
        for boot_id, run in runs
        for number, (time_s, each) in enumerate(run, start=1)
    ]


RAISED = (1.0, alert("raised", "swing", active("swing", "trip", "a-1"), incident="a-1"))
CLEARED = (9.0, alert("cleared", "swing", incident="a-1"))
ACKNOWLEDGED = replace(alert("acknowledged", "swing", incident="a-1"), acknowledged_by="ann")
LATER = (20.0, alert("raised", "lean", active("lean", "trip", "b-1"), incident="b-1"))


@pytest.mark.parametrize(
    ("runs", "expected"),
    [
        ([("a", [RAISED])], ["a-1"]),  # it stood when the gateway ended
        ([("a", [RAISED, CLEARED])], ["a-1"]),
        ([("a", [RAISED, CLEARED, (12.0, ACKNOWLEDGED)])], []),
        ([("a", [RAISED, CLEARED]), ("b", [LATER])], ["a-1", "b-1"]),
        ([("a", [RAISED]), ("b", [LATER, (25.0, ACKNOWLEDGED)])], ["b-1"]),  # acknowledged in the run after it
        ([("a", [RAISED, CLEARED]), ("b", [(SHIFT_NS / S + 10, LATER[1])])], ["b-1"]),  # of an earlier shift
    ],
)
def test_what_nobody_acknowledged_before_the_start_waits(
    runs: list[tuple[str, list[tuple[float, Alert]]]], expected: list[str]
) -> None:
    register = IncidentRegister("c")
    register.remember(unacknowledged_incidents(stored(*runs)))
    assert list(register.unacknowledged()) == expected
    for incident_id in expected:
        assert math.isfinite(register.find(incident_id).limit_rad)  # type: ignore[union-attr]


def test_past_incidents_are_bounded_and_the_newest_stay() -> None:
    count = MAX_ENDED_INCIDENTS + 3
    run = [
        (float(i), alert("raised", "swing", active("swing", "trip", f"a-{i}"), incident=f"a-{i}")) for i in range(count)
    ]
    register = IncidentRegister("c")
    register.remember(unacknowledged_incidents(stored(("a", run))))
    assert list(register.unacknowledged()) == [f"a-{i}" for i in range(3, count)]
