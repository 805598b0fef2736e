"""Angular rates of a device with a gyroscope, in the frame of the housing."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from devices.axes_map import AxesMap, map_axes
from devices.block import DeviceInfo, SampleBlock
from devices.saturation import angular_rates
from gateway.motion.gyro_reading import GyroPrior
from gateway.numerics.array import Array

BIAS_LIMIT_RAD_S = np.radians(20.0)
"""Limit of the reading at rest of a gyroscope without one in its data sheet."""


def gyro_prior(bias_limit_rad_s: float | None = None, noise_rad_s: float | None = None) -> GyroPrior:
    """Return what is known of a gyroscope before its first reading: a bias anywhere within its limit."""
    return GyroPrior((BIAS_LIMIT_RAD_S if bias_limit_rad_s is None else bias_limit_rad_s) / 3**0.5, noise_rad_s)


def device_gyro(info: DeviceInfo) -> GyroPrior | None:
    """Return what is known of a device's gyroscope; None where it has none."""
    if info.gyro_rad_s_per_count is None:
        return None
    return gyro_prior(info.gyro_bias_rad_s, info.gyro_noise_rad_s)


def housing_rates(blocks: Sequence[SampleBlock], rad_s_per_count: float | None, axes: AxesMap) -> Array | None:
    """Return the rates of consecutive blocks, shape (n, 3), NaN where a sample has none; None without a gyroscope."""
    if rad_s_per_count is None:
        return None
    parts = [_rates(block.gyro_counts, len(block), rad_s_per_count) for block in blocks]
    return map_axes(np.concatenate(parts), axes)


def _rates(counts: NDArray[np.int32] | None, length: int, rad_s_per_count: float) -> Array:
    if counts is None:
        return np.full((length, 3), np.nan)
    return angular_rates(counts, rad_s_per_count)
