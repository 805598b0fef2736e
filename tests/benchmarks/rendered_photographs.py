"""Photographs of a dot board with a laser spot, rendered by a camera of known pose and lens: pinhole, Brown's distortion, blur,
uneven light, noise, sRGB, 8 bits. The spot's place on the board is exact.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gateway.numerics.array import Array

WHITE, BLACK = 0.75, 0.05
WALL = np.array([0.15, 0.25, 0.40])
"""Blue, green, red reflectance beside the board: brown."""


@dataclass(frozen=True)
class Scene:
    """One photograph. Lengths in mm, x to the right and y down on the board, origin in its middle."""

    spots: tuple[tuple[float, float], ...] = ((3.0, -40.0),)
    pitch_mm: float = 20.0
    columns: int = 7
    rows: int = 7
    dot_mm: float = 10.0
    margin_mm: float = 12.0
    """White beyond the outer dots' edges."""
    px_per_mm: float = 5.0
    tilt_deg: tuple[float, float] = (0.0, 0.0)
    """Of the camera against the board's normal, about the horizontal and the vertical."""
    roll_deg: float = 0.0
    distance_mm: float = 600.0
    k1: float = 0.0
    """Brown's radial distortion, by the tangent of the angle of view."""
    blur_px: float = 0.8
    noise: float = 1.5
    """Standard deviation, values of 255."""
    uneven: float = 0.0
    """Share by which light changes from side to side."""
    laser: float = 1.5
    """Irradiance at the spot's middle; the board's own light is about 0.6."""
    spot_sigma_mm: tuple[float, float] = (1.6, 1.3)
    hidden: tuple[tuple[int, int], ...] = ()
    """Dots that are covered with white."""
    laser_channel: int = 2
    size_px: tuple[int, int] = (900, 900)
    """Width and height."""
    seed: int = 1
    centre_mm: tuple[float, float] = field(default=(0.0, 0.0))
    """Place of the board in the middle of the photograph."""


def render(scene: Scene) -> NDArray[np.uint8]:
    """Return the pixels, shape (height, width, 3), blue, green, red."""
    random = np.random.default_rng(scene.seed)
    place, reflectance, irradiance = _lit_board(replace(scene, **NOT_OF_THE_BOARD))
    sigma = np.array(scene.spot_sigma_mm)
    for spot in scene.spots:
        beam = scene.laser * np.exp(-(((place - np.array(spot)) / sigma) ** 2).sum(axis=2) / 2)
        colour = np.full(3, 0.01)
        colour[scene.laser_channel] = 1.0
        irradiance = irradiance + beam[..., None] * colour
    seen = cv2.GaussianBlur(reflectance * irradiance, (0, 0), scene.blur_px)
    encoded = 255 * np.where(seen <= 0.0031308, 12.92 * seen, 1.055 * np.maximum(seen, 1e-9) ** (1 / 2.4) - 0.055)
    noisy = encoded + scene.noise * random.standard_normal(seen.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), dtype=np.uint8)


NOT_OF_THE_BOARD: dict[str, Any] = {
    "spots": (),
    "laser": 0.0,
    "laser_channel": 2,
    "blur_px": 0.0,
    "noise": 0.0,
    "seed": 0,
}
"""What a scene has beside its board and its light."""


@lru_cache(maxsize=4)
def _lit_board(scene: Scene) -> tuple[Array, Array, Array]:
    """Return the place that each pixel shows (height, width, 2), and reflectance and irradiance of the board without a laser."""
    place = board_places(scene)
    footprint = 1 / scene.px_per_mm
    middle = (np.array([scene.columns, scene.rows]) - 1) / 2
    node = np.clip(np.rint(place / scene.pitch_mm + middle), 0, 2 * middle)
    edge = np.linalg.norm(place - (node - middle) * scene.pitch_mm, axis=2) - scene.dot_mm / 2
    dots = np.clip(0.5 - edge / footprint, 0, 1)
    for column, row in scene.hidden:
        dots[(node == [column, row]).all(axis=2)] = 0
    half = middle * scene.pitch_mm + scene.dot_mm / 2 + scene.margin_mm
    paper = np.clip(0.5 - (np.abs(place) - half).max(axis=2) / footprint, 0, 1)[..., None]
    reflectance = paper * (WHITE + (BLACK - WHITE) * dots)[..., None] + (1 - paper) * WALL
    height, width = dots.shape
    across, down = np.linspace(-1, 1, width), np.linspace(-1, 1, height)[:, None]
    light = 0.6 * (1 + scene.uneven * (0.6 * across + 0.4 * down)) * (1 - scene.uneven * 0.3 * (across**2 + down**2))
    return place, reflectance, light[..., None] * np.array([0.85, 1.0, 1.05])


def board_places(scene: Scene) -> Array:
    """Return the place of the board that each pixel shows, mm, shape (height, width, 2)."""
    width, height = scene.size_px
    focal = scene.px_per_mm * scene.distance_mm
    x, y = np.meshgrid(np.arange(width) - (width - 1) / 2, np.arange(height) - (height - 1) / 2)
    distorted = np.stack([x, y]) / focal
    straight = distorted.copy()
    for _ in range(12 if scene.k1 else 0):
        straight = distorted / (1 + scene.k1 * (straight**2).sum(axis=0))
    ray = np.stack([*straight, np.ones_like(x)])
    rotation = _camera_rotation(scene)
    ray = np.tensordot(rotation, ray, axes=1)
    camera = np.array([*scene.centre_mm, 0.0]) - scene.distance_mm * rotation[:, 2]
    reach = -camera[2] / ray[2]
    return np.asarray((camera[:2, None, None] + reach * ray[:2]).transpose(1, 2, 0))


def _camera_rotation(scene: Scene) -> Array:
    about_x, about_y, about_z = np.radians([*scene.tilt_deg, scene.roll_deg])
    cx, sx, cy, sy, cz, sz = (f(a) for a in (about_x, about_y, about_z) for f in (np.cos, np.sin))
    rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(ry @ rx @ rz)


def moved(scene: Scene, x_mm: float, y_mm: float, seed: int = 2) -> Scene:
    """Return the scene with its spot elsewhere."""
    return replace(scene, spots=((x_mm, y_mm),), seed=seed)
