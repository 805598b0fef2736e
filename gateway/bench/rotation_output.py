"""The output of `plumbline calibrate rotation`: its text, the fields that it adds to a record, and their figure."""

from typing import Any

import numpy as np

from gateway.bench.rotation import RotationFit, all_sines
from gateway.bench.rotation_turn import AxisSine, TurnFit
from gateway.calibration.record import FigureSeries, RecordFigure
from gateway.numerics.stats import NORMAL_975


def format_rotation(fit: RotationFit, unit: str) -> str:
    """Return the report as several lines of text; intervals are 95 %."""
    lines = [
        f"{'turn':9} {'axis':4} {'offset':>22} {'scale per g':>22} {'phase / deg':>17} {'prediction':>11} {'confidence':>11}"
    ]
    lines += [_sine_line(turn, sine) for turn, sine in all_sines(fit)]
    lines.append(f"offset and scale in {unit}; +- is the 95 % interval; prediction and confidence of the curve in mg")
    if fit.calibration is not None:
        lines += [
            f"rotation axis of turn {number} ({'xyz'[turn.rotation_axis]}): {np.degrees(level):+.3f} deg off the horizontal"
            for number, (turn, level) in enumerate(zip(fit.turns, fit.level_rad, strict=True), start=1)
        ]
    for pair in fit.pairs:
        names = " and ".join("xyz"[axis] for axis in pair.axes)
        basis = "" if pair.from_phases else ", including the mounting on the rig"
        angle_deg, u_deg = np.degrees(pair.angle_rad), np.degrees(pair.u_rad)
        lines.append(f"non-orthogonality of {names}: {angle_deg:+.3f} +- {NORMAL_975 * u_deg:.3f} deg{basis}")
    lines.append(
        f"permissible error of |m|, one mean reading: dm = {1000 * fit.norm_error_g:.3f} mg (eq. 14, corrected)"
    )
    return "\n".join(lines)


def _sine_line(turn: TurnFit, sine: AxisSine) -> str:
    factor = NORMAL_975
    offset = f"{sine.offset:.6g} +- {factor * sine.u_offset:.2g}"
    scale = f"{sine.scale:.6g} +- {factor * sine.u_scale:.2g}"
    phase = f"{np.degrees(sine.phase_rad):+.3f} +- {np.degrees(factor * sine.u_phase_rad):.3f}"
    prediction, confidence = (1000 * value / sine.scale for value in (sine.prediction, sine.confidence))
    name = f"about {'xyz'[turn.rotation_axis]}"
    return f"{name:9} {'xyz'[sine.axis]:4} {offset:>22} {scale:>22} {phase:>17} {prediction:11.3f} {confidence:11.3f}"


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
