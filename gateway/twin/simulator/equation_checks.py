"""A trial of the equations of an effect on a nominal rig, before an effect of the user takes part in simulations and fits."""

import inspect
import traceback
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.errors import InputError
from gateway.twin.effects.effect import Effect
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
