"""Offset and scale factor of a sensor over its calibrations, in the form of Łuczak et al. 2022, Tables 6 to 8 and Figure 7."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta

import numpy as np

from gateway.calibration.drift.change import change_between, reading_error_g, sensitivity_of, tilt_error_rad
from gateway.calibration.drift.forecast import MEASURING_METHODS, created_at
from gateway.calibration.record import CalibrationError, CalibrationRecord
from gateway.numerics.array import Array


@dataclass(frozen=True, slots=True)
class DriftRow:
    """One calibration, against the first one; arrays by axis, shape (3,)."""

    created_utc: str
    elapsed_h: float
    """Time since the first calibration, h."""
    offset: Array
    """Offset, raw units."""
    offset_change: Array
    """Relative change of the offset; NaN where the first offset is zero."""
    scale: Array
    """Scale factor, raw units per g."""
    scale_change: Array
    """Relative change of the scale factor."""
    error_g: Array
    """Largest error of a reading within 1 g with the first calibration (eq. 19)."""
    tilt_error_rad: Array
    """Tilt error by it (eq. 20)."""
    offset_change_g: Array
    """Change of the zero-g offset, g."""
    u_offset_change_g: Array
    """Standard uncertainty of `offset_change_g`, g."""
    u_scale_change: Array
    """Standard uncertainty of `scale_change`."""


def drift_table(records: Sequence[CalibrationRecord]) -> tuple[DriftRow, ...]:
    """Return a row for each record of one device that measures offset and scale, oldest first.

    Raises `CalibrationError` without such a record, and for records of different devices or units.
    """
    measuring = sorted((record for record in records if record.method in MEASURING_METHODS), key=created_at)
    if not measuring:
        raise CalibrationError(f"none of {len(records)} records measured offset and scale")
    return tuple(_row(measuring[0], record) for record in measuring)


def _row(first: CalibrationRecord, record: CalibrationRecord) -> DriftRow:
    offsets = [np.array(one.offset, dtype=np.float64) for one in (first, record)]
    scales = [np.diag(sensitivity_of(one)) for one in (first, record)]
    with np.errstate(divide="ignore", invalid="ignore"):
        offset_change = np.where(offsets[0] == 0, np.nan, offsets[1] / offsets[0] - 1)
    scale_change = scales[1] / scales[0] - 1
    error_g = reading_error_g((offsets[1] - offsets[0]) / scales[0], scale_change)
    change = change_between(first, record)
    return DriftRow(
        created_utc=record.created_utc,
        elapsed_h=(created_at(record) - created_at(first)) / timedelta(hours=1),
        offset=offsets[1],
        offset_change=offset_change,
        scale=scales[1],
        scale_change=scale_change,
        error_g=error_g,
        tilt_error_rad=tilt_error_rad(error_g),
        offset_change_g=change.offset_g,
        u_offset_change_g=change.u_offset_g,
        u_scale_change=change.u_scale,
    )
