"""Displacement of a laser spot from rendered photographs at 5 px/mm: errors, coverage, and the error of the scale of two dots."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gateway.bench.laser.board import DotBoard
from gateway.bench.laser.displacement import Displacement, MeasuredPhotograph, displacement, measure_photograph
from gateway.bench.laser.photograph import LaserColour, Photograph
from tests.benchmarks.rendered_photographs import Scene, moved, render

BOARD = DotBoard(7, 7, 0.020, 0.010, u_pitch_m=1e-9)
"""The rendered board is exact."""
END_MM = (-2.0, 45.0)
PLAIN = Scene()
SCENES: dict[str, tuple[Scene, tuple[float, float]]] = {
    "square on": (PLAIN, END_MM),
    "perspective, 18 and 12 deg": (replace(PLAIN, tilt_deg=(18, -12)), END_MM),
    "barrel lens": (replace(PLAIN, k1=-0.6, centre_mm=(5, -4)), END_MM),
    "pincushion lens and perspective": (replace(PLAIN, k1=0.5, tilt_deg=(12, 10)), END_MM),
    "blur of 3 px": (replace(PLAIN, blur_px=3), END_MM),
    "noise of 3 in 255": (replace(PLAIN, noise=3), END_MM),
    "uneven light": (replace(PLAIN, uneven=0.6), END_MM),
    "spot on a dot": (replace(PLAIN, spots=((1.0, -40.5),)), (0.0, 40.0)),
    "spot on the edge of a dot": (PLAIN, (4.0, 43.0)),
    "spot half outside the board": (replace(PLAIN, spots=((-10.0, -30.0),)), (0.5, 70.0)),
    "spot half outside the photograph": (
        replace(PLAIN, spots=((-10.0, -30.0),), size_px=(900, 650), centre_mm=(0, 4.7)),
        (10.0, 69.0),
    ),
    "board rotated by 90 deg": (replace(PLAIN, roll_deg=90), END_MM),
    "board rotated by 30 deg": (replace(PLAIN, roll_deg=30), END_MM),
    "dots hidden": (replace(PLAIN, hidden=((0, 0), (3, 3), (6, 4))), END_MM),
    "saturated spot": (replace(PLAIN, laser=6), END_MM),
    "green laser": (replace(PLAIN, laser_channel=1), END_MM),
}
RANDOM_SCENES = 40
ON_WHITE = (replace(PLAIN, spots=((10.0, -30.0),)), (8.0, 50.0))


def compress(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a photograph after JPEG of quality 75."""
    content = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 75])[1]
    return np.asarray(cv2.imdecode(content, cv2.IMREAD_COLOR), dtype=np.uint8)


def speckle(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a photograph whose laser light has speckle of 35 % and 1.2 px."""
    grains = cv2.GaussianBlur(np.random.default_rng(1).standard_normal(pixels.shape[:2]), (0, 0), 1.2)
    seen = pixels.astype(np.float64)
    seen[:, :, 2] += 0.35 * grains / grains.std() * np.clip(seen[:, :, 2] - 1.03 * seen[:, :, 1], 0, None)
    return np.clip(seen, 0, 255).astype(np.uint8)


def fringe(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a photograph whose red is imaged 0.2 % larger."""
    height, width = pixels.shape[:2]
    larger = np.array([[1.002, 0, -0.001 * width], [0, 1.002, -0.001 * height]])
    seen = pixels.copy()
    seen[:, :, 2] = cv2.warpAffine(
        pixels[:, :, 2], larger, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return seen


def steepen(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a photograph with a steeper tone curve."""
    share = np.arange(256) / 255
    return np.clip(255 * (0.5 * (3 * share**2 - 2 * share**3) + 0.5 * share), 0, 255).round().astype(np.uint8)[pixels]


DISTURBANCES: dict[str, Callable[[NDArray[np.uint8]], NDArray[np.uint8]]] = {
    "JPEG of quality 75": compress,
    "speckle of 35 %": speckle,
    "red imaged 0.2 % larger": fringe,
    "steeper tone curve": steepen,
}


@cache
def measured(scene: Scene) -> MeasuredPhotograph:
    """Return what is found in the photograph of a scene."""
    colour: LaserColour = "red" if scene.laser_channel == 2 else "green"
    return measure_photograph(Photograph(Path("rendered.png"), render(scene), colour), BOARD)


def measure(scene: Scene, end_mm: tuple[float, float]) -> tuple[Displacement, float]:
    """Return the displacement from the scene's spot to another place, and its error in mm."""
    end = moved(scene, *end_mm)
    found = displacement(measured(scene), measured(end))
    actual = float(np.hypot(*(np.array(end.spots[0]) - scene.spots[0])))
    return found, 1000 * abs(found.d_m) - actual


def measure_disturbed(
    disturb: Callable[[NDArray[np.uint8]], NDArray[np.uint8]], scene: Scene, end_mm: tuple[float, float]
) -> tuple[Displacement, float]:
    """Return a displacement and its error in mm as `measure` does, from photographs with a disturbance."""
    pixels = (disturb(render(each)) for each in (scene, moved(scene, *end_mm)))
    zero, end = (measure_photograph(Photograph(Path("rendered.png"), each, "red"), BOARD) for each in pixels)
    found = displacement(zero, end)
    return found, 1000 * abs(found.d_m) - float(np.hypot(*(np.array(end_mm) - scene.spots[0])))


def random_scene(seed: int) -> tuple[Scene, tuple[float, float]]:
    """Return a scene of moderate difficulty, drawn at random."""
    random = np.random.default_rng(seed)
    scene = replace(
        PLAIN,
        tilt_deg=tuple(random.uniform(-15, 15, 2)),
        roll_deg=random.uniform(-10, 10),
        k1=random.uniform(-0.4, 0.4),
        blur_px=random.uniform(0.6, 2),
        noise=random.uniform(0.5, 3),
        uneven=random.uniform(0, 0.5),
        laser=random.uniform(0.5, 4),
        spots=((random.uniform(-50, 50), random.uniform(-55, -30)),),
        seed=seed,
    )
    return scene, (scene.spots[0][0] + random.uniform(-5, 5), random.uniform(20, 55))


def two_dot_displacement_mm(start: MeasuredPhotograph, end: MeasuredPhotograph, found: Displacement) -> float:
    """Return the displacement by eq. 17 and 18 of Zhu et al. 2020: each segment by the scale of the two nearest dots."""
    place = end.board_map.to_board(end.spot.centre_px[None])[0]
    column = int(np.clip(np.rint(place[0]), 0, 6))
    rows = np.array([end.board_map.to_pixel(np.array([column, row], dtype=np.float64)) for row in range(7)])
    pitch_px = np.hypot(*np.diff(rows, axis=0).T)
    first = float(start.board_map.to_board(start.spot.centre_px[None])[0, 1])
    total, row = 0.0, first
    for segment in found.segments:
        cell = int(np.clip(np.floor(row + 1e-9), 0, len(pitch_px) - 1))
        total += 1000 * BOARD.pitch_m / pitch_px[cell] * segment.length_px
        row += segment.length_m / BOARD.pitch_m
    return total


def main() -> None:
    """Print the tables of docs/evidence/bench_methods.md."""
    print("error of d and its standard uncertainty, mm; rendered at 5 px/mm")
    for name, (scene, end_mm) in SCENES.items():
        found, error_mm = measure(scene, end_mm)
        print(f"  {name:34} {error_mm:+.3f}  {1000 * found.u_d_m:.3f}")
    for name, disturb in DISTURBANCES.items():
        for where, (scene, end_mm) in (("edge of a dot", (PLAIN, END_MM)), ("white", ON_WHITE)):
            found, error_mm = measure_disturbed(disturb, scene, end_mm)
            print(f"  {name + ', ' + where:40} {error_mm:+.3f}  {1000 * found.u_d_m:.3f}")
    scores, errors = [], []
    for seed in range(RANDOM_SCENES):
        found, error_mm = measure(*random_scene(seed))
        errors.append(abs(error_mm))
        scores.append(error_mm / (1000 * found.u_d_m))
    print(f"{RANDOM_SCENES} random scenes: error {np.median(errors):.3f} mm (95 %: {np.quantile(errors, 0.95):.3f})")
    print(f"  within 1.96 u: {np.mean(np.abs(scores) < 1.96):.1%}")
    scene = replace(PLAIN, tilt_deg=(15, 15), spots=((8.0, -45.0),))
    found, error_mm = measure(scene, (8.0, 45.0))
    by_dots = two_dot_displacement_mm(measured(scene), measured(moved(scene, 8.0, 45.0)), found)
    print(f"board leaning by 15 and 15 deg, 90 mm: error {error_mm:+.3f} mm; scale of two dots {by_dots - 90:+.3f} mm")
