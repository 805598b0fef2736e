"""The text output of `plumbline calibrate rotation`: curves, intervals, non-orthogonality, permissible error of |m|."""

import numpy as np

from gateway.calibration.methods.rotation import RotationFit, all_sines
from gateway.calibration.methods.rotation_turn import AxisSine, TurnFit
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
