"""Names, numbers and words that only the report prints: axes, noise, counts, the rig, the two models that it compares."""

import math

import numpy as np

from gateway.documents.format import format_number
from gateway.twin.effects.parameter import Value
from gateway.twin.model import TwinRig
from gateway.twin.reconcile.output.result import Curves, Reconciliation

AXES = ("x", "y", "z")
AXIS_NAMES = {"x": "x, across the rope", "y": "y, across the rope", "z": "z, along the rope"}
Facts = tuple[tuple[str, str], ...]
COUNTED = {
    "read": "samples read",
    "used": "samples used",
    "spikes": "lone spikes",
    "lost": "lost",
    "repeated": "repeated times",
    "backward": "backward times",
    "invalid": "invalid",
}
REFITTED = {
    "initial.tilt_x_rad": "inclination of the rope along x at the start",
    "initial.tilt_y_rad": "inclination of the rope along y at the start",
    "initial.rate_x_rad_s": "rate of the swing along x at the start",
    "initial.rate_y_rad_s": "rate of the swing along y at the start",
    "initial.heading_rad": "heading of the housing",
}
NOMINAL = "nominal model"
FINAL = {"one_of": "one of the group, as fitted", "unmodelled": "best attempt, not an explanation"}
CAUTION = {
    "one_of": "“After” shows one member of the group. The others fit equally well, so it is not the answer.",
    "unmodelled": "“After” shows the best attempt. It does not explain the data, so its effects have no claim to be the cause.",
    "named_with_remainder": "Effects of “after” that are not named in the verdict are not established.",
}
WITH_EQUATION = "model with the equation"
EQUATION_CAUTION = "“After” shows the model with the equation, which describes the data and names no cause."


def noise_ratio(chi2: float) -> str:
    """Return the rms of a residual in standard deviations of the noise, from its reduced chi-square."""
    return format_number(math.sqrt(max(chi2, 0.0)))


def format_noise_ratio(chi2: float) -> str:
    """Return the rms of a residual as a multiple of the noise: `4.18 × noise`."""
    return f"{noise_ratio(chi2)} × noise"


def format_change(before: str, after: str) -> str:
    """Return `15.2 → 0.995`, or one value where both are the same."""
    return before if before == after else f"{before} → {after}"


def rig_facts(rig: TwinRig) -> Facts:
    """Return the rig as it was described."""
    return (
        ("rope, pivot to the load’s centre", f"{format_number(rig.length_m, 5)} m"),
        ("housing, pivot to the sensor", f"{format_number(rig.position_m, 5)} m"),
        ("gravity", f"{format_number(rig.gravity_m_s2, 6)} m/s²"),
        ("noise σ of x, y, z", f"{', '.join(format_number(1e3 * each) for each in rig.noise_g)} mg"),
        ("sample rate", f"{format_number(rig.sample_rate_hz)} Hz" if rig.sample_rate_hz is not None else "not given"),
        ("full scale", f"{format_number(rig.full_scale_g)} g" if rig.full_scale_g is not None else "not given"),
    )


def single_model_name(result: Reconciliation) -> str:
    """Return the name of the one model where before and after simulate the same."""
    return f"{NOMINAL} with the effects seen in the samples" if result.effects else f"{NOMINAL}, nothing added"


def is_same_model(curves: Curves) -> bool:
    """Return whether before and after simulate the same."""
    return bool(np.allclose(curves.before_g, curves.after_g, rtol=0.0, atol=1e-9))


def final_model_name(result: Reconciliation) -> str:
    """Return the name of the model after, as the verdict allows to call it."""
    return WITH_EQUATION if result.law is not None else FINAL.get(result.verdict, "final model")


def caution(result: Reconciliation) -> str:
    """Return what must not be read into the model after; empty where there is nothing to warn of."""
    if result.comparison is None or is_same_model(result.comparison.log):
        return ""
    return EQUATION_CAUTION if result.law is not None else CAUTION.get(result.verdict, "")


def model_value(value: Value) -> str:
    """Return a value as the rig's description has it."""
    return f"[{', '.join(f'{each:.6g}' for each in value)}]" if isinstance(value, tuple) else f"{value:.6g}"
