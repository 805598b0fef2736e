"""The vocabulary: every effect by its name, in the order in which the sensor's chain applies them."""

from gateway.twin.effects.damping import CoulombFriction, QuadraticDrag, ViscousDamping
from gateway.twin.effects.driving import Impact, SteadyWind, TrolleyAcceleration, WindGust
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.housing import HousingPosition, HousingSpin, Slewing
from gateway.twin.effects.limits import Clipping, ClockDrift, LowpassLag, Quantization, SampleLoss
from gateway.twin.effects.rope import DoublePendulum, Hoisting, LoadChange, RopeLength, RopeStretch
from gateway.twin.effects.sensor import (
    AxisOffset,
    CrossAxis,
    MountMisalignment,
    ScaleError,
    ThermalDrift,
    Vibration,
)

EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        ViscousDamping(),
        QuadraticDrag(),
        CoulombFriction(),
        SteadyWind(),
        WindGust(),
        Impact(),
        TrolleyAcceleration(),
        RopeLength(),
        DoublePendulum(),
        Hoisting(),
        LoadChange(),
        RopeStretch(),
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
}
