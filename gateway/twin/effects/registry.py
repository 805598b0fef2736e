"""The registry of effects: the built-in vocabulary, and effects that users add from a file or an installed package."""

import importlib.util
import inspect
import sys
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType

from gateway.errors import InputError
from gateway.twin.effects.effect import Effect, Parameter

ENTRY_POINT_GROUP = "plumbline.effects"
"""A package offers effects of its own as entry points of this group, each of them a subclass of `Effect`."""


class EffectRegistry(Mapping[str, Effect]):
    """Effects by name, in the order in which the sensor's chain applies them."""

    def __init__(self, effects: Iterable[Effect] = ()) -> None:
        self._effects: dict[str, Effect] = {}
        for effect in effects:
            self.register(effect)

    def __getitem__(self, name: str) -> Effect:
        return self._effects[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    def register(self, effect: Effect, place: str = "effects") -> None:
        """Add an effect after those that are there. Raises `InputError` for one that is incomplete or named as another."""
        fault = _find_fault(effect)
        if fault is not None:
            raise InputError(f"{place}: {type(effect).__name__} {fault}")
        if effect.name in self._effects:
            raise InputError(f"{place}: there is an effect {effect.name!r} already; choose another name")
        self._effects[effect.name] = effect

    def load_file(self, path: Path) -> tuple[str, ...]:
        """Register all subclasses of `Effect` that a Python file defines and return their names. Raises `InputError`."""
        module = _import_file(path)
        found = [
            each
            for _, each in inspect.getmembers(module, inspect.isclass)
            if issubclass(each, Effect) and each.__module__ == module.__name__ and hasattr(each, "name")
        ]
        if not found:
            raise InputError(
                f"--effects-from {path}: defines no effect; write a subclass of gateway.twin.effects.Effect"
            )
        for effect in sorted(found, key=lambda each: inspect.getsourcelines(each)[1]):
            self.register(effect(), f"--effects-from {path}")
        return tuple(each.name for each in found)

    def load_entry_points(self) -> None:
        """Register the effects that installed packages offer. Raises `InputError`."""
        for entry in entry_points(group=ENTRY_POINT_GROUP):
            self.register(entry.load()(), f"entry point {entry.name} of {ENTRY_POINT_GROUP}")

    def choose(self, **traits: object) -> tuple[str, ...]:
        """Names of the effects that have all these traits, in their order."""
        return tuple(
            name
            for name, effect in self._effects.items()
            if all(getattr(effect, trait) == value for trait, value in traits.items())
        )


def _find_fault(effect: Effect) -> str | None:
    for wanted in ("name", "equation", "explains", "reference", "enters", "parameters"):
        if not hasattr(effect, wanted):
            return f"has no {wanted}; set it as a class attribute"
    if not effect.name.isidentifier():
        return f"is named {effect.name!r}; use lower-case letters, digits and underscores"
    if not effect.parameters or not all(isinstance(each, Parameter) for each in effect.parameters):
        return "has no parameters; give a tuple of Parameter"
    return None


def _import_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise InputError(f"--effects-from {path}: there is no such file")
    spec = importlib.util.spec_from_file_location(f"user_effects_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"--effects-from {path}: is not a Python file; its name should end in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever a user's file raises is one line, not a traceback
        raise InputError(f"--effects-from {path}: {type(error).__name__}: {error}") from error
    return module
