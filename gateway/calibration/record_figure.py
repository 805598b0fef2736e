"""The data of a record's figure: series of values with uncertainties, which the certificate plots as they stand."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Text = Annotated[str, Field(max_length=200)]
Values = Annotated[tuple[float, ...], Field(max_length=2000)]


class FigureSeries(BaseModel):
    """One quantity over another; all tuples have the same length."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Text
    x: Values
    y: Values
    u: Values
    """Standard uncertainty of each y; 0 where none is drawn."""


class RecordFigure(BaseModel):
    """Figure of a method whose evidence is not a set of poses; a record stores it in its field `figure`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    title: Text
    x_label: Text
    y_label: Text
    series: Annotated[tuple[FigureSeries, ...], Field(min_length=1, max_length=4)]
    bounds: Annotated[tuple[float, ...], Field(max_length=4)] = ()
    """Heights of dashed lines: limits, intervals."""
    caption: Annotated[str, Field(max_length=400)] = ""
