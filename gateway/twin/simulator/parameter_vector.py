"""The parameter vector of a simulator: the meaning of each of its values."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any

from gateway.twin.effects.effect import Effect, ModelStructure
from gateway.twin.effects.parameter import EVENT_TIME_KINDS, Parameter, ParameterKind

TILTS = (
    ("tilt_x_rad", "rad", 3.1),
    ("tilt_y_rad", "rad", 1.5),
    ("rate_x_rad_s", "rad/s", 50.0),
    ("rate_y_rad_s", "rad/s", 50.0),
)
"""Name, unit and limit of each coordinate. Basis: the tilt toward y is an arc sine, so it must stay below 90 degrees."""
HEADING = ("heading_rad", "rad", 7.0)
"""The same for the heading of the housing."""
ADDED: Mapping[ModelStructure, tuple[tuple[str, str, float], ...]] = {
    ModelStructure.RIGGING: tuple((f"rigging_{name}", unit, limit) for name, unit, limit in TILTS),
    ModelStructure.ELASTIC: (("stretch_m", "m", 0.5), ("stretch_rate_m_s", "m/s", 5.0)),
    ModelStructure.PRESLIDING: (("contact_x_rad", "rad", 0.2), ("contact_y_rad", "rad", 0.2)),
    ModelStructure.HEAVY_ROPE: (
        ("bow_x_m", "m", 5.0),
        ("bow_y_m", "m", 5.0),
        ("bow_rate_x_m_s", "m/s", 50.0),
        ("bow_rate_y_m_s", "m/s", 50.0),
    ),
}
"""The same for what a structure adds. Basis: a choice; far beyond what a fit should reach."""
INITIAL_STATE_SCALE = 1e-3
"""A change of an initial state that an operator would call small. Basis: a choice; a milliradian or millimetre."""


@dataclass(frozen=True, slots=True)
class ParameterSpec(Parameter):
    """One number of the parameter vector: a component of a parameter, with its bounds on this rope."""

    effect: str = ""
    """Name of the effect; empty for an initial state."""
    component: int = 0

    @property
    def part(self) -> str:
        """Name of the component, or of the parameter where it has none."""
        return self.components[self.component] if self.components else self.name

    @property
    def label(self) -> str:
        """`steady_wind.accel_m_s2[x]`, `initial.tilt_x_rad`."""
        return f"{self.effect or 'initial'}.{self.name}" + (f"[{self.part}]" if self.components else "")

    @property
    def is_event_time(self) -> bool:
        """Whether the number determines when an event acts, and not how strongly."""
        return self.kind in EVENT_TIME_KINDS

    def convert(self, number: float) -> float:
        """Return the number of the vector for one of the parameter, or the other way round: a cutoff stands by its inverse."""
        return 1 / number if self.kind is ParameterKind.CUTOFF else number


@lru_cache
def initial_state_specs(structure: ModelStructure) -> tuple[ParameterSpec, ...]:
    """Return the coordinates of the initial state."""
    kinds = (*TILTS, HEADING, *ADDED.get(structure, ()))
    return tuple(
        ParameterSpec(name, unit, "", -limit, limit, 0.0, INITIAL_STATE_SCALE, 0.0, refitted=True)
        for name, unit, limit in kinds
    )


@lru_cache
def effect_parameter_specs(effect: Effect, length_m: float) -> tuple[ParameterSpec, ...]:
    """Return the numbers of an effect on a rope of this nominal length."""
    bounded = [_in_vector(p, effect.upper_bound(p, length_m)) for p in effect.parameters]
    return tuple(
        ParameterSpec(**_fields_of(p), effect=effect.name, component=i) for p in bounded for i in range(p.size)
    )


def _in_vector(p: Parameter, upper: float) -> Parameter:
    if p.kind is ParameterKind.CUTOFF:
        return replace(p, lower=1 / upper, upper=1 / p.lower, neutral=1 / min(p.neutral, upper))
    return replace(p, upper=upper, neutral=min(p.neutral, upper))


def _fields_of(parameter: Parameter) -> dict[str, Any]:
    return {each.name: getattr(parameter, each.name) for each in fields(Parameter)}
