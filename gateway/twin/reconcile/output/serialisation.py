"""The answer as the JSON that `reconcile --json` writes."""

from typing import Any

import numpy as np

from gateway.twin.reconcile.data.crane_inputs import EstimatedInput
from gateway.twin.reconcile.output.estimates import Estimate, Law, NamedEffect
from gateway.twin.reconcile.output.remainder import Remainder
from gateway.twin.reconcile.output.result import Gap, Reconciliation

SCHEMA_VERSION = 2
"""Raised when a field changes its meaning; fields are added without."""


def to_json(result: Reconciliation, runtime_s: float) -> dict[str, Any]:
    """Names as published; what could not be computed is null."""
    return {
        "schema_version": SCHEMA_VERSION,
        "verdict": result.verdict,
        "reason": result.reason,
        "reason_code": result.reason_code,
        "remainder": result.leaves_remainder,
        "ended_early": result.ended_early,
        "parts": [
            {
                "role": part.role,
                "recording": part.recording,
                "blocks_s": [list(block) for block in part.blocks_s],
                "samples": part.n_samples,
            }
            for part in result.parts
        ],
        "effects": [_effect(effect) for effect in result.effects],
        "best_attempt": {
            name: {parameter: np.asarray(value).tolist() for parameter, value in values.items()}
            for name, values in result.best_attempt.items()
        },
        "candidates": list(result.candidates),
        "also_one_of": [list(group) for group in result.also_one_of],
        "split_by": result.split_by,
        "equivalents": [
            {"name": e.name, "of": e.of, "parameters": dict(e.parameters), "split_by": e.split_by}
            for e in result.equivalents
        ],
        "equation": None if result.law is None else _equation(result.law),
        "disagreement": [
            {"axis": d.axis, "from_s": d.from_s, "to_s": d.to_s, "band_hz": list(d.band_hz), "rms_sigma": d.rms_sigma}
            for d in result.disagreement
        ],
        "gap": _gap(result.gap),
        "residual": _residual(result),
        "left_of_motion": None if result.remainder is None else _remainder(result.remainder),
        "steps": [
            {
                "added": list(step.added),
                "dropped": list(step.dropped),
                "gap_log": step.gap_log,
                "gap_held_out": step.gap_held_out,
                "bic": step.bic,
            }
            for step in result.steps
        ],
        "refitted_on_held_out": list(result.refitted_on_held_out),
        "ranking": [
            {
                "names": list(c.names),
                "chi2_log": c.chi2_log,
                "chi2_held_out": c.chi2_held_out,
                "behind": c.behind,
                "rival": c.rival,
            }
            for c in result.ranking
        ],
        "inputs": [
            *(_input(each, "log") for each in result.inputs),
            *(_input(each, "held_out") for each in result.held_out_inputs),
        ],
        "samples": dict(result.counts),
        "runtime_s": runtime_s,
    }


def _effect(effect: NamedEffect) -> dict[str, Any]:
    return {
        "name": effect.name,
        "parameters": {
            name: _estimate(estimate) | {"plausible": estimate.plausible, "limit": estimate.limit}
            for name, estimate in effect.parameters.items()
        },
        "when_s": None if effect.when_s is None else list(effect.when_s),
    }


def _equation(law: Law) -> dict[str, Any]:
    return {
        "text": law.text,
        "terms": [
            {
                "name": term.name,
                "text": term.text,
                "meaning": term.meaning,
                "parameters": {name: _estimate(estimate) for name, estimate in term.parameters.items()},
                "alternatives": list(term.alternatives),
                "closest_effects": [
                    {"name": each.name, "cosine": each.cosine, "reversed": each.reversed}
                    for each in term.closest_effects
                ],
            }
            for term in law.terms
        ],
        "beside": list(law.beside),
        "closed_test_percent": law.closed_test_percent,
    }


def _input(found: EstimatedInput, recording: str) -> dict[str, Any]:
    return {
        "kind": found.kind,
        "recording": recording,
        "from_s": found.from_s,
        "to_s": found.to_s,
        "peak": found.peak,
        "unit": found.unit,
    }


def _estimate(estimate: Estimate) -> dict[str, Any]:
    def plain(value: Any) -> Any:
        return list(value) if isinstance(value, tuple) else value

    return {"value": plain(estimate.value), "ci95": [plain(bound) for bound in estimate.ci95], "unit": estimate.unit}


def _gap(gap: Gap | None) -> dict[str, Any]:
    if gap is None:
        nothing = {"log": None, "held_out": None, "test": None}
        return {"before": nothing, "after": nothing, "closed_percent": nothing}
    before = {"log": gap.before_log, "held_out": gap.before_held_out, "test": gap.before_test}
    after = {"log": gap.after_log, "held_out": gap.after_held_out, "test": gap.after_test}
    return {
        "before": before,
        "after": after,
        "closed_percent": {key: Gap.closed_percent(before[key], after[key]) for key in before},
    }


def _residual(result: Reconciliation) -> dict[str, Any] | None:
    if result.residual is None:
        return None
    return {
        "white": result.residual.white,
        "ljung_box_p": result.residual.ljung_box_p,
        "peaks": [
            {
                "hz": p.hz,
                "axis": p.axis,
                "amplitude_g": p.amplitude_g,
                "multiple_of_swing": p.multiple,
            }
            for p in result.residual.peaks
        ],
    }


def _remainder(remainder: Remainder) -> dict[str, Any]:
    """As shares of the rms of the motion, 0 to 1."""
    return {
        "share": remainder.share,
        "share_before": remainder.share_before,
        "share_wide_swing": remainder.share_wide,
        "share_small_swing": remainder.share_small,
        "direction": remainder.direction,
        "hz": remainder.hz,
        "amplitude_g": remainder.amplitude_g,
        "multiple_of_swing": remainder.multiple,
    }
