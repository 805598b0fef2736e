"""Names of the two models that the report compares, and what must not be read into the second one."""

import numpy as np

from gateway.twin.effects.parameter import Value
from gateway.twin.reconcile.output.result import Curves, Reconciliation

NOMINAL = "nominal model"
FINAL = {"one_of": "one of the group, as fitted", "unmodelled": "best attempt, not an explanation"}
CAUTION = {
    "one_of": "“After” shows one member of the group. The others fit equally well, so it is not the answer.",
    "unmodelled": "“After” shows the best attempt. It does not explain the data, so its effects have no claim to be the cause.",
    "named_with_remainder": "Effects of “after” that are not named in the verdict are not established.",
}

WITH_EQUATION = "model with the equation"
EQUATION_CAUTION = "“After” shows the model with the equation, which describes the data and names no cause."


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
    if result.log is None or is_same_model(result.log):
        return ""
    return EQUATION_CAUTION if result.law is not None else CAUTION.get(result.verdict, "")


def model_value(value: Value) -> str:
    """Return a value as the rig's description has it."""
    return f"[{', '.join(f'{each:.6g}' for each in value)}]" if isinstance(value, tuple) else f"{value:.6g}"
