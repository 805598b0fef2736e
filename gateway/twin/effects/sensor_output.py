"""The sensor's output: limits of bandwidth, range and resolution, and errors of the recorded time."""

from types import MappingProxyType

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.effect import Array, Effect
from gateway.twin.effects.experiments import MEASURE_ROPE
from gateway.twin.effects.parameter import ParameterKind, Symbols, Values, amplitude, shape
from gateway.twin.effects.sensor import AXES

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
            "cutoff_hz",
            "Hz",
            "f_c, −3 dB",
            (0.05, 1000.0),
            20.0,
            typical=1.0,
            kind=ParameterKind.CUTOFF,
            step_limit=1.0,
        ),
        amplitude(
            "began_g",
            "g",
            "state of the filter at the first sample, minus the state that the motion alone would give",
            (-2.0, 2.0),
            (0.0, 0.0, 0.0),
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
