"""Axes maps: which axis of a source, with which sign, is the x, y and z of the result."""

import numpy as np
from numpy.typing import NDArray

AxesMap = tuple[tuple[int, int], ...]
"""For each axis of the result the index and the sign of the axis of the source along it."""
SAME_AXES: AxesMap = ((0, 1), (1, 1), (2, 1))


def parse_axes_map(text: str) -> AxesMap:
    """Return the map in a text such as `-y,x,z`. Raises `ValueError` where it is none, or a mirror image."""
    axes = [axis.strip() for axis in text.split(",")]
    if sorted(axis.removeprefix("-").removeprefix("+") for axis in axes) != ["x", "y", "z"]:
        raise ValueError(f"{text!r} must name x, y and z once each, such as '-y,x,z'")
    parsed = tuple(("xyz".index(axis[-1]), -1 if axis.startswith("-") else 1) for axis in axes)
    if _is_mirrored(parsed):
        raise ValueError(f"{text!r} is left-handed (a mirror image); turn one sign")
    return parsed


def _is_mirrored(axes: AxesMap) -> bool:
    even = [index for index, _ in axes] in ([0, 1, 2], [1, 2, 0], [2, 0, 1])
    negative = sum(sign < 0 for _, sign in axes) % 2 == 1
    return even == negative


def map_axes(vectors: NDArray[np.float64], axes: AxesMap) -> NDArray[np.float64]:
    """Return vectors, shape (n, 3), in the axes of the result."""
    return vectors[:, [index for index, _ in axes]] * np.array([sign for _, sign in axes], dtype=np.float64)
