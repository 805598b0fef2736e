"""The messages: what leaves the pipeline, is recorded, published and shown. Degrees and g at this edge, always suffixed.

Every number that could not be computed is null, never a stand-in; `reasons` say why. The JSON Schemas that recordings and
`plumbline config schema --messages` carry are made from these classes.
"""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, WithJsonSchema

Verdict = Literal["static", "quasi_static", "swinging", "disturbed", "unknown"]
Cause = Literal["hoisting", "trolley", "impact", "clipped", "vibration"]
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """What every message carries."""

    time_ns: Annotated[int, Field(description="UTC of the (newest) sample that this speaks of, ns since 1970")]
    clock: ClockQuality
    sequence: Annotated[int, Field(description="counts the messages of this topic since start, from 0")]
    calibration_id: Annotated[str | None, Field(description="the calibration record that made the numbers; null: none")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples(Message):
    """One block of raw samples: everything else can be computed again from these."""

    first_log_time_ns: Annotated[
        int, Field(description="gateway time of the first sample (monotonic, anchored to UTC at start)")
    ]
    period_ns: Annotated[float | None, Field(description="sample i is at first + round(i * period); null: see offsets")]
    offsets_ns: Annotated[
        list[int] | None, Field(description="time of each sample after the first, where they are uneven")
    ]
    unit: Literal["counts", "g"]
    packing: Annotated[
        Literal["difference", "plain"],
        Field(description="difference: the first entry is a value, each other one the change from its predecessor"),
    ]
    x: Readings
    y: Readings
    z: Readings
    temperature_c: float | None
    lost: Annotated[int, Field(description="samples missing just before this block")]
    invalid: Annotated[int, Field(description="samples that came and could not be used")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tilt(Message):
    """The low-passed static tilt, at the newest sample less the filter's delay."""

    pitch_deg: Degrees | None
    roll_deg: Degrees | None
    axial_deg: Annotated[
        float | None, Field(description="angle between the housing's z axis and the vertical, degrees")
    ]
    u_deg: Annotated[float | None, Field(description="standard uncertainty of the axial tilt")]
    direction_deg: Annotated[
        float | None, Field(description="azimuth in the housing frame that the rope leans to, from x to y")
    ]
    specific_force_g: Vector | None
    temperature_c: float | None
    delay_s: Annotated[float, Field(description="group delay of the low-pass: this is how old the tilt is")]
    trusted: Annotated[bool, Field(description="the condition allows a static tilt to be read")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Formulas:
    """The four published phi_max formulas (000 eq. 22-25) over one swing, as printed; see the docs for where each holds."""

    arccos_min_az: Degrees | None
    arcsin_max_axy: Degrees | None
    arctan_max_axy_min_az: Degrees | None
    arccos_max_az: Degrees | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing(Message):
    """How far the load swings: the estimate with its uncertainty, and the four published formulas."""

    swinging: Annotated[
        bool | None, Field(description="false: no swing seen, phi_max is below its upper bound; null: unknown")
    ]
    phi_max_deg: Annotated[
        float | None, Field(description="largest angle between rope and vertical over the last swing")
    ]
    u_deg: Annotated[float | None, Field(description="standard uncertainty; null: cannot be computed")]
    coverage95_deg: Interval | None
    minor_phi_max_deg: Degrees | None
    azimuth_deg: Annotated[
        float | None, Field(description="direction of the swing's major axis in the housing frame, -90..90")
    ]
    lean_deg: Degrees | None
    lean_azimuth_deg: Degrees | None
    period_s: Seconds | None
    predicted_phi_max_deg: Annotated[float | None, Field(description="the coming maximum, from the motion so far")]
    predicted_u_deg: Degrees | None
    time_to_peak_s: Seconds | None
    formulas_deg: Formulas
    reasons: Annotated[list[str], Field(description="why a number is missing or widened")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition(Message):
    """Whether the reading can be trusted."""

    verdict: Verdict
    cause: Annotated[
        Cause | None, Field(description="what disturbs, or shakes a steady mean; null: nothing, or not known")
    ]
    trusted: bool
    reasons: list[str]
    gates: Annotated[dict[str, bool], Field(description="each named gate, true where it is met")]
    norm_g: Annotated[float | None, Field(description="magnitude of the low-passed specific force")]
    permissible_norm_error_g: Annotated[float | None, Field(description="dm of 001 eq. 14")]
    calibration: CalibrationStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class ActiveAlert:
    """One alert that stands."""

    rule: Annotated[str, Field(description="swing, lean, calibration")]
    level: Level
    since_ns: int
    value_deg: Degrees | None
    limit_deg: Degrees | None
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Alert(Message):
    """The standing alert state; sent at each change and as a heartbeat."""

    level: Annotated[
        Level, Field(description="the worst that stands; unknown: nothing can be said, which is not 'safe'")
    ]
    event: Literal["raised", "changed", "cleared", "standing"]
    rule: Annotated[str | None, Field(description="the rule whose change this is; null for a heartbeat")]
    active: list[ActiveAlert]
    text: Annotated[str, Field(description="one line for the operator")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Health(Message):
    """How the gateway itself is."""

    state: Literal["starting", "running", "recovering", "stopping"]
    device_id: str | None
    device_kind: str
    boot_id: str
    software: str
    uptime_s: float
    measured_rate_hz: float | None
    samples: int
    lost: int
    invalid: int
    faults: Annotated[dict[str, int], Field(description="survived faults by name since start")]
    dropped: Annotated[dict[str, int], Field(description="messages dropped by each bounded queue")]
    recording: str | None
    recording_error: str | None
    disk_free_mb: float | None
    cpu_percent: float | None
    resident_mb: float | None
    drift: Annotated[
        dict[str, Any] | None,
        Field(description="what readings at rest say of the record in force; null, state no_rest: not watched yet"),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionPose:
    """One pose that was taken."""

    face: Annotated[str | None, Field(description="sensor axis that pointed up; null: none near the vertical")]
    count: int
    used: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSession:
    """How a recalibration stands; faces and directions are in the sensor's axes."""

    id: Annotated[str, Field(description="of the request that began it; empty before the first one")]
    phase: SessionPhase
    method: str
    by: Annotated[str, Field(description="who asked, as said in the request")]
    poses: list[SessionPose]
    wanted: Annotated[int, Field(description="poses needed at least")]
    still: Annotated[bool, Field(description="the housing is at rest now")]
    pose_fraction: Annotated[float, Field(description="of the pose that is being taken, 0 to 1")]
    seconds_left: Annotated[float | None, Field(description="until that pose is taken; null while it moves")]
    next_face: Annotated[
        str | None, Field(description="sensor axis that should point up next; null: see next_direction")
    ]
    next_direction: Annotated[
        list[float] | None, Field(description="where up should point next in the sensor's axes; null: complete")
    ]
    record_id: Annotated[str | None, Field(description="the new record, from review on")]
    reasons: Annotated[list[str], Field(description="why it may not be committed, or not without a reason")]
    suspended: Annotated[bool, Field(description="nothing that is measured speaks of the load; alerts are suspended")]
    notes: Annotated[list[str], Field(description="drift since the record before, warnings of the fit")]
    text: Annotated[str, Field(description="one line: what to do now, or how it ended")]


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
    """Which calibration makes the numbers."""

    status: CalibrationStatus
    device_id: str
    record: Annotated[dict[str, Any], Field(description="the calibration record; empty where there is none")]
    in_force: Annotated[
        dict[str, Any], Field(description="specific_force_g = gain_g_per_unit @ raw + bias_g, in the housing frame")
    ]
    text: str
    session: CalibrationSession = NO_SESSION


@dataclass(frozen=True, slots=True, kw_only=True)
class Clock(Message):
    """How gateway time, which never jumps, stands to the wall clock."""

    log_time_ns: int
    wall_offset_ns: Annotated[int, Field(description="UTC by the wall clock minus gateway time")]
    stepped: Annotated[bool, Field(description="the wall clock jumped by more than 0.5 s since the last message")]


@dataclass(frozen=True, slots=True, kw_only=True)
class FoxgloveTime:
    """Time as `foxglove.Log` wants it."""

    sec: int
    nsec: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """`foxglove.Log`."""

    timestamp: FoxgloveTime
    level: Annotated[int, Field(description="1 debug, 2 info, 3 warning, 4 error, 5 fatal")]
    message: str
    name: str
    file: str = ""
    line: int = 0
