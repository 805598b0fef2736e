"""A photograph as linear light: the channel of the laser, and one that does not see it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from gateway.calibration.record import NotDeterminedError
from gateway.errors import InputError
from gateway.numerics.array import Array

LaserColour = Literal["red", "green"]
CHANNELS: dict[LaserColour, tuple[int, int]] = {"red": (2, 1), "green": (1, 2)}
"""Channel of the laser, and channel for the board, in the order blue, green, red."""
LINEAR_VALUE, LINEAR_SLOPE, SRGB_GAMMA, SRGB_SHIFT = 0.04045, 12.92, 2.4, 0.055
"""Exponent and shift from values to light and back (sRGB, IEC 61966-2-1)."""
MIN_SATURATED_VALUE = 250
"""Values from here on are clipped. Basis: a choice; compression lowers a clipped 255 by a few values."""
MIN_SIDE_PX, MAX_SIDE_PX = 200, 20_000
"""Basis: a choice; no board can be measured below, and above a file is no photograph but an attack on the memory."""


@dataclass(frozen=True, slots=True)
class Photograph:
    """One photograph."""

    path: Path
    bgr: NDArray[np.uint8]
    """Pixels, shape (height, width, 3)."""
    colour: LaserColour

    @property
    def laser(self) -> NDArray[np.uint8]:
        """The channel of the laser, shape (height, width)."""
        return self.bgr[:, :, CHANNELS[self.colour][0]]

    @property
    def board(self) -> NDArray[np.uint8]:
        """The channel that shows the board without the laser, shape (height, width)."""
        return self.bgr[:, :, CHANNELS[self.colour][1]]


def read_photograph(path: Path, colour: LaserColour) -> Photograph:
    """Return a photograph, turned as its EXIF data say. Raises `InputError` if it cannot be read."""
    try:
        content = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); name another file") from error
    pixels = cv2.imdecode(content, cv2.IMREAD_COLOR) if len(content) else None
    if pixels is None:
        raise InputError(f"{path}: is no photograph that can be read; use JPEG, PNG or TIFF")
    if not MIN_SIDE_PX <= min(pixels.shape[:2]) <= max(pixels.shape[:2]) <= MAX_SIDE_PX:
        height, width = pixels.shape[:2]
        raise InputError(f"{path}: {width} x {height} pixels; sides from {MIN_SIDE_PX} to {MAX_SIDE_PX} can be used")
    photograph = Photograph(path, np.asarray(pixels, dtype=np.uint8), colour)
    if np.mean(cv2.absdiff(photograph.laser, photograph.board)) == 0:
        raise NotDeterminedError(
            f"{path}: the photograph is grey; the laser spot is found by its colour: take it in colour"
        )
    return photograph


def to_light(values: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the light, 0 to 1, of values of a photograph."""
    share = np.arange(256) / 255
    light = np.where(
        share <= LINEAR_VALUE, share / LINEAR_SLOPE, ((share + SRGB_SHIFT) / (1 + SRGB_SHIFT)) ** SRGB_GAMMA
    )
    return np.asarray(light.astype(np.float32)[values])


def to_share(light: Array) -> Array:
    """Return the values of a photograph, 0 to 1, of light; the noise of values is uniform."""
    power = (1 + SRGB_SHIFT) * np.maximum(light, 0) ** (1 / SRGB_GAMMA) - SRGB_SHIFT
    return np.where(light <= LINEAR_VALUE / LINEAR_SLOPE, LINEAR_SLOPE * light, power)
