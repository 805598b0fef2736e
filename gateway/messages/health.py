"""The messages of the gateway's own state, of a line of its log in the schema of Foxglove, and of a mark that a person sets."""

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import Field

from gateway.messages.header import Message


@dataclass(frozen=True, slots=True, kw_only=True)
class NewestStatement:
    """The newest segment about which the gateway has signed a final statement: who keeps it can prove a rewriting."""

    gateway: Annotated[str, Field(max_length=300, description="its key on the bus")]
    segment: Annotated[int, Field(ge=1, description="number of the segment")]
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$", description="hash of the statement")]
    public_key: Annotated[
        str, Field(pattern=r"^([0-9a-f]{64})?$", description="the key that has signed it; empty: not signed")
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationOffer:
    """A record in the gateway's store that waits for a person to put it in force."""

    record: Annotated[str, Field(description="its id")]
    text: Annotated[str, Field(description="what it is, and what it found")]


SOURCES = {"simulated": "SIMULATION", "replay": "REPLAY"}
"""What a reader is told of samples that no sensor takes now, by `device_kind`."""
HealthState = Literal["starting", "running", "recovering", "stopping"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Health(Message):
    """The state of the gateway itself."""

    state: HealthState
    device_id: str | None = None
    device_kind: str
    boot_id: str
    software: str
    uptime_s: float
    measured_rate_hz: float | None = None
    samples: int
    lost: int
    invalid: int
    faults: Annotated[dict[str, int], Field(description="faults since start that did not stop the gateway, by name")]
    standing_faults: Annotated[
        dict[str, str], Field(description="parts that do not work at present, with the reason")
    ] = field(default_factory=dict)
    dropped: Annotated[dict[str, int], Field(description="items dropped by each bounded queue")]
    certificate_days_left: Annotated[
        int | None, Field(description="days until the gateway's bus certificate expires; null: it has none")
    ] = None
    refused: Annotated[dict[str, int], Field(description="requests refused since start, by kind")] = field(
        default_factory=dict
    )
    changed_limits: Annotated[
        list[str] | None,
        Field(
            description="limits of the alerts that were changed over the bus and are not as they were at commissioning, a line "
            "each; null: an older gateway does not say"
        ),
    ] = None
    page: Annotated[
        str | None,
        Field(
            max_length=200,
            pattern=r"^https?://[^\s\"'<>]+$",
            description="address of the operator's page; null: not stated",
        ),
    ] = None
    recording: str | None = None
    recording_error: str | None = None
    newest_statement: Annotated[
        NewestStatement | None,
        Field(description="the newest signed statement about a recording; null: there is none yet"),
    ] = None
    disk_free_mb: float | None = None
    cpu_percent: float | None = None
    resident_mb: float | None = None
    alert_latency_ms: Annotated[
        dict[str, float] | None,
        Field(
            description="from the newest sample of a block to the sending of the change of an alert that follows from it, over "
            "the last hour: count, p50, p99, max; null: no change"
        ),
    ] = None
    drift: Annotated[
        dict[str, Any] | None,
        Field(description="drift of the record in force by readings at rest; null or state no_rest: not known yet"),
    ] = None
    offer: Annotated[
        CalibrationOffer | None,
        Field(description="a record that was made after the one in force, its parent; null: none waits"),
    ] = None
    battery_v: Annotated[
        float | None, Field(description="voltage of a wireless sensor's battery; null: not reported in the last 30 s")
    ] = None
    battery_percent: Annotated[float | None, Field(description="charge of the battery, as the sensor states it")] = None
    battery_low: Annotated[
        bool | None, Field(description="the battery is below the sensor's limit; null: not known")
    ] = None
    signal_dbm: Annotated[
        float | None, Field(description="received power of a wireless sensor; null: not reported in the last 30 s")
    ] = None
    relay: Annotated[
        Literal["energised", "released", "failed"] | None,
        Field(description="state of the relay; failed: it could not be switched; null: none is configured"),
    ] = None
    relay_reason: Annotated[str | None, Field(description="why the relay is released; null: it is not")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FoxgloveTime:
    """The time of a `foxglove.Log`."""

    sec: int
    nsec: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """A line of the log, in the schema `foxglove.Log`."""

    timestamp: FoxgloveTime
    level: Annotated[int, Field(description="1 debug, 2 info, 3 warning, 4 error, 5 fatal")]
    message: str
    name: str
    file: str = ""
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark(Message):
    """A mark that a person set in the recording; the time around it is kept like that around an alert."""

    id: Annotated[str, Field(description="id of the request")]
    by: Annotated[str, Field(description="who set it, as stated in the request")]
    text: str
    reason: Annotated[str, Field(description="as stated in the request; empty: none was")] = ""
