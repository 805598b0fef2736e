"""The verdict on a reading, whether it can be trusted, from the gates of the last seconds."""

from dataclasses import dataclass

import numpy as np

from gateway.messages import Cause, Verdict
from gateway.numerics.array import Array
from gateway.stages.conditions.gates import FEWEST_BINS, SwingContext, evaluate_gates
from gateway.stages.conditions.window import ConditionWindow
from gateway.stages.conditions.window_features import SMOOTHED_BINS, WindowFeatures, moving_average

Decision = tuple[Verdict, Cause | None, tuple[str, ...]]
"""Verdict, cause and reasons."""

UNUSABLE = {
    "complete": "more than a tenth of the samples is missing",
    "axes_alive": "an axis reads exactly zero",
}
"""Gates without which nothing is known, and the reason."""
DISTURBING: dict[str, tuple[Cause | None, str]] = {
    "not_clipped": ("clipped", "clipped: a reading reached full scale"),
    "no_impact": ("impact", "impact: a sample far from its neighbours"),
    "not_shaken": ("vibration", "vibration: too strong for a reliable mean"),
    "rope_keeps_length": ("hoisting", "hoisting: the rope's length changes"),
    "norm_pendulum": (None, "the magnitude of the force is not that of a hanging load"),
    "energy": ("trolley", "trolley: the swing's energy changes faster than that of a free swing"),
    "axial": ("hoisting", "hoisting: the force along the rope is not that of a free swing"),
    "no_spin": (None, "the housing turns about the rope"),
    "rate_pendulum": (None, "the housing turns faster than the rope swings"),
}
"""Gates without which a reading is disturbed, with cause and reason."""
TRUSTED: tuple[Verdict, ...] = ("static", "quasi_static", "swinging")


@dataclass(frozen=True, slots=True)
class ConditionResult:
    """The verdict with its gates."""

    verdict: Verdict
    cause: Cause | None
    trusted: bool
    reasons: tuple[str, ...]
    gates: dict[str, bool]
    norm_g: float | None


def judge_condition(
    window: ConditionWindow, swing: SwingContext, noise_g: float | None, permissible_norm_error_g: float
) -> ConditionResult:
    """Judge the window; `noise_g` is that of the device, None where it is not known."""
    bins = window.bins
    if len(bins) < FEWEST_BINS:
        return ConditionResult("unknown", None, False, ("less than a second of data",), {"enough_data": False}, None)
    features = WindowFeatures.at(bins, noise_g)
    gates = evaluate_gates(features, window, swing, noise_g, permissible_norm_error_g)
    verdict, cause, reasons = _decide(gates, swing, features.means_g)
    norm_g = float(np.linalg.norm(features.means_g.mean(axis=0)))
    return ConditionResult(verdict, cause, verdict in TRUSTED, reasons, gates, norm_g)


def _decide(gates: dict[str, bool], swing: SwingContext, means: Array) -> Decision:
    """Return verdict and cause; the reasons name the gates that decided."""
    if unusable := tuple(text for gate, text in UNUSABLE.items() if not gates[gate]):
        return "unknown", None, unusable
    if disturbed := [entry for gate, entry in DISTURBING.items() if not gates.get(gate, True)]:
        cause = next((cause for cause, _ in disturbed if cause is not None), None)
        if cause is None and not gates["still"]:
            cause = _infer_cause(means)
        return "disturbed", cause, tuple(text for _, text in disturbed)
    if gates["pendulum"]:
        return "swinging", None, ("moves as a free pendulum",)
    return _decide_without_swing(gates, swing, means)


def _decide_without_swing(gates: dict[str, bool], swing: SwingContext, means: Array) -> Decision:
    if gates["still"] and gates["norm_static"]:
        if not gates["steady"]:
            return "unknown", None, ("still for too short a time: a swing is still at its turning point",)
        return _decide_at_rest(gates)
    if swing.swinging is None:
        return "unknown", None, ("moving; less than a full swing observed",)
    if gates["still"]:
        return "disturbed", None, ("still, but the magnitude is not 1 g",)
    cause = _infer_cause(means)
    return "disturbed", cause, (f"{cause}: the motion is not that of a pendulum",)


def _decide_at_rest(gates: dict[str, bool]) -> Decision:
    if not gates.get("not_turning", True):
        return "disturbed", None, ("the forces are constant, but the housing turns",)
    if gates["quiet"]:
        return "static", None, ("still, and the magnitude is 1 g",)
    return "quasi_static", "vibration", ("vibration about a constant mean of 1 g",)


def _infer_cause(means: Array) -> Cause:
    """Return the probable drive: hoisting acts along the rope, a trolley or the wind across it."""
    range_g = np.ptp(moving_average(means, SMOOTHED_BINS), axis=0)
    return "hoisting" if range_g[2] > np.hypot(range_g[0], range_g[1]) else "trolley"
