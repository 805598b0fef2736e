"""Errors of the sensor: before its low-pass, at its output, and of the recorded time."""

from types import MappingProxyType

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar, Vector, add
from gateway.twin.effects.effect import MEASURE_HOUSING, MEASURE_ROPE, TURN_HOUSING, Array, Effect
from gateway.twin.effects.evaluation_context import EvaluationContext
from gateway.twin.effects.guess_context import GuessContext, guess_vibration, wrap_angle
from gateway.twin.effects.parameter import ParameterKind, Symbols, Values, amplitude, frequency, shape

AXES = ("x", "y", "z")
MIN_GUESSED_MOUNT_DEG = 5.0
"""Smallest angle between the mean reading and the z axis that needs a guess. Basis: a fit finds smaller ones from zero."""


def rotate_across(reading: Vector, about_x: Scalar, about_y: Scalar) -> Vector:
    """Return a vector after a rotation about x, then about y, by angles in rad."""
    x, y, z = reading
    y, z = ca.cos(about_x) * y - ca.sin(about_x) * z, ca.sin(about_x) * y + ca.cos(about_x) * z
    return ca.cos(about_y) * x + ca.sin(about_y) * z, y, ca.cos(about_y) * z - ca.sin(about_y) * x


class MountMisalignment(Effect):
    """A rotation of the housing against the rope."""

    name = "mount_misalignment"
    equation = "f_s = R_y(β) R_x(α) f"
    explains = "The housing is clamped askew on the rope."
    reference = "misalignment, IEEE 528: rotations about the housing's x and y axes"
    enters = "sensor"
    discriminating_experiment = TURN_HOUSING
    in_every_rig = True
    parameters = (amplitude("deg", "°", "α about x and β about y", (-60.0, 60.0), (0.5, -0.5), ("x", "y"), limit=30.0),)

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return the mount in which the mean of the readings, along which the rope hangs on average, would be the z axis."""
        x, y, z = context.force_g.mean(axis=0)
        about_x_deg, about_y_deg = np.degrees([np.arctan2(-y, np.hypot(x, z)), np.arctan2(x, z)])
        askew = np.hypot(about_x_deg, about_y_deg) > MIN_GUESSED_MOUNT_DEG
        return [{"deg": (float(about_x_deg), float(about_y_deg))}] if askew else [{}]

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Rotate about x, then about y."""
        about_x, about_y = (ca.pi / 180 * angle for angle in p["deg"])
        return rotate_across(reading, about_x, about_y)


class CrossAxis(Effect):
    """Sensitivity of each axis to the specific force along the other axes."""

    name = "cross_axis"
    equation = "f_x += c_xy f_y + c_xz f_z, f_y += c_xy f_x + c_yz f_z, f_z += c_xz f_x + c_yz f_y"
    explains = "The sensor's axes are not at right angles, or respond to forces along the other axes."
    reference = "cross-axis sensitivity, IEEE 528: a symmetric matrix; the antisymmetric part is mount_misalignment"
    enters = "sensor"
    discriminating_experiment = TURN_HOUSING
    parameters = tuple(
        amplitude(pair, "1", f"c, between {pair[0]} and {pair[1]}", (-0.3, 0.3), 0.01, limit=0.03)
        for pair in ("xy", "xz", "yz")
    )

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add the product with the symmetric matrix."""
        x, y, z = reading
        return x + p["xy"] * y + p["xz"] * z, y + p["xy"] * x + p["yz"] * z, z + p["xz"] * x + p["yz"] * y


class ScaleError(Effect):
    """An error of the scale factor of each axis."""

    name = "scale_error"
    equation = "f_i (1 + s_i)"
    explains = "The sensor's sensitivity has changed."
    reference = "scale-factor error, IEEE 1293"
    enters = "sensor"
    discriminating_experiment = MEASURE_HOUSING
    in_every_rig = True
    parameters = (
        amplitude("relative", "1", "s of each axis", (-0.3, 0.3), 0.01, AXES, limit=0.03, limit_of_rig="scale_limit"),
    )

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Scale each axis."""
        x, y, z = (f * (1 + s) for f, s in zip(reading, p["relative"], strict=True))
        return x, y, z


class AxisOffset(Effect):
    """A constant offset of each axis."""

    name = "axis_offset"
    equation = "f_i + b_i"
    explains = "The sensor's zero has moved."
    reference = "zero-g offset (bias), IEEE 528 and IEEE 1293"
    enters = "sensor"
    discriminating_experiment = TURN_HOUSING
    in_every_rig = True
    parameters = (
        amplitude(
            "offset_g", "g", "b of each axis", (-0.5, 0.5), 0.01, AXES, limit=0.06, limit_of_rig="offset_limit_g"
        ),
    )

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add the offset to each axis."""
        return add(reading, p["offset_g"])


class ThermalDrift(Effect):
    """A drift of the zero-g offset with temperature."""

    name = "thermal_drift"
    equation = "f_i + k_i (T − T_ref)"
    explains = "The sensor's zero moves as it warms up."
    reference = "temperature coefficient of the zero-g offset, Sawicki and Walendziuk 2016"
    enters = "sensor"
    needs_temperature = True
    parameters = (amplitude("mg_per_c", "mg/°C", "k of each axis", (-20.0, 20.0), (0.5, 0.5, 1.0), AXES),)

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add an offset proportional to the temperature above that of the calibration."""
        x, y, z = (f + 1e-3 * k * context.temperature_rise_c for f, k in zip(reading, p["mg_per_c"], strict=True))
        return x, y, z


class Vibration(Effect):
    """A sinusoidal vibration of the housing."""

    name = "vibration"
    equation = "f_i + A_i sin(2π f t + φ_i)"
    explains = "A motor, a gear or the wind shakes the housing."
    reference = "harmonic motion, Inman 2014, section 1.2: a sine on each axis, along a line or on an ellipse"
    enters = "sensor"
    linear_at_neutral = False
    found_before_search = True
    steady_frequency = True
    parameters = (
        frequency("f", (0.5, 2000.0), 10.0, typical=12.0, scale=1e-3, step_limit=0.05),
        amplitude("amplitude_g", "g", "A of each axis", (-1.0, 1.0), (3e-3, 3e-3, 3e-3), AXES),
        shape(
            "lag_rad",
            "rad",
            "phase lag of y and z behind x",
            (-7.0, 7.0),
            0.0,
            typical=(0.0, 0.0),
            components=("y", "z"),
            kind=ParameterKind.PHASE,
        ),
        shape("phase_rad", "rad", "φ of x", (-7.0, 7.0), 0.0, refitted=True, kind=ParameterKind.PHASE),
    )

    def initial_guesses(self, context: GuessContext) -> list[Values]:
        """Return the strongest line above the pendulum's frequencies, if it is no overtone."""
        return guess_vibration(context)

    def shift_start(self, values: Values, by_s: float) -> Values:
        """Return the same sine counted from a later first sample."""
        frequency_hz, phase_rad = (float(np.asarray(values[key])) for key in ("frequency_hz", "phase_rad"))
        return {**values, "phase_rad": float(wrap_angle(np.asarray(phase_rad + 2 * np.pi * frequency_hz * by_s)))}

    def reading_g(self, p: Symbols, context: EvaluationContext, reading: Vector) -> Vector:
        """Add a sine with the amplitude and phase of each axis."""
        angle = 2 * ca.pi * p["frequency_hz"] * context.time_s + p["phase_rad"]
        angles = (angle, *(angle - lag for lag in p["lag_rad"]))
        x, y, z = (f + a * ca.sin(each) for f, a, each in zip(reading, p["amplitude_g"], angles, strict=True))
        return x, y, z


SAME_READING_G = 1e-6
"""Readings that differ by less are the same. Basis: recordings are written with six or seven digits."""
ROUNDING = 1e-9
"""Rounding of the quotient of whole numbers. Basis: above that of 64 bits (1e-16), below a step."""


class LowpassLag(Effect):
    """A one-pole low-pass in the sensor."""

    name = "lowpass_lag"
    equation = "f_s′ = 2π f_c (f − f_s)"
    explains = "A low-pass filter in the sensor that is not in its description: smaller and later readings."
    reference = "one-pole low-pass, solved exactly between samples (first-order hold)"
    enters = "sensor"
    linear_at_neutral = False
    scored = True
    needs_single_segment = True
    default_guess = MappingProxyType({"cutoff_hz": 2.0})
    parameters = (
        shape(
            "cutoff_hz", "Hz", "f_c, −3 dB", (0.05, 1e3), 20.0, typical=1.0, kind=ParameterKind.CUTOFF, step_limit=1.0
        ),
        amplitude(
            "began_g",
            "g",
            "state of the filter at the first sample, minus the state that the motion alone would give",
            (-2.0, 2.0),
            0.0,
            AXES,
            refitted=True,
        ),
    )


class Quantization(Effect):
    """Rounding of the readings to a coarse step."""

    name = "quantization"
    equation = "f_s = q round(f/q)"
    explains = "The sensor's resolution is coarse, or its range is set too wide."
    reference = "uniform quantisation, IEEE 528: the error has a variance of q²/12"
    enters = "sensor"
    linear_at_neutral = False
    detected_in_samples = True
    found_before_search = True
    parameters = (amplitude("lsb_g", "g", "q, step of the readings", (0.0, 0.5), 4e-3),)

    def sample_output_g(self, values: Values, force_g: Array) -> Array:
        """Round to multiples of the step; a step of 0 leaves the samples unchanged."""
        lsb_g = float(np.asarray(values["lsb_g"]))
        return force_g if lsb_g == 0 else np.rint(force_g / lsb_g) * lsb_g


class SampleHold(Effect):
    """Repetition of each reading until the sensor has a new one."""

    name = "sample_hold"
    equation = "row i holds the reading of row ⌈k N⌉, k = ⌊i/N⌋"
    explains = "The sensor is slower than its file: each reading is repeated over several rows."
    reference = "zero-order hold; the repeated rows carry no information and are left out, each reading counts once"
    enters = "sensor"
    linear_at_neutral = False
    detected_in_samples = True
    found_before_search = True
    parameters = (shape("rows", "1", "N, rows of the file per reading of the sensor", (1.0, 1000.0), 1.0, typical=3.0),)

    def sample_output_g(self, values: Values, force_g: Array) -> Array:
        """Hold each reading; one row per reading leaves the samples unchanged."""
        rows = float(np.asarray(values["rows"]))
        held = np.ceil(np.floor(np.arange(len(force_g)) / rows + ROUNDING) * rows - ROUNDING)
        return force_g[held.astype(np.int64)]


class Clipping(Effect):
    """Saturation of the readings at a limit."""

    name = "clipping"
    equation = "f_s = max(−c, min(c, f))"
    explains = "The sensor's range is too small, or is set wrong."
    reference = "saturation, IEEE 528"
    enters = "sensor"
    linear_at_neutral = False
    detected_in_samples = True
    found_before_search = True
    parameters = (shape("full_scale_g", "g", "c, largest reading", (0.05, 100.0), 16.0, typical=1.005),)

    def sample_output_g(self, values: Values, force_g: Array) -> Array:
        """Limit each axis to the full scale."""
        full_scale_g = np.asarray(values["full_scale_g"])
        return np.clip(force_g, -full_scale_g, full_scale_g)

    def output_stage_g(self, p: Symbols, reading: Vector) -> Vector:
        """Limit each axis to the full scale."""
        x, y, z = (ca.fmin(ca.fmax(f, -p["full_scale_g"]), p["full_scale_g"]) for f in reading)
        return x, y, z


class ClockDrift(Effect):
    """A rate error of the sensor's clock."""

    name = "clock_drift"
    equation = "t_true = t_recorded/(1 + e)"
    explains = "The time stamps are stretched: the sensor's clock, or its stated sample rate, is wrong."
    reference = "definition of the clock rate error e"
    enters = "clock"
    discriminating_experiment = MEASURE_ROPE
    scales_period = True
    parameters = (
        # The limit is the initial tolerance of an oscillator without a crystal: MPU-6000 data sheet, section 6.6.
        amplitude("relative", "1", "e, positive if the clock is fast", (-0.2, 0.2), 5e-3, limit=0.05),
    )

    def true_time_s(self, p: Symbols, recorded_s: Scalar) -> Scalar:
        """Scale the time since the first sample."""
        return recorded_s / (1 + p["relative"])


class SampleLoss(Effect):
    """Samples that were lost at random and left no gap in the time stamps."""

    name = "sample_loss"
    equation = "a sample is lost with probability p; stamps that count samples: t_true ≈ t_recorded/(1 − p)"
    explains = "The link or the host loses samples, and the time stamps do not show it."
    reference = "mean of a sum of geometric gaps; around the mean a random walk with standard deviation √(n p) Δt"
    enters = "clock"
    scored = False
    found_before_search = True
    scales_period = True
    parameters = (amplitude("fraction", "1", "p, fraction of the samples that is lost", (0.0, 0.95), 0.03),)

    def keep_samples(self, values: Values, count: int, random: np.random.Generator) -> NDArray[np.bool_]:
        """Lose samples at random, never the first."""
        kept: NDArray[np.bool_] = random.random(count) >= values["fraction"]
        kept[:1] = True
        return kept

    def true_time_s(self, p: Symbols, recorded_s: Scalar) -> Scalar:
        """Scale the time by the mean loss; which samples are lost cannot be predicted."""
        return recorded_s / (1 - p["fraction"])
