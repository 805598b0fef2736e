"""The verdict: what was found, how large it is, and what it means for the operator of the crane.

Below it stand the effects considered, in the order of the evidence.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gateway.documents.format import (
    as_sentence,
    format_number,
    format_time_span,
    format_with_interval,
    human_name,
    join_names,
)
from gateway.twin.effects import EFFECTS
from gateway.twin.reconcile.output.result import (
    Candidate,
    Comparison,
    Equivalent,
    Estimate,
    Law,
    NamedEffect,
    Reconciliation,
)
from gateway.twin.report.gap import part_rows
from gateway.twin.report.text import format_noise_ratio

LABELS = {
    "data_unusable": ("No answer", "unusable"),
    "none_missing": ("No effect missing", "agrees"),
    "named": ("Cause identified", "found"),
    "one_of": ("One of several", "doubt"),
    "named_with_remainder": ("Partly identified", "doubt"),
    "unmodelled": ("Unknown cause", "unknown"),
}
NO_ACTION = (
    "No action is needed. This holds for what the recording could show: its length, the amplitude of its swing, "
    "and the time at which it was made."
)
UNUSABLE = "This is no statement on the crane or the sensor; do not take it for “all is well”."
NEXT_TIME = "Once it is confirmed, add it to the rig’s description: the next comparison then starts from there."
WHERE_TO_LOOK = "Check what else acted on the load, the rope or the sensor."
INDISTINGUISHABLE = ", and this recording cannot distinguish them"
NO_SPLIT = "No experiment that would distinguish them was found."
UNIT_SUFFIX = re.compile(r"(^|_)(m_s2|m_s|rad_s|deg_s|per_s|per_m|mg_per_c|hz|deg|rad|g|m|s)$")
NOT_ONE_ALONE = "Until then, do not act on one of them alone."


@dataclass(frozen=True, slots=True)
class Size:
    """A number that says how large an effect is, as it is printed."""

    label: str
    value: str
    interval: str
    """95 %."""
    unit: str
    """Empty for a pure number."""


def effect_sizes(effect: NamedEffect) -> tuple[Size, ...]:
    """Return the estimated parameters that say how large an effect is, not when it acted or with which phase."""
    sizes = []
    for name, estimate in effect.parameters.items():
        if not estimate.refitted and (estimate.unit != "s" or effect.when_s is None):
            short_name = human_name(UNIT_SUFFIX.sub("", name))
            for component, value, interval in component_texts(estimate):
                label = " ".join(filter(None, (short_name, component)))
                sizes.append(Size(label, value, interval, estimate.unit_text))
    return tuple(sizes)


def component_texts(estimate: Estimate) -> Iterator[tuple[str, str, str]]:
    """Yield the name, value and 95 % interval of each component of a parameter; an empty name where there are none."""
    values, low, high = (np.atleast_1d(np.asarray(each)).tolist() for each in (estimate.value, *estimate.ci95))
    for component, *numbers in zip(estimate.components or ("",), values, low, high, strict=True):
        yield component, *format_with_interval(*numbers)


@dataclass(frozen=True, slots=True)
class Finding:
    """An effect of the answer."""

    name: str
    meaning: str
    is_addition: bool
    """Identified on its own, in addition to a group that cannot be distinguished."""
    acted: str
    """When it acted; empty where it acts all the time or its time is not known."""
    sizes: tuple[Size, ...]


def verdict_content(result: Reconciliation) -> dict[str, object]:
    """Return the box at the head of the report, and the gap below it: empty where no model was fitted."""
    label, kind = LABELS[result.verdict]
    return {
        "label": label,
        "kind": kind,
        "sentence": _sentence(result),
        "findings": _findings(result),
        "paragraphs": _paragraphs(result),
        "parts": () if result.comparison is None else part_rows(result.comparison, result.rig),
    }


def confirmed_effects(result: Reconciliation) -> tuple[NamedEffect, ...]:
    """Return the effects that are identified on their own, not as one of a group."""
    group = set(result.candidates) if result.verdict == "one_of" else set()
    return tuple(effect for effect in result.effects if effect.name not in group)


def unexplained(compared: Comparison) -> str:
    """Return what the final model does not explain, in a sentence."""
    gap = compared.gap
    size = f"{format_noise_ratio(gap.after_log)}, on held-out data {format_noise_ratio(gap.after_held_out)}"
    return f"The residual of the best model is {size}: {compared.remainder.sentence}."


UNKNOWN_CAUSE = {
    False: "No effect in the catalogue explains the difference; its cause is unknown.",
    True: "The cause of the difference was not found before the search was ended.",
}
"""By whether the search was ended early."""


def _sentence(result: Reconciliation) -> str:
    effects = confirmed_effects(result)
    names = join_names([f"{'the true size of ' if effect.is_stated else ''}{effect.name}" for effect in effects])
    match result.verdict:
        case "data_unusable":
            return "The recording cannot be used, so there is no answer."
        case "none_missing":
            return "No effect is missing: simulation and measurement agree within the sensor’s noise."
        case "named":
            them = "it" if len(effects) == 1 else "them"
            return f"The nominal model lacks {names}. With {them}, the simulation agrees with the measurement."
        case "one_of":
            does = "acts" if result.leaves_remainder else "explains the difference"
            beside = " A further effect is not known." if result.leaves_remainder else ""
            known = result.alternatives
            of, names = (
                ("these", f": {join_names(known, 'or')}") if known else ("several", "; their names were not recorded")
            )
            return f"One of {of} effects {does}{INDISTINGUISHABLE}{names}.{beside}"
        case "named_with_remainder":
            return f"The nominal model lacks {names}, and a further effect that is not known."
        case "unmodelled":
            return UNKNOWN_CAUSE[result.ended_early]


def _findings(result: Reconciliation) -> tuple[Finding, ...]:
    if result.verdict in ("data_unusable", "unmodelled"):
        return ()
    group = result.candidates if result.verdict == "one_of" else ()
    meanings = {name: as_sentence(EFFECTS[name].explains) if name in EFFECTS else "" for name in group}
    found = [Finding(human_name(name), meaning, False, "", ()) for name, meaning in meanings.items()]
    for effect in confirmed_effects(result):
        meaning = as_sentence(effect.explains)
        if effect.is_stated:
            meaning += f" The rig’s description states {_stated(effect)}."
        acted, sizes = _acted(effect.when_s), effect_sizes(effect)
        found.append(Finding(human_name(effect.name), meaning, bool(group), acted, sizes))
    return tuple(found)


def _stated(effect: NamedEffect) -> str:
    return ", ".join(
        f"{format_number(float(each))} {estimate.unit_text}".strip()
        for estimate in effect.parameters.values()
        if estimate.stated is not None
        for each in np.atleast_1d(np.asarray(estimate.stated, dtype=np.float64))
    )


def _acted(when_s: tuple[float, float] | None) -> str:
    if when_s is None:
        return ""
    text = format_time_span(*when_s)
    start = "" if text.startswith("at ") else "from "
    return f"It acted {start}{text} after the start of the recording."


def _paragraphs(result: Reconciliation) -> tuple[str, ...]:
    """Return advice and reason; the reason comes first where it says what to mend."""
    advice = " ".join((_advice(result), *map(_equivalent, result.equivalents)))
    if not result.reason.strip():
        return (advice,)
    reason = as_sentence(result.reason)
    if result.verdict == "data_unusable":
        return (reason, advice)
    equation = () if result.law is None else (_equation(result.law),)
    return (*_further_groups(result), *equation, advice, f"Reason for this verdict: {reason}")


def _further_groups(result: Reconciliation) -> tuple[str, ...]:
    """Return what acts as well, of which the recording shows only the group."""
    headline = () if result.verdict == "one_of" or not result.candidates else (result.candidates,)
    groups = (*headline, *result.also_one_of)
    found = [
        f"One of these acts as well, and this recording cannot distinguish them: {join_names(each, 'or')}."
        for each in groups
    ]
    if found and result.verdict != "one_of" and result.split_by:
        found.append(f"To distinguish them: {as_sentence(result.split_by)}")
    return tuple(found)


def _equation(law: Law) -> str:
    """Return what describes the remainder, and what it resembles."""
    text = f"An equation describes the remainder: {law.text}."
    if law.closed_test_percent is not None:
        text += f" It closes {law.closed_test_percent:.1f} % of the gap on the test part."
    alike = dict.fromkeys(each.name for term in law.terms for each in term.closest_effects)
    if alike:
        text += f" The closest known effects do not explain it: {join_names(list(alike))}."
    return f"{text} It is a description and names no cause."


def _equivalent(each: Equivalent) -> str:
    values = ", ".join(
        f"{format_number(float(np.asarray(each.parameters[p.name])))} {p.unit}"
        for p in EFFECTS[each.name].parameters
        if p.name in each.parameters
    )
    how = "look the same in this recording as" if each.gives_same_samples else "swing with the same period as"
    same = f"{human_name(each.name)} ({values}) would {how} {human_name(each.of)}."
    return f"{same} To distinguish them: {as_sentence(each.split_by)}"


def _advice(result: Reconciliation) -> str:
    left = "" if result.comparison is None else unexplained(result.comparison)
    match result.verdict:
        case "data_unusable":
            return UNUSABLE
        case "none_missing":
            return NO_ACTION
        case "named":
            return f"Check the crane and the sensor for this. {NEXT_TIME}"
        case "one_of":
            split = f"To distinguish them: {as_sentence(result.split_by)}" if result.split_by else NO_SPLIT
            rest = f" {left} {WHERE_TO_LOOK}" if result.leaves_remainder else ""
            return f"{split} {NOT_ONE_ALONE}{rest}"
        case "named_with_remainder":
            return f"The named part is supported by the data. {left} {WHERE_TO_LOOK}"
        case "unmodelled":
            return f"{left} {WHERE_TO_LOOK}"


def ranked_candidates(result: Reconciliation) -> list[Candidate]:
    """Return the sets of effects that were fitted, the best one first."""
    return sorted(result.ranking, key=lambda each: (each.behind, each.chi2_held_out is None))


def is_transient(name: str) -> bool:
    """Return whether an effect acts for a time only."""
    known = EFFECTS.get(name)
    return known is not None and known.transient


def relative_deficit(candidate: Candidate, candidates: list[Candidate]) -> float:
    """Return the deficit of a candidate on a logarithmic scale, as a share of the largest."""
    if not math.isfinite(candidate.behind):
        return 1.0
    most = max(each.behind for each in candidates if math.isfinite(each.behind))
    return math.log1p(max(candidate.behind, 0.0)) / math.log1p(most) if most > 0 else 0.0


def assessment(candidate: Candidate, best: Candidate) -> str:
    """Return the class of a candidate: best, rival, trifle or worse.

    The best set with more effects may fit a little better: too little for a name, so the addition was dropped.
    """
    if candidate is best:
        return "best"
    if candidate.rival:
        return "rival"
    return "trifle" if set(candidate.names) > set(best.names) else "worse"
