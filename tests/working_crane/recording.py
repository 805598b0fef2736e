"""A case simulated and sampled: the rows of the log and the truth at every sample."""

from dataclasses import dataclass

import numpy as np

from tests.blind.mechanics import Array
from tests.working_crane.commands import Commands, commands
from tests.working_crane.crane import DURATION_S, RATE_HZ, Case
from tests.working_crane.engine import Motion, simulate, step_s
from tests.working_crane.sensor import readings


@dataclass(frozen=True, slots=True)
class Recording:
    """`time_s` and `reading_g` lack the lost samples; `truth` is complete."""

    time_s: Array
    reading_g: Array
    truth: dict[str, Array]
    rate_rad_s: Array
    """True angular rate of the housing in its own frame, at the rows of `reading_g`, shape (n, 3)."""

    @property
    def largest_deg(self) -> float:
        return float(self.truth["angle_deg"].max())


def record(case: Case, duration_s: float = DURATION_S) -> Recording:
    """Simulate the case, or its beginning, and sample it."""
    per_sample = round(1 / (RATE_HZ * step_s(case.crane)))
    lead_in = round(case.lead_in_s * RATE_HZ)
    count = round(duration_s * RATE_HZ)
    half_steps = np.arange(2 * per_sample * (lead_in + count)) - 2 * per_sample * lead_in
    given = commands(case.crane, case.events, case.steady_wind_m_s2, half_steps * step_s(case.crane) / 2)
    motion = simulate(case.crane, given, case.tilt_rad, case.rigging_tilt_rad)
    start = lead_in * per_sample
    kept = slice(start, start + count * per_sample, per_sample)
    truth = _truth(case, motion, kept, given, slice(2 * start, None, 2 * per_sample))
    heading = np.radians(truth["heading_deg"])
    kept_rows, reading_g = readings(case, truth["time_s"], _turned(motion.force_m_s2[kept], heading))
    rate_rad_s = _turned(motion.rate_rad_s[kept], heading)
    rate_rad_s[:, 2] += np.gradient(heading, truth["time_s"])
    return Recording(truth["time_s"][kept_rows], reading_g, truth, rate_rad_s[kept_rows])


def _truth(case: Case, motion: Motion, rows: slice, given: Commands, half: slice) -> dict[str, Array]:
    n, rate = motion.direction[rows], motion.direction_rate[rows]
    across = np.hypot(n[:, 0], n[:, 1])
    pivot, wind = given.pivot_m_s2[half], given.wind_m_s2[half]
    return {
        "time_s": np.arange(len(n)) / RATE_HZ,
        "angle_deg": np.degrees(np.arctan2(across, -n[:, 2])),
        "azimuth_deg": np.degrees(np.arctan2(n[:, 1], n[:, 0])),
        "driven": given.driven[half].astype(float),
        "hoisting": given.hoisting[half].astype(float),
        "gust": given.unsteady_wind[half].astype(float),
        "length_m": case.crane.length_m + motion.paid_out_m[rows],
        "rate_deg_s": np.degrees(np.linalg.norm(rate, axis=1)),
        "angle_rate_deg_s": np.degrees(np.sum(n[:, :2] * rate[:, :2], axis=1) / np.maximum(across, 1e-9) / -n[:, 2]),
        "pivot_accel_x_m_s2": pivot[:, 0],
        "pivot_accel_y_m_s2": pivot[:, 1],
        "pivot_accel_z_m_s2": pivot[:, 2],
        "hoist_m_s": given.hoist_m_s[half],
        "wind_x_m_s2": wind[:, 0],
        "wind_y_m_s2": wind[:, 1],
        "heading_deg": np.degrees(given.heading_rad[half]),
        "rigging_angle_deg": np.degrees(np.arctan2(np.hypot(*motion.rigging[rows, :2].T), -motion.rigging[rows, 2])),
    }


def _turned(force: Array, heading_rad: Array) -> Array:
    """Return the vectors in axes turned about the rope, shape (n, 3)."""
    cosine, sine = np.cos(heading_rad), np.sin(heading_rad)
    x, y, z = force.T
    return np.column_stack([x * cosine + y * sine, y * cosine - x * sine, z])
