"""The manoeuvres that are tried."""

from gateway.twin.experiment_design.experiment import Experiment, Run

TURN_DEG_S = 3.0
"""One turn in the two minutes of a recording; 0.05 rad/s."""
FREE_SWING = Experiment((Run(),))
"""What is recorded when nobody does anything for the comparison's sake."""
STILL_DEG = 0.3

CANDIDATES: tuple[Experiment, ...] = (
    FREE_SWING,
    # a swing alone: wider, rounder, longer
    Experiment((Run(duration_s=300.0),)),
    Experiment((Run(amplitude_deg=10.0),)),
    Experiment((Run(amplitude_deg=10.0, duration_s=300.0),)),
    Experiment((Run(roundness=0.9),)),
    Experiment((Run(amplitude_deg=10.0, roundness=0.9),)),
    # turning the housing about the rope
    Experiment((Run(amplitude_deg=STILL_DEG, turn_deg_s=TURN_DEG_S),)),
    Experiment((Run(turn_deg_s=TURN_DEG_S),)),
    Experiment((Run(amplitude_deg=10.0, turn_deg_s=TURN_DEG_S),)),
    # hoisting and lowering
    Experiment((Run(amplitude_deg=10.0, hoist_share=1 / 3),)),
    Experiment((Run(amplitude_deg=10.0, duration_s=300.0, hoist_share=1 / 3),)),
    Experiment((Run(amplitude_deg=10.0, duration_s=300.0, hoist_share=-1 / 3),)),
    Experiment((Run(amplitude_deg=10.0, turn_deg_s=TURN_DEG_S, hoist_share=1 / 3),)),
    # two recordings
    Experiment((Run(), Run(amplitude_deg=10.0))),
    Experiment((Run(), Run(heading_deg=90.0))),
    Experiment((Run(amplitude_deg=10.0), Run(amplitude_deg=10.0, place_share=0.2))),
    Experiment((Run(amplitude_deg=10.0), Run(amplitude_deg=10.0, place_share=0.6))),
)
