"""The registry of effects, the built-in ones and those that users add, and the checks of what an effect declares."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from gateway.errors import InputError
from gateway.twin.effects.effect import Effect, ModelStructure
from gateway.twin.effects.parameter import EVENT_TIME_KINDS, Parameter, ParameterKind

BUILT_IN = "the vocabulary"
"""Source of the effects that Plumbline brings."""
TEXTS = ("name", "equation", "explains", "reference", "enters")


class EffectRegistry(Mapping[str, Effect]):
    """Effects by name, in the order in which the sensor's chain applies them."""

    def __init__(self, effects: Iterable[Effect] = ()) -> None:
        self._effects: dict[str, Effect] = {}
        self._source_of: dict[str, str] = {}
        self.register(effects)

    def __getitem__(self, name: str) -> Effect:
        return self._effects[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    def register(self, effects: Iterable[Effect], source: str = BUILT_IN) -> None:
        """Add effects after the registered ones, all or none. Raises `InputError` for an invalid effect or a name in use."""
        added: dict[str, Effect] = {}
        for effect in effects:
            fault = find_fault(effect)
            if fault is not None:
                raise InputError(f"{source}: {type(effect).__name__} {fault}")
            if effect.name in self._effects or effect.name in added:
                owner = self._source_of.get(effect.name, source)
                raise InputError(f"{source}: the name {effect.name} is in use by {owner}; choose another name")
            added[effect.name] = effect
        self._effects |= added
        self._source_of |= dict.fromkeys(added, source)

    @property
    def sources(self) -> frozenset[str]:
        """Sources of the registered effects."""
        return frozenset(self._source_of.values())

    def names_from(self, source: str) -> tuple[str, ...]:
        """Return the names of the effects from a source."""
        return tuple(name for name, each in self._source_of.items() if each == source)

    def unregister(self, source: str) -> None:
        """Remove the effects from a source."""
        for name in self.names_from(source):
            del self._effects[name], self._source_of[name]

    def choose(self, **traits: object) -> tuple[str, ...]:
        """Return the names of the effects that have all these traits, in their order."""
        return tuple(
            name
            for name, effect in self._effects.items()
            if all(getattr(effect, trait) == value for trait, value in traits.items())
        )


def find_fault(effect: Effect) -> str | None:
    """Return what is wrong with the declarations of an effect, with the correction; None if nothing is."""
    return next(_faults(effect), None)


def _faults(effect: Effect) -> Iterator[str]:
    for attribute in TEXTS:
        text = getattr(effect, attribute, None)
        if not isinstance(text, str) or not text:
            yield f"has no {attribute}; set it to a text, as a class attribute"
    if not (effect.name.isidentifier() and effect.name.islower()):
        yield f"is named {effect.name!r}; use lower-case letters, digits and underscores"
    parameters = getattr(effect, "parameters", ())
    if not isinstance(parameters, tuple) or not parameters or not all(isinstance(p, Parameter) for p in parameters):
        yield "has no parameters; set them to a tuple of Parameter"
    for name, count in Counter(p.name for p in parameters).items():
        if count > 1:
            yield f"has {count} parameters {name!r}; rename one"
    for parameter in parameters:
        yield from (f"has a wrong parameter {parameter.name!r}: {fault}" for fault in _parameter_faults(parameter))
    yield from _trait_faults(effect)


def _parameter_faults(p: Parameter) -> Iterator[str]:
    if not p.name.isidentifier():
        yield "the name should have letters, digits and underscores only"
    if not p.lower < p.upper:
        yield f"lower = {p.lower:g} should be below upper = {p.upper:g}"
    if not p.lower <= p.neutral <= p.upper:
        yield f"neutral = {p.neutral:g} should be from {p.lower:g} to {p.upper:g}"
    if not (p.scale > 0 and math.isfinite(p.scale)):
        yield f"scale = {p.scale:g} should be above 0"
    if not p.step_limit > 0:
        yield f"step_limit = {p.step_limit:g} should be above 0"
    typical = np.atleast_1d(p.typical)
    if typical.shape != (p.size,) or isinstance(p.typical, tuple) != bool(p.components):
        yield f"typical = {p.typical} should be {f'a tuple of {p.size} numbers' if p.components else 'one number'}"
    elif not ((typical >= p.lower) & (typical <= p.upper)).all():
        yield f"typical = {p.typical} should be from {p.lower:g} to {p.upper:g}"


def _trait_faults(effect: Effect) -> Iterator[str]:
    starts = effect.names_of(ParameterKind.START)
    if effect.transient and len(starts) != 1:
        yield "is transient and has no start; give it one parameter of the kind START, for instance start(30.0)"
    timed = [p.name for p in effect.parameters if p.kind in EVENT_TIME_KINDS]
    if timed and not effect.transient:
        yield f"has {timed[0]} and is not transient; set transient = True"
    if effect.instantaneous and not effect.transient:
        yield "is instantaneous and not transient; set transient = True"
    unknown = sorted(set(effect.default_guess) - {p.name for p in effect.parameters})
    if unknown:
        yield f"has a default_guess of {unknown[0]}, which is no parameter"
    rigging = type(effect).rigging is not Effect.rigging
    if rigging != (effect.structure is ModelStructure.RIGGING):
        yield "should have both the structure RIGGING and the hook rigging, or neither"
