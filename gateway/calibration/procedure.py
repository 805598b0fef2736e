"""What every way of calibrating has in common: readings in, progress out, a fit at the end. Live and offline run the same."""

from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from gateway.calibration.record import Number

Array = NDArray[np.float64]
Face = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
"""The sensor axis that points up."""
OUTLIER = "outlier:"
"""A fit's warning that begins so names a reading that does not fit the others."""


@dataclass(frozen=True, slots=True)
class RawReadings:
    """Readings as they leave the device, in the sensor's axes."""

    time_s: Array
    """Shape (n,), rising."""
    raw: Array
    """Shape (n, 3), in the record's unit."""
    temperature_c: float | None = None


@dataclass(frozen=True, slots=True)
class Pose:
    """One resting pose: the mean of its readings."""

    mean: tuple[float, float, float]
    type_a: tuple[float, float, float]
    """Standard uncertainty of each mean (GUM 4.2)."""
    count: int
    face: Face | None
    """None where no axis is near the vertical."""
    used: bool = True
    temperature_c: float | None = None
    noise: tuple[float, float, float] | None = None
    """Standard deviation of a single reading; None: from `type_a` and `count`, as for independent readings."""
    step: float = 0.0
    """Smallest step of the readings, for their quantisation."""

    def as_json(self) -> dict[str, Any]:
        """As the record has it."""
        return {
            "mean": list(self.mean),
            "type_a": list(self.type_a),
            "count": self.count,
            "face": self.face,
            "used": self.used,
            "temperature_c": self.temperature_c,
            "noise": None if self.noise is None else list(self.noise),
            "step": self.step,
        }


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a procedure has come; what the rigger is shown."""

    poses: tuple[Pose, ...]
    wanted: int
    """Poses needed at least."""
    still: bool
    """The housing is at rest now."""
    pose_fraction: float
    """Of the readings of the pose that is being taken, 0 to 1."""
    seconds_left: float | None
    """Until that pose is taken; None while it moves."""
    next_face: Face | None
    """Which sensor axis should point up next; None: any, or complete."""
    next_direction: tuple[float, float, float] | None
    """Where up should point in the sensor's axes next, a unit vector; None: complete."""
    complete: bool
    text: str
    """One line for the rigger: what to do now, or what was wrong with the pose."""


@dataclass(frozen=True, slots=True)
class CalibrationFit:
    """What a procedure found: the record's content but for who, when and for which device."""

    method: str
    offset: tuple[Number, Number, Number]
    correction_matrix: Array
    """Shape (3, 3), g per unit."""
    covariance: Array
    """Shape (12, 12): matrix rows, then offset."""
    prediction_interval_g: float
    poses: tuple[Pose, ...]
    temperature_c: dict[str, Number] | None
    misalignment_deg: dict[str, list[float]]
    residual_rms_g: float
    condition_number: float
    budget: tuple[dict[str, Any], ...]
    """Rows of the GUM budget: source, type (A or B), u_g, u_deg."""
    warnings: tuple[str, ...]


class Procedure(Protocol):
    """One way of calibrating, fed as readings come."""

    @property
    def method(self) -> str:
        """`six-position` or `norm-fit`."""
        ...

    def feed(self, readings: RawReadings) -> None:
        """Take readings. Never raises for what the rigger does: that is said in the progress."""
        ...

    def progress(self) -> Progress:
        """How far it has come."""
        ...

    def resume(self, poses: tuple[Pose, ...]) -> None:
        """Go on from poses that were taken before a restart."""
        ...

    def finish(self) -> CalibrationFit:
        """The fit. Raises `CalibrationError` naming what the poses do not determine and the mend."""
        ...
