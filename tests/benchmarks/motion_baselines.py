"""What the motion filter is compared with: four published formulas of the last period, and a complementary filter.

The complementary filter works on each transverse axis alone. Its slow part is the angle of the specific force against the
housing's axis over 1 - rho, which is right in a small free swing. Its fast part integrates the transverse reading twice, because
at the distance d above the load that is the rope's angular acceleration. Both integrators leak with the time T, and the slow part
fills in what they lose: for the component u of gravity along x

    v' = (g/d) f_x - v/T        u' = v + (s - u)/T        s = -f_x/((1 - rho) f_z)

It is told rho, d and T, which is the best of a grid on the same recordings. It has no model of the swing and no uncertainty.
"""

from dataclasses import astuple

import numpy as np

from gateway.numerics.array import Array
from gateway.stages.lowpass import LowPass
from gateway.swing.formulas import as_published, extremes
from tests.benchmarks.motion_recordings import GRAVITY_M_S2, WorkRecording
from tests.values import present

CUTOFF_HZ, ORDER, RATE_HZ = 1.0, 2, 50.0
EQUATIONS = ("eq. 22", "eq. 23", "eq. 24", "eq. 25")
LEAKS_IN_PERIODS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)


def formula_angles(recording: WorkRecording, at_s: Array) -> Array:
    """Return the angles in rad by which the formulas, as published, state the largest one of the last period.

    Shape (times, 4); NaN where a formula has no answer. The readings are those behind the low-pass.
    """
    smooth_g = LowPass(CUTOFF_HZ, ORDER, RATE_HZ).apply(recording.force_g)
    begins = np.searchsorted(recording.time_s, at_s - recording.period_s)
    ends = np.searchsorted(recording.time_s, at_s, side="right")
    rows = [
        astuple(as_published(present(extremes(smooth_g[begin:end])))) for begin, end in zip(begins, ends, strict=True)
    ]
    return np.array(rows, dtype=np.float64)


def largest_of_last_period(recording: WorkRecording, at_s: Array) -> Array:
    """Return the true largest angle of the last period, deg."""
    time_s, angle_deg = recording.truth["time_s"], recording.truth["angle_deg"]
    begins = np.searchsorted(time_s, at_s - recording.period_s)
    ends = np.searchsorted(time_s, at_s, side="right")
    return np.array([angle_deg[begin:end].max() for begin, end in zip(begins, ends, strict=True)])


def complementary_angle(recording: WorkRecording, leak_s: float, at_s: Array) -> Array:
    """Return the rope's angle in rad by the complementary filter, which is told rho and d, shape (times,)."""
    length_m = recording.above_load_m / (1 - recording.rho)
    return complementary(recording.time_s, recording.force_g, recording.above_load_m, length_m, leak_s, at_s)


def complementary(
    time_s: Array, force_g: Array, above_load_m: float, length_m: float, leak_s: float, at_s: Array
) -> Array:
    """Return the angle in rad by a complementary filter that is told lengths, shape (times,)."""
    x, y, z = force_g.T
    reading = x + 1j * y
    acceleration = (GRAVITY_M_S2 / above_load_m * reading).tolist()
    slow = (-reading / z * length_m / above_load_m).tolist()
    steps_s = np.diff(time_s, prepend=time_s[0]).tolist()
    rate, u, track = 0j, slow[0], []
    for step_s, fast, static in zip(steps_s, acceleration, slow, strict=True):
        share = min(step_s / leak_s, 1.0)
        rate += step_s * fast - share * rate
        u += step_s * rate + share * (static - u)
        track.append(u)
    sine = np.minimum(np.abs(np.array(track)), 1.0)
    angle_rad: Array = np.interp(at_s, time_s, np.arcsin(sine))
    return angle_rad
