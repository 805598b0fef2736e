"""Live read-out for aligning: the last full turn, as readings arrive."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from gateway.calibration.alignment.turn import Turn, fit_turn, shaft_axis, turning_angle_rad
from gateway.calibration.alignment.turn_advice import HOUSING_DEVIATION_RAD, AligningUnit, TurnAdvice, advise_after_turn
from gateway.numerics.array import Array

MAX_READINGS = 6000
"""Readings that are kept: ten minutes at ten readings per second. Basis: a choice; ten minutes at ten readings per second, longer
than a turn, and a bound of the memory."""
OVERSHOOT_RAD = np.radians(60.0)
"""Angle after a turn, rad, that the next one leaves out. Basis: a person stops a little later, and turns a screw there."""
MIN_TURN_READINGS = 48
"""Least number of readings of a turn. Basis: two in each sector."""


@dataclass(frozen=True, slots=True)
class TurnReadout:
    """What a person at the screws sees."""

    turned_rad: float
    """Angle since the last complete turn, 0 to 2 pi."""
    n_turns: int
    """Number of complete turns."""
    turn: Turn | None
    """The last complete turn."""
    advice: TurnAdvice | None
    time_s: float | None
    """Time of the last reading of that turn."""


class TurnMonitor:
    """Finds the axis along the shaft and each complete turn about it. The angle counts whichever way the shaft is turned."""

    def __init__(
        self,
        unit: AligningUnit | None = None,
        axis: int | None = None,
        *,
        step_g: float = 0.0,
        housing_deviation_rad: float = HOUSING_DEVIATION_RAD,
    ) -> None:
        """`axis` is the axis along the shaft; None: it is found. `step_g` is the quantisation step."""
        self._unit = unit
        self._housing_deviation_rad = housing_deviation_rad
        self._axis = axis
        self._step_g = step_g
        self._readings: deque[tuple[float, float, float, float]] = deque(maxlen=MAX_READINGS)
        self._view = TurnReadout(0.0, 0, None, None, None)

    def add(self, time_s: float, force_g: Array) -> TurnReadout:
        """Add one reading of the three sensor axes in g, shape (3,), and return the read-out."""
        x, y, z = force_g.tolist()
        self._readings.append((time_s, x, y, z))
        if len(self._readings) < 2:
            return self._view
        readings = np.array(self._readings)
        axis = self._axis if self._axis is not None else shaft_axis(readings[:, 1:])
        if axis is None:
            return self._view
        angle_rad = turning_angle_rad(readings[:, 1:], axis)
        turned_rad = float(np.ptp(angle_rad))
        overshoot_rad = OVERSHOOT_RAD if self._view.n_turns else 0.0
        if turned_rad >= 2 * np.pi + overshoot_rad and len(readings) >= MIN_TURN_READINGS:
            before = np.flatnonzero(np.abs(angle_rad - angle_rad[-1]) > 2 * np.pi)
            self._complete_turn(readings[before[-1] + 1 if len(before) else 0 :], axis)
            turned_rad = 0.0
        self._view = TurnReadout(turned_rad, self._view.n_turns, self._view.turn, self._view.advice, self._view.time_s)
        return self._view

    def _complete_turn(self, readings: Array, axis: int) -> None:
        self._readings.clear()
        turn = fit_turn(readings[:, 1:], axis, self._step_g)
        if turn is None:
            return
        advice = advise_after_turn(turn, self._view.turn, self._unit, housing_deviation_rad=self._housing_deviation_rad)
        self._view = TurnReadout(0.0, self._view.n_turns + 1, turn, advice, float(readings[-1, 0]))


def sensor_force_g(force_g: Array, gain: Array) -> Array:
    """Return the readings of the sensor's own axes, without the correction of their misalignment, from (..., 3) in the housing.

    `gain` is that of the correction in force, g per raw unit, shape (3, 3). Screws act on the axes as they are, so a correction
    that hides their misalignment must be undone.
    """
    sensitivity = np.linalg.inv(gain)
    return np.asarray(force_g @ (sensitivity / np.linalg.norm(sensitivity, axis=1, keepdims=True)).T)
