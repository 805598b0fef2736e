"""The hypotheses that an experiment separates: effects, or some components of them."""

from dataclasses import dataclass

from gateway.errors import InputError
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.parameter import Parameter
from gateway.twin.simulator.parameter_vector import ParameterSpec


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """An effect, or some components of it."""

    effect: str
    parts: tuple[str, ...] = ()
    """Names of components, or of parameters without components; empty for all."""

    @property
    def label(self) -> str:
        """`axis_offset[x+y]`, as `parse_hypotheses` reads it."""
        return f"{self.effect}[{'+'.join(self.parts)}]" if self.parts else self.effect

    def has(self, spec: ParameterSpec) -> bool:
        """Return whether the hypothesis contains a number of a simulator's parameter vector."""
        return spec.effect == self.effect and (not self.parts or _part_of(spec) in self.parts)


Group = tuple[Hypothesis, ...]
"""Hypotheses that are to be separated from each other."""


def amplitude_parts(effect: Effect) -> tuple[str, ...]:
    """Return the parts by which a hypothesis may be limited: those that say how strong the effect is."""
    return tuple(part for p in effect.parameters if p.is_amplitude for part in (p.components or (p.name,)))


def parameter_of(spec: ParameterSpec) -> Parameter:
    """Return the parameter of a number of the parameter vector."""
    return next(p for p in EFFECTS[spec.effect].parameters if p.name == spec.parameter)


def parse_hypotheses(text: str) -> Group:
    """Return the hypotheses of `steady_wind,axis_offset[x+y]`. Raises `InputError` for what no experiment can show."""
    group = tuple(_parse_hypothesis(each.strip()) for each in text.split(","))
    if len(group) < 2 or len(set(group)) < len(group):
        raise InputError(f"--effects {text}: name two or more, each once, such as steady_wind,axis_offset[x+y]")
    return group


def _parse_hypothesis(text: str) -> Hypothesis:
    name, bracket, inside = text.partition("[")
    effect = EFFECTS.get(name)
    if effect is None:
        raise InputError(f"--effects {text}: {name!r} is no effect; known are {', '.join(sorted(EFFECTS))}")
    if not effect.linear_at_neutral:
        raise InputError(
            f"--effects {text}: {name} shows in the samples or in their spectrum and not by an experiment; leave it out"
        )
    known = amplitude_parts(effect)
    parts = tuple(inside.removesuffix("]").split("+")) if bracket else ()
    if (bracket and not inside.endswith("]")) or not set(parts) <= set(known):
        raise InputError(f"--effects {text}: write {name}, or {name}[...] with some of {'+'.join(known)}")
    return Hypothesis(name, parts)


def _part_of(spec: ParameterSpec) -> str:
    parameter = parameter_of(spec)
    return parameter.components[spec.component] if parameter.components else parameter.name
