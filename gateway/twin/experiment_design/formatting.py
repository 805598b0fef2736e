"""An experiment in an operator's words."""

from gateway.twin.experiment_design.candidates import AT_REST_DEG
from gateway.twin.experiment_design.experiment import DRIVE_START_SHARE, ROUND_SWING_AXIS_RATIO, Experiment, Run
from gateway.twin.experiment_design.hypotheses import Hypothesis
from gateway.twin.model import TwinRig


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
