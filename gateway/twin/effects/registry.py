"""The registry of effects: the built-in vocabulary, and effects that users add."""

from collections.abc import Iterable, Iterator, Mapping

from gateway.errors import InputError
from gateway.twin.effects.effect import Effect
from gateway.twin.effects.effect_checks import find_fault

BUILT_IN = "the vocabulary"
"""Source of the effects that Plumbline brings."""


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
