"""The fields of a record that a rotation calibration adds: its curves, and its figure."""

from typing import Any

import numpy as np

from gateway.calibration.methods.rotation import RotationFit, all_sines
from gateway.calibration.methods.rotation_turn import AxisSine, TurnFit
from gateway.calibration.record_figure import FigureSeries, RecordFigure


def rotation_fields(fit: RotationFit) -> dict[str, Any]:
    """Return `rotation`, the numbers of Łuczak n.d., eq. 11 to 14, and `figure`, the residuals over the angle."""
    return {"rotation": _numbers(fit), "figure": _figure(fit).model_dump(mode="json")}


def _numbers(fit: RotationFit) -> dict[str, Any]:
    return {
        "curves": [_curve(turn, sine) for turn, sine in all_sines(fit)],
        "level_deg": [float(np.degrees(level)) for level in fit.level_rad],
        "non_orthogonality": [
            {
                "axes": "".join("xyz"[axis] for axis in pair.axes),
                "angle_deg": float(np.degrees(pair.angle_rad)),
                "u_deg": float(np.degrees(pair.u_rad)),
                "from_phases": pair.from_phases,
            }
            for pair in fit.pairs
        ],
        "norm_error_g": fit.norm_error_g,
    }


def _curve(turn: TurnFit, sine: AxisSine) -> dict[str, Any]:
    """Return offset and scale in raw units, phases in degrees, intervals of 95 % in raw units."""
    return {
        "rotation_axis": "xyz"[turn.rotation_axis],
        "axis": "xyz"[sine.axis],
        "offset": sine.offset,
        "u_offset": sine.u_offset,
        "scale": sine.scale,
        "u_scale": sine.u_scale,
        "phase_deg": float(np.degrees(sine.phase_rad)),
        "u_phase_deg": float(np.degrees(sine.u_phase_rad)),
        "confidence": sine.confidence,
        "prediction": sine.prediction,
    }


def _figure(fit: RotationFit) -> RecordFigure:
    dm_mg = 1000 * fit.norm_error_g
    return RecordFigure(
        title="Residual of each curve",
        x_label="angle of the rig / °",
        y_label="measured − fitted / mg",
        series=tuple(_series(turn, sine) for turn, sine in all_sines(fit)),
        bounds=(dm_mg, -dm_mg),
        caption=f"Curves: offset + scale · sin or cos of the angle. Dashed: prediction interval of 95 %, ± {dm_mg:.2g} mg.",
    )


def _series(turn: TurnFit, sine: AxisSine) -> FigureSeries:
    residual_mg = 1000 * turn.residual[:, sine.axis] / sine.scale
    return FigureSeries(
        name=f"{'xyz'[sine.axis]}, turn about {'xyz'[turn.rotation_axis]}",
        x=tuple(np.degrees(turn.readings.angle_rad).tolist()),
        y=tuple(residual_mg.tolist()),
        u=(0.0,) * len(residual_mg),
    )
