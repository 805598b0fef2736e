"""Whether a gateway could raise an alert now, by the last message of its alerts."""

import json

import pytest

from gateway.daemon.health import unable_to_alert


@pytest.mark.parametrize(
    ("validity", "swing", "problem"),
    [
        ("valid", None, None),
        ("valid", "trip", None),
        ("uncalibrated", "warn", None),
        ("uncalibrated", "unknown", "the angle is not known: why"),
        ("not_known", "trip", "the angle is not known: why"),
        ("suspended", "unknown", "alerts cannot be raised: why"),
        ("no_samples", "unknown", "alerts cannot be raised: why"),
    ],
)
def test_an_alert_can_be_raised_where_the_angle_is_known_and_alerts_are_not_suspended(
    validity: str, swing: str | None, problem: str | None
) -> None:
    active = [{"rule": "lean", "level": "unknown"}, *([] if swing is None else [{"rule": "swing", "level": swing}])]
    message = {"validity": validity, "active": active, "text": "why"}
    assert unable_to_alert(json.dumps(message).encode()) == problem


def test_before_the_first_message_nothing_is_known() -> None:
    assert unable_to_alert(None) == "no alert message yet"
