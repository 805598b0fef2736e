"""A simulated recording: the model's prediction, through the simulated accelerometer."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.double_pendulum import modes
from devices.simulated.accelerometer import Accelerometer, no_errors
from gateway.errors import InputError
from gateway.twin.effects import EFFECTS, ModelStructure
from gateway.twin.effects.evaluation_context import Rigging
from gateway.twin.model import EffectValues, Model, TwinRig
from gateway.twin.simulator.simulator import Simulator
from gateway.twin.simulator.state import (
    RIGGING_RATES,
    RIGGING_TILTS,
    ROPE_RATES,
    ROPE_TILTS,
    STRETCH,
    initial_state_specs,
)

Array = NDArray[np.float64]
DEFAULT_AMPLITUDE_RAD = math.radians(5.0)
"""Tilt of the rope from which the load is released if no initial state is given."""
DEFAULT_AXIS_RATIO = 0.2
"""Smaller axis of the swing's ellipse over the larger one."""
DEFAULT_STRETCH_M = 5e-3
"""Initial stretch of an elastic rope."""
FAST_MODE_SHARE = 1.5
"""Initial tilt of the rigging over that in the slow mode. Basis: 1 would leave the fast mode at rest."""
TEMPERATURE_RISE_C, TEMPERATURE_TIME_S = 20.0, 30.0
"""Rise of the sensor's temperature after it is switched on, and its time constant."""
DEFAULT_RATE_HZ = 50.0
"""Sample rate of a rig that states none."""
MAX_SAMPLES = 2_000_000
"""Longest recording. Basis: 11 hours at 50 Hz; it takes some 1 GB of memory."""
DEFAULT_RANGE_G = 2.0
"""Full scale of a rig that states none."""


@dataclass(frozen=True, slots=True)
class Simulated:
    """The samples that the simulated accelerometer delivers."""

    time_s: Array
    """Recorded time, shape (n,)."""
    force_g: Array
    """Shape (n, 3)."""
    temperature_c: Array
    """Shape (n,)."""
    full_scale_g: float
    noise_g: float
    rate_hz: float


def simulate(model: Model, duration_s: float, seed: int, initial: dict[str, float]) -> Simulated:
    """Return a recording of a model; `initial` gives coordinates of the initial state by name.

    Coordinates that are not given are those of a load that is released at 5 degrees. The same seed gives the same recording.
    Raises `InputError` for a model that cannot be simulated.
    """
    random = np.random.default_rng(seed)
    rate_hz = model.rig.sample_rate_hz or DEFAULT_RATE_HZ
    if duration_s * rate_hz > MAX_SAMPLES:
        raise InputError(
            f"{duration_s:g} s at {rate_hz:g} Hz are {duration_s * rate_hz:.3g} samples; at most {MAX_SAMPLES:,} are simulated, "
            f"{MAX_SAMPLES / rate_hz:.6g} s"
        )
    time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    if len(time_s) < 2:
        raise InputError(f"{duration_s:g} s at {rate_hz:g} Hz holds no two samples; choose a longer duration")
    for name, values in model.effects.items():
        kept = EFFECTS[name].keep_samples(values, len(time_s), random)
        time_s = time_s if kept is None else time_s[kept]
    temperature_c = model.rig.reference_temperature_c + TEMPERATURE_RISE_C * -np.expm1(-time_s / TEMPERATURE_TIME_S)
    force_g = _prediction(model, initial, random, time_s, temperature_c)
    sensor = Accelerometer(no_errors(), rate_hz, model.rig.full_scale_g or DEFAULT_RANGE_G)
    noisy_g = force_g + _excess_noise_g(model, sensor) * random.standard_normal(force_g.shape)
    samples_g = sensor.counts(noisy_g, temperature_c, random) / sensor.units_per_g
    recorded_s = np.arange(len(time_s)) / rate_hz  # stamps count samples, so lost samples leave no trace in them
    noise_g = float(np.sqrt(np.mean(np.square(model.rig.noise_g))))
    for name, effect in EFFECTS.items():  # in the order of the sensor's chain
        if name in model.effects:
            samples_g = effect.sample_output_g(model.effects[name], samples_g)
    return Simulated(recorded_s, samples_g, temperature_c, sensor.full_scale_g, noise_g, rate_hz)


def _prediction(
    model: Model, initial: dict[str, float], random: np.random.Generator, time_s: Array, temperature_c: Array
) -> Array:
    predicted = {name: values for name, values in model.effects.items() if not EFFECTS[name].acts_on_noisy_samples}
    try:
        simulator = Simulator(model.rig, tuple(predicted))
    except ValueError as error:
        raise InputError(str(error)) from error
    values = simulator.values([], predicted)
    _check_bounds(simulator, values)
    start = _initial_state(simulator, predicted, random)
    known = [spec.name for spec in simulator.initial]
    for name, value in initial.items():
        if name not in known:
            raise InputError(
                f"the initial state has no {name}; its coordinates are {', '.join(known)}".replace("_rad", "_deg")
            )
        start[known.index(name)] = value
    values[: simulator.n_initial_states] = start
    _check_bounds(simulator, values)
    return simulator.predict(values, time_s, temperature_c)


def _check_bounds(simulator: Simulator, values: Array) -> None:
    for spec, value in zip(simulator.parameters, values, strict=True):
        if not spec.lower <= value <= spec.upper:
            raise InputError(
                f"{spec.label} = {value:g} should be from {spec.lower:g} to {spec.upper:g} {spec.unit} here"
            )


def _initial_state(simulator: Simulator, effects: EffectValues, random: np.random.Generator) -> Array:
    """Return the initial state of a load that is released at a tilt in a random direction, with some speed across it.

    Rigging has a larger tilt than in the slow mode, an elastic rope is stretched, and a heavy one is straight, so that all modes
    are excited.
    """
    rig, azimuth_rad = simulator.rig, random.uniform(-np.pi, np.pi)
    start = released_state(rig, simulator.structure, DEFAULT_AMPLITUDE_RAD, DEFAULT_AXIS_RATIO, azimuth_rad)
    rigging = _rigging(effects)
    if rigging is not None:
        upper_m = rig.length_m - rigging.length_m
        slow, _ = modes(upper_m, rigging.length_m, rigging.hook_mass_ratio, rig.gravity_m_s2)
        start[RIGGING_TILTS] = FAST_MODE_SHARE * slow.rigging_tilt * start[ROPE_TILTS]
        start[RIGGING_RATES] = slow.rigging_tilt * start[ROPE_RATES]
    if simulator.structure is ModelStructure.ELASTIC:
        start[STRETCH] = DEFAULT_STRETCH_M
    return start


def released_state(
    rig: TwinRig, structure: ModelStructure, amplitude_rad: float, axis_ratio: float, azimuth_rad: float
) -> Array:
    """Return the initial state of a load that is released at a tilt toward an azimuth, with some speed across it, shape (z,)."""
    along = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    start = np.zeros(len(initial_state_specs(structure)))
    start[ROPE_TILTS] = amplitude_rad * along
    start[ROPE_RATES] = axis_ratio * rig.small_swing_rate_1_s * amplitude_rad * along[::-1] * [-1, 1]
    return start


def _rigging(effects: EffectValues) -> Rigging | None:
    found = (EFFECTS[name].rigging(values) for name, values in effects.items())
    return next((rigging for rigging in found if rigging is not None), None)


def _excess_noise_g(model: Model, sensor: Accelerometer) -> Array:
    """Return the noise of the rig beyond that of the simulated accelerometer, shape (3,)."""
    squares = np.square(model.rig.noise_g) - sensor.noise_g**2
    if (squares < 0).any():
        raise InputError(
            f"sensor.noise_g {min(model.rig.noise_g):g} is below what the simulated part has at {sensor.odr_hz:g} Hz, "
            f"{sensor.noise_g:.2g} g; raise it, or lower sensor.sample_rate_hz"
        )
    return np.sqrt(squares)
