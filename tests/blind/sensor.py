"""From specific force at the housing to the rows of a recording: mounting, axes, drift, lag, sampling, noise, digits, clock."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from tests.blind.mechanics import Array, Motion

STANDARD_GRAVITY_M_S2 = 9.80665

Addition = Callable[[Array], Array]
"""Times, s, shape (n,) -> what is added, g, shape (n, 3)."""
Distortion = Callable[[Array, Array], Array]
"""Times, s, and readings, g -> readings, g; both on the engine's own steps."""


@dataclass(frozen=True, slots=True)
class Lag:
    """A low-pass of equal poles in front of the sampling."""

    cutoff_hz: float
    """Of each pole."""
    poles: int


@dataclass(frozen=True, slots=True)
class Sensor:
    """The true chain; as it stands here, the believed one."""

    mount: Array = field(default_factory=lambda: np.eye(3))
    """R_sensor_from_housing."""
    axes: Array = field(default_factory=lambda: np.eye(3))
    """Scale factors on the diagonal, cross-axis sensitivity beside it."""
    offset_g: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drift_g_per_c: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drift_limit_c: float = np.inf
    """The offset follows the temperature no further than this above the reference."""
    shaking: tuple[Addition, ...] = ()
    """Accelerations of the housing that are no part of the crane's motion."""
    distortions: tuple[Distortion, ...] = ()
    lag: Lag | None = None
    full_scale_g: float = 2.0
    lsb_g: float = 0.0
    hold_s: float = 0.0
    """The sensor's own interval, in which a row of the file shows the latest reading; 0: it has one for each row."""
    averages: bool = False
    """A reading is the mean over the interval before it."""
    clock_relative: float = 0.0
    """Stated seconds for one true second, less one."""
    loss_fraction: float = 0.0


@dataclass(frozen=True, slots=True)
class Sampling:
    """When it samples and how well."""

    rate_hz: float
    noise_g: float
    noise_memory: float = 0.0
    """Correlation of neighbouring samples' noise; the rms stays `noise_g`."""
    jitter_s: float = 0.0
    """Spread of the instants about the even ones; the recording states it."""
    stamp_s: float = 0.0
    """Spread of the stated times about the instants; the recording does not know it."""


@dataclass(frozen=True, slots=True)
class Temperature:
    """A housing that warms up: start + rise (1 - exp(-t/constant))."""

    start_c: float
    rise_c: float
    constant_s: float
    noise_c: float = 0.05

    def at(self, time_s: Array) -> Array:
        """True temperature, shape (n,)."""
        warmed: Array = self.start_c + self.rise_c * (1 - np.exp(-time_s / self.constant_s))
        return warmed


@dataclass(frozen=True, slots=True)
class Recording:
    """Rows as a logger writes them."""

    time_s: Array
    force_g: Array
    temperature_c: Array


def analogue(motion: Motion, sensor: Sensor, temperature: Temperature) -> Array:
    """Readings before sampling, g, on the engine's steps, shape (n, 3)."""
    time_s = motion.time_s
    force_g = motion.force_m_s2 / STANDARD_GRAVITY_M_S2 @ sensor.mount.T
    for shake in sensor.shaking:
        force_g = force_g + shake(time_s)
    warmth_c = np.minimum(temperature.at(np.maximum(time_s, 0.0)) - temperature.start_c, sensor.drift_limit_c)
    reading_g = force_g @ sensor.axes.T + np.array(sensor.offset_g) + np.outer(warmth_c, sensor.drift_g_per_c)
    for distort in sensor.distortions:
        reading_g = distort(time_s, reading_g)
    return reading_g if sensor.lag is None else _lagging(time_s, reading_g, sensor.lag)


def record(
    motion: Motion, sensor: Sensor, sampling: Sampling, temperature: Temperature, count: int, rng: np.random.Generator
) -> Recording:
    """`count` even samples, less those that are lost."""
    even_s = np.arange(count) / sampling.rate_hz
    instant_s = np.maximum(even_s + sampling.jitter_s * rng.normal(size=count), 0.0)
    analogue_g = analogue(motion, sensor, temperature)
    taken_s, latest = instant_s, np.arange(count)
    if sensor.hold_s:
        taken_s, latest = _own_instants(instant_s, sensor.hold_s, float(rng.random()))
    reading_g = at_times(motion.time_s, analogue_g, taken_s)
    if sensor.averages:
        reading_g = _mean_before(motion.time_s, analogue_g, taken_s, sensor.hold_s)
    reading_g = (reading_g + sampling.noise_g * _noise(rng, len(taken_s), sampling.noise_memory))[latest]
    reading_g = np.clip(reading_g, -sensor.full_scale_g, sensor.full_scale_g)
    if sensor.lsb_g:
        reading_g = sensor.lsb_g * np.round(reading_g / sensor.lsb_g)
    warmth_c = temperature.at(instant_s) + temperature.noise_c * rng.normal(size=count)
    stated_s = (instant_s + sampling.stamp_s * rng.normal(size=count)) * (1 + sensor.clock_relative)
    kept = np.flatnonzero(rng.random(count) >= sensor.loss_fraction)
    # A logger that counts samples does not see the lost ones: the times stay even.
    return Recording(stated_s[: len(kept)], reading_g[kept], warmth_c[kept])


def _own_instants(row_s: Array, hold_s: float, phase: float) -> tuple[Array, NDArray[np.int64]]:
    """When a sensor with its own interval samples, and the latest of its samples at each row."""
    number = np.floor(row_s / hold_s - phase).astype(np.int64)
    own, latest = np.unique(number, return_inverse=True)
    return np.maximum((own + phase) * hold_s, 0.0), latest


def _mean_before(grid_s: Array, values: Array, time_s: Array, over_s: float) -> Array:
    """Mean of the columns over an interval that ends at each time, or begins at 0."""
    area = np.zeros_like(values)
    area[1:] = np.cumsum((values[1:] + values[:-1]) / 2 * np.diff(grid_s)[:, None], axis=0)
    from_s = np.minimum(np.maximum(time_s - over_s, 0.0), time_s - 1e-4)
    mean: Array = (at_times(grid_s, area, time_s) - at_times(grid_s, area, from_s)) / (time_s - from_s)[:, None]
    return mean


def at_times(grid_s: Array, values: Array, time_s: Array) -> Array:
    """Columns of `values` between the grid's times, by straight lines, shape (len(time_s), columns)."""
    return np.stack([np.interp(time_s, grid_s, column) for column in values.T], axis=1)


def _noise(rng: np.random.Generator, count: int, memory: float) -> Array:
    """Unit variance, shape (count, 3); neighbours correlated by `memory`."""
    white = rng.normal(size=(count, 3))
    white[1:] *= np.sqrt(1 - memory**2)
    noise: Array = lfilter([1.0], [1.0, -memory], white, axis=0)
    return noise


def _lagging(time_s: Array, reading_g: Array, lag: Lag) -> Array:
    """Each pole by the exact response to a straight line between steps."""
    step_s = float(time_s[1] - time_s[0])
    x = 2 * np.pi * lag.cutoff_hz * step_s
    keep = np.exp(-x)
    now, before = 1 - (1 - keep) / x, (1 - keep) / x - keep
    for _ in range(lag.poles):
        settled = (1 - now) * reading_g[:1]
        reading_g, _ = lfilter([now, before], [1.0, -keep], reading_g, axis=0, zi=settled)
    return reading_g
