"""The answer for a terminal, as JSON, and as files: predictions as recordings, the found model as a rig."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from gateway.measurement.source import HeldRows
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Value, without_rounding
from gateway.twin.model import EffectValues, as_tables
from gateway.twin.reconcile.data.crane_inputs import EstimatedInput
from gateway.twin.reconcile.output.result import (
    AVERAGED,
    Comparison,
    Curves,
    Estimate,
    Gap,
    Law,
    Reconciliation,
)

SCHEMA_VERSION = 2
"""Definition: raised when a field changes its meaning; fields are added without."""
Array = NDArray[np.float64]
ONLY_FOR_READERS = frozenset({"explains", "equation", "components", "refitted"})
"""Fields of the result that are words of its own kind, and no part of the JSON."""
VERDICT_SENTENCES = {
    "data_unusable": "the data cannot be used",
    "none_missing": "nothing is missing",
    "named": "missing:",
    "one_of": "missing: one of",
    "named_with_remainder": "partly explained; missing:",
    "unmodelled": "something is missing that the vocabulary does not have",
}


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
        "gap": _gap_of(compared),
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


def _gap_of(compared: Comparison | None) -> dict[str, Any]:
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


def to_text(result: Reconciliation) -> str:
    """A few lines."""
    named = tuple(f"{effect.name}{' other than stated' if effect.is_stated else ''}" for effect in result.effects)
    names = {"one_of": result.alternatives, "unmodelled": ()}.get(result.verdict, named)
    lines = [f"verdict      {_verdict(result, names)}".rstrip(), f"because      {result.reason}"]
    if result.verdict in ("one_of", "unmodelled") and named:
        lines.append(f"also missing {', '.join(named)}")
    groups = [*([result.candidates] if result.verdict != "one_of" and result.candidates else []), *result.also_one_of]
    lines += [f"also missing one of {', '.join(group)}{_fitted(group, result)}" for group in groups]
    for effect in result.effects:
        lines.append(f"  {effect.name}: {effect.explains}")
        lines += [
            f"    {name} = {_estimate(estimate)}{_against_stated(estimate)}{_doubt(estimate)}"
            for name, estimate in effect.parameters.items()
        ]
    for each in result.equivalents:
        same = "samples" if each.gives_same_samples else "period"
        lines.append(f"or equally   {_effects({each.name: each.parameters})}, which gives the {same} of {each.of}")
        lines.append(f"to decide    {each.split_by}")
    if result.best_attempt:
        lines.append(f"best attempt {_effects(result.best_attempt)}; not an explanation: a pattern remains")
    lines += _law(result.law)
    if result.split_by is not None:
        lines.append(f"to decide    {result.split_by}")
    if result.inputs:
        lines.append(f"inputs       {_inputs(result.inputs)}")
    compared = result.comparison
    if compared is None:
        return "\n".join(lines)
    if AVERAGED in result.counts:
        highest_hz = 1 / (2 * float(np.median(np.diff(compared.log.time_s))))
        why = f"for the recording is long: nothing faster than {highest_hz:.2g} Hz was judged"
        lines.append(f"samples      {result.counts[AVERAGED]} to a mean, {why}")
    lines.append(f"gap          {_gap(compared.gap)}")
    if result.leaves_remainder:
        lines.append(f"left         {compared.remainder.sentence}")
    return "\n".join(lines)


def _verdict(result: Reconciliation, names: Sequence[str]) -> str:
    if result.verdict == "unmodelled" and result.law is not None:
        return f"unmodelled: {result.law.text}"
    if result.verdict == "unmodelled" and result.ended_early:
        return "something is missing; what, had not been found when the search was ended"
    return f"{VERDICT_SENTENCES[result.verdict]} {', '.join(names)}"


def _law(law: Law | None) -> list[str]:
    """A description of the remainder, which is no cause."""
    if law is None:
        return []
    lines = []
    for term in law.terms:
        lines.append(f"equation     {term.text}: {term.meaning}")
        lines += [f"    {name} = {_estimate(estimate)}" for name, estimate in term.parameters.items()]
        if term.alternatives:
            lines.append(f"    nearly as good: {', '.join(term.alternatives)}")
        if term.closest_effects:
            alike = (
                f"{each.name}{' of the opposite sign' if each.reversed else ''} ({each.cosine:.3f})"
                for each in term.closest_effects
            )
            lines.append(f"    resembles {', '.join(alike)}")
    if law.closed_test_percent is not None:
        lines.append(f"    closes {law.closed_test_percent:.1f} % of the gap on the test part")
    return lines


def _inputs(found: Sequence[EstimatedInput]) -> str:
    kinds = (("drive", "drives"), ("hoist", "hoists"))
    counts = [(sum(each.kind == kind for each in found), kind, plural) for kind, plural in kinds]
    text = " and ".join(f"{count} {kind if count == 1 else plural}" for count, kind, plural in counts if count)
    return f"{text} of the crane, as estimated from the recording; their samples are not fitted"


def _fitted(group: Sequence[str], result: Reconciliation) -> str:
    """The values of the one that the final model has."""
    fitted = {name: result.model[name] for name in group if name in result.model}
    return f"; fitted: {_effects(fitted)}" if fitted else ""


def _effects(effects: EffectValues) -> str:
    return "; ".join(
        f"{name} ({', '.join(_value(name, parameter, value) for parameter, value in values.items())})"
        for name, values in effects.items()
    )


def _value(effect: str, parameter: str, value: Value) -> str:
    unit = next((each.unit for each in EFFECTS[effect].parameters if each.name == parameter), "1")
    numbers = ",".join(_number(each) for each in np.atleast_1d(np.asarray(value, dtype=np.float64)))
    return f"{parameter} {numbers}" + ("" if unit == "1" else f" {unit}")


def _estimate(estimate: Estimate) -> str:
    low, high = (np.atleast_1d(end) for end in estimate.ci95)
    return ", ".join(
        f"{_with_unit(_number(value), estimate)} ({_number(least)} to {_number(most)})"
        for value, least, most in zip(np.atleast_1d(estimate.value), low, high, strict=True)
    )


def _with_unit(text: str, estimate: Estimate) -> str:
    return f"{text} {estimate.unit_text}".rstrip()


def _against_stated(estimate: Estimate) -> str:
    """Which components are larger or smaller than the rig states, by more than their interval."""
    if estimate.stated is None:
        return ""
    stated, low, high = (np.atleast_1d(each) for each in (estimate.stated, *estimate.ci95))
    differs = dict.fromkeys(
        "larger" if a > s else "smaller" for s, a, b in zip(stated, low, high, strict=True) if not a <= s <= b
    )
    than = f"{' or '.join(differs)} than stated: " if differs else "as stated: "
    return f"; {than}{_with_unit(', '.join(map(_number, stated)), estimate)}"


def _number(value: float) -> str:
    """Return a number; what a fit leaves of an axis that was not measured is 0."""
    return f"{without_rounding(value):.4g}"


def _doubt(estimate: Estimate) -> str:
    if estimate.plausible:
        return ""
    if estimate.limit is None:
        return "; doubtful: at the edge of what is possible"
    return f"; implausible: beyond {_with_unit(f'{estimate.limit:.3g}', estimate)}, the most that is usual"


def _gap(gap: Gap) -> str:
    closed = Gap.closed_percent(gap.before_test, gap.after_test)
    text = "" if closed is None else f" ({closed:.1f} % closed)"
    return (
        f"log {gap.before_log:.3g} -> {gap.after_log:.3g}, test part {gap.before_test:.3g} -> {gap.after_test:.3g}{text} "
        "(reduced chi-square; 1 is noise)"
    )
