"""The plan as printed, and as JSON."""

from dataclasses import asdict
from typing import Any

from gateway.twin.experiment_design.candidates import FREE_SWING
from gateway.twin.experiment_design.experiment import Experiment, Run
from gateway.twin.experiment_design.formatting import describe, how_long, suspect_in_words
from gateway.twin.experiment_design.plan import GroupPlan, Pair, Plan
from gateway.twin.experiment_design.separation import SAME_TRACE, SEEN_SIGMA, Separation
from gateway.twin.model import TwinRig

PREAMBLE = (
    "What is left unexplained, in sigma, when one effect of typical size is taken for the other; cosine 1 is the same trace.\n"
    f"Told apart: {SEEN_SIGMA:g} sigma or more, and a cosine below {SAME_TRACE:g}. "
    f"Before: a free swing of {FREE_SWING.legs[0].amplitude_deg:g}°, {FREE_SWING.duration_s:.0f} s."
)


def as_text(found: Plan) -> str:
    """For a terminal."""
    return "\n\n".join([PREAMBLE, *(_group_text(each, found.rig) for each in found.groups)])


def _group_text(each: GroupPlan, rig: TwinRig) -> str:
    lines = [" | ".join(suspect_in_words(suspect) for suspect in each.group)]
    if each.manoeuvre is None:
        lines.append(f"  none of the {each.tried} manoeuvres tried tells these apart")
    else:
        lines.append(f"  do: {describe(each.manoeuvre, rig)}{_of_free_swing(each)}")
        lines.append(f"  takes: {how_long(each.manoeuvre)}")
        lines += [
            f"  expect: {name.replace('_', ' ')} among the named effects: that is you" for name in _own(each, rig)
        ]
    lines += [f"  {line}" for line in _table(each.pairs)]
    if each.instead is not None:
        lines.append(f"  {'instead' if each.manoeuvre is None else 'for what stays'}: {each.instead}")
    lines += [f"  or: {describe(other, rig)} ({how_long(other)})" for other in each.alternatives]
    return "\n".join(lines)


def _of_free_swing(each: GroupPlan) -> str:
    if each.manoeuvre != FREE_SWING:
        return ""
    return (
        " (an ordinary free swing is enough)"
        if each.is_distinguishable
        else " (an ordinary free swing: nothing else does more)"
    )


def _own(each: GroupPlan, rig: TwinRig) -> list[str]:
    return [] if each.manoeuvre is None else sorted(each.manoeuvre.inputs(rig))


def _table(pairs: tuple[Pair, ...]) -> list[str]:
    names = [f"{suspect_in_words(pair.first)} / {suspect_in_words(pair.second)}" for pair in pairs]
    width = max(len(name) for name in names)
    return [
        f"{name:<{width}}  before {_said(pair.before)}{'' if pair.after is None else f'   then {_said(pair.after)}'}".rstrip()
        for name, pair in zip(names, pairs, strict=True)
    ]


def _said(separation: Separation) -> str:
    verdict = "told apart" if separation.is_distinguishable else "not told apart"
    return f"{separation.sigma:6.1f} sigma, cosine {separation.cosine:.5f}, {verdict:<14}"


def as_json(found: Plan) -> dict[str, Any]:
    """For programs; angles in degrees, lengths in metres."""
    return {"rig": asdict(found.rig), "groups": [_group_json(each, found.rig) for each in found.groups]}


def _group_json(each: GroupPlan, rig: TwinRig) -> dict[str, Any]:
    return {
        "effects": [suspect.label for suspect in each.group],
        "told_apart": each.is_distinguishable,
        "manoeuvre": None if each.manoeuvre is None else _manoeuvre_json(each.manoeuvre, rig),
        "pairs": [_pair_json(pair) for pair in each.pairs],
        "alternatives": [_manoeuvre_json(other, rig) for other in each.alternatives],
        "instead": each.instead,
        "tried": each.tried,
    }


def _manoeuvre_json(manoeuvre: Experiment, rig: TwinRig) -> dict[str, Any]:
    return {
        "do": describe(manoeuvre, rig),
        "duration_s": manoeuvre.duration_s,
        "effort_s": manoeuvre.effort_s,
        "recordings": [_leg_json(leg, rig) for leg in manoeuvre.legs],
    }


def _leg_json(leg: Run, rig: TwinRig) -> dict[str, Any]:
    return {
        "amplitude_deg": leg.amplitude_deg,
        "roundness": leg.roundness,
        "duration_s": leg.duration_s,
        "heading_deg": leg.heading_deg,
        "housing_position_m": rig.position_m + leg.moved_m(rig),
        "model": {name: dict(values) for name, values in leg.inputs(rig).items()},
    }


def _pair_json(pair: Pair) -> dict[str, Any]:
    return {
        "first": pair.first.label,
        "second": pair.second.label,
        "before": _separation_json(pair.before),
        "after": None if pair.after is None else _separation_json(pair.after),
    }


def _separation_json(separation: Separation) -> dict[str, Any]:
    return {"sigma": separation.sigma, "cosine": separation.cosine, "told_apart": separation.is_distinguishable}
