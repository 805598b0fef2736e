"""A manoeuvre in an operator's words."""

from gateway.twin.experiment_design.candidates import STILL_DEG
from gateway.twin.experiment_design.experiment import DRIVE_FROM, ROUND_FROM, Experiment, Run
from gateway.twin.experiment_design.hypotheses import Hypothesis
from gateway.twin.model import TwinRig


def describe(manoeuvre: Experiment, rig: TwinRig) -> str:
    """What to do, one clause after another."""
    said = [_leg(leg, rig) for leg in manoeuvre.legs]
    if len(said) == 1:
        return said[0]
    return f"two recordings right after one another, in the same wind: first {said[0]}; then {said[1]}"


def how_long(manoeuvre: Experiment) -> str:
    """Recordings, and all in all."""
    return f"{manoeuvre.duration_s / 60:.0f} min of recording, about {manoeuvre.effort_s / 60:.0f} min in all"


def suspect_in_words(suspect: Hypothesis) -> str:
    """`axis offset (x, y)`."""
    name = suspect.effect.replace("_", " ")
    return f"{name} ({', '.join(suspect.parts)})" if suspect.parts else name


def _leg(leg: Run, rig: TwinRig) -> str:
    clauses = [*_before(leg, rig), _swing(leg), *_during(leg, rig)]
    return f"{', '.join(clauses)}; record {leg.duration_s:.0f} s"


def _before(leg: Run, rig: TwinRig) -> list[str]:
    clauses = []
    if leg.heading_deg:
        clauses.append(f"clamp the housing on again, turned by {leg.heading_deg:.0f}° about the rope")
    if leg.place_share is not None:
        clauses.append(
            f"clamp the housing {leg.place_share * rig.length_m:.2f} m below the pivot, the same side facing the same way"
        )
    return clauses


def _swing(leg: Run) -> str:
    if leg.amplitude_deg <= STILL_DEG:
        return "let the load hang still"
    shape = "round, nearly in a circle," if leg.roundness > ROUND_FROM else "freely"
    return f"let it swing {shape} from {leg.amplitude_deg:.0f}°"


def _during(leg: Run, rig: TwinRig) -> list[str]:
    clauses = []
    if leg.turn_deg_s:
        one_turn_s = 360 / leg.turn_deg_s
        clauses.append(f"turn the housing evenly about the rope meanwhile, one turn in {one_turn_s:.0f} s")
    if leg.hoist_share:
        verb = "hoist" if leg.hoist_share > 0 else "lower"
        by_m, drive_s = abs(leg.hoist_share) * rig.length_m, leg.drive_s(rig)
        clauses.append(f"{verb} by {by_m:.1f} m within {drive_s:.0f} s, from {leg.duration_s * DRIVE_FROM:.0f} s on")
    return clauses
