"""The messages that the pipeline emits and that are recorded, published and displayed. Angles in degrees, accelerations in g.

A number that could not be computed is null on the bus and left out in recordings, and `reasons` state why; a field that is left
out reads as null. The JSON Schemas in recordings and in the output of `plumbline config schema --topic` are generated from these
classes. `docs/messages.md` states the rules for their versions.
"""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, WithJsonSchema

SCHEMA_VERSION: Literal[1] = 1
"""Version of every message and JSON output: raised when a field is removed, renamed or changes its meaning."""

Verdict = Literal["static", "quasi_static", "swinging", "driven", "disturbed", "unknown"]
Cause = Literal["hoisting", "trolley", "wind", "impact", "clipped", "vibration"]
MotionState = Literal["rest", "free", "driven", "hoisting", "wind", "unknown"]
"""What crane and load do: the load rests or swings freely, the pivot accelerates, the rope's length changes, a gust pushes the
load; unknown: the angle is not known."""
Level = Literal["normal", "warn", "trip", "unknown"]
ClockQuality = Literal["synchronised", "free_running", "replayed"]
CalibrationStatus = Literal["calibrated", "factory", "as_recorded", "uncalibrated"]
SessionPhase = Literal["idle", "collecting", "review", "committed", "rejected"]

Degrees = Annotated[float, Field(description="degrees")]
Seconds = Annotated[float, Field(description="seconds")]
Vector = Annotated[list[float], Field(min_length=3, max_length=3, description="x, y, z in the housing frame")]
Readings = Annotated[
    list[int] | list[float],  # counts are written as whole numbers
    WithJsonSchema({"type": "array", "items": {"type": "number"}}),
]
Interval = Annotated[list[float], Field(min_length=2, max_length=2, description="[low, high]")]
HorizontalVector = Annotated[
    list[float], Field(min_length=2, max_length=2, description="x, y across the rope, in the housing frame")
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """The header of every message."""

    schema_version: Annotated[Literal[1], Field(description="version of the message's fields")] = SCHEMA_VERSION
    time_ns: Annotated[int, Field(description="UTC of the (newest) sample that the message describes, ns since 1970")]
    clock: ClockQuality
    sequence: Annotated[int, Field(description="number of the message within its topic since start, from 0")]
    calibration_id: Annotated[str | None, Field(description="the calibration record in force; null: none")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples(Message):
    """One block of raw samples, from which every other message can be computed again."""

    first_log_time_ns: Annotated[
        int, Field(description="gateway time of the first sample (monotonic, anchored to UTC at start)")
    ]
    period_ns: Annotated[
        float | None, Field(description="sample i is at first + round(i * period); null: see offsets_ns")
    ] = None
    offsets_ns: Annotated[
        list[int] | None,
        Field(description="times of the samples after the first, from the first; null where they are even"),
    ] = None
    unit: Literal["counts", "g"]
    packing: Annotated[
        Literal["difference", "plain"],
        Field(
            description="difference: the first entry is a value, each other entry the difference from the one before"
        ),
    ]
    x: Readings
    y: Readings
    z: Readings
    temperature_c: float | None = None
    lost: Annotated[int, Field(description="samples missing immediately before this block")]
    invalid: Annotated[int, Field(description="samples that arrived and could not be used")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Acceleration(Message):
    """The specific force in the housing frame, g: mean, smallest and largest reading of each axis since the message before.

    Impacts and vibration show in the extremes at any rate of the samples.
    """

    x_g: Annotated[float | None, Field(description="mean; +1 g on the axis that points up at rest")] = None
    y_g: float | None = None
    z_g: float | None = None
    x_min_g: float | None = None
    x_max_g: float | None = None
    y_min_g: float | None = None
    y_max_g: float | None = None
    z_min_g: float | None = None
    z_max_g: float | None = None
    u_g: Annotated[
        float | None, Field(description="standard uncertainty of the calibration, of the axis with the largest one")
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Tilt(Message):
    """The low-passed static tilt, valid for the newest sample's time minus the filter's delay."""

    pitch_deg: Degrees | None = None
    roll_deg: Degrees | None = None
    axial_deg: Annotated[
        float | None, Field(description="angle between the housing's z axis and the vertical, degrees")
    ] = None
    u_deg: Annotated[float | None, Field(description="standard uncertainty of the axial tilt")] = None
    direction_deg: Annotated[
        float | None, Field(description="azimuth of the rope's lean in the housing frame, from x towards y")
    ] = None
    specific_force_g: Vector | None = None
    temperature_c: float | None = None
    delay_s: Annotated[float, Field(description="group delay of the low-pass filter: the age of the tilt")]
    trusted: Annotated[bool, Field(description="whether the condition allows a static tilt to be read")]


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionProbabilities:
    """Probabilities of what acts. free + driven + wind = 1; hoisting goes with any of them and is a probability of its own."""

    free: Annotated[float, Field(description="nothing acts on the pivot, and no gust on the load")]
    driven: Annotated[float, Field(description="the pivot accelerates")]
    wind: Annotated[float, Field(description="a gust pushes the load")]
    hoisting: Annotated[float, Field(description="the rope's length changes, whatever else acts")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion(Message):
    """The rope's motion at the time of the message; every u is a standard uncertainty."""

    state: MotionState
    angle_deg: Annotated[float | None, Field(description="angle between rope and vertical; null: not known")] = None
    u_deg: Annotated[float | None, Field(description="standard uncertainty of the angle; null where the angle is")] = (
        None
    )
    azimuth_deg: Annotated[
        float | None,
        Field(description="side to which the load hangs, in the housing frame from x towards y, -180..180"),
    ] = None
    rate_deg_s: Annotated[float | None, Field(description="time derivative of the angle, degrees per second")] = None
    pivot_accel_m_s2: Annotated[
        HorizontalVector | None, Field(description="horizontal acceleration of the pivot: trolley, bridge or jib")
    ] = None
    pivot_accel_u_m_s2: Annotated[float | None, Field(description="of each component")] = None
    hoist_m_s: Annotated[float | None, Field(description="rate of the rope's length, lowering positive, m/s")] = None
    hoist_u_m_s: float | None = None
    length_m: Annotated[float | None, Field(description="pivot to the load's centre")] = None
    length_u_m: float | None = None
    phi_max_deg: Annotated[float | None, Field(description="largest angle of the last period")] = None
    phi_max_u_deg: Degrees | None = None
    predicted_phi_max_deg: Annotated[
        float | None, Field(description="next maximum of the angle if the pivot keeps its present acceleration")
    ] = None
    predicted_u_deg: Degrees | None = None
    time_to_peak_s: Seconds | None = None
    coasting_phi_max_deg: Annotated[
        float | None, Field(description="next maximum of the angle if the pivot's acceleration ends now")
    ] = None
    coasting_u_deg: Degrees | None = None
    coasting_time_to_peak_s: Seconds | None = None
    lean_deg: Annotated[float | None, Field(description="steady angle of the rope, about which the load swings")] = None
    lean_u_deg: Degrees | None = None
    probabilities: MotionProbabilities | None = None
    fast_oscillation_hz: Annotated[
        float | None,
        Field(
            description="frequency of a fast oscillation on top of the swing, such as a load under its hook; null: none"
        ),
    ] = None
    fast_oscillation_deg: Annotated[float | None, Field(description="amplitude of its share in the rope's angle")] = (
        None
    )
    reasons: Annotated[list[str], Field(description="what acts, and why the angle is not known or is less certain")]
    text: Annotated[str, Field(description="one line for the operator; its interval is that of 95 %")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Formulas:
    """The four formulas for phi_max over one swing (Łuczak et al. 2022, eq. 22 to 25); docs/swing.md states their validity."""

    arccos_min_az: Degrees | None = None
    arcsin_max_axy: Degrees | None = None
    arctan_max_axy_min_az: Degrees | None = None
    arccos_max_az: Degrees | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing(Message):
    """The swing estimate with its uncertainty, and the four published formulas."""

    swinging: Annotated[
        bool | None, Field(description="false: no swing detected, phi_max is below its upper limit; null: unknown")
    ] = None
    phi_max_deg: Annotated[
        float | None, Field(description="largest angle between rope and vertical over the last swing")
    ] = None
    u_deg: Annotated[float | None, Field(description="standard uncertainty; null: cannot be computed")] = None
    coverage95_deg: Interval | None = None
    minor_phi_max_deg: Degrees | None = None
    azimuth_deg: Annotated[
        float | None, Field(description="direction of the swing's major axis in the housing frame, -90..90")
    ] = None
    lean_deg: Degrees | None = None
    lean_azimuth_deg: Degrees | None = None
    period_s: Seconds | None = None
    predicted_phi_max_deg: Annotated[float | None, Field(description="predicted maximum of the current half swing")] = (
        None
    )
    predicted_u_deg: Degrees | None = None
    time_to_peak_s: Seconds | None = None
    formulas_deg: Formulas
    reasons: Annotated[list[str], Field(description="why a number is missing or its uncertainty is enlarged")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition(Message):
    """Whether the reading can be trusted."""

    verdict: Annotated[Verdict, Field(description="driven: the crane works or a gust pushes, and the angle is known")]
    cause: Annotated[
        Cause | None, Field(description="what drives or disturbs the load; null: nothing, or not known")
    ] = None
    trusted: bool
    reasons: list[str]
    gates: Annotated[dict[str, bool], Field(description="the gates by name; true: passed")]
    norm_g: Annotated[float | None, Field(description="magnitude of the low-passed specific force")] = None
    permissible_norm_error_g: Annotated[
        float | None, Field(description="prediction interval dm (Łuczak n.d., eq. 14)")
    ] = None
    calibration: CalibrationStatus
    text: Annotated[
        str | None, Field(description="one line for the operator; null in recordings made before the field existed")
    ] = None


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
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Alert(Message):
    """The state of the alerts, sent at each change and as a heartbeat."""

    level: Annotated[
        Level,
        Field(description="the highest active level; unknown: no statement is possible, which does not mean safe"),
    ]
    event: Annotated[
        Literal["raised", "changed", "corrected", "cleared", "standing"],
        Field(description="corrected: the first value was an upper bound, and the limit was not reached"),
    ]
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
    change: Annotated[str | None, Field(description="one line on the change; null for a heartbeat")] = None
    active: list[ActiveAlert]
    text: Annotated[str, Field(description="one line for the operator")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Health(Message):
    """The state of the gateway itself."""

    state: Literal["starting", "running", "recovering", "stopping"]
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
    dropped: Annotated[dict[str, int], Field(description="items dropped by each bounded queue")]
    recording: str | None = None
    recording_error: str | None = None
    disk_free_mb: float | None = None
    cpu_percent: float | None = None
    resident_mb: float | None = None
    drift: Annotated[
        dict[str, Any] | None,
        Field(description="drift of the record in force by readings at rest; null or state no_rest: not known yet"),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionPose:
    """One pose that was taken."""

    face: Annotated[str | None, Field(description="sensor axis that pointed up; null: no axis near the vertical")] = (
        None
    )
    count: int
    used: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSession:
    """The state of a recalibration; faces and directions are in the sensor's axes."""

    id: Annotated[str, Field(description="id of the request that started the session; empty before the first session")]
    phase: SessionPhase
    method: str
    by: Annotated[str, Field(description="who sent the request, as stated in it")]
    poses: list[SessionPose]
    wanted: Annotated[int, Field(description="smallest number of poses needed")]
    still: Annotated[bool, Field(description="whether the housing is at rest")]
    pose_fraction: Annotated[float, Field(description="progress of the current pose, 0 to 1")]
    seconds_left: Annotated[
        float | None, Field(description="seconds until the current pose is complete; null while the housing moves")
    ] = None
    next_face: Annotated[
        str | None, Field(description="sensor axis that should point up next; null: see next_direction")
    ] = None
    next_direction: Annotated[
        list[float] | None,
        Field(description="direction in the sensor's axes that should point up next; null: complete"),
    ] = None
    record_id: Annotated[str | None, Field(description="id of the new record, from the review on")] = None
    reasons: Annotated[list[str], Field(description="why the record may not be committed, or only with a reason")]
    committable: Annotated[
        bool, Field(description="whether the record in review may be committed; `reasons` state if that needs a reason")
    ] = False
    suspended: Annotated[bool, Field(description="alerts are suspended, because no reading describes the load")]
    notes: Annotated[list[str], Field(description="change since the previous record, warnings of the fit")]
    text: Annotated[str, Field(description="one line: what to do now, or how the session ended")]


NO_SESSION = CalibrationSession(
    id="",
    phase="idle",
    method="",
    by="",
    poses=[],
    wanted=0,
    still=False,
    pose_fraction=0.0,
    seconds_left=None,
    next_face=None,
    next_direction=None,
    record_id=None,
    reasons=[],
    suspended=False,
    notes=[],
    text="",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration(Message):
    """The calibration in force."""

    status: CalibrationStatus
    device_id: str
    record: Annotated[dict[str, Any], Field(description="the calibration record; empty where there is none")]
    in_force: Annotated[
        dict[str, Any],
        Field(
            description="specific_force_g = gain_g_per_unit @ raw + bias_g, in the housing frame; where the record has a thermal "
            "model, raw is first brought to its reference temperature"
        ),
    ]
    text: str
    session: CalibrationSession = NO_SESSION


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark(Message):
    """A mark that a person set in the recording; the time around it is kept like that around an alert."""

    id: Annotated[str, Field(description="id of the request")]
    by: Annotated[str, Field(description="who set it, as stated in the request")]
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockOffset(Message):
    """The offset of the wall clock from gateway time, which never steps."""

    log_time_ns: int
    wall_offset_ns: Annotated[int, Field(description="UTC of the wall clock minus gateway time")]
    stepped: Annotated[
        bool, Field(description="whether the wall clock has stepped by more than 0.5 s since the last message")
    ]


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
