"""The vocabulary: every effect by its name, in the order in which the sensor's chain applies them."""

from gateway.twin.effects.damping import CoulombFriction, QuadraticDrag, ViscousDamping
from gateway.twin.effects.driving import Impact, SteadyWind, TrolleyAcceleration, WindGust
from gateway.twin.effects.effect import (
    BodyState,
    Effect,
    EvaluationContext,
    ModelStructure,
    Parameter,
    ParameterKind,
    RopeGeometry,
    Symbols,
)
from gateway.twin.effects.guess_context import GuessContext
from gateway.twin.effects.housing import HousingPosition, HousingSpin, Slewing
from gateway.twin.effects.limits import Clipping, ClockDrift, LowpassLag, Quantization, SampleLoss
from gateway.twin.effects.registry import EffectRegistry
from gateway.twin.effects.rope import DoublePendulum, Hoisting, LoadChange, RopeLength, RopeStretch
from gateway.twin.effects.sensor import (
    AxisOffset,
    CrossAxis,
    MountMisalignment,
    ScaleError,
    ThermalDrift,
    Vibration,
)

__all__ = [
    "EFFECTS",
    "BodyState",
    "Effect",
    "EvaluationContext",
    "GuessContext",
    "ModelStructure",
    "Parameter",
    "ParameterKind",
    "RopeGeometry",
    "Symbols",
]

EFFECTS = EffectRegistry(
    (
        ViscousDamping(),
        QuadraticDrag(),
        CoulombFriction(),
        SteadyWind(),
        WindGust(),
        Impact(),
        TrolleyAcceleration(),
        RopeLength(),
        RopeStretch(),
        DoublePendulum(),
        Hoisting(),
        LoadChange(),
        HousingPosition(),
        HousingSpin(),
        Slewing(),
        Vibration(),
        MountMisalignment(),
        CrossAxis(),
        ScaleError(),
        AxisOffset(),
        ThermalDrift(),
        LowpassLag(),
        Clipping(),
        Quantization(),
        ClockDrift(),
        SampleLoss(),
    )
)
