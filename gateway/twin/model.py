"""A model is data: what is believed of the rig, and the effects that act, with their parameters."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from devices.pendulum.gravity import STANDARD_GRAVITY_M_S2
from devices.pendulum.small_swing import small_swing_period_s, small_swing_rate_1_s
from gateway.errors import InputError
from gateway.measurement.rig import Rig
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Parameter, Value

EffectValues = Mapping[str, Mapping[str, Value]]


@dataclass(frozen=True, slots=True)
class TwinRig:
    """What is believed before looking at the data."""

    length_m: float
    position_m: float
    gravity_m_s2: float = STANDARD_GRAVITY_M_S2
    noise_g: tuple[float, float, float] = (1e-3, 1e-3, 1e-3)
    sample_rate_hz: float | None = None
    full_scale_g: float | None = None
    reference_temperature_c: float = 22.0
    """Where the sensor's offsets are known; `thermal_drift` counts from here."""

    @property
    def small_swing_period_s(self) -> float:
        """Period of a small swing on the believed rope."""
        return small_swing_period_s(self.length_m, self.gravity_m_s2)

    @property
    def small_swing_rate_1_s(self) -> float:
        """Angular frequency of a small swing on the believed rope."""
        return small_swing_rate_1_s(self.length_m, self.gravity_m_s2)


@dataclass(frozen=True, slots=True)
class Model:
    """Base and effects."""

    rig: TwinRig
    effects: EffectValues


def model_of(rig: Rig, place: str = "rig") -> Model:
    """Of a `rig.toml`; raises `InputError` with the place and the mend."""
    position_m = rig.housing.position_m
    if position_m is None:
        position_m = rig.rope.length_m - (rig.housing.above_load_m or 0.0)
    noise = rig.sensor.noise_g
    noise_g = tuple(noise) if isinstance(noise, list) else (noise or 1e-3,) * 3
    believed = TwinRig(
        rig.rope.length_m,
        position_m,
        rig.site.gravity_m_s2,
        (noise_g[0], noise_g[1], noise_g[2]),
        rig.sensor.sample_rate_hz,
        rig.sensor.full_scale_g,
    )
    return Model(believed, checked(rig.model, place))


def checked(tables: Mapping[str, Mapping[str, Any]], place: str) -> EffectValues:
    """Effects with all their parameters in bounds; raises `InputError`."""
    return {name: _checked_effect(name, values, f"{place}: [model.{name}]") for name, values in tables.items()}


def _checked_effect(name: str, values: Mapping[str, Any], place: str) -> dict[str, Value]:
    effect = EFFECTS.get(name)
    if effect is None:
        raise InputError(f"{place} is no effect; known are {', '.join(sorted(EFFECTS))}")
    known = {parameter.name: parameter for parameter in effect.parameters}
    for given in values:
        if given not in known:
            raise InputError(f"{place} has no {given}; its parameters are {', '.join(known)}")
    for needed, parameter in known.items():
        if needed not in values and not parameter.refitted:
            raise InputError(f"{place} wants {needed}, in {parameter.unit}: {parameter.meaning}")
    return {name: _checked_value(values.get(name, p.typical), p, f"{place} {name}") for name, p in known.items()}


def _checked_value(value: Any, parameter: Parameter, place: str) -> Value:
    given = value if isinstance(value, (list, tuple)) else [value]
    if len(given) != parameter.size:
        wanted = f"[{', '.join(parameter.components)}]" if parameter.components else "one number"
        raise InputError(f"{place} = {value} should be {wanted}")
    for each in given:
        number = isinstance(each, (int, float)) and not isinstance(each, bool) and math.isfinite(each)
        if not number or not parameter.lower <= each <= parameter.upper:
            raise InputError(
                f"{place} = {value} should be from {parameter.lower:g} to {parameter.upper:g} {parameter.unit}"
            )
    numbers = tuple(float(each) for each in given)
    return numbers if parameter.components else numbers[0]


def as_tables(effects: EffectValues) -> dict[str, dict[str, Any]]:
    """`[model.<effect>]` tables of `rig.toml`."""
    return {
        name: {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}
        for name, values in effects.items()
    }


def parse_effect_assignments(effects: EffectValues, wanted: Sequence[str]) -> EffectValues:
    """More effects, each as `name` or `name:parameter=value:parameter=value,value`; what is not given is typical.

    Raises `InputError`.
    """
    tables: dict[str, Mapping[str, Any]] = dict(effects)
    for text in wanted:
        name, *assignments = text.split(":")
        given = dict(_assignment(assignment, text) for assignment in assignments)
        effect = EFFECTS.get(name)
        typical = {} if effect is None else {p.name: p.typical for p in effect.parameters}
        tables[name] = {**typical, **given}
    return checked(tables, "--effect")


def _assignment(assignment: str, text: str) -> tuple[str, Any]:
    name, _, value = assignment.partition("=")
    try:
        numbers = [float(number) for number in value.split(",")]
    except ValueError as error:
        raise InputError(f"--effect {text}: {assignment!r} should be PARAMETER=VALUE, or VALUE,VALUE") from error
    return name, numbers if len(numbers) > 1 else numbers[0]
