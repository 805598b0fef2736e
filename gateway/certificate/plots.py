"""The figures of a certificate as coordinates: the residual of every pose, and the figure that a method has stored.

The residual plot has every pose against its own uncertainty and the record's prediction interval; the figure of a method comes
from the data in the record's field `figure`. Both have one area, and y points down.
"""

import math
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gateway.calibration.record import CalibrationRecord, FigureSeries, RecordFigure
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
MAX_SERIES_POINTS = 160
"""Points of a series that are drawn; a longer series is thinned. Basis: a choice; neighbours touch at the figure's width."""
X_MARGIN, Y_MARGIN = 1.06, 1.35
"""Half ranges of the scales relative to those of the values. Basis: a choice of taste; the legend stands above the points, the
unit below."""
MIN_HALF_SCALE_SHARE, MIN_HALF_SCALE = 1e-6, 1e-9
"""Least half range of a scale, relative to its values and absolute. Basis: below it the labels could not tell the ticks apart."""


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
class FigurePoint:
    """A value with its bar of ± 2 u."""

    x: float
    y: float
    bar_top: float
    bar_bottom: float
    title: str


def _point(x: float, value: float, u: float, scale: Scale, title: str) -> FigurePoint:
    return FigurePoint(x, scale.place(value), scale.place(value + 2 * u), scale.place(value - 2 * u), title)


@dataclass(frozen=True, slots=True)
class PoseResiduals:
    """The residuals of the poses together, and all coordinates of their plot."""

    rms_g: float | None
    """Of the poses that the fit used; None where it used none that can be shown."""
    used: int
    beyond_3u: int
    hidden: int
    """Poses that cannot be shown."""
    ticks: tuple[Tick, ...]
    pose_labels: tuple[Tick, ...]
    poses: tuple[tuple[PoseResidual, FigurePoint], ...]
    prediction_interval: tuple[float, ...]
    """Heights of its two lines, the upper one first; empty where it lies outside the plot."""
    prediction_interval_mg: str
    has_faces: bool
    area: PlotArea = AREA


def pose_residuals(record: CalibrationRecord) -> PoseResiduals | None:
    """Return the residuals of a record; None where it holds no pose that can be shown."""
    found = residuals(record)[:MAX_SHOWN_POSES]
    if not found:
        return None
    used = [residual for residual in found if residual.used]
    dm_mg = 1000 * float(record.prediction_interval_g)
    reach_mg = max(1000 * (abs(residual.residual_g) + 2 * residual.u_g) for residual in found) or dm_mg
    band_shown = dm_mg <= BAND_SHOWN * reach_mg
    half_mg = 1.12 * (max(reach_mg, dm_mg) if band_shown else reach_mg)
    scale = Scale(0.0, half_mg, AREA.bottom, AREA.top)
    return PoseResiduals(
        rms_g=math.sqrt(sum(r.residual_g**2 for r in used) / len(used)) if used else None,
        used=len(used),
        beyond_3u=sum(residual.ratio > BEYOND_U for residual in used),
        hidden=len(record.poses) - len(found),
        ticks=scale.ticks(),
        pose_labels=_pose_labels(found),
        poses=tuple((one, _pose_point(one, _x(place, len(found)), scale)) for place, one in enumerate(found)),
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


def _pose_point(residual: PoseResidual, x: float, scale: Scale) -> FigurePoint:
    value_mg, u_mg = 1000 * residual.residual_g, 1000 * residual.u_g
    title = f"pose {residual.number}: {format_short(value_mg)} mg, u {format_short(u_mg)} mg"
    return _point(x, value_mg, u_mg, scale, title)


@dataclass(frozen=True, slots=True)
class PlottedSeries:
    """The points of a series and its entry in the legend."""

    name: str
    points: tuple[FigurePoint, ...]
    legend_x: float


@dataclass(frozen=True, slots=True)
class MethodPlot:
    """All coordinates of the figure."""

    figure: RecordFigure
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]
    bounds: tuple[float, ...]
    series: tuple[PlottedSeries, ...]
    area: PlotArea = AREA


def method_plot(record: CalibrationRecord) -> MethodPlot | None:
    """Return the figure of a record; None where it has none, or none that can be plotted."""
    try:
        return plot_figure(RecordFigure.model_validate((record.model_extra or {}).get("figure")))
    except ValidationError:
        return None


def plot_figure(figure: RecordFigure) -> MethodPlot | None:
    """Return the coordinates of a figure; None where it cannot be plotted."""
    x_values = [x for series in figure.series for x in series.x]
    y_values = [
        y + side * 2 * u
        for series in figure.series
        for y, u in zip(series.y, series.u, strict=False)
        for side in (-1, 1)
    ]
    if not y_values or any(not len(series.x) == len(series.y) == len(series.u) for series in figure.series):
        return None
    x_scale, y_scale = (
        _scale(x_values, X_MARGIN, AREA.left, AREA.right),
        _scale([*y_values, *figure.bounds], Y_MARGIN, AREA.bottom, AREA.top),
    )
    if x_scale is None or y_scale is None:
        return None
    return MethodPlot(
        figure=figure,
        x_ticks=x_scale.ticks(),
        y_ticks=y_scale.ticks(),
        bounds=tuple(y_scale.place(height) for height in figure.bounds),
        series=tuple(_plotted_series(series, place, x_scale, y_scale) for place, series in enumerate(figure.series)),
    )


def _scale(values: list[float], margin: float, low_place: float, high_place: float) -> Scale | None:
    """Return a scale that shows all values with a margin; None where their range overflows."""
    low, high = min(values), max(values)
    half = max(margin * (high - low) / 2, MIN_HALF_SCALE_SHARE * max(abs(low), abs(high)), MIN_HALF_SCALE)
    return Scale((low + high) / 2, half, low_place, high_place) if math.isfinite(half) else None


def _plotted_series(series: FigureSeries, place: int, x_scale: Scale, y_scale: Scale) -> PlottedSeries:
    every = math.ceil(len(series.x) / MAX_SERIES_POINTS) or 1
    points = tuple(
        _point(x_scale.place(x), y, u, y_scale, f"{format_short(x, 6)}: {format_short(y)}")
        for x, y, u in list(zip(series.x, series.y, series.u, strict=True))[::every]
    )
    return PlottedSeries(printable_text(series.name, 24), points, AREA.left + 8 + 80 * place)
