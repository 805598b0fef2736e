"""The messages of tilt, motion and swing, and of the condition: whether the reading can be trusted."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from gateway.messages.header import CalibrationStatus, Degrees, Interval, Message, Seconds, Vector

MotionState = Literal["rest", "free", "driven", "hoisting", "wind", "unknown"]
"""What crane and load do: the load rests or swings freely, the pivot accelerates, the rope's length changes, a gust pushes the
load; unknown: the angle is not known."""


HorizontalVector = Annotated[
    list[float], Field(min_length=2, max_length=2, description="x, y across the rope, in the housing frame")
]


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
    wind: Annotated[float, Field(description="a gust pushes the load, and the pivot rests")]
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
        float | None, Field(description="largest angle of the next whole swing if pivot and gust go on as now")
    ] = None
    predicted_u_deg: Degrees | None = None
    time_to_peak_s: Seconds | None = None
    coasting_phi_max_deg: Annotated[float | None, Field(description="the same if both end now")] = None
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
    reason_codes: Annotated[
        list[str] | None,
        Field(description="the kind of each of `reasons`; null: there are none, or the message is older"),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Formulas:
    """The four formulas for phi_max over one swing (Łuczak et al. 2022, eq. 22 to 25); validity: docs/evidence/swing.md."""

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
    predicted_phi_max_deg: Annotated[
        float | None,
        Field(
            description="expected next maximum: halfway between a pivot that keeps its acceleration and one that coasts"
        ),
    ] = None
    predicted_u_deg: Degrees | None = None
    time_to_peak_s: Seconds | None = None
    formulas_deg: Formulas
    reasons: Annotated[list[str], Field(description="why a number is missing or its uncertainty is enlarged")]


Verdict = Literal["static", "quasi_static", "swinging", "driven", "disturbed", "unknown"]


Cause = Literal["hoisting", "trolley", "wind", "impact", "clipped", "vibration"]


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
    reason_codes: Annotated[
        list[str] | None,
        Field(description="the kind of each of `reasons`; null: there are none, or the message is older"),
    ] = None
