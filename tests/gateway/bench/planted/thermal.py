"""Temperature sessions with known coefficients: ramps, steps and service at rest, with lag, slow noise and drift in time.

    reading = offset + o1 dT + o2 dT^2 + sensitivity (1 + s1 dT) (axis row . up)        dT = element - 25 °C

The thermometer follows the element by a first-order lag. Slow noise is a sum of first-order processes (flicker), drift a straight
line in time of its own in each recording and axis.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
RATE_HZ = 20.0
UP = np.vstack([np.eye(3)[[0]], -np.eye(3)[[0]], np.eye(3)[[1]], -np.eye(3)[[1]], np.eye(3)[[2]], -np.eye(3)[[2]]])
"""Vertical in the housing for +x, -x, +y, -y, +z, -z up."""


@dataclass(frozen=True, slots=True)
class ThermalTruth:
    """Coefficients at 25 °C by axis, shape (3,)."""

    offset_g: Values
    axes: Values
    """Rows: the sensitive axes in the housing times their scale factors, g per g, shape (3, 3)."""
    offset_mg_per_c: Values
    offset_mg_per_c2: Values
    sensitivity_percent_per_c: Values

    def reading_g(self, up: Values, element_c: Values) -> Values:
        """Return noiseless readings, (n, 3), for the vertical `up`, (3,) or (n, 3), at temperatures (n,)."""
        change = (element_c - 25.0)[:, None]
        force = np.atleast_2d(up) @ self.axes.T * (1 + self.sensitivity_percent_per_c / 100 * change)
        drift = self.offset_mg_per_c / 1000 * change + self.offset_mg_per_c2 / 1000 * change**2
        return np.asarray(self.offset_g + force + drift)

    def mean_slopes(self, range_c: tuple[float, float]) -> tuple[Values, Values]:
        """Return mg/°C of the offset between the ends of a range, and %/°C of the sensitivity, at its scale factor."""
        scale = np.diag(self.axes)
        slope = self.offset_mg_per_c + self.offset_mg_per_c2 * (sum(range_c) - 50.0)
        return slope / scale, self.sensitivity_percent_per_c


@dataclass(frozen=True, slots=True)
class Disturbances:
    """What a real session adds to its sensor, all standard deviations."""

    white_g: float = 0.002
    """Noise of a reading at 20 Hz."""
    flicker_g: float = 3e-5
    """Slow noise."""
    drift_g: float = 5e-5
    """Drift in time over a recording."""
    lag_s: float = 0.0
    """Time constant by which the thermometer follows the element; negative: by which the element follows the thermometer."""
    placement_deg: float = 0.2
    """Of a face, about each axis."""
    loop_g: float = 0.0
    """Hysteresis: the offset's distance between warming and cooling."""


def draw_truth(random: np.random.Generator) -> ThermalTruth:
    """Return a sensor of the size of data sheets; one in four has a square in the offset of an axis."""
    square = np.zeros(3)
    if random.random() < 0.25:
        square[random.integers(3)] = random.choice([-1, 1]) * random.uniform(0.005, 0.02)
    return ThermalTruth(
        offset_g=random.normal(0, 0.02, 3),
        axes=np.diag(random.normal(1, 0.02, 3)) @ (np.eye(3) + random.normal(0, 0.01, (3, 3)) * (1 - np.eye(3))),
        offset_mg_per_c=random.normal(0, 1.0, 3),
        offset_mg_per_c2=square,
        sensitivity_percent_per_c=random.normal(0, 0.01, 3),
    )


def lagged(values: Values, tau_s: float) -> Values:
    """Return a series at `RATE_HZ` behind a first-order lag that begins in balance."""
    if tau_s <= 0:
        return values.copy()
    keep = np.exp(-1 / (RATE_HZ * tau_s))
    kernel = keep ** np.arange(round(12 * tau_s * RATE_HZ))
    before = np.full(len(kernel) - 1, values[0])
    return np.asarray(np.convolve(np.concatenate([before, values]), kernel / kernel.sum(), "valid"))


def flicker(random: np.random.Generator, count: int, columns: int) -> Values:
    """Return noise with a spectrum of 1/f below 1 Hz and 1/f^2 above, unit standard deviation, (count, columns)."""
    frequency_hz = np.fft.rfftfreq(2 * count, 1 / RATE_HZ)[1:]
    amplitude = 1 / np.sqrt(frequency_hz * (1 + frequency_hz))
    phases = random.standard_normal((len(amplitude), columns)) + 1j * random.standard_normal((len(amplitude), columns))
    series = np.fft.irfft(np.vstack([np.zeros((1, columns)), amplitude[:, None] * phases]), axis=0)
    return np.asarray(series[:count] / np.sqrt((amplitude**2).sum()) * count)


def ramp_profile(random: np.random.Generator, duration_s: float, there_and_back: bool) -> Values:
    """Return a temperature that an oven gives: linear, or towards a limit it would reach in one to three durations."""
    time = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ / duration_s
    low_c, high_c = random.uniform(-5, 12), random.uniform(45, 60)
    towards = random.uniform(0.4, 3.0)
    leg = np.minimum(2 * time, 2 - 2 * time) if there_and_back else time
    way = (1 - np.exp(-leg / towards)) / (1 - np.exp(-1 / towards))
    return np.asarray(low_c + (high_c - low_c) * way)


def step_profile(random: np.random.Generator, duration_s: float, there_and_back: bool) -> Values:
    """Return plateaus, each approached with a time constant of a tenth of its length."""
    plateaus = int(random.integers(4, 7))
    levels = np.linspace(random.uniform(-5, 12), random.uniform(45, 60), plateaus)
    if there_and_back:
        levels = np.concatenate([levels, levels[-2::-1]])
    count = round(duration_s * RATE_HZ)
    place = np.minimum((np.arange(count) * len(levels)) // count, len(levels) - 1)
    return lagged(levels[place], duration_s / len(levels) / 10)


def loop(element_c: Values, width_c: float, start: float) -> Values:
    """Return the play of a backlash of `width_c`, from -1 (warming) to 1 (cooling), that begins at `start`."""
    state, out = element_c[0] + start * width_c / 2, np.empty_like(element_c)
    for place, value in enumerate(element_c):
        state = min(max(state, value - width_c / 2), value + width_c / 2)
        out[place] = (state - value) / (width_c / 2)
    return out


def thermometer(random: np.random.Generator, element_c: Values) -> Values:
    """Return what a thermometer of 1/16 °C reports, with its noise."""
    return np.asarray(np.rint((element_c + 0.05 * random.standard_normal(len(element_c))) * 16) / 16)


def six_recordings(
    random: np.random.Generator, truth: ThermalTruth, kind: str, duration_s: float, added: Disturbances
) -> list[tuple[Values, Values, Values]]:
    """Return time_s (n,), readings in g (n, 3) and thermometer_c (n,) of the faces +x, -x, ... -z; kind: ramp or steps."""
    make = {"ramp": ramp_profile, "steps": step_profile}[kind]
    there_and_back = bool(random.random() < 0.5)
    width_c, start = random.uniform(2, 8), float(random.random() < 0.5)
    sides_g = added.loop_g / 2 * random.choice([-1, 1], 3)
    found = []
    for up in UP:
        driven_c = make(random, duration_s, there_and_back)
        element_c = lagged(driven_c, -added.lag_s)
        measured_c = thermometer(random, lagged(driven_c, added.lag_s))
        placed = up + np.cross(random.normal(0, np.radians(added.placement_deg), 3), up)
        raw = truth.reading_g(placed / np.linalg.norm(placed), element_c) + disturb(random, len(driven_c), added)
        if added.loop_g:
            raw += np.outer(loop(element_c, width_c, start), sides_g)
        found.append((np.arange(len(raw)) / RATE_HZ, raw, measured_c))
    return found


def disturb(random: np.random.Generator, count: int, added: Disturbances) -> Values:
    """Return white noise, slow noise and drift of one recording, g, (count, 3)."""
    line = np.linspace(-0.5, 0.5, count)[:, None] * random.normal(0, added.drift_g, 3)
    white = added.white_g * random.standard_normal((count, 3))
    return np.asarray(white + added.flicker_g * flicker(random, count, 3) + line)


def service_at_rest(
    random: np.random.Generator, truth: ThermalTruth, lean_rad: Values, duration_s: float, added: Disturbances
) -> tuple[Values, Values, Values]:
    """Return time_s, readings in g and thermometer_c of a housing on a rope, z up: work and rests in turn over a day's warming.

    `lean_rad`, (2,), is the constant lean about x and y; each rest adds one of its own of .05 degrees.
    """
    count = round(duration_s * RATE_HZ)
    time_s = np.arange(count) / RATE_HZ
    day = np.sin(2 * np.pi * (time_s / duration_s * random.uniform(0.4, 1.1) + random.random()))
    driven_c = random.uniform(10, 25) + random.uniform(6, 12) * day
    element_c = lagged(driven_c, -added.lag_s)
    measured_c = thermometer(random, lagged(driven_c, added.lag_s))
    tilt = np.zeros((count, 2))
    start = 0
    while start < count:
        rest, work = (round(RATE_HZ * random.uniform(*span)) for span in ((20, 60), (10, 40)))
        tilt[start : start + rest + work] = lean_rad + random.normal(0, np.radians(0.05), 2)
        swing = slice(start + rest, min(start + rest + work, count))
        phase = 2 * np.pi * 0.2 * np.arange(max(swing.stop - swing.start, 0)) / RATE_HZ
        tilt[swing, 0] += 0.1 * np.sin(phase)
        start += rest + work
    up = np.column_stack([np.sin(tilt), np.sqrt(1 - (np.sin(tilt) ** 2).sum(axis=1))])
    raw = truth.reading_g(up, element_c) + disturb(random, count, added)
    if added.loop_g:
        side = loop(element_c, random.uniform(2, 8), float(random.random() < 0.5))
        raw += np.outer(side, added.loop_g / 2 * random.choice([-1, 1], 3))
    return time_s, raw, measured_c
