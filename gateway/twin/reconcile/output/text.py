"""The answer for a terminal."""

from collections.abc import Sequence

import numpy as np

from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Value, without_rounding
from gateway.twin.model import EffectValues
from gateway.twin.reconcile.data.crane_inputs import EstimatedInput
from gateway.twin.reconcile.output.estimates import Estimate, Law, Resemblance
from gateway.twin.reconcile.output.result import AVERAGED, Curves, Gap, Reconciliation

VERDICT_SENTENCES = {
    "data_unusable": "the data cannot be used",
    "none_missing": "nothing is missing",
    "named": "missing:",
    "one_of": "missing: one of",
    "named_with_remainder": "partly explained; missing:",
    "unmodelled": "something is missing that the vocabulary does not have",
}


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
        lines.append(f"samples      {_averaged(result.counts[AVERAGED], compared.log)}")
    lines.append(f"gap          {_gap(compared.gap)}")
    if result.leaves_remainder:
        lines.append(f"left         {compared.remainder.sentence}")
    return "\n".join(lines)


def _averaged(count: int, log: Curves) -> str:
    rate_hz = 1 / float(np.median(np.diff(log.time_s)))
    return f"{count} to a mean, for the recording is long: nothing faster than {rate_hz / 2:.2g} Hz was judged"


def _verdict(result: Reconciliation, names: Sequence[str]) -> str:
    if result.verdict == "unmodelled" and result.law is not None:
        return f"unmodelled: {result.law.text}"
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
            lines.append(f"    resembles {', '.join(_resemblance(each) for each in term.closest_effects)}")
    if law.closed_test_percent is not None:
        lines.append(f"    closes {law.closed_test_percent:.1f} % of the gap on the test part")
    return lines


def _resemblance(found: Resemblance) -> str:
    return f"{found.name}{' of the opposite sign' if found.reversed else ''} ({found.cosine:.3f})"


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
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    values = [
        f"{_number(value)}{unit} ({_number(least)} to {_number(most)})"
        for value, least, most in zip(np.atleast_1d(estimate.value), low, high, strict=True)
    ]
    return ", ".join(values)


def _against_stated(estimate: Estimate) -> str:
    """Which components are larger or smaller than the rig states, by more than their interval."""
    if estimate.stated is None:
        return ""
    stated, low, high = (np.atleast_1d(each) for each in (estimate.stated, *estimate.ci95))
    differs = dict.fromkeys(
        "larger" if a > s else "smaller" for s, a, b in zip(stated, low, high, strict=True) if not a <= s <= b
    )
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    than = f"{' or '.join(differs)} than stated: " if differs else "as stated: "
    return f"; {than}{', '.join(_number(each) for each in stated)}{unit}"


def _number(value: float) -> str:
    """Return a number; what a fit leaves of an axis that was not measured is 0."""
    return f"{without_rounding(value):.4g}"


def _doubt(estimate: Estimate) -> str:
    if estimate.plausible:
        return ""
    if estimate.limit is None:
        return "; doubtful: at the edge of what is possible"
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    return f"; implausible: beyond {estimate.limit:.3g}{unit}, the most that is usual"


def _gap(gap: Gap) -> str:
    closed = Gap.closed_percent(gap.before_test, gap.after_test)
    text = "" if closed is None else f" ({closed:.1f} % closed)"
    return (
        f"log {gap.before_log:.3g} -> {gap.after_log:.3g}, test part {gap.before_test:.3g} -> {gap.after_test:.3g}{text} "
        "(reduced chi-square; 1 is noise)"
    )
