"""The simulated crane: a spherical pendulum driven by a schedule of events, with its true state at any time.

The motion is integrated on a fixed grid from time 0 and interpolated, so that the result at a time does not depend on the other
times of a call. The damping of the rope is viscous, F/m = -2 zeta w0 L n'.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.pendulum import equations, pendulum
from devices.pendulum.equations import Vector
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2, small_swing_rate_1_s
from devices.simulated.schedule import Drive, Event, Gust, Hoist, Schedule, TrolleyMove

Array = NDArray[np.float64]

STEP_S = 1 / 32
"""Integration step, a power of two so that the grid is exact. Basis: the error is about 1e-9 rad with a rope of 2 m."""
STEPS_AT_ONCE = 16
"""Basis: a choice; half a second, and numpy's cost is per call."""
HISTORY_STEPS = 2048
"""Basis: a choice; a minute, longer than a device lags."""
HISTORY_S = HISTORY_STEPS * STEP_S / 2
"""Times that may be requested again: at most this much older than the newest requested time."""


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """The true state of the crane at n times."""

    rope_angle_rad: Array
    """Angle between rope and vertical, shape (n,)."""
    direction: Array
    """Unit vector from the pivot to the load in the world frame, shape (n, 3)."""
    up_in_housing: Array
    """The vertical in the housing frame, shape (n, 3): (0, 0, 1) when the load hangs straight."""
    length_m: Array
    """Pivot to the load's centre, shape (n,)."""
    position_m: Array
    """Pivot to the accelerometer, shape (n,)."""
    trolley: NDArray[np.bool_]
    """The trolley or the bridge accelerates or brakes, shape (n,)."""
    gust: NDArray[np.bool_]
    hoisting: NDArray[np.bool_]

    @property
    def rho(self) -> Array:
        """Position of the housing divided by the rope's length, shape (n,)."""
        return self.position_m / self.length_m

    @property
    def free(self) -> NDArray[np.bool_]:
        """The load is not driven: it hangs or swings freely, shape (n,)."""
        return ~(self.trolley | self.gust | self.hoisting)


class Crane:
    """Advances in time up to the newest requested time; keeps the last `HISTORY_S`."""

    def __init__(
        self,
        *,
        length_m: float,
        position_m: float,
        gravity_m_s2: float = STANDARD_GRAVITY_M_S2,
        events: Iterable[Event] = (),
        motion: Array | None = None,
        damping_ratio: float = 0.0,
        wind_m_s2: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """`length_m` and `position_m` at time 0; `events` in the order of their starts; `motion` at time 0 (default: hanging
        still)."""
        if not 0 <= position_m <= length_m:
            raise ValueError(f"position_m {position_m:g} must lie on the rope of length_m {length_m:g}")
        self.gravity_m_s2 = gravity_m_s2
        self._above_load_m = length_m - position_m
        self._schedule = Schedule(events, length_m, wind_m_s2)
        self._damping_hz = 2 * damping_ratio * small_swing_rate_1_s(length_m, gravity_m_s2)
        self._motions = np.empty((HISTORY_STEPS, 3, 3))
        self._rates = np.empty((HISTORY_STEPS, 3, 3))
        self._newest = 0
        self._advance(pendulum.start_motion(0.0, 0.0, 0.0, 0.0) if motion is None else motion)

    def specific_force_m_s2(self, time_s: Array) -> Array:
        """Return the specific force at the housing in its own axes, shape (n, 3), at increasing times (n,), n >= 1.

        Raises `ValueError` for a time before the history.
        """
        return np.concatenate([self._specific_force_m_s2(part) for part in self._split_times(time_s)])

    def truth(self, time_s: Array) -> GroundTruth:
        """Return the true state at increasing times (n,). Raises `ValueError` for a time before the history."""
        parts = [self._truth(part) for part in self._split_times(time_s)]
        return GroundTruth(*(np.concatenate([getattr(part, name) for part in parts]) for name in GroundTruth.__slots__))

    def captions(self, after_s: float, until_s: float) -> list[str]:
        """Return what begins between two times within the history, in words."""
        return self._schedule.captions(after_s, until_s)

    def _split_times(self, time_s: Array) -> list[Array]:
        """Return parts of the times that fit into the history."""
        if time_s[-1] - time_s[0] <= HISTORY_S:
            return [time_s]
        cuts = np.arange(time_s[0] + HISTORY_S, time_s[-1], HISTORY_S)
        return [part for part in np.split(time_s, np.searchsorted(time_s, cuts)) if len(part)]

    def _specific_force_m_s2(self, time_s: Array) -> Array:
        motion, drive = self._motion(time_s), self._schedule.at(time_s)
        n, n_rate = motion[:, 0], motion[:, 1]
        acting_m_s2 = self._with_damping(self._acting(drive), n_rate, drive.length_m)
        return pendulum.specific_force_m_s2(
            motion,
            pendulum.acceleration_of_direction(n, n_rate, acting_m_s2, drive.length_m, drive.length_rate_m_s),
            drive.pivot_acceleration_m_s2,
            self.gravity_m_s2,
            drive.length_m - self._above_load_m,
            drive.length_rate_m_s,
            drive.length_acceleration_m_s2,
        )

    def _truth(self, time_s: Array) -> GroundTruth:
        motion, schedule = self._motion(time_s), self._schedule
        n = motion[:, 0]
        length_m = schedule.at(time_s).length_m[:, 0]
        return GroundTruth(
            rope_angle_rad=np.arctan2(np.hypot(n[:, 0], n[:, 1]), -n[:, 2]),
            direction=n,
            up_in_housing=pendulum.housing_axes(motion)[:, :, 2],
            length_m=length_m,
            position_m=length_m - self._above_load_m,
            trolley=schedule.acts(TrolleyMove, time_s),
            gust=schedule.acts(Gust, time_s),
            hoisting=schedule.acts(Hoist, time_s),
        )

    def _motion(self, time_s: Array) -> Array:
        """Return the motion by cubic Hermite interpolation between grid points, shape (n, 3, 3)."""
        while self._newest * STEP_S <= time_s[-1]:
            self._advance(self._motions[self._newest % HISTORY_STEPS])
        oldest_s = max(0, self._newest - HISTORY_STEPS + 1) * STEP_S
        if time_s[0] < oldest_s:
            raise ValueError(f"the crane keeps {oldest_s:g} s and later; {time_s[0]:g} s is before that")
        step = np.floor(time_s / STEP_S).astype(np.int64)
        s = (time_s / STEP_S - step)[:, None, None]
        before, after = step % HISTORY_STEPS, (step + 1) % HISTORY_STEPS
        start, end = self._motions[before], self._motions[after]
        start_slope, end_slope = STEP_S * self._rates[before], STEP_S * self._rates[after]
        rise = end - start
        cubic = start_slope + end_slope - 2 * rise
        motion: Array = start + s * (start_slope + s * (rise - start_slope - cubic + s * cubic))
        return motion

    def _advance(self, motion: Array) -> None:
        """Integrate the next `STEPS_AT_ONCE` steps; the drives at all their stages are computed in one call."""
        first = self._newest
        drive = self._schedule.at((first + np.arange(2 * STEPS_AT_ONCE + 1) / 2) * STEP_S)
        acting = [tuple(row) for row in self._acting(drive).tolist()]
        length, length_rate = drive.length_m[:, 0].tolist(), drive.length_rate_m_s[:, 0].tolist()

        def rate(time_s: float, motion: Array) -> Array:
            at = round(time_s * 2 / STEP_S)
            return np.array(self._rate(motion.tolist(), acting[at], length[at], length_rate[at]))

        motions, rates = [motion], [rate(0.0, motion)]
        for step in range(STEPS_AT_ONCE):
            end = pendulum.runge_kutta_step(rate, step * STEP_S, motions[-1], STEP_S, rates[-1])
            motions.append(end if step < STEPS_AT_ONCE - 1 else _project_onto_sphere(end))
            rates.append(rate((step + 1) * STEP_S, motions[-1]))
        kept = np.arange(first, first + STEPS_AT_ONCE + 1) % HISTORY_STEPS
        self._motions[kept], self._rates[kept] = motions, rates
        self._newest = first + STEPS_AT_ONCE
        self._schedule.prune_past((self._newest - HISTORY_STEPS) * STEP_S)

    def _rate(self, motion: list[Vector], acting: Vector, length: float, length_rate: float) -> list[Vector]:
        """Return the derivative of one motion; plain numbers are faster than arrays here."""
        n, n_rate, x_axis = motion
        drive = equations.add(acting, equations.scale(-self._damping_hz * length, n_rate))
        n_acceleration = equations.acceleration_of_direction(n, n_rate, drive, length, length_rate)
        return [n_rate, n_acceleration, equations.transport_rate(n, n_rate, x_axis)]

    def _acting(self, drive: Drive) -> Array:
        """Return g - a_p + F/m of the external forces, shape (n, 3)."""
        gravity_m_s2: Array = np.array([0.0, 0.0, -self.gravity_m_s2])
        return drive.force_m_s2 - drive.pivot_acceleration_m_s2 + gravity_m_s2

    def _with_damping(self, acting_m_s2: Array, n_rate: Array, length_m: Array) -> Array:
        return acting_m_s2 - self._damping_hz * length_m * n_rate


def _project_onto_sphere(motion: Array) -> Array:
    """Project the motion back onto the unit sphere, so that rounding errors do not accumulate."""
    n = motion[0] / np.linalg.norm(motion[0])
    n_rate = motion[1] - np.dot(n, motion[1]) * n
    x_axis = motion[2] - np.dot(n, motion[2]) * n
    return np.array([n, n_rate, x_axis / np.linalg.norm(x_axis)])
