"""Results of the laser method as text, JSON and CSV."""

from typing import Any

import numpy as np

from gateway.calibration.laser.displacement import Displacement, MeasuredPhotograph

Measured = list[tuple[MeasuredPhotograph, Displacement]]


def format_displacements(found: Measured) -> str:
    """Return a line per photograph."""
    lines = [f"{'d / mm':>10} {'u / mm':>8} {'dots':>5} {'rms / mm':>9} {'mm/px':>15}  photograph"]
    for measured, displacement in found:
        scales = [1000 * segment.scale_m for segment in displacement.segments]
        scale = f"{min(scales):.4f}..{max(scales):.4f}" if scales else "zero"
        rms_mm = 1000 * measured.board_map.residual_rms * measured.board.pitch_m
        lines.append(
            f"{1000 * displacement.d_m:10.3f} {1000 * displacement.u_d_m:8.3f} {int(measured.board_map.used.sum()):5} "
            f"{rms_mm:9.4f} {scale:>15}  {measured.photograph.path}"
        )
    return "\n".join(lines)


def displacements_as_json(found: Measured) -> dict[str, Any]:
    """Return all results; lengths in mm."""
    return {"method": "laser", "photographs": [_photograph_as_json(*each) for each in found]}


def displacements_as_csv(found: Measured) -> str:
    """Return the displacements from the zero, the first photograph, for `calibrate single-parameter`; angles are to be added."""
    rows = [
        f"{displacement.d_m * 1000:.4f},{displacement.u_d_m * 1000:.4f},{measured.photograph.path.name}"
        for measured, displacement in found[1:]
    ]
    return "\n".join(["displacement_mm,u_displacement_mm,photograph", *rows]) + "\n"


def _photograph_as_json(measured: MeasuredPhotograph, displacement: Displacement) -> dict[str, Any]:
    return {
        "photograph": str(measured.photograph.path),
        "d_mm": 1000 * displacement.d_m,
        "u_d_mm": 1000 * displacement.u_d_m,
        "spot_mm": (1000 * measured.spot_m).tolist(),
        "u_spot_mm": (1000 * np.sqrt(np.diag(measured.covariance_m2))).tolist(),
        "spot_px": measured.spot.centre_px.tolist(),
        "dots": int(measured.board_map.used.sum()),
        "board": [measured.board.columns, measured.board.rows],
        "residual_rms_mm": 1000 * measured.board_map.residual_rms * measured.board.pitch_m,
        "segments": [
            {
                "length_mm": 1000 * segment.length_m,
                "length_px": segment.length_px,
                "scale_mm_px": 1000 * segment.scale_m,
            }
            for segment in displacement.segments
        ],
    }
