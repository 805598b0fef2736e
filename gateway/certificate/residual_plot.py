"""The residual plot: every pose against its own uncertainty and the record's prediction interval, as coordinates.

The area of a plot and the scales of its axes are those of every figure of a certificate; y points down.
"""

import math
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gateway.calibration.record import CalibrationRecord
from gateway.documents.figures import tick_step
from gateway.documents.format import format_short, printable_text

TICK_DIGITS = 6
"""Basis: a choice; the least half range of a scale is a millionth of its values."""
Three = tuple[float, float, float]
MAX_SHOWN_POSES = 160
"""Basis: a choice; neighbours touch at the figure's width."""
MAX_POSE_LABELS = 14
"""Basis: a choice; labels do not touch."""
BAND_SHOWN = 4.0
"""The prediction interval is drawn where it is at most so many times the residuals. Basis: else it would hide them."""
BEYOND_U = 3.0
"""A residual of more standard uncertainties is counted in the caption. Basis: a choice; 0.3 % by chance."""


@dataclass(frozen=True, slots=True)
class PlotArea:
    """The size of a figure, and the frame in it."""

    width: float = 380.0
    height: float = 190.0
    left: float = 44.0
    right: float = 372.0
    top: float = 10.0
    bottom: float = 160.0


AREA = PlotArea()
"""Area of every figure of a certificate."""


@dataclass(frozen=True, slots=True)
class Tick:
    """A tick of an axis."""

    place: float
    label: str
    is_zero: bool = False


@dataclass(frozen=True, slots=True)
class Scale:
    """A linear scale from values to coordinates."""

    centre: float
    half: float
    low_place: float
    high_place: float

    def place(self, value: float) -> float:
        """Return the coordinate of a value."""
        middle = (self.low_place + self.high_place) / 2
        return middle + (value - self.centre) / self.half * (self.high_place - self.low_place) / 2

    def ticks(self) -> tuple[Tick, ...]:
        """Return the ticks at round values, at most seven."""
        step = tick_step(self.half)
        first, last = math.ceil((self.centre - self.half) / step), math.floor((self.centre + self.half) / step)
        return tuple(
            Tick(self.place(count * step), format_short(count * step, TICK_DIGITS), count == 0)
            for count in range(first, last + 1)
        )


class _RecordedPose(BaseModel):
    """Fields of a pose that its residual needs."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)

    mean: Three
    type_a: Three = Field(default=(0.0, 0.0, 0.0))
    face: str | None = None
    used: bool = True


@dataclass(frozen=True, slots=True)
class PoseResidual:
    """Residual of one pose after the correction: |m| - 1 g, which is zero at rest in any attitude."""

    number: int
    """Number of the pose from 1, in the order of the record."""
    face: str | None
    used: bool
    residual_g: float
    u_g: float
    """Type A standard uncertainty of the pose's mean along its vertical."""

    @property
    def ratio(self) -> float:
        """Residual over uncertainty; infinite where none is stated."""
        return abs(self.residual_g) / self.u_g if self.u_g > 0 else math.inf


def residuals(record: CalibrationRecord) -> tuple[PoseResidual, ...]:
    """Return the residual of every pose that can be read; gravity is 1 g by definition."""
    matrix = np.array(record.correction_matrix, dtype=np.float64)
    offset = np.array(record.offset, dtype=np.float64)
    found = []
    for number, entry in enumerate(record.poses, 1):
        try:
            pose = _RecordedPose.model_validate(entry)
        except ValidationError:
            continue  # the certificate counts the poses that are not shown
        corrected_g = matrix @ (np.array(pose.mean) - offset)
        norm_g = float(np.linalg.norm(corrected_g))
        if not 0 < norm_g < math.inf:
            continue
        u_g = float(np.linalg.norm(corrected_g / norm_g @ matrix * pose.type_a))
        if not math.isfinite(u_g):
            continue
        found.append(PoseResidual(number, pose.face, pose.used, norm_g - 1, u_g))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class PoseMark:
    """A pose in the plot: a circle with a bar of ± 2 u."""

    number: int
    used: bool
    x: float
    y: float
    bar_top: float
    bar_bottom: float
    title: str


@dataclass(frozen=True, slots=True)
class ResidualPlot:
    """All coordinates of the plot."""

    ticks: tuple[Tick, ...]
    pose_labels: tuple[Tick, ...]
    poses: tuple[PoseMark, ...]
    prediction_interval: tuple[float, ...]
    """Heights of its two lines, the upper one first; empty where it lies outside the plot."""
    prediction_interval_mg: str
    has_faces: bool
    area: PlotArea = AREA


@dataclass(frozen=True, slots=True)
class PoseResiduals:
    """The residuals of the poses together, with their plot."""

    plot: ResidualPlot
    rms_g: float | None
    """Of the poses that the fit used; None where it used none that can be shown."""
    used: int
    beyond_3u: int
    hidden: int
    """Poses that cannot be shown."""


def pose_residuals(record: CalibrationRecord) -> PoseResiduals | None:
    """Return the residuals of a record; None where it holds no pose that can be shown."""
    found = residuals(record)[:MAX_SHOWN_POSES]
    if not found:
        return None
    used = [residual for residual in found if residual.used]
    return PoseResiduals(
        plot=_plot(found, 1000 * float(record.prediction_interval_g)),
        rms_g=math.sqrt(sum(r.residual_g**2 for r in used) / len(used)) if used else None,
        used=len(used),
        beyond_3u=sum(residual.ratio > BEYOND_U for residual in used),
        hidden=len(record.poses) - len(found),
    )


def _plot(found: tuple[PoseResidual, ...], dm_mg: float) -> ResidualPlot:
    reach_mg = max(1000 * (abs(residual.residual_g) + 2 * residual.u_g) for residual in found) or dm_mg
    band_shown = dm_mg <= BAND_SHOWN * reach_mg
    half_mg = 1.12 * (max(reach_mg, dm_mg) if band_shown else reach_mg)
    scale = Scale(0.0, half_mg, AREA.bottom, AREA.top)
    return ResidualPlot(
        ticks=scale.ticks(),
        pose_labels=_pose_labels(found),
        poses=tuple(_mark(residual, _x(place, len(found)), scale) for place, residual in enumerate(found)),
        prediction_interval=(scale.place(dm_mg), scale.place(-dm_mg)) if band_shown else (),
        prediction_interval_mg=format_short(dm_mg),
        has_faces=any(residual.face is not None for residual in found),
    )


def _x(place: int, count: int) -> float:
    return AREA.left + (place + 0.5) * (AREA.right - AREA.left) / count


def _pose_labels(found: tuple[PoseResidual, ...]) -> tuple[Tick, ...]:
    """Return the numbers of the poses and their faces, as many as fit."""
    every = math.ceil(len(found) / MAX_POSE_LABELS)
    return tuple(
        Tick(
            _x(place, len(found)),
            str(residual.number) if residual.face is None else f"{residual.number} {printable_text(residual.face, 3)}",
        )
        for place, residual in enumerate(found)
        if place % every == 0
    )


def _mark(residual: PoseResidual, x: float, scale: Scale) -> PoseMark:
    value_mg, u_mg = 1000 * residual.residual_g, 1000 * residual.u_g
    return PoseMark(
        number=residual.number,
        used=residual.used,
        x=x,
        y=scale.place(value_mg),
        bar_top=scale.place(value_mg + 2 * u_mg),
        bar_bottom=scale.place(value_mg - 2 * u_mg),
        title=f"pose {residual.number}: {format_short(value_mg)} mg, u {format_short(u_mg)} mg",
    )
