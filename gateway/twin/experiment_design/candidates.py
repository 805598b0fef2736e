"""The manoeuvres that are tried."""

from gateway.twin.experiment_design.experiment import Leg, Manoeuvre

TURN_DEG_S = 3.0
"""One turn in the two minutes of a recording; 0.05 rad/s."""
FREE_SWING = Manoeuvre((Leg(),))
"""What is recorded when nobody does anything for the comparison's sake."""
STILL_DEG = 0.3

CANDIDATES: tuple[Manoeuvre, ...] = (
    FREE_SWING,
    # a swing alone: wider, rounder, longer
    Manoeuvre((Leg(duration_s=300.0),)),
    Manoeuvre((Leg(amplitude_deg=10.0),)),
    Manoeuvre((Leg(amplitude_deg=10.0, duration_s=300.0),)),
    Manoeuvre((Leg(roundness=0.9),)),
    Manoeuvre((Leg(amplitude_deg=10.0, roundness=0.9),)),
    # turning the housing about the rope
    Manoeuvre((Leg(amplitude_deg=STILL_DEG, turn_deg_s=TURN_DEG_S),)),
    Manoeuvre((Leg(turn_deg_s=TURN_DEG_S),)),
    Manoeuvre((Leg(amplitude_deg=10.0, turn_deg_s=TURN_DEG_S),)),
    # hoisting and lowering
    Manoeuvre((Leg(amplitude_deg=10.0, hoist_share=1 / 3),)),
    Manoeuvre((Leg(amplitude_deg=10.0, duration_s=300.0, hoist_share=1 / 3),)),
    Manoeuvre((Leg(amplitude_deg=10.0, duration_s=300.0, hoist_share=-1 / 3),)),
    Manoeuvre((Leg(amplitude_deg=10.0, turn_deg_s=TURN_DEG_S, hoist_share=1 / 3),)),
    # two recordings
    Manoeuvre((Leg(), Leg(amplitude_deg=10.0))),
    Manoeuvre((Leg(), Leg(heading_deg=90.0))),
    Manoeuvre((Leg(amplitude_deg=10.0), Leg(amplitude_deg=10.0, place_share=0.2))),
    Manoeuvre((Leg(amplitude_deg=10.0), Leg(amplitude_deg=10.0, place_share=0.6))),
)
