"""A recording that was never measured: the model's prediction, through the simulated part."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.double_pendulum import modes
from devices.simulated.accelerometer import Accelerometer, no_errors
from gateway.errors import InputError
from gateway.twin.effects import EFFECTS
from gateway.twin.effects.limits import Quantization
from gateway.twin.effects.rope import DoublePendulum, RopeStretch
from gateway.twin.model import Model
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import RIGGING_RATES, RIGGING_TILTS, ROPE_RATES, ROPE_TILTS, STRETCH

Array = NDArray[np.float64]
FIRST_SWING_RAD = math.radians(5.0)
"""Where a load is let go that nobody gave another start."""
FIRST_ROUNDNESS = 0.2
FIRST_STRETCH_M = 5e-3
RIGGING_AHEAD = 1.5
"""By how much the rigging leans more than it does in the slow mode, so that both modes are there."""
WARMS_UP_BY_C, WARM_UP_S = 20.0, 30.0
DEFAULT_RATE_HZ = 50.0
DEFAULT_RANGE_G = 2.0


@dataclass(frozen=True, slots=True)
class Simulated:
    """What the simulated part handed on."""

    time_s: Array
    """As stamped, shape (n,)."""
    force_g: Array
    """Shape (n, 3)."""
    temperature_c: Array
    """Shape (n,)."""
    full_scale_g: float
    noise_g: float
    rate_hz: float


def simulate(model: Model, duration_s: float, seed: int, initial: dict[str, float]) -> Simulated:
    """A recording of a model; `initial` gives coordinates of the start by name, without it the load is let go from 5 degrees.

    The same seed gives the same recording. Raises `InputError` where the part or the model cannot do it.
    """
    random = np.random.default_rng(seed)
    rate_hz = model.rig.sample_rate_hz or DEFAULT_RATE_HZ
    time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    if len(time_s) < 2:
        raise InputError(f"{duration_s:g} s at {rate_hz:g} Hz holds no two samples; choose a longer duration")
    time_s = _drop_samples(model, time_s, random)
    temperature_c = model.rig.reference_temperature_c + WARMS_UP_BY_C * -np.expm1(-time_s / WARM_UP_S)
    force_g = _prediction(model, initial, random, time_s, temperature_c)
    part = Accelerometer(no_errors(), rate_hz, model.rig.full_scale_g or DEFAULT_RANGE_G)
    noisy_g = force_g + _excess_noise_g(model, part) * random.standard_normal(force_g.shape)
    handed_g = part.counts(noisy_g, temperature_c, random) / part.units_per_g
    stamped_s = np.arange(len(time_s)) / rate_hz  # stamps count samples: what was lost leaves no trace in them
    noise_g = float(np.sqrt(np.mean(np.square(model.rig.noise_g))))
    return Simulated(stamped_s, _hand_on(model, handed_g), temperature_c, part.full_scale_g, noise_g, rate_hz)


def _prediction(
    model: Model, initial: dict[str, float], random: np.random.Generator, time_s: Array, temperature_c: Array
) -> Array:
    predicted = {name: values for name, values in model.effects.items() if not EFFECTS[name].acts_on_noisy_samples}
    try:
        simulator = Simulator(model.rig, tuple(predicted))
    except ValueError as error:
        raise InputError(str(error)) from error
    values = simulator.values([], predicted)
    _refuse_outside(simulator, values)
    start = _start(simulator, model, random)
    known = [slot.parameter for slot in simulator.initial]
    for name, value in initial.items():
        if name not in known:
            raise InputError(f"the start has no {name}; its coordinates are {', '.join(known)}")
        start[known.index(name)] = value
    values[: simulator.n_initial_states] = start
    _refuse_outside(simulator, values)
    return simulator.predict(values, time_s, temperature_c)


def _refuse_outside(simulator: Simulator, values: Array) -> None:
    for slot, value in zip(simulator.parameters, values, strict=True):
        if not slot.lower <= value <= slot.upper:
            raise InputError(
                f"{slot.label} = {value:g} should be from {slot.lower:g} to {slot.upper:g} {slot.unit} here"
            )


def _start(simulator: Simulator, model: Model, random: np.random.Generator) -> Array:
    """Let go from a lean in some direction, with a little speed across; the rigging leans further, the rope is stretched."""
    rig = model.rig
    azimuth_rad = random.uniform(-np.pi, np.pi)
    along = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    tilt = FIRST_SWING_RAD * along
    rate = FIRST_ROUNDNESS * rig.small_swing_rate_1_s * FIRST_SWING_RAD * along[::-1] * [-1, 1]
    start = np.zeros(simulator.n_initial_states)
    start[ROPE_TILTS], start[ROPE_RATES] = tilt, rate
    if DoublePendulum.name in model.effects:
        hung = model.effects[DoublePendulum.name]
        lower_m, ratio = hung["rigging_length_m"], hung["hook_mass_ratio"]
        slow, _ = modes(rig.length_m - np.asarray(lower_m), lower_m, ratio, rig.gravity_m_s2)
        start[RIGGING_TILTS] = RIGGING_AHEAD * slow.rigging_tilt * tilt
        start[RIGGING_RATES] = slow.rigging_tilt * rate
    if RopeStretch.name in model.effects:
        start[STRETCH] = FIRST_STRETCH_M
    return start


def _drop_samples(model: Model, time_s: Array, random: np.random.Generator) -> Array:
    for name, values in model.effects.items():
        kept = EFFECTS[name].keep_samples(values, len(time_s), random)
        time_s = time_s if kept is None else time_s[kept]
    return time_s


def _excess_noise_g(model: Model, part: Accelerometer) -> Array:
    """What the believed noise has more than the part's own, shape (3,)."""
    squares = np.square(model.rig.noise_g) - part.noise_g**2
    if (squares < 0).any():
        raise InputError(
            f"sensor.noise_g {min(model.rig.noise_g):g} is below what the simulated part has at {part.odr_hz:g} Hz, "
            f"{part.noise_g:.2g} g; raise it, or lower sensor.sample_rate_hz"
        )
    beyond: Array = np.sqrt(squares)
    return beyond


def _hand_on(model: Model, force_g: Array) -> Array:
    """Apply what acts on noisy samples, the coarse steps before the smaller range."""
    for name in (Quantization.name, *(each for each in EFFECTS if each != Quantization.name)):
        if name in model.effects:
            force_g = EFFECTS[name].sample_output_g(model.effects[name], force_g)
    return force_g
