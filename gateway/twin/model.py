"""A model as data: the nominal rig, and the effects that act, with their parameters."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2, small_swing_period_s, small_swing_rate_1_s
from gateway.errors import InputError
from gateway.pipeline.rig import Rig
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Parameter, Value
from gateway.twin.effects.terms import register_terms

EffectValues = Mapping[str, Mapping[str, Value]]
"""Effects by name, each with its parameters by name."""
DEFAULT_NOISE_G = 1e-3
"""Noise of each axis of a rig that states none."""


@dataclass(frozen=True, slots=True)
class TwinRig:
    """The rig as it is described before any data: nominal values."""

    length_m: float
    position_m: float
    gravity_m_s2: float = STANDARD_GRAVITY_M_S2
    noise_g: tuple[float, float, float] = (DEFAULT_NOISE_G, DEFAULT_NOISE_G, DEFAULT_NOISE_G)
    sample_rate_hz: float | None = None
    full_scale_g: float | None = None
    reference_temperature_c: float = 22.0
    """The temperature at which the sensor's offsets are known; thermal drift counts from here."""
    offset_limit_g: float | None = None
    """Largest zero-g offset that the sensor can have; None where the rig does not state it."""
    scale_limit: float | None = None
    """Largest scale-factor error that it can have."""
    is_placed_from_load: bool = False
    """Whether the housing's place was measured from the load; `position_m` then follows from the nominal length."""

    @property
    def small_swing_period_s(self) -> float:
        """Period of a small swing on the nominal rope."""
        return small_swing_period_s(self.length_m, self.gravity_m_s2)

    @property
    def small_swing_rate_1_s(self) -> float:
        """Angular frequency of a small swing on the nominal rope."""
        return small_swing_rate_1_s(self.length_m, self.gravity_m_s2)


@dataclass(frozen=True, slots=True)
class Model:
    """A rig and the effects that act on it."""

    rig: TwinRig
    effects: EffectValues


def model_of(rig: Rig, source: str = "rig") -> Model:
    """Return the model of a `rig.toml`. Raises `InputError` with the place and the correction."""
    length_m, position_m = rig.rope.length_m, rig.housing.position_m
    # A housing that is stated at the very end of the rope is at its end, however long the rope is.
    is_placed_from_load = position_m is None or position_m == length_m
    if position_m is None:
        position_m = length_m - (rig.housing.above_load_m or 0.0)
    noise = rig.sensor.noise_g
    noise_g = tuple(noise) if isinstance(noise, list) else (noise or DEFAULT_NOISE_G,) * 3
    nominal = TwinRig(
        length_m,
        position_m,
        rig.site.gravity_m_s2,
        (noise_g[0], noise_g[1], noise_g[2]),
        rig.sensor.sample_rate_hz,
        rig.sensor.full_scale_g,
        offset_limit_g=_limit(rig.sensor.offset_u_mg, 1e-3),
        scale_limit=_limit(rig.sensor.scale_u, 1.0),
        is_placed_from_load=is_placed_from_load,
    )
    return Model(nominal, validate_effects(rig.model, source))


def _limit(standard_uncertainty: float | list[float] | None, unit: float) -> float | None:
    """Return the half-width of the rectangular distribution with this standard uncertainty (GUM 4.3.7), of the largest axis."""
    return None if standard_uncertainty is None else math.sqrt(3) * unit * float(np.max(standard_uncertainty))


def validate_effects(tables: Mapping[str, Mapping[str, Any]], source: str) -> EffectValues:
    """Return effects with all their parameters. Raises `InputError` for unknown names, missing values and broken bounds.

    The terms of a law that `reconcile --write-model` has written are effects from here on.
    """
    register_terms(tables)
    return {name: _validate_effect(name, values, f"{source}: [model.{name}]") for name, values in tables.items()}


def _validate_effect(name: str, values: Mapping[str, Any], place: str) -> dict[str, Value]:
    effect = EFFECTS.get(name)
    if effect is None:
        raise InputError(
            f"{place} is no effect; known are {', '.join(sorted(EFFECTS))}; "
            "an effect of your own needs --effects-from FILE.py"
        )
    known = {parameter.name: parameter for parameter in effect.parameters}
    for given in values:
        if given not in known:
            raise InputError(f"{place} has no {given}; its parameters are {', '.join(known)}")
    for needed, parameter in known.items():
        if needed not in values and not parameter.refitted:
            raise InputError(f"{place} needs {needed}, in {parameter.unit}: {parameter.meaning}")
    return {name: _validate_value(values.get(name, p.typical), p, f"{place} {name}") for name, p in known.items()}


def _validate_value(value: Any, parameter: Parameter, place: str) -> Value:
    given = value if isinstance(value, (list, tuple)) else [value]
    if len(given) != parameter.size:
        expected = f"[{', '.join(parameter.components)}]" if parameter.components else "one number"
        raise InputError(f"{place} = {value} should be {expected}")
    for each in given:
        is_number = isinstance(each, (int, float)) and not isinstance(each, bool) and math.isfinite(each)
        if not is_number or not parameter.lower <= each <= parameter.upper:
            unit = "" if parameter.unit == "1" else f" {parameter.unit}"
            raise InputError(f"{place} = {value} should be from {parameter.lower:g} to {parameter.upper:g}{unit}")
    numbers = tuple(float(each) for each in given)
    return numbers if parameter.components else numbers[0]


def shift_start(effects: EffectValues, by_s: float) -> EffectValues:
    """Return effects for a recording whose first sample is later by this time."""
    return {name: EFFECTS[name].shift_start(values, by_s) for name, values in effects.items()}


def as_tables(effects: EffectValues) -> dict[str, dict[str, Any]]:
    """Return effects as the `[model.<effect>]` tables of a `rig.toml`."""
    return {
        name: {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}
        for name, values in effects.items()
    }


def parse_effect_assignments(effects: EffectValues, assignments: Sequence[str]) -> EffectValues:
    """Return effects with those of the command line added; a parameter that is not given takes its typical value.

    An assignment is `name` or `name:parameter=value:parameter=value,value`. Raises `InputError`.
    """
    tables: dict[str, Mapping[str, Any]] = dict(effects)
    for text in assignments:
        name, *pairs = text.split(":")
        given = dict(_parse_pair(pair, text) for pair in pairs)
        effect = EFFECTS.get(name)
        typical = {} if effect is None else {p.name: p.typical for p in effect.parameters}
        tables[name] = {**typical, **given}
    return validate_effects(tables, "--effect")


def _parse_pair(pair: str, text: str) -> tuple[str, Any]:
    name, _, value = pair.partition("=")
    try:
        numbers = [float(number) for number in value.split(",")]
    except ValueError as error:
        raise InputError(f"--effect {text}: {pair!r} should be PARAMETER=VALUE, or VALUE,VALUE") from error
    return name, numbers if len(numbers) > 1 else numbers[0]
