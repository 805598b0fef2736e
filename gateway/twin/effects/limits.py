"""What a reading loses on its way out: bandwidth, range, resolution, samples, the right time."""

from collections.abc import Sequence
from types import MappingProxyType

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.effect import Array, Effect, Parameter, ParameterKind, Symbols, Values
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.rope import MEASURE_ROPE

SAME_READING_G = 1e-6
"""Readings that differ by less are the same: recordings are written with six or seven digits."""
MIN_SATURATED_SAMPLES = 3
"""Noise comes before a limit, so several samples stand exactly at it; noise alone puts one at the extreme."""
STATE = "the filter at the first sample, beside where the motion alone would have brought it"


class LowpassLag(Effect):
    """The reading follows late."""

    name = "lowpass_lag"
    equation = "f_s' = 2π f_c (f − f_s)"
    explains = "A low-pass filter in the sensor that nobody told of: smaller and later readings."
    reference = "one-pole low-pass, solved exactly between samples (first-order hold)"
    enters = "sensor"
    linear_at_neutral = False
    scored = True
    needs_single_segment = True
    default_guess = MappingProxyType({"cutoff_hz": 2.0})
    parameters = (
        Parameter(
            "cutoff_hz", "Hz", "f_c, −3 dB", 0.05, 1000.0, 20.0, 0.02, 1.0, kind=ParameterKind.CUTOFF, step_limit=1.0
        ),
        Parameter("began_g", "g", STATE, -2.0, 2.0, 0.0, 1e-3, (0.0, 0.0, 0.0), ("x", "y", "z"), True),
    )


class Clipping(Effect):
    """The reading stops at a limit."""

    name = "clipping"
    equation = "f_s = max(−c, min(c, f))"
    explains = "The sensor's range is too small, or set wrong."
    reference = "saturation"
    enters = "sensor"
    linear_at_neutral = False
    detected_in_samples = True
    parameters = (Parameter("full_scale_g", "g", "c", 0.05, 100.0, 16.0, 1e-3, 1.005),)

    def initial_guesses(self, context: GuessContext) -> Sequence[Values]:
        """At the largest reading, where several samples stand exactly at it."""
        size_g = np.abs(context.force_g)
        top_g = float(size_g.max())
        saturated = int((size_g > top_g - SAME_READING_G).sum())
        return [{"full_scale_g": top_g}] if saturated >= MIN_SATURATED_SAMPLES else []

    def sample_output_g(self, values: Values, force_g: Array) -> Array:
        """Limit each axis to the full scale."""
        full_scale_g = np.asarray(values["full_scale_g"])
        return np.clip(force_g, -full_scale_g, full_scale_g)

    def output_stage_g(self, p: Symbols, reading: Vector) -> Vector:
        """Each axis for itself."""
        x, y, z = (ca.fmin(ca.fmax(f, -p["full_scale_g"]), p["full_scale_g"]) for f in reading)
        return x, y, z


class Quantization(Effect):
    """The reading comes in steps."""

    name = "quantization"
    equation = "f_s = q round(f/q)"
    explains = "The sensor's steps are coarse, or its range is set too wide."
    reference = "uniform quantisation: its error has a variance of q²/12"
    enters = "sensor"
    linear_at_neutral = False
    detected_in_samples = True
    found_before_search = True
    parameters = (Parameter("lsb_g", "g", "q", 0.0, 0.5, 0.0, 1e-4, 4e-3),)

    def sample_output_g(self, values: Values, force_g: Array) -> Array:
        """Round to multiples of the step; a step of 0 is none."""
        lsb_g = float(np.asarray(values["lsb_g"]))
        return force_g if lsb_g == 0 else np.rint(force_g / lsb_g) * lsb_g


class ClockDrift(Effect):
    """The sensor's clock runs fast or slow."""

    name = "clock_drift"
    equation = "t_true = t_recorded/(1 + e)"
    explains = "The time stamps are stretched: the sensor's clock, or its stated sample rate, is wrong."
    reference = "clock rate error"
    enters = "clock"
    discriminating_experiment = MEASURE_ROPE
    scales_period = True
    parameters = (Parameter("relative", "1", "e", -0.2, 0.2, 0.0, 1e-4, 5e-3),)

    def true_time_s(self, p: Symbols, elapsed_s: Scalar) -> Scalar:
        """By the rate alone; the recording's first sample is the origin."""
        return elapsed_s / (1 + p["relative"])


class SampleLoss(Effect):
    """Samples are missing."""

    name = "sample_loss"
    equation = "a sample is lost with probability p; stamps that count samples: t_true ≈ t_recorded/(1 − p)"
    explains = "The link or the host loses samples, and nothing in the time stamps tells."
    reference = "mean of a sum of geometric gaps; about the mean it walks at random with sigma √(n p) Δt"
    enters = "clock"
    scored = False
    found_before_search = True
    scales_period = True
    parameters = (Parameter("fraction", "1", "p", 0.0, 0.95, 0.0, 1e-3, 0.03),)

    def keep_samples(self, values: Values, count: int, random: np.random.Generator) -> NDArray[np.bool_]:
        """Lose samples at random, never the first."""
        kept: NDArray[np.bool_] = random.random(count) >= values["fraction"]
        kept[:1] = True
        return kept

    def true_time_s(self, p: Symbols, elapsed_s: Scalar) -> Scalar:
        """The mean alone: which samples are lost cannot be predicted."""
        return elapsed_s / (1 - p["fraction"])
