"""The vocabulary: every effect by its name, in the order in which the sensor's chain applies them.

An effect of your own needs no more than what this package exports; see docs/development/add_an_effect.md.
"""

from gateway.twin.effects.driving import (
    CoulombFriction,
    Impact,
    QuadraticDrag,
    SteadyWind,
    TrolleyAcceleration,
    ViscousDamping,
    WindGust,
)
from gateway.twin.effects.effect import Effect, ModelStructure
from gateway.twin.effects.evaluation_context import BodyState, EvaluationContext, Rigging, RopeGeometry
from gateway.twin.effects.guess_context import EventWindow, GuessContext
from gateway.twin.effects.housing import HousingPosition, HousingRocking, HousingSpin, HousingTorsion, LeverArm, Slewing
from gateway.twin.effects.parameter import Parameter, ParameterKind, Symbols, Value, Values
from gateway.twin.effects.pivot import PivotCompliance, PivotFriction
from gateway.twin.effects.pulse import Pulse, PulseEffect, duration, ramp_fraction, start
from gateway.twin.effects.registry import EffectRegistry
from gateway.twin.effects.rope import (
    DoublePendulum,
    Hoisting,
    LoadChange,
    LoadInertia,
    RopeLength,
    RopeMass,
    RopeStretch,
)
from gateway.twin.effects.sensor import (
    AxisOffset,
    Clipping,
    ClockDrift,
    CrossAxis,
    LowpassLag,
    MountMisalignment,
    Quantization,
    SampleHold,
    SampleLoss,
    ScaleError,
    ThermalDrift,
    Vibration,
)

__all__ = [
    "EFFECTS",
    "BodyState",
    "Effect",
    "EvaluationContext",
    "EventWindow",
    "GuessContext",
    "ModelStructure",
    "Parameter",
    "ParameterKind",
    "Pulse",
    "PulseEffect",
    "Rigging",
    "RopeGeometry",
    "Symbols",
    "Value",
    "Values",
    "duration",
    "ramp_fraction",
    "start",
]

EFFECTS = EffectRegistry(
    (
        ViscousDamping(),
        QuadraticDrag(),
        CoulombFriction(),
        PivotFriction(),
        SteadyWind(),
        WindGust(),
        Impact(),
        TrolleyAcceleration(),
        PivotCompliance(),
        RopeLength(),
        RopeStretch(),
        DoublePendulum(),
        Hoisting(),
        LoadChange(),
        LoadInertia(),
        RopeMass(),
        HousingPosition(),
        LeverArm(),
        HousingSpin(),
        HousingTorsion(),
        Slewing(),
        HousingRocking(),
        Vibration(),
        MountMisalignment(),
        CrossAxis(),
        ScaleError(),
        AxisOffset(),
        ThermalDrift(),
        LowpassLag(),
        Quantization(),
        Clipping(),
        SampleHold(),
        ClockDrift(),
        SampleLoss(),
    )
)
