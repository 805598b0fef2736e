"""Results of the laser method as text, JSON and CSV, and drawn into the photographs."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gateway.bench.laser.displacement import Displacement, MeasuredPhotograph
from gateway.certificate.traceability import BOARD, measurement_facts
from gateway.numerics.array import Array

Measured = list[tuple[MeasuredPhotograph, Displacement]]
DOT_COLOUR, UNUSED_COLOUR, SPOT_COLOUR, LINE_COLOUR = (0, 200, 0), (0, 140, 255), (255, 0, 255), (255, 120, 0)
"""Blue, green, red. Basis: a choice of taste."""
SHIFT_BITS = 4
"""Fractional bits of coordinates: marks are drawn to a sixteenth of a pixel. Definition: 1/16 of a pixel."""


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


def displacements_as_json(found: Measured, by: str) -> dict[str, Any]:
    """Return all results and who measured; lengths in mm."""
    stated = dict(measurement_facts(BOARD, by))
    return {"method": "laser", "traceability": stated, "photographs": [_photograph_as_json(*each) for each in found]}


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


def draw_overlay(measured: MeasuredPhotograph, zero: MeasuredPhotograph, displacement: Displacement) -> bytes:
    """Return a PNG of the photograph with the marks."""
    picture = measured.photograph.bgr.copy()
    width = max(1, round(max(picture.shape) / 1200))
    for place, index, used in zip(measured.dots_px, measured.index, measured.board_map.used, strict=True):
        colour = DOT_COLOUR if used else UNUSED_COLOUR
        _cross(picture, place, 6 * width, colour, width)
        _text(picture, f"{index[0]},{index[1]}", place + 5 * width, 0.35 * width, colour, width)
    start = measured.board_map.to_pixel(_lattice(zero, measured))
    cv2.line(picture, _fixed(start), _fixed(measured.spot.centre_px), LINE_COLOUR, width, cv2.LINE_AA, SHIFT_BITS)
    _cross(picture, start, 9 * width, LINE_COLOUR, width)
    spot = measured.spot
    axes = np.rint(2 * np.array(spot.sigma_px) * (1 << SHIFT_BITS)).astype(int)
    cv2.ellipse(
        picture,
        _fixed(spot.centre_px),
        (int(axes[0]), int(axes[1])),
        float(np.degrees(spot.axis_rad)),
        0,
        360,
        SPOT_COLOUR,
        width,
        cv2.LINE_AA,
        SHIFT_BITS,
    )
    _cross(picture, spot.centre_px, 9 * width, SPOT_COLOUR, width)
    text = f"d = {1000 * displacement.d_m:.3f} mm, u = {1000 * displacement.u_d_m:.3f} mm"
    _text(picture, text, np.array([10.0, 24.0]) * width, 0.7 * width, SPOT_COLOUR, 2 * width)
    return bytes(cv2.imencode(".png", picture)[1])


def _lattice(zero: MeasuredPhotograph, measured: MeasuredPhotograph) -> Array:
    """Return the zero's spot in the lattice coordinates of a photograph."""
    board = measured.board
    return np.asarray(zero.spot_m / board.pitch_m + (np.array([board.columns, board.rows]) - 1) / 2)


def _fixed(place: Array) -> tuple[int, int]:
    x, y = np.rint(place * (1 << SHIFT_BITS)).astype(int).tolist()
    return x, y


def _cross(picture: NDArray[np.uint8], place: Array, reach: int, colour: tuple[int, int, int], width: int) -> None:
    for step in (np.array([reach, 0]), np.array([0, reach])):
        cv2.line(picture, _fixed(place - step), _fixed(place + step), colour, width, cv2.LINE_AA, SHIFT_BITS)


def _text(
    picture: NDArray[np.uint8], text: str, place: Array, size: float, colour: tuple[int, int, int], width: int
) -> None:
    x, y = np.rint(place).astype(int).tolist()
    cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, size, (255, 255, 255), 3 * width, cv2.LINE_AA)
    cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, size, colour, width, cv2.LINE_AA)
