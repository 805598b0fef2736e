"""The blurred edges of dots, where a pixel mixes light of two reflectances and shows the laser beside its own place."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gateway.calibration.laser.board_map import BoardMap
from gateway.numerics.array import Array

SMOOTHING_PX = 1.0
"""Smoothing before edges and spot are measured, standard deviation: it makes the blur Gaussian and the noise small."""
SIGMAS_10_TO_90 = 2.563
"""Width of a blurred edge between 10 and 90 %, standard deviations."""


@dataclass(frozen=True, slots=True)
class DotEdges:
    """The edges of the dots in a photograph."""

    board_map: BoardMap
    diameter_px: float
    blur_px: float
    """Standard deviation of the blur of the photograph together with a smoothing of `SMOOTHING_PX`."""

    def distance_px(self, pixel: Array) -> Array:
        """Return the distance of pixels, shape (n, 2), of one neighbourhood from the nearest edge; negative within a dot."""
        board = self.board_map.to_board(pixel)
        scale_px = 1 / np.sqrt(abs(np.linalg.det(self.board_map.derivative(pixel.mean(axis=0)))))
        return np.asarray(np.hypot(*(board - np.rint(board)).T) * scale_px - self.diameter_px / 2)


def find_edges(light: NDArray[np.float32], dots_px: Array, diameter_px: float, board_map: BoardMap) -> DotEdges:
    """Measure the blur of the dots' edges: the area from 10 to 90 % of their darkness is the edge's width times its length."""
    reach = int(diameter_px * 0.75)
    smooth = cv2.GaussianBlur(light, (0, 0), SMOOTHING_PX)
    widths = []
    for x, y in np.rint(dots_px).astype(int).tolist():
        window = smooth[max(0, y - reach) : y + reach + 1, max(0, x - reach) : x + reach + 1]
        black, white = np.quantile(window, [0.05, 0.95])
        darkness = (white - window) / (white - black)
        widths.append(((darkness > 0.1) & (darkness < 0.9)).sum() / (np.pi * diameter_px))
    sigma_px = float(np.median(widths)) / SIGMAS_10_TO_90
    return DotEdges(board_map, diameter_px, sigma_px)
