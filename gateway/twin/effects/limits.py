"""What a reading loses on its way out: bandwidth, range, resolution, samples, the right time."""

import casadi as ca

from devices.pendulum.equations import Scalar, Vector
from gateway.twin.effects.effect import Effect, Parameter, Symbols

STATE = "the filter at the first sample, beside where the motion alone would have brought it"


class LowpassLag(Effect):
    """The reading follows late."""

    name = "lowpass_lag"
    equation = "f_s' = 2π f_c (f − f_s)"
    explains = "A low-pass filter in the sensor that nobody told of: smaller and later readings."
    reference = "one-pole low-pass, solved exactly between samples (first-order hold)"
    enters = "sensor"
    linear_at_neutral = False
    parameters = (
        Parameter("cutoff_hz", "Hz", "f_c, −3 dB", 0.05, 1000.0, 20.0, 0.02, 1.0),
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
    parameters = (Parameter("full_scale_g", "g", "c", 0.05, 100.0, 16.0, 1e-3, 1.005),)

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
    parameters = (Parameter("lsb_g", "g", "q", 0.0, 0.5, 0.0, 1e-4, 4e-3),)


class ClockDrift(Effect):
    """The sensor's clock runs fast or slow."""

    name = "clock_drift"
    equation = "t_true = t_recorded/(1 + e)"
    explains = "The time stamps are stretched: the sensor's clock, or its stated sample rate, is wrong."
    reference = "clock rate error"
    enters = "clock"
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
    parameters = (Parameter("fraction", "1", "p", 0.0, 0.95, 0.0, 1e-3, 0.03),)

    def true_time_s(self, p: Symbols, elapsed_s: Scalar) -> Scalar:
        """The mean alone: which samples are lost cannot be predicted."""
        return elapsed_s / (1 - p["fraction"])
