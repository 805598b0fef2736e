"""What is to be told apart: effects, or some components of them, and the groups that an ordinary recording does not split."""

from dataclasses import dataclass

from gateway.errors import InputError
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.parameter import Parameter
from gateway.twin.simulator.parameter_vector import ParameterSpec


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """An effect, or the components of it that matter."""

    effect: str
    parts: tuple[str, ...] = ()
    """Components, or parameters where a parameter has none; empty for all."""

    @property
    def label(self) -> str:
        """`axis_offset[x+y]`, as `suspects` reads it."""
        return f"{self.effect}[{'+'.join(self.parts)}]" if self.parts else self.effect

    def has(self, slot: ParameterSpec) -> bool:
        """Whether one of a simulator's values is of this suspect."""
        return slot.effect == self.effect and (not self.parts or part_of(slot) in self.parts)


def part_of(slot: ParameterSpec) -> str:
    """The name by which a suspect picks one of an effect's values."""
    parameter = next(p for p in EFFECTS[slot.effect].parameters if p.name == slot.parameter)
    return parameter.components[slot.component] if parameter.components else parameter.name


def is_amplitude(parameter: Parameter) -> bool:
    """Others say when an effect acts, or how it goes on."""
    return parameter.unit != "s" and parameter.typical != parameter.neutral


Group = tuple[Hypothesis, ...]
GROUPS: tuple[Group, ...] = (
    (
        Hypothesis("steady_wind"),
        Hypothesis("axis_offset", ("x", "y")),
        Hypothesis("mount_misalignment"),
        Hypothesis("cross_axis", ("xz", "yz")),
    ),
    (Hypothesis("axis_offset", ("z",)), Hypothesis("scale_error", ("z",))),
    (Hypothesis("rope_length"), Hypothesis("clock_drift"), Hypothesis("housing_position")),
    (Hypothesis("slewing"), Hypothesis("housing_spin")),
    (Hypothesis("viscous_damping"), Hypothesis("quadratic_drag"), Hypothesis("coulomb_friction")),
)
"""Lateral, axial, rate, turning, damping: measured by linearisation to be much alike on an ordinary recording."""


def suspects(text: str) -> Group:
    """Of `steady_wind,axis_offset[x+y]`. Raises `InputError` for what is no effect, or nothing that a manoeuvre could show."""
    group = tuple(_suspect(each.strip()) for each in text.split(","))
    if len(group) < 2 or len(set(group)) < len(group):
        raise InputError(f"--effects {text}: name two or more, each once, such as steady_wind,axis_offset[x+y]")
    return group


def _suspect(text: str) -> Hypothesis:
    name, bracket, inside = text.partition("[")
    effect = EFFECTS.get(name)
    if effect is None:
        raise InputError(f"--effects {text}: {name!r} is no effect; known are {', '.join(sorted(EFFECTS))}")
    if not effect.linear_at_neutral:
        raise InputError(
            f"--effects {text}: {name} shows as a line, a lag or a lattice of the readings and not by a manoeuvre; leave it out"
        )
    known = [part for p in effect.parameters if is_amplitude(p) for part in (p.components or (p.name,))]
    parts = tuple(inside.removesuffix("]").split("+")) if bracket else ()
    if (bracket and not inside.endswith("]")) or not set(parts) <= set(known):
        raise InputError(f"--effects {text}: write {name}, or {name}[...] with some of {'+'.join(known)}")
    return Hypothesis(name, parts)
