"""The attitude of a housing at rest: which of its faces is up."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from devices.axes_map import AxesMap
from devices.block import DeviceInfo, SampleBlock
from gateway.daemon.check_result import CheckResult

SCALE_TOLERANCE = 0.1
"""Relative tolerance of the magnitude at rest, besides the zero-g offsets of the data sheet."""
FACE_UP_G = 0.8
"""Least share of one g along the axis that points up."""


def check_attitude(info: DeviceInfo, axes: AxesMap, blocks: list[SampleBlock]) -> Iterator[CheckResult]:
    """Say which face of the housing is up in readings at rest, with a sketch, and whether their magnitude is one g."""
    sensor_g: NDArray[np.float64] = np.concatenate([block.raw for block in blocks]).mean(axis=0) / info.units_per_g
    magnitude_g = float(np.linalg.norm(sensor_g))
    tolerance_g = 3**0.5 * (info.zero_g_offset_g or 0.0) + SCALE_TOLERANCE
    if abs(magnitude_g - 1) > tolerance_g:
        possible = f"{max(1 - tolerance_g, 0):.2f} to {1 + tolerance_g:.2f} is possible"
        text = f"{magnitude_g:.3f} g at rest, {possible}; check kind and range"
        yield CheckResult("bad", "reading", text, {"sensor_g": sensor_g.tolist(), "magnitude_g": magnitude_g})
        return
    housing_g = np.array([sign * sensor_g[index] for index, sign in axes])
    readings = ", ".join(f"{axis} {value:+.3f}" for axis, value in zip("xyz", housing_g, strict=True))
    values = {"housing_g": housing_g.tolist(), "magnitude_g": magnitude_g}
    largest = int(np.abs(housing_g).argmax())
    up = ("-" if housing_g[largest] < 0 else "+") + "xyz"[largest]
    upright = largest == 2 and housing_g[2] > FACE_UP_G
    advice = "" if upright else "; on the rope +z must point up: turn the housing or set device.axes_map"
    text = f"the housing's {up} face is up ({readings} g){advice}"
    sketch = sketch_housing(largest, -1 if housing_g[largest] < 0 else 1, axes)
    yield CheckResult("good" if upright else "note", "attitude", text, values, sketch)


def sketch_housing(axis: int, sign: int, axes: AxesMap) -> tuple[str, ...]:
    """Return the lines of a sketch of the housing, one face of which is up, and where the sensor's axes are in it.

    The faces in front and on the right are those of a housing that was turned the shortest way.
    """
    up, right = (axis, sign), ((axis + 1) % 3, 1)
    front = (axis + 2) % 3, -sign  # up, right and back are right-handed
    sensor = [f"{'-' if turned < 0 else '+'}{'xyz'[index]}" for index, turned in axes]
    names = ", ".join(f"{name} is {each}" for name, each in zip("xyz", sensor, strict=True))
    return (
        "   +--------+     up",
        f"  /   {_face(up)}  /|     ^",
        " +--------+ |     |",
        f" |        |{_face(right)}",
        f" |   {_face(front)}   | +     faces of the housing",
        " |        |/      by the sensor's axes: " + names,
        " +--------+",
    )


def _face(face: tuple[int, int]) -> str:
    return f"{'-' if face[1] < 0 else '+'}{'xyz'[face[0]]}"
