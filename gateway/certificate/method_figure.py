"""The figure of a method, from the data in the record's field `figure`, as coordinates."""

import math
from dataclasses import dataclass

from pydantic import ValidationError

from gateway.calibration.record import CalibrationRecord, FigureSeries, RecordFigure
from gateway.certificate.residual_plot import AREA, PlotArea, Scale, Tick
from gateway.documents.format import format_short, printable_text

MAX_SERIES_POINTS = 160
"""Points of a series that are drawn; a longer series is thinned. Basis: a choice; neighbours touch at the figure's width."""
X_MARGIN, Y_MARGIN = 1.06, 1.35
"""Half ranges of the scales relative to those of the values. Basis: a choice of taste; the legend stands above the points, the
unit below."""
MIN_HALF_SCALE_SHARE, MIN_HALF_SCALE = 1e-6, 1e-9
"""Least half range of a scale, relative to its values and absolute. Basis: below it the labels could not tell the ticks apart."""


@dataclass(frozen=True, slots=True)
class FigurePoint:
    """A value with its bar of ± 2 u."""

    x: float
    y: float
    bar_top: float
    bar_bottom: float
    title: str


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
        series=tuple(_plot(series, place, x_scale, y_scale) for place, series in enumerate(figure.series)),
    )


def _scale(values: list[float], margin: float, low_place: float, high_place: float) -> Scale | None:
    """Return a scale that shows all values with a margin; None where their range overflows."""
    low, high = min(values), max(values)
    half = max(margin * (high - low) / 2, MIN_HALF_SCALE_SHARE * max(abs(low), abs(high)), MIN_HALF_SCALE)
    return Scale((low + high) / 2, half, low_place, high_place) if math.isfinite(half) else None


def _plot(series: FigureSeries, place: int, x_scale: Scale, y_scale: Scale) -> PlottedSeries:
    every = math.ceil(len(series.x) / MAX_SERIES_POINTS) or 1
    points = tuple(
        FigurePoint(
            x=x_scale.place(x),
            y=y_scale.place(y),
            bar_top=y_scale.place(y + 2 * u),
            bar_bottom=y_scale.place(y - 2 * u),
            title=f"{format_short(x, 6)}: {format_short(y)}",
        )
        for x, y, u in list(zip(series.x, series.y, series.u, strict=True))[::every]
    )
    return PlottedSeries(printable_text(series.name, 24), points, AREA.left + 8 + 80 * place)
