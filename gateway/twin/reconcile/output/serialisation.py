"""The answer as files: the JSON of `reconcile --json`, predictions as recordings, the found model as a rig."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from gateway.measurement.source import HeldRows
from gateway.twin.effects.parameter import Value
from gateway.twin.model import as_tables
from gateway.twin.reconcile.data.crane_inputs import EstimatedInput
from gateway.twin.reconcile.output.estimates import Estimate, Law, NamedEffect, Remainder
from gateway.twin.reconcile.output.result import Curves, Gap, Reconciliation

SCHEMA_VERSION = 2
"""Raised when a field changes its meaning; fields are added without."""
Array = NDArray[np.float64]


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
        "candidate_sets": [list(each) for each in result.candidate_sets],
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
            name: _estimate(estimate)
            | {"plausible": estimate.plausible, "limit": estimate.limit, "stated": _plain(estimate.stated)}
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
    return {"value": _plain(estimate.value), "ci95": [_plain(bound) for bound in estimate.ci95], "unit": estimate.unit}


def _plain(value: Value | None) -> Any:
    return list(value) if isinstance(value, tuple) else value


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


def format_prediction_csv(
    curves: Sequence[Curves], held: HeldRows | None = None, row_times_s: Array | None = None
) -> str:
    """The final model's prediction, one row per row of the recording; parts of one recording follow each other.

    Rows that repeat a reading repeat its prediction. Of means of samples, the prediction is that of a curve through them at the
    times of the rows (n,).
    """
    parts, begin_s = [], 0.0
    for each in curves:
        parts.append(np.column_stack([each.time_s + begin_s, each.after_g]))
        begin_s += 2 * float(each.time_s[-1]) - float(each.time_s[-2])
    rows = np.concatenate(parts) if parts else np.empty((0, 4))
    if row_times_s is not None and len(rows):
        elapsed_s = row_times_s - row_times_s[0]
        rows = np.column_stack([elapsed_s, CubicSpline(rows[:, 0], rows[:, 1:])(elapsed_s)])
    if held is not None:
        rows = np.column_stack([held.time_s - held.time_s[0], rows[held.reading, 1:]])
    lines = ["{:.6f},{:.7f},{:.7f},{:.7f}".format(*row) for row in rows.tolist()]
    return "\n".join(["time_s,ax_g,ay_g,az_g", *lines, ""])


def format_model_toml(result: Reconciliation) -> str:
    """The rig with the model that was found, in the form that `--rig` reads."""
    rig = result.rig
    sensor: dict[str, object] = {"noise_g": list(rig.noise_g)}
    if rig.sample_rate_hz is not None:
        sensor["sample_rate_hz"] = rig.sample_rate_hz
    if rig.full_scale_g is not None:
        sensor["full_scale_g"] = rig.full_scale_g
    return tomli_w.dumps(
        {
            "rope": {"length_m": rig.length_m},
            "housing": {"position_m": rig.position_m},
            "sensor": sensor,
            "site": {"gravity_m_s2": rig.gravity_m_s2},
            "model": as_tables(result.model),
        }
    )
