"""The verdict on a reading, whether it can be trusted, from the gates of the last seconds and the rope's motion."""

from dataclasses import dataclass

import numpy as np

from gateway.messages import Cause, MotionState, Verdict
from gateway.stages.conditions.gates import MIN_VERDICT_BINS, MotionContext, evaluate_gates
from gateway.stages.conditions.window import ConditionWindow, WindowFeatures

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
    "norm_hanging": (None, "the magnitude of the force is not that of a hanging load"),
    "explained": (None, "no motion of crane and load explains the readings"),
    "no_spin": (None, "the housing turns about the rope"),
    "rate_pendulum": (None, "the housing turns faster than the rope swings"),
}
"""Gates without which a reading is disturbed, with cause and reason."""
CAUSES: dict[MotionState, Cause] = {"driven": "trolley", "hoisting": "hoisting", "wind": "wind"}
TRUSTED_VERDICTS: tuple[Verdict, ...] = ("static", "quasi_static", "swinging", "driven")


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
    window: ConditionWindow, motion: MotionContext, noise_g: float | None, permissible_norm_error_g: float
) -> ConditionResult:
    """Judge the window; `noise_g` is that of the device, None where it is not known."""
    bins = window.bins
    if len(bins) < MIN_VERDICT_BINS:
        return ConditionResult("unknown", None, False, ("less than a second of data",), {"enough_data": False}, None)
    features = WindowFeatures.at(bins, noise_g)
    gates = evaluate_gates(features, window, motion, noise_g, permissible_norm_error_g)
    verdict, cause, reasons = _decide(gates, motion)
    norm_g = float(np.linalg.norm(features.means_g.mean(axis=0)))
    return ConditionResult(verdict, cause, verdict in TRUSTED_VERDICTS, reasons, gates, norm_g)


def _decide(gates: dict[str, bool], motion: MotionContext) -> Decision:
    """Return verdict and cause; the reasons name what decided."""
    if unusable := tuple(text for gate, text in UNUSABLE.items() if not gates[gate]):
        return "unknown", None, unusable
    if disturbed := [entry for gate, entry in DISTURBING.items() if not gates.get(gate, True)]:
        cause = next((cause for cause, _ in disturbed if cause is not None), None)
        return "disturbed", cause, tuple(text for _, text in disturbed)
    at_rest = gates["still"] and (gates["steady"] or (motion.state == "rest" and motion.is_below_stillness))
    if at_rest and (not motion.is_known or motion.state != "free"):
        return _decide_at_rest(gates)
    return _decide_by_motion(motion) if motion.is_known else _decide_unknown(gates, motion)


def _decide_by_motion(motion: MotionContext) -> Decision:
    if motion.is_driven:
        return "driven", CAUSES[motion.state], motion.reasons
    reason = "moves as a free pendulum" if motion.state == "free" else "swings too little to be more than at rest"
    return "swinging", None, (reason, *motion.reasons)


def _decide_unknown(gates: dict[str, bool], motion: MotionContext) -> Decision:
    if gates["still"] and gates["norm_static"]:
        return "unknown", None, ("still for too short a time: a swing is still at its turning point",)
    return "unknown", None, motion.reasons or ("moving, and the angle is not known well enough",)


def _decide_at_rest(gates: dict[str, bool]) -> Decision:
    if not gates["norm_static"]:
        return "disturbed", None, ("still, but the magnitude is not 1 g",)
    if not gates.get("not_turning", True):
        return "disturbed", None, ("the forces are constant, but the housing turns",)
    if gates["quiet"]:
        return "static", None, ("still, and the magnitude is 1 g",)
    return "quasi_static", "vibration", ("vibration about a constant mean of 1 g",)
