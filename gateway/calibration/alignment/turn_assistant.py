"""The read-out of turns, the last full one as readings arrive, for terminal and page, while a sensor is turned on a shaft."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from gateway.calibration.alignment.turn_advice import (
    AXES,
    HOUSING_DEVIATION_RAD,
    AligningUnit,
    Turn,
    TurnAdvice,
    advise_after_turn,
    fit_turn,
    shaft_axis,
    turning_angle_rad,
)
from gateway.messages import Tilt
from gateway.numerics.array import Array

MAX_READINGS = 6000
"""Readings that are kept. Basis: a choice; ten minutes at ten a second, longer than a turn, and a bound of the memory."""
OVERSHOOT_RAD = np.radians(60.0)
"""Angle after a turn, rad, that the next one leaves out. Basis: a person stops a little later, and turns a screw there."""
MIN_TURN_READINGS = 48
"""Least number of readings of a turn. Basis: two in each sector."""
MIN_AXIAL_DEG = 30.0
"""Tilt, degrees, that shows that a sensor is off its rope. Basis: a hanging housing leans by less."""
FORGET_S = 120.0
"""Time after the last such tilt, s, after which the read-out ends. Basis: a choice; a person looks for a spanner in less, and the
read-out does not stay all day."""


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


class TurnAssistant:
    """Reads turns from tilts while the sensor is off its rope. A correction in force is undone: screws act on the real axes."""

    def __init__(self, unit: AligningUnit | None = None, axis: int | None = None) -> None:
        self._unit = unit
        self._axis = axis
        self._gain = np.eye(3)
        self._monitor = TurnMonitor(unit, axis)
        self._view: TurnReadout | None = None
        self._turned_ns: int | None = None

    def set_gain(self, gain: object) -> None:
        """Set the gain of the correction in force, g per raw unit, 3 x 3 numbers; a new one starts the read-out again.

        Without one, or with one that cannot be undone, readings count as they come.
        """
        matrix = _invertible(gain)
        if not np.array_equal(matrix, self._gain):
            self._gain = matrix
            self._restart()

    def add_tilt(self, tilt: Tilt) -> TurnReadout | None:
        """Return the read-out after a tilt; None while the sensor hangs."""
        if tilt.specific_force_g is None:
            return self._view
        if tilt.axial_deg is not None and tilt.axial_deg > MIN_AXIAL_DEG:
            self._turned_ns = tilt.time_ns
        if self._turned_ns is None or tilt.time_ns - self._turned_ns > FORGET_S * 1e9:
            if self._view is not None:
                self._restart()
            return None
        force_g = sensor_force_g(np.array(tilt.specific_force_g), self._gain)
        self._view = self._monitor.add(tilt.time_ns / 1e9, force_g)
        return self._view

    def _restart(self) -> None:
        self._monitor = TurnMonitor(self._unit, self._axis)
        self._view = None
        self._turned_ns = None


def _invertible(gain: object) -> Array:
    try:
        matrix = np.array(gain, dtype=np.float64)
    except (TypeError, ValueError):
        return np.eye(3)
    is_usable = matrix.shape == (3, 3) and np.isfinite(matrix).all() and np.linalg.matrix_rank(matrix) == 3
    return matrix if is_usable else np.eye(3)


def format_turn(view: TurnReadout) -> str:
    """Return the read-out in one line."""
    turn, advice = view.turn, view.advice
    turned = f"{math.degrees(view.turned_rad):.0f} deg of turn {view.n_turns + 1}"
    if turn is None or advice is None:
        return f"{turned}: turn the shaft slowly, once round"
    return (
        f"{AXES[turn.axis]}: {1000 * turn.peak_to_peak_g:.2f} mg peak-to-peak, floor {1000 * turn.floor_g:.2f} mg; "
        f"{advice.text}; {turned}"
    )


def format_errors(view: TurnReadout) -> str:
    """Return APE and TAE of the last turn (Łuczak et al. 2022, eq. 1 and 2)."""
    if view.advice is None:
        return "no complete turn"
    precision_deg, total_deg = math.degrees(view.advice.precision_error_rad), math.degrees(view.advice.total_error_rad)
    return f"APE {precision_deg:.3f} deg, TAE {total_deg:.3f} deg"
