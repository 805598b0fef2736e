"""Means of low-pass filtered readings at rest, over an hour and over the hours of a day."""

from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from gateway.numerics.array import Array

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]


class RestMean(BaseModel):
    """A mean of readings at rest."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    hour: int
    """Hours since 1970, UTC; for a day its newest hour with rest."""
    count: int = Field(gt=0)
    """Number of readings."""
    norm_g: float = Field(gt=0)
    """Mean of the magnitudes, g."""
    force_g: Vector
    """Mean specific force in the housing frame, g."""
    temperature_c: float | None


class HourSums(BaseModel):
    """Sums over the readings of the current hour."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    hour: int
    count: int = 0
    norm_g: float = 0.0
    force_g: Vector = [0.0, 0.0, 0.0]
    temperature_c: float = 0.0
    temperatures: int = 0
    """Number of readings with a temperature."""

    def add(self, force_g: Array, temperature_c: float | None) -> None:
        """Add a reading, shape (3,)."""
        self.count += 1
        self.norm_g += float(np.linalg.norm(force_g))
        self.force_g = [total + float(value) for total, value in zip(self.force_g, force_g, strict=True)]
        if temperature_c is not None:
            self.temperature_c += temperature_c
            self.temperatures += 1

    def mean(self) -> RestMean:
        """Return the mean of the readings; there must be at least one."""
        return RestMean(
            hour=self.hour,
            count=self.count,
            norm_g=self.norm_g / self.count,
            force_g=[total / self.count for total in self.force_g],
            temperature_c=self.temperature_c / self.temperatures if self.temperatures else None,
        )


def combine_means(earlier: RestMean, later: RestMean) -> RestMean:
    """Return the mean of two means, weighted by their counts."""
    count = earlier.count + later.count
    a, b = earlier.count / count, later.count / count
    temperature_c = None
    if earlier.temperature_c is not None and later.temperature_c is not None:
        temperature_c = a * earlier.temperature_c + b * later.temperature_c
    return RestMean(
        hour=later.hour,
        count=count,
        norm_g=a * earlier.norm_g + b * later.norm_g,
        force_g=[a * x + b * y for x, y in zip(earlier.force_g, later.force_g, strict=True)],
        temperature_c=temperature_c,
    )
