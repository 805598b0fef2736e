"""The experiments that a plan compares."""

from gateway.twin.experiment_design.experiment import Experiment, Run

TURN_DEG_S = 3.0
"""Rotation of the housing. Basis: one turn in the two minutes of a recording, 0.05 rad/s."""
FREE_SWING = Experiment((Run(),))
"""An ordinary recording, in which the operator does nothing to separate effects."""
AT_REST_DEG = 0.3
"""Amplitude of a load that hangs still."""

CANDIDATES: tuple[Experiment, ...] = (
    FREE_SWING,
    # a swing that is longer, larger or rounder
    Experiment((Run(duration_s=300.0),)),
    Experiment((Run(amplitude_deg=10.0),)),
    Experiment((Run(amplitude_deg=10.0, duration_s=300.0),)),
    Experiment((Run(axis_ratio=0.9),)),
    Experiment((Run(amplitude_deg=10.0, axis_ratio=0.9),)),
    # rotation of the housing about the rope
    Experiment((Run(amplitude_deg=AT_REST_DEG, turn_deg_s=TURN_DEG_S),)),
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
    Experiment((Run(amplitude_deg=10.0), Run(amplitude_deg=10.0, position_share=0.2))),
    Experiment((Run(amplitude_deg=10.0), Run(amplitude_deg=10.0, position_share=0.6))),
)
