"""Errors of the recorded time: clock rate and lost samples."""

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.equations import Scalar
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.experiments import MEASURE_ROPE
from gateway.twin.effects.parameter import Parameter, Symbols, Values


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
        Parameter(
            "relative",
            "1",
            "e, positive if the clock is fast",
            lower=-0.2,
            upper=0.2,
            neutral=0.0,
            scale=1e-4,
            typical=5e-3,
            limit=0.05,  # an oscillator without a crystal, initial tolerance: MPU-6000 data sheet, section 6.6
        ),
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
    parameters = (
        Parameter(
            "fraction",
            "1",
            "p, fraction of the samples that is lost",
            lower=0.0,
            upper=0.95,
            neutral=0.0,
            scale=1e-3,
            typical=0.03,
        ),
    )

    def keep_samples(self, values: Values, count: int, random: np.random.Generator) -> NDArray[np.bool_]:
        """Lose samples at random, never the first."""
        kept: NDArray[np.bool_] = random.random(count) >= values["fraction"]
        kept[:1] = True
        return kept

    def true_time_s(self, p: Symbols, recorded_s: Scalar) -> Scalar:
        """Scale the time by the mean loss; which samples are lost cannot be predicted."""
        return recorded_s / (1 - p["fraction"])
