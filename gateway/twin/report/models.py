"""What stands before and after: how the two models are called, and what the later one is not."""

import numpy as np

from gateway.twin.reconcile.output.result import Curves, Reconciliation

BELIEVED = "model as believed"
FINAL = {"one_of": "one of the group, as fitted", "unmodelled": "best attempt, no explanation"}
CAUTION = {
    "one_of": "“After” shows one member of the group: the others fit as well, so it is not the answer.",
    "unmodelled": "“After” shows the best attempt. It does not explain the data, so what it added has no claim to be the cause.",
    "named_with_remainder": "What “after” holds beside the named effects is not decided.",
}


def only_name(result: Reconciliation) -> str:
    """The one model where before and after simulate the same."""
    return (
        "model with what the readings themselves show" if result.effects else f"{BELIEVED}, to which nothing was added"
    )


def fitted_part(result: Reconciliation) -> str:
    """What the model was fitted to."""
    return "the first two thirds" if result.held_out_is_last_third else "the recording"


def same(curves: Curves) -> bool:
    """Before and after simulate the same."""
    return bool(np.allclose(curves.before_g, curves.after_g, rtol=0.0, atol=1e-9))


def final_name(result: Reconciliation) -> str:
    """The model after, as its verdict allows to call it."""
    return FINAL.get(result.verdict, "final model")


def caution(result: Reconciliation) -> str:
    """What must not be read into the model after; empty where there is nothing to warn of."""
    if result.log is None or same(result.log):
        return ""
    return CAUTION.get(result.verdict, "")
