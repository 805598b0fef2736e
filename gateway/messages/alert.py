"""The message of the alerts."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from gateway.messages.header import Degrees, Message

Level = Literal["normal", "warn", "trip", "unknown"]
CALIBRATION_RULE = "calibration"
"""The rule of the drift monitor, the only one without a measured value; it has its own hold time."""
LEVEL_RANK: dict[Level, int] = {"normal": 0, "unknown": 1, "warn": 2, "trip": 3}
"""Unknown is worse than normal: nobody sees what happens. Definition: the order of the levels."""
AlertEventKind = Literal["raised", "changed", "corrected", "cleared", "acknowledged", "standing"]
"""corrected: the first value of an alert was an upper bound, and the angle stayed below the limit. acknowledged: by a person.
standing: nothing has changed, a heartbeat."""
Validity = Literal["valid", "no_samples", "suspended", "uncalibrated", "not_known"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ActiveAlert:
    """One alert that is active."""

    rule: Annotated[str, Field(description="swing, lean, calibration")]
    level: Level
    since_ns: int
    value_deg: Degrees | None = None
    limit_deg: Degrees | None = None
    clear_deg: Annotated[
        float | None,
        Field(description="the alert clears after the hold time below this level, degrees; null: no level"),
    ] = None
    ends_in_s: Annotated[
        float | None,
        Field(
            description="time until it ends or steps down if the angle stays as low as now; null: it is not low enough"
        ),
    ] = None
    next_level: Annotated[
        Level | None,
        Field(description="level that follows then: a trip becomes a warning first; null: from a drift watch"),
    ] = None
    next_below_deg: Annotated[
        float | None, Field(description="level below which the angle must stay for the hold time until then, degrees")
    ] = None
    expected_in_s: Annotated[
        float | None,
        Field(description="time until value_deg is reached: that of a coming peak, 0 for the present angle"),
    ] = None
    estimate_deg: Annotated[
        float | None, Field(description="best estimate of the angle of which value_deg is the upper end, degrees")
    ] = None
    is_bound: Annotated[
        bool | None,
        Field(description="value_deg is an upper bound: the best estimate of the present angle is below limit_deg"),
    ] = None
    incident: Annotated[str | None, Field(description="id from raised to cleared; null: no incident")] = None
    largest_deg: Annotated[
        float | None,
        Field(description="largest angle since the incident began, best estimate, degrees; no coming peak"),
    ] = None
    largest_upper_deg: Annotated[
        float | None, Field(description="largest upper end of its 95 % interval since the incident began, degrees")
    ] = None
    acknowledged_by: Annotated[str | None, Field(description="who acknowledged it; null: nobody yet")] = None
    acknowledged_ns: Annotated[int | None, Field(description="when, on the time scale of since_ns")] = None
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Alert(Message):
    """The state of the alerts, sent at each change and as a heartbeat."""

    level: Annotated[
        Level,
        Field(description="the highest active level; unknown: no statement is possible, which does not mean safe"),
    ]
    validity: Annotated[
        Validity | None,
        Field(
            description="whether the levels are known, and why not: no samples come, the housing is off the rope, the sensor "
            "has no calibration, or another reason, which is in the text; null: from an older gateway"
        ),
    ] = None
    event: Annotated[
        AlertEventKind,
        Field(
            description="corrected: the first value was an upper bound, and the limit was not reached; standing: a heartbeat"
        ),
    ]
    boot_id: Annotated[str | None, Field(description="id of the gateway's start")] = None
    alert_number: Annotated[
        int | None,
        Field(
            description="number of the change, which continues over restarts; in a heartbeat that of the last change"
        ),
    ] = None
    stored: Annotated[
        bool | None,
        Field(
            description="the change with this number was on the gateway's disk before it was sent; null: a recording"
        ),
    ] = None
    rule: Annotated[str | None, Field(description="the rule that has changed; null for a heartbeat")] = None
    incident: Annotated[
        str | None,
        Field(description="boot id and number of the incident that the change belongs to, from raised to cleared"),
    ] = None
    limit_deg: Annotated[float | None, Field(description="limit of the rule that has changed, degrees")] = None
    clear_deg: Annotated[float | None, Field(description="level below which that rule clears, degrees")] = None
    largest_deg: Annotated[
        float | None, Field(description="largest angle since the incident began, best estimate, degrees")
    ] = None
    largest_upper_deg: Annotated[
        float | None, Field(description="largest upper end of its 95 % interval since the incident began, degrees")
    ] = None
    acknowledged_by: Annotated[str | None, Field(description="who acknowledged the incident, in that change")] = None
    reason: Annotated[str | None, Field(description="what that person stated with it")] = None
    change: Annotated[str | None, Field(description="one line on the change; null for a heartbeat")] = None
    active: list[ActiveAlert]
    text: Annotated[str, Field(description="one line for the operator")]
