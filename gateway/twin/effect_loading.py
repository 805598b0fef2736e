"""Effects of the user, from Python files and from installed packages: checked, tried, and added to the vocabulary."""

import hashlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Sequence
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from gateway.errors import InputError
from gateway.twin.effects import EFFECTS, Effect
from gateway.twin.effects.guess_context import EventWindow, GuessContext
from gateway.twin.effects.parameter import EVENT_TIME_KINDS, ParameterKind, Values
from gateway.twin.model import TwinRig
from gateway.twin.simulator.simulator import Linearisation, Simulator
from gateway.twin.simulator.state import ROPE_RATES, ROPE_TILTS
from gateway.twin.simulator.vectorised_function import UnsupportedOperationError

Array = NDArray[np.float64]
RIG = TwinRig(length_m=12.0, position_m=5.0)
TIME_S: Array = np.arange(0.0, 8.0, 0.05)
TEMPERATURE_C: Array = RIG.reference_temperature_c + TIME_S
EVENT_START_S = 1.013
"""Time at which an event starts in the trial."""
TILTS_RAD, RATES_RAD_S = (0.1, -0.04), (0.02, 0.05)
MAX_NEUTRAL_CHANGE_G = 1e-7
"""Largest change of a sample by an effect at its neutral values. Basis: the error of the integration."""
MAX_MESSAGE_LENGTH = 200
ENTRY_POINT_GROUP = "plumbline.effects"
"""A package offers its effects as entry points of this group, each of them a subclass of `Effect`."""


def check_equations(effect: Effect, source: str) -> None:
    """Evaluate a registered effect at its typical and at its neutral values. Raises `InputError` with the fault."""
    try:
        fault = _find_fault(effect)
    except UnsupportedOperationError as error:
        raise InputError(
            f"{source}: the effect {effect.name} uses the operation {error.operation} of CasADi, which cannot be evaluated "
            "for many samples at once; use elementary functions"
        ) from error
    except Exception as error:  # whatever a user's hook raises becomes one line
        place = inspect.getsourcefile(type(effect))
        text = one_line(error, None if place is None else Path(place))
        raise InputError(f"{source}: the equations of the effect {effect.name} fail: {text}") from error
    if fault is not None:
        raise InputError(f"{source}: the effect {effect.name} {fault}")


def one_line(error: BaseException, path: Path | None = None) -> str:
    """Return an exception in one line, with the line of a file from which it came."""
    frames = [] if path is None else traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if path is not None and Path(frame.filename) == path]
    number = getattr(error, "lineno", None) or (lines[-1] if lines else None)
    message = error.msg if isinstance(error, SyntaxError) else str(error)
    text = " ".join(message.split())[:MAX_MESSAGE_LENGTH]
    return f"{type(error).__name__}: {text}" + ("" if number is None else f" (line {number})")


def _find_fault(effect: Effect) -> str | None:
    typical = {p.name: EVENT_START_S if p.kind is ParameterKind.START else p.typical for p in effect.parameters}
    simulator = Simulator(RIG, (effect.name,))
    try:
        lin = _linearise(simulator, effect, typical)
    except FloatingPointError:
        return (
            "gives numbers that are not finite at its typical values; "
            "use functions of CasADi, not of math, and check the typical values"
        )
    output_g = effect.sample_output_g(typical, lin.force_g.copy())
    kept = effect.keep_samples(typical, len(TIME_S), np.random.default_rng(0))
    if output_g.shape != lin.force_g.shape or (kept is not None and kept.shape != TIME_S.shape):
        return "returns samples of another shape than it was given"
    return _guess_fault(effect, lin.force_g) or (_neutral_fault(effect, typical) if effect.linear_at_neutral else None)


def _linearise(simulator: Simulator, effect: Effect, values: Values) -> Linearisation:
    vector = simulator.values(np.zeros(simulator.n_initial_states), {effect.name: values})
    vector[ROPE_TILTS], vector[ROPE_RATES] = TILTS_RAD, RATES_RAD_S
    lin = simulator.linearise(vector, TIME_S, TEMPERATURE_C)
    predicted_g = simulator.predict(vector, TIME_S, TEMPERATURE_C)
    if not (np.isfinite(predicted_g).all() and np.isfinite(lin.jacobian).all()):
        raise FloatingPointError("not finite")
    return lin


def _neutral_fault(effect: Effect, typical: Values) -> str | None:
    """Check that an effect which is linear at its neutral values vanishes there and has a sensitivity."""
    neutral = {p.name: typical[p.name] for p in effect.parameters if p.kind in EVENT_TIME_KINDS}
    with_effect, without = Simulator(RIG, (effect.name,)), Simulator(RIG)
    try:
        lin = _linearise(with_effect, effect, neutral)
    except FloatingPointError:
        return "gives numbers that are not finite at its neutral values; smooth its equations there"
    plain_g = _linearise(without, effect, {}).force_g
    if with_effect.n_initial_states != without.n_initial_states:
        return "changes the structure of the model, so it cannot vanish; set linear_at_neutral = False"
    change_g = float(np.abs(lin.force_g - plain_g).max())
    if change_g > MAX_NEUTRAL_CHANGE_G:
        return (
            f"changes the samples by {change_g:.2g} g at its neutral values; "
            "correct the neutral values, or set linear_at_neutral = False"
        )
    own = [i for i, spec in enumerate(with_effect.parameters) if spec.effect == effect.name]
    if not lin.jacobian[..., own].any():
        return "has no sensitivity at its neutral values; set linear_at_neutral = False"
    return None


def _guess_fault(effect: Effect, force_g: Array) -> str | None:
    window = EventWindow(2.0, 4.0, 0.0)
    noise_g = np.array(RIG.noise_g)
    residual_g = noise_g * np.random.default_rng(0).standard_normal(force_g.shape)
    context = GuessContext(
        RIG.length_m, RIG.gravity_m_s2, TIME_S, force_g, noise_g, residual_g, (window, window, window), window
    )
    known = {p.name for p in effect.parameters}
    for guess in effect.initial_guesses(context):
        if not set(guess) <= known:
            return f"guesses {sorted(set(guess) - known)[0]}, which is no parameter"
    return None


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
    bases = {base for each in own for base in each.__mro__[1:]}
    found = [each for each in dict.fromkeys(own) if hasattr(each, "name") or each not in bases]
    if not found:
        raise InputError(f"{source}: defines no effect; write a subclass of gateway.twin.effects.Effect")
    return found


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
