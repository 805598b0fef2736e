"""The message of the condition: whether the reading can be trusted."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from gateway.messages.header import CalibrationStatus, Message

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
