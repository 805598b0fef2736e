"""The answer as files: the JSON of `reconcile --json`, predictions as recordings, the found model as a rig."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from gateway.measurement.source import HeldRows
from gateway.twin.model import as_tables
from gateway.twin.reconcile.output.result import Comparison, Curves, Gap, Reconciliation

SCHEMA_VERSION = 2
"""Raised when a field changes its meaning; fields are added without."""
Array = NDArray[np.float64]
ONLY_FOR_READERS = frozenset({"explains", "equation"})
"""Fields of the result that are words of its own kind, and no part of the JSON."""


def to_json(result: Reconciliation, runtime_s: float) -> dict[str, Any]:
    """Names as published; what could not be computed is null."""
    compared = result.comparison
    return {
        "schema_version": SCHEMA_VERSION,
        "verdict": result.verdict,
        "reason": result.reason,
        "reason_code": result.reason_code,
        "remainder": result.leaves_remainder,
        "ended_early": result.ended_early,
        "parts": [] if compared is None else _plain(compared.parts),
        "effects": _plain(result.effects),
        "best_attempt": _plain(result.best_attempt),
        "candidates": _plain(result.candidates),
        "candidate_sets": _plain(result.candidate_sets),
        "also_one_of": _plain(result.also_one_of),
        "split_by": result.split_by,
        "equivalents": _plain(result.equivalents),
        "equation": None if result.law is None else {"text": result.law.text, **_plain(result.law)},
        "disagreement": [] if compared is None else _plain(compared.disagreement),
        "gap": _gap(compared),
        "residual": None if compared is None else _plain(compared.residual),
        "left_of_motion": None if compared is None else _plain(compared.remainder),
        "steps": _plain(result.steps),
        "refitted_on_held_out": _plain(result.refitted_on_held_out),
        "ranking": _plain(result.ranking),
        "inputs": [
            {**_plain(each), "recording": recording, "unit": each.unit}
            for recording, inputs in (("log", result.inputs), ("held_out", result.held_out_inputs))
            for each in inputs
        ],
        "samples": dict(result.counts),
        "runtime_s": runtime_s,
    }


def _plain(value: Any) -> Any:
    """Return a value in the types of JSON; a dataclass becomes an object with the names of its fields."""
    if is_dataclass(value):
        return {
            each.name: _plain(getattr(value, each.name)) for each in fields(value) if each.name not in ONLY_FOR_READERS
        }
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    return [_plain(each) for each in value] if isinstance(value, tuple | list) else value


def _gap(compared: Comparison | None) -> dict[str, Any]:
    keys = ("log", "held_out", "test")
    if compared is None:
        return {name: dict.fromkeys(keys) for name in ("before", "after", "closed_percent")}
    before, after = ({key: getattr(compared.gap, f"{when}_{key}") for key in keys} for when in ("before", "after"))
    closed = {key: Gap.closed_percent(before[key], after[key]) for key in keys}
    return {"before": before, "after": after, "closed_percent": closed}


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
