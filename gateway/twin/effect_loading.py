"""Effects of the user, from Python files and from installed packages: checked, tried, and added to the vocabulary."""

import hashlib
import importlib.util
import inspect
import sys
from collections.abc import Sequence
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType

from gateway.errors import InputError
from gateway.twin.effects import EFFECTS, Effect
from gateway.twin.simulator.equation_checks import check_equations, one_line

ENTRY_POINT_GROUP = "plumbline.effects"
"""A package offers its effects as entry points of this group, each of them a subclass of `Effect`."""


def load_installed_effects() -> tuple[str, ...]:
    """Add the effects of installed packages, once, and return their names. Raises `InputError`."""
    names: tuple[str, ...] = ()
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        source = f"entry point {entry.name} = {entry.value} of {ENTRY_POINT_GROUP}"
        if not EFFECTS.names_from(source):
            try:
                found = entry.load()
            except Exception as error:  # whatever a package raises becomes one line
                raise InputError(f"{source}: {one_line(error)}; mend or uninstall that package") from error
            _add([found], source)
        names += EFFECTS.names_from(source)
    return names


def load_effect_file(path: Path) -> tuple[str, ...]:
    """Add the effects that a Python file defines, once, and return their names. Raises `InputError`."""
    source = f"--effects-from {path.resolve()}"
    if not EFFECTS.names_from(source):
        _add(_effect_classes(_import_file(path, source), source), source)
    return EFFECTS.names_from(source)


def _add(classes: Sequence[object], source: str) -> None:
    """Register effects, and remove them again if the equations of one of them fail."""
    effects = [_instance(each, source) for each in classes]
    EFFECTS.register(effects, source)
    try:
        for effect in effects:
            check_equations(effect, source)
    except InputError:
        EFFECTS.unregister(source)
        raise


def _instance(found: object, source: str) -> Effect:
    if not (inspect.isclass(found) and issubclass(found, Effect)):
        raise InputError(f"{source}: {found!r} is no subclass of gateway.twin.effects.Effect")
    try:
        return found()
    except Exception as error:  # whatever a user's class raises becomes one line
        raise InputError(f"{source}: {found.__name__}() fails: {one_line(error)}") from error


def _effect_classes(module: ModuleType, source: str) -> list[type[Effect]]:
    """Return the effects that a module defines, in their order; a class without a name may be a base of others."""
    own = [
        each
        for each in vars(module).values()
        if inspect.isclass(each) and issubclass(each, Effect) and each.__module__ == module.__name__
    ]
    found = [each for each in dict.fromkeys(own) if hasattr(each, "name") or not _is_base(each, own)]
    if not found:
        raise InputError(f"{source}: defines no effect; write a subclass of gateway.twin.effects.Effect")
    return found


def _is_base(found: type[Effect], classes: Sequence[type[Effect]]) -> bool:
    return any(issubclass(each, found) for each in classes if each is not found)


def _import_file(path: Path, source: str) -> ModuleType:
    if not path.is_file():
        raise InputError(f"{source}: there is no such file")
    digest = hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:8]
    spec = importlib.util.spec_from_file_location(f"user_effects_{digest}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"{source}: is no Python file; its name should end in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # whatever a user's file raises becomes one line
        del sys.modules[spec.name]
        raise InputError(f"{source}: {one_line(error, path)}") from error
    return module
