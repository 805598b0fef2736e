"""The read-out of turns from live tilts: for the terminal and the page, while a sensor is turned on a shaft."""

import math

import numpy as np

from gateway.calibration.alignment.turn_advice import AXES, AligningUnit
from gateway.calibration.alignment.turn_monitor import TurnMonitor, TurnReadout, sensor_force_g
from gateway.messages import Tilt
from gateway.numerics.array import Array

MIN_AXIAL_DEG = 30.0
"""Tilt, degrees, that shows that a sensor is off its rope. Basis: a hanging housing leans by less."""
FORGET_S = 120.0
"""Time after the last such tilt, s, after which the read-out ends. Basis: a choice; a person looks for a spanner in less, and the
read-out does not stay all day."""


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
