"""The plan as text and as JSON."""

from dataclasses import asdict
from typing import Any

from gateway.twin.experiment_design.experiment import (
    AT_REST_DEG,
    DRIVE_START_SHARE,
    FREE_SWING,
    ROUND_SWING_AXIS_RATIO,
    Experiment,
    Run,
)
from gateway.twin.experiment_design.plan import MAX_COSINE, MIN_SEPARATION_SIGMA, GroupPlan, Pair, Plan, Separation
from gateway.twin.experiment_design.signatures import Hypothesis
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


def describe(experiment: Experiment, rig: TwinRig) -> str:
    """Return what to do, in the order of the actions."""
    runs = [_describe_run(run, rig) for run in experiment.runs]
    if len(runs) == 1:
        return runs[0]
    return f"two recordings in succession, in the same wind: first {runs[0]}; then {runs[1]}"


def describe_duration(experiment: Experiment) -> str:
    """Return the time of recording and the total time."""
    return f"{experiment.duration_s / 60:.0f} min of recording, about {experiment.effort_s / 60:.0f} min in all"


def describe_hypothesis(hypothesis: Hypothesis) -> str:
    """Return `axis offset (x, y)`."""
    name = hypothesis.effect.replace("_", " ")
    return f"{name} ({', '.join(hypothesis.parts)})" if hypothesis.parts else name


def _describe_run(run: Run, rig: TwinRig) -> str:
    clauses = [*_preparation(run, rig), _swing(run), *_actions(run, rig)]
    return f"{', '.join(clauses)}; record {run.duration_s:.0f} s"


def _preparation(run: Run, rig: TwinRig) -> list[str]:
    clauses = []
    if run.heading_deg:
        clauses.append(f"clamp the housing again, turned by {run.heading_deg:.0f}° about the rope")
    if run.position_share is not None:
        position_m = run.position_share * rig.length_m
        clauses.append(f"clamp the housing {position_m:.2f} m below the pivot, with the same side facing the same way")
    return clauses


def _swing(run: Run) -> str:
    if run.amplitude_deg <= AT_REST_DEG:
        return "let the load hang still"
    shape = "nearly in a circle" if run.axis_ratio > ROUND_SWING_AXIS_RATIO else "freely"
    return f"let it swing {shape} from {run.amplitude_deg:.0f}°"


def _actions(run: Run, rig: TwinRig) -> list[str]:
    clauses = []
    if run.turn_deg_s:
        turn_s = 360 / run.turn_deg_s
        clauses.append(f"meanwhile turn the housing evenly about the rope, one turn in {turn_s:.0f} s")
    if run.hoist_share:
        verb = "hoist" if run.hoist_share > 0 else "lower"
        height_m, drive_s = abs(run.hoist_share) * rig.length_m, run.drive_s(rig)
        start_s = run.duration_s * DRIVE_START_SHARE
        clauses.append(f"{verb} by {height_m:.1f} m within {drive_s:.0f} s, starting at {start_s:.0f} s")
    return clauses
