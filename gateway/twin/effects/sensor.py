"""What the sensor makes of the specific force: its own errors, in g."""

from collections.abc import Sequence

import casadi as ca

from devices.pendulum.equations import Vector
from gateway.twin.effects.driving import TURN_HOUSING
from gateway.twin.effects.effect import Effect, EvaluationContext, Parameter, ParameterKind, Symbols, Values
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.rope import MEASURE_HOUSING
from gateway.twin.effects.spectral_guesses import guess_vibration

AXES = ("x", "y", "z")


class MountMisalignment(Effect):
    """The housing is not in line with the rope."""

    name = "mount_misalignment"
    equation = "f_s = R_y(β) R_x(α) f"
    explains = "The housing is clamped askew on the rope."
    reference = "small rotations about the housing's x and y axes"
    enters = "sensor"
    discriminating_experiment = TURN_HOUSING
    mixes_axes = True
    parameters = (Parameter("deg", "°", "about x and y", -20.0, 20.0, 0.0, 0.05, (0.5, -0.5), ("x", "y")),)

    def reading_g(self, p: Symbols, now: EvaluationContext, reading: Vector) -> Vector:
        """Turned about x, then about y."""
        about_x, about_y = (ca.pi / 180 * angle for angle in p["deg"])
        x, y, z = reading
        y, z = ca.cos(about_x) * y - ca.sin(about_x) * z, ca.sin(about_x) * y + ca.cos(about_x) * z
        return ca.cos(about_y) * x + ca.sin(about_y) * z, y, ca.cos(about_y) * z - ca.sin(about_y) * x


class CrossAxis(Effect):
    """An axis picks up another."""

    name = "cross_axis"
    equation = "f_x += c_xy f_y + c_xz f_z, f_y += c_xy f_x + c_yz f_z, f_z += c_xz f_x + c_yz f_y"
    explains = "The sensor's axes are not at right angles, or pick each other up."
    reference = "symmetric cross-axis matrix; its antisymmetric part is a rotation, mount_misalignment"
    enters = "sensor"
    discriminating_experiment = TURN_HOUSING
    mixes_axes = True
    parameters = tuple(
        Parameter(pair, "1", f"between {pair[0]} and {pair[1]}", -0.3, 0.3, 0.0, 1e-3, 0.01)
        for pair in ("xy", "xz", "yz")
    )

    def reading_g(self, p: Symbols, now: EvaluationContext, reading: Vector) -> Vector:
        """The symmetric matrix."""
        x, y, z = reading
        return x + p["xy"] * y + p["xz"] * z, y + p["xy"] * x + p["yz"] * z, z + p["xz"] * x + p["yz"] * y


class ScaleError(Effect):
    """An axis reads too much or too little."""

    name = "scale_error"
    equation = "f_i (1 + s_i)"
    explains = "The sensor's sensitivity has changed."
    reference = "scale-factor error, IEEE 1293"
    enters = "sensor"
    discriminating_experiment = MEASURE_HOUSING
    parameters = (Parameter("relative", "1", "s", -0.3, 0.3, 0.0, 1e-3, (0.01, 0.01, 0.01), AXES),)

    def reading_g(self, p: Symbols, now: EvaluationContext, reading: Vector) -> Vector:
        """Each axis for itself."""
        x, y, z = (f * (1 + s) for f, s in zip(reading, p["relative"], strict=True))
        return x, y, z


class AxisOffset(Effect):
    """An axis is off by a constant."""

    name = "axis_offset"
    equation = "f_i + b_i"
    explains = "The sensor's zero has moved."
    reference = "zero-g offset, IEEE 1293"
    enters = "sensor"
    discriminating_experiment = TURN_HOUSING
    parameters = (Parameter("offset_g", "g", "b", -0.5, 0.5, 0.0, 1e-3, (0.01, 0.01, 0.01), AXES),)

    def reading_g(self, p: Symbols, now: EvaluationContext, reading: Vector) -> Vector:
        """Each axis for itself."""
        x, y, z = (f + b for f, b in zip(reading, p["offset_g"], strict=True))
        return x, y, z


class ThermalDrift(Effect):
    """The zero moves with temperature."""

    name = "thermal_drift"
    equation = "f_i + k_i (T − T_ref)"
    explains = "The sensor's zero moves as it warms up."
    reference = "temperature coefficient of the zero-g offset"
    enters = "sensor"
    needs_temperature = True
    parameters = (Parameter("mg_per_c", "mg/°C", "k", -20.0, 20.0, 0.0, 0.05, (0.5, 0.5, 1.0), AXES),)

    def reading_g(self, p: Symbols, now: EvaluationContext, reading: Vector) -> Vector:
        """In proportion to the temperature's distance from the calibration's."""
        x, y, z = (f + 1e-3 * k * now.warmer_c for f, k in zip(reading, p["mg_per_c"], strict=True))
        return x, y, z


class Vibration(Effect):
    """The housing shakes."""

    name = "vibration"
    equation = "f_i + A sin(2π f t + φ_i)"
    explains = "A motor, a gear or the wind shakes the housing."
    reference = "a sine on each axis: a line to and fro, or an ellipse"
    enters = "sensor"
    linear_at_neutral = False
    found_before_search = True
    steady_frequency = True
    parameters = (
        Parameter(
            "frequency_hz",
            "Hz",
            "f",
            0.5,
            2000.0,
            10.0,
            1e-3,
            12.0,
            kind=ParameterKind.FREQUENCY,
            step_limit=0.05,
        ),
        Parameter("amplitude_g", "g", "A of each axis", -1.0, 1.0, 0.0, 1e-4, (3e-3, 3e-3, 3e-3), AXES),
        Parameter(
            "lag_rad",
            "rad",
            "of y and z behind x",
            -7.0,
            7.0,
            0.0,
            0.1,
            (0.0, 0.0),
            ("y", "z"),
            kind=ParameterKind.PHASE,
        ),
        Parameter("phase_rad", "rad", "φ of x", -7.0, 7.0, 0.0, 0.1, 0.0, refitted=True, kind=ParameterKind.PHASE),
    )

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """At the strongest line above the pendulum's frequencies that is no overtone."""
        return guess_vibration(context)

    def reading_g(self, p: Symbols, now: EvaluationContext, reading: Vector) -> Vector:
        """Each axis with its own amplitude and phase."""
        angle = 2 * ca.pi * p["frequency_hz"] * now.time_s + p["phase_rad"]
        angles = (angle, *(angle - lag for lag in p["lag_rad"]))
        x, y, z = (f + a * ca.sin(at) for f, a, at in zip(reading, p["amplitude_g"], angles, strict=True))
        return x, y, z
