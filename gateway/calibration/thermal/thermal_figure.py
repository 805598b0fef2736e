"""The figure of a thermal record: the change of the zero-g offset of each axis against temperature."""

from collections.abc import Sequence

import numpy as np

from devices.conversion import force_g, zero_g_output
from gateway.calibration.poses.faces import FACES
from gateway.calibration.record_figure import FigureSeries, RecordFigure
from gateway.calibration.thermal.ramp import Ramp
from gateway.calibration.thermal.ramp_calibration import ThermalCalibration
from gateway.documents.format import format_fixed
from gateway.numerics.array import Array

N_POINTS = 20
"""Number of temperatures of a series."""


def thermal_figure(found: ThermalCalibration) -> RecordFigure:
    """Return half sums of opposite faces against temperature (Sawicki and Walendziuk 2016, eq. 8 and Figure 7), in mg."""
    grid_c = np.linspace(*found.range_c, N_POINTS)
    series = []
    for axis, entry in enumerate(found.summary):
        up, down = (_mean_reading(found.ramps, face, axis, grid_c) for face in FACES[2 * axis : 2 * axis + 2])
        change_mg = 1000 * force_g(zero_g_output(up, down), entry.zero_g, entry.sensitivity)
        series.append(
            FigureSeries(name=entry.axis, x=tuple(grid_c.tolist()), y=tuple(change_mg.tolist()), u=(0.0,) * N_POINTS)
        )
    offset = ", ".join(f"{entry.axis} {format_fixed(entry.offset_mg_per_c.value, 3)}" for entry in found.summary)
    sensitivity = ", ".join(
        f"{entry.axis} {format_fixed(entry.sensitivity_percent_per_c.value, 4)}" for entry in found.summary
    )
    verdicts = ", ".join(f"{entry.axis} {entry.verdict}" for entry in found.summary if entry.verdict is not None)
    return RecordFigure(
        title="Zero-g offset against temperature",
        x_label="temperature / °C",
        y_label="change of the offset / mg",
        series=tuple(series),
        caption=f"Mean slopes: offset {offset} mg/°C; sensitivity {sensitivity} %/°C. The gateway corrects for both."
        + (f" Against the data sheet: {verdicts}." if verdicts else ""),
    )


def _mean_reading(ramps: Sequence[Ramp], face: str, axis: int, grid_c: Array) -> Array:
    curves = [np.interp(grid_c, ramp.temperature_c, ramp.mean[:, axis]) for ramp in ramps if ramp.face == face]
    return np.asarray(np.mean(curves, axis=0))
