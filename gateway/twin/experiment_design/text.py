"""The plan as text and as JSON."""

from dataclasses import asdict
from typing import Any

from gateway.twin.experiment_design.candidates import FREE_SWING
from gateway.twin.experiment_design.experiment import Experiment, Run
from gateway.twin.experiment_design.formatting import describe, describe_duration, describe_hypothesis
from gateway.twin.experiment_design.plan import GroupPlan, Pair, Plan
from gateway.twin.experiment_design.separation import MAX_COSINE, MIN_SEPARATION_SIGMA, Separation
from gateway.twin.model import TwinRig

PREAMBLE = (
    "The residual, in sigma, if one effect of typical size is replaced by the other; a cosine of 1 means the same signature.\n"
    f"Separated: {MIN_SEPARATION_SIGMA:g} sigma or more, and a cosine below {MAX_COSINE:g}. "
    f"Before: a free swing of {FREE_SWING.runs[0].amplitude_deg:g}°, {FREE_SWING.duration_s:.0f} s."
)


def as_text(plan: Plan) -> str:
    """Return the plan for a terminal."""
    return "\n\n".join([PREAMBLE, *(_group_text(each, plan.rig) for each in plan.groups)])


def _group_text(each: GroupPlan, rig: TwinRig) -> str:
    lines = [" | ".join(describe_hypothesis(hypothesis) for hypothesis in each.group)]
    if each.experiment is None:
        lines.append(f"  none of the {each.tried} experiments tried separates these effects")
    else:
        lines.append(f"  do: {describe(each.experiment, rig)}{_free_swing_note(each)}")
        lines.append(f"  takes: {describe_duration(each.experiment)}")
        lines += [
            f"  expect: {name.replace('_', ' ')} among the named effects, because you do it"
            for name in sorted(each.experiment.inputs(rig))
        ]
    lines += [f"  {line}" for line in _table(each.pairs)]
    if each.instead is not None:
        lines.append(f"  {'instead' if each.experiment is None else 'for the others'}: {each.instead}")
    lines += [f"  or: {describe(other, rig)} ({describe_duration(other)})" for other in each.alternatives]
    return "\n".join(lines)


def _free_swing_note(each: GroupPlan) -> str:
    if each.experiment != FREE_SWING:
        return ""
    return (
        " (an ordinary free swing is enough)"
        if each.is_distinguishable
        else " (an ordinary free swing: no other experiment separates more)"
    )


def _table(pairs: tuple[Pair, ...]) -> list[str]:
    names = [f"{describe_hypothesis(pair.first)} / {describe_hypothesis(pair.second)}" for pair in pairs]
    width = max(len(name) for name in names)
    return [_row(f"{name:<{width}}", pair) for name, pair in zip(names, pairs, strict=True)]


def _row(name: str, pair: Pair) -> str:
    after = "" if pair.after is None else f"   after {_separation_text(pair.after)}"
    return f"{name}  before {_separation_text(pair.before)}{after}".rstrip()


def _separation_text(separation: Separation) -> str:
    verdict = "separated" if separation.is_distinguishable else "not separated"
    return f"{separation.sigma:6.1f} sigma, cosine {separation.cosine:.5f}, {verdict:<13}"


def as_json(plan: Plan) -> dict[str, Any]:
    """Return the plan for programs; angles in degrees, lengths in metres."""
    return {"rig": asdict(plan.rig), "groups": [_group_json(each, plan.rig) for each in plan.groups]}


def _group_json(each: GroupPlan, rig: TwinRig) -> dict[str, Any]:
    return {
        "effects": [hypothesis.label for hypothesis in each.group],
        "told_apart": each.is_distinguishable,
        "manoeuvre": None if each.experiment is None else _experiment_json(each.experiment, rig),
        "pairs": [_pair_json(pair) for pair in each.pairs],
        "alternatives": [_experiment_json(other, rig) for other in each.alternatives],
        "instead": each.instead,
        "tried": each.tried,
    }


def _experiment_json(experiment: Experiment, rig: TwinRig) -> dict[str, Any]:
    return {
        "do": describe(experiment, rig),
        "duration_s": experiment.duration_s,
        "effort_s": experiment.effort_s,
        "recordings": [_run_json(run, rig) for run in experiment.runs],
    }


def _run_json(run: Run, rig: TwinRig) -> dict[str, Any]:
    return {
        "amplitude_deg": run.amplitude_deg,
        "roundness": run.axis_ratio,
        "duration_s": run.duration_s,
        "heading_deg": run.heading_deg,
        "housing_position_m": rig.position_m + run.position_change_m(rig),
        "model": {name: dict(values) for name, values in run.inputs(rig).items()},
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
