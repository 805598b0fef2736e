"""Effects that the catalogue does not have: the right answer is that something unmodelled remains."""

from collections.abc import Callable

import numpy as np

from tests.blind.mechanics import Array, Vector
from tests.blind.scene import Draw, Effect, Rig, Scene, adding, along, horizontal, signed, sine
from tests.blind.sensor import Distortion
from tests.blind.sensor_effects import thermal_drift

Generator = np.random.Generator
Apply = Callable[[Scene, Generator], Scene]


def negative_drag(rng: Generator, rig: Rig, size: float) -> Effect:
    """Something feeds the swing."""
    rate = size * float(rng.uniform(0.003, 0.008))

    def push(x: float, y: float, z: float) -> Vector:
        return rate * x, rate * y, rate * z

    return Effect("negative_drag", {"rate_per_s": rate}, adding(velocity_force=push))


def pivot_vibration(rng: Generator, rig: Rig, size: float) -> Effect:
    """The jib shakes sideways."""
    frequency_hz, drive = float(rng.uniform(0.4, 1.5)), horizontal(rng, size * rng.uniform(0.03, 0.12))

    def apply(scene: Scene, run: Generator) -> Scene:
        shake = along(drive, sine(frequency_hz, run.uniform(0, 2 * np.pi)))
        return adding(pivot_acceleration=shake)(scene, run)

    return Effect("pivot_vibration", {"frequency_hz": frequency_hz, "accel_m_s2": drive}, apply)


def pivot_heave(rng: Generator, rig: Rig, size: float) -> Effect:
    """A floating crane: the pivot rises and falls."""
    frequency_hz, amplitude_m_s2 = float(rng.uniform(0.25, 0.8)), size * float(rng.uniform(0.02, 0.12))

    def apply(scene: Scene, run: Generator) -> Scene:
        level = sine(frequency_hz, run.uniform(0, 2 * np.pi))
        return adding(pivot_acceleration=lambda time_s: np.outer(amplitude_m_s2 * level(time_s), [0, 0, 1]))(scene, run)

    return Effect("pivot_heave", {"frequency_hz": frequency_hz, "amplitude_m_s2": amplitude_m_s2}, apply)


def periodic_wind(rng: Generator, rig: Rig, size: float) -> Effect:
    """Gusts that come and go at one frequency."""
    frequency_hz, wind = float(rng.uniform(0.25, 0.7)), horizontal(rng, size * rng.uniform(0.04, 0.15))

    def apply(scene: Scene, run: Generator) -> Scene:
        gusts = along(wind, sine(frequency_hz, run.uniform(0, 2 * np.pi)))
        return adding(load_acceleration=gusts)(scene, run)

    return Effect("periodic_wind", {"frequency_hz": frequency_hz, "accel_m_s2": wind}, apply)


def periodic_hoisting(rng: Generator, rig: Rig, size: float) -> Effect:
    """The winch hunts about its place."""
    frequency_hz, speed_m_s = float(rng.uniform(0.3, 0.8)), size * float(rng.uniform(0.01, 0.05))

    def apply(scene: Scene, run: Generator) -> Scene:
        phase = run.uniform(0, 2 * np.pi)
        ahead_m = speed_m_s / (2 * np.pi * frequency_hz) * np.cos(phase)  # so that the mean length is the believed one
        length_m, position_m = scene.mechanics.length_m - ahead_m, scene.mechanics.position_m - ahead_m
        level = sine(frequency_hz, phase)
        hunting = adding(length_speed=lambda time_s: speed_m_s * level(time_s))
        return hunting(scene.with_mechanics(length_m=length_m, position_m=position_m), run)

    return Effect("periodic_hoisting", {"frequency_hz": frequency_hz, "speed_m_s": speed_m_s}, apply)


def rope_mode(rng: Generator, rig: Rig, size: float) -> Effect:
    """The rope itself rings sideways like a string and dies away."""
    frequency_hz, decay_s = float(rng.uniform(2.5, 9)), float(rng.uniform(5, 20))
    size_g = horizontal(rng, max(size * float(rng.uniform(0.004, 0.02)), 4 * rig.noise_g))

    def apply(scene: Scene, run: Generator) -> Scene:
        level = sine(frequency_hz, run.uniform(0, 2 * np.pi))
        ring = along(size_g, lambda time_s: np.exp(-np.maximum(time_s, 0) / decay_s) * level(time_s))
        return scene.with_sensor(shaking=(*scene.sensor.shaking, ring))

    return Effect("rope_mode", {"frequency_hz": frequency_hz, "decay_s": decay_s, "amplitude_g": size_g}, apply)


def driven_torsion(rng: Generator, rig: Rig, size: float) -> Effect:
    """The housing twists to and fro about the rope at one frequency and does not die away."""
    frequency_hz, amplitude_deg = float(rng.uniform(0.04, 0.3)), size * float(rng.uniform(3, 15))

    def apply(scene: Scene, run: Generator) -> Scene:
        level = sine(frequency_hz, run.uniform(0, 2 * np.pi))

        def twist(time_s: Array, reading_g: Array) -> Array:
            turned = (reading_g[:, 0] + 1j * reading_g[:, 1]) * np.exp(-1j * np.radians(amplitude_deg) * level(time_s))
            return np.stack([turned.real, turned.imag, reading_g[:, 2]], axis=1)

        return _distort(twist)(scene, run)

    return Effect("driven_torsion", {"frequency_hz": frequency_hz, "amplitude_deg": amplitude_deg}, apply)


def backlash(rng: Generator, rig: Rig, size: float) -> Effect:
    """A mount with play: part of the sideways reading follows late."""
    gap_g, gain = _gap_g(rng, rig, size), float(rng.uniform(0.4, 1.0))

    def slack(_time_s: Array, reading_g: Array) -> Array:
        across = np.stack([_play(reading_g[:, axis], gap_g) for axis in (0, 1)], axis=1)
        return np.column_stack([reading_g[:, :2] + gain * (across - reading_g[:, :2]), reading_g[:, 2]])

    return Effect("backlash", {"gap_g": gap_g, "gain": gain}, _distort(slack))


def hysteresis(rng: Generator, rig: Rig, size: float) -> Effect:
    """One axis remembers where it came from, like a magnetised part."""
    gap_g, axis = _gap_g(rng, rig, size), int(rng.integers(2))

    def remember(_time_s: Array, reading_g: Array) -> Array:
        return _with_axis(reading_g, axis, _play(reading_g[:, axis], gap_g))

    return Effect("hysteresis", {"gap_g": gap_g, "axis": axis}, _distort(remember))


def sticking_axis(rng: Generator, rig: Rig, size: float) -> Effect:
    """One axis stays where it is until the truth has moved away far enough, then jumps there."""
    grip_g, axis = 2 * _gap_g(rng, rig, size), int(rng.integers(2))

    def stick(_time_s: Array, reading_g: Array) -> Array:
        held, stuck = reading_g[:, axis].copy(), reading_g[0, axis]
        for i, value in enumerate(reading_g[:, axis]):
            stuck = value if abs(value - stuck) > grip_g else stuck
            held[i] = stuck
        return _with_axis(reading_g, axis, held)

    return Effect("sticking_axis", {"grip_g": grip_g, "axis": axis}, _distort(stick))


def rectification(rng: Generator, rig: Rig, size: float) -> Effect:
    """A sensitivity that bends: what is read grows with the square of what is there."""
    bend_per_g = size * signed(rng, 0.5, 3.0)

    def bend(_time_s: Array, reading_g: Array) -> Array:
        return reading_g + bend_per_g * (reading_g - [0, 0, 1]) ** 2

    return Effect("rectification", {"bend_per_g": bend_per_g}, _distort(bend))


def offset_creep(rng: Generator, rig: Rig, size: float) -> Effect:
    """The offsets settle after switching on, much sooner than the housing warms up."""
    creep_g, settle_s = size * rng.choice([-1, 1], 3) * rng.uniform(0.004, 0.015, 3), float(rng.uniform(4, 12))

    def creep(time_s: Array, reading_g: Array) -> Array:
        return reading_g + np.outer(np.exp(-np.maximum(time_s, 0) / settle_s), creep_g)

    return Effect("offset_creep", {"creep_g": creep_g.tolist(), "settle_s": settle_s}, _distort(creep))


def offset_step(rng: Generator, rig: Rig, size: float) -> Effect:
    """A knock leaves the sensor with another offset."""
    step_g, start_s = size * rng.choice([-1, 1], 3) * rng.uniform(0.003, 0.012, 3), float(rng.uniform(25, 50))

    def step(time_s: Array, reading_g: Array) -> Array:
        return reading_g + np.outer(time_s >= start_s, step_g)

    return Effect("offset_step", {"step_g": step_g.tolist(), "start_s": start_s}, _distort(step))


def thermal_saturation(rng: Generator, rig: Rig, size: float) -> Effect:
    """The offset follows the temperature up to a point: the thermal drift is there too, and may be named."""
    drift, limit_c = thermal_drift(rng, rig, size), float(rng.uniform(5, 10))

    def apply(scene: Scene, run: Generator) -> Scene:
        return drift.apply(scene, run).with_sensor(drift_limit_c=limit_c)

    return Effect("thermal_saturation", {**drift.parameters, "limit_c": limit_c}, apply)


ALSO_TRUE = {"thermal_saturation": "thermal_drift"}
"""What an outside effect contains of the catalogue: naming it is no mistake."""


def _gap_g(rng: Generator, rig: Rig, size: float) -> float:
    """Half the width of a play, in proportion to what the sideways axes read."""
    reach_g = (1 - rig.rho) * rig.amplitude_rad
    return max(size * float(rng.uniform(0.04, 0.15)) * reach_g, rig.noise_g)


def _play(values: Array, gap: float) -> Array:
    """The follower of a driver with play: it rests until the driver pushes it by either side."""
    follower = np.empty_like(values)
    place = values[0]
    for i, value in enumerate(values.tolist()):
        place = min(max(place, value - gap), value + gap)
        follower[i] = place
    return follower


def _with_axis(reading_g: Array, axis: int, values: Array) -> Array:
    out = reading_g.copy()
    out[:, axis] = values
    return out


def _distort(distortion: Distortion) -> Apply:
    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_sensor(distortions=(*scene.sensor.distortions, distortion))

    return apply


OUTSIDE: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        negative_drag,
        pivot_vibration,
        pivot_heave,
        periodic_wind,
        periodic_hoisting,
        rope_mode,
        driven_torsion,
        backlash,
        hysteresis,
        sticking_axis,
        rectification,
        offset_creep,
        offset_step,
        thermal_saturation,
    )
}
