"""Effects of the catalogue that move the load, the pivot or the rope."""

import numpy as np

from tests.blind.mechanics import Array, Hook, Release, Spring, Vector
from tests.blind.scene import Draw, Effect, Rig, Scene, adding, along, horizontal, pulse, signed

Generator = np.random.Generator
STILL_M_S = 1e-3
"""Dry friction falls off below this speed, so that a resting load rests."""


def viscous_damping(rng: Generator, rig: Rig, size: float) -> Effect:
    ratio = size * float(rng.uniform(0.003, 0.011))
    rate = 2 * ratio * rig.rate_rad_s

    def push(x: float, y: float, z: float) -> Vector:
        return -rate * x, -rate * y, -rate * z

    return Effect("viscous_damping", {"damping_ratio": ratio}, adding(velocity_force=push))


def quadratic_drag(rng: Generator, rig: Rig, size: float) -> Effect:
    drag_per_m = size * float(rng.uniform(0.003, 0.012))

    def push(x: float, y: float, z: float) -> Vector:
        rate = drag_per_m * (x * x + y * y + z * z) ** 0.5
        return -rate * x, -rate * y, -rate * z

    return Effect("quadratic_drag", {"drag_per_m": drag_per_m}, adding(velocity_force=push))


def coulomb_friction(rng: Generator, rig: Rig, size: float) -> Effect:
    decel_m_s2 = size * float(rng.uniform(0.002, 0.006))

    def push(x: float, y: float, z: float) -> Vector:
        rate = decel_m_s2 / (x * x + y * y + z * z + STILL_M_S**2) ** 0.5
        return -rate * x, -rate * y, -rate * z

    return Effect("coulomb_friction", {"decel_m_s2": decel_m_s2}, adding(velocity_force=push))


def steady_wind(rng: Generator, rig: Rig, size: float) -> Effect:
    wind = horizontal(rng, size * rng.uniform(0.1, 0.35))
    return Effect("steady_wind", {"accel_m_s2": wind}, adding(load_acceleration=along(wind, np.ones_like)))


def wind_gust(rng: Generator, rig: Rig, size: float) -> Effect:
    wind = horizontal(rng, size * rng.uniform(0.1, 0.4))
    start_s, duration_s, rise_s = rng.uniform(32, 50), rng.uniform(4, 12), _rise_s(rng, 0.2, 1.0)
    parameters = {"accel_m_s2": wind, "start_s": start_s, "duration_s": duration_s, "rise_s": rise_s}
    return Effect("wind_gust", parameters, adding(load_acceleration=along(wind, pulse(start_s, duration_s, rise_s))))


def hoisting(rng: Generator, rig: Rig, size: float) -> Effect:
    start_s, duration_s, rise_s = rng.uniform(32, 50), rng.uniform(5, 11), rng.uniform(0.2, 1.0)
    room_m_s = 0.6 * min(rig.position_m, 0.2 * rig.length_m) / duration_s
    speed_m_s = signed(rng, 0.4, 1.0) * min(size * 0.25, room_m_s)
    parameters = {"speed_m_s": speed_m_s, "start_s": start_s, "duration_s": duration_s, "rise_s": rise_s}
    winch = pulse(start_s, duration_s, rise_s)
    return Effect("hoisting", parameters, adding(length_speed=lambda time_s: speed_m_s * winch(time_s)))


def trolley_acceleration(rng: Generator, rig: Rig, size: float) -> Effect:
    drive = horizontal(rng, size * rng.uniform(0.1, 0.35))
    start_s, duration_s, coast_s = rng.uniform(32, 45), rng.uniform(3, 5), rng.uniform(4, 10)
    rise_s = _rise_s(rng, 0.1, 0.5)
    off, brake = pulse(start_s, duration_s, rise_s), pulse(start_s + duration_s + coast_s, duration_s, rise_s)
    parameters = {
        "accel_m_s2": drive,
        "start_s": start_s,
        "duration_s": duration_s,
        "coast_s": coast_s,
        "rise_s": rise_s,
    }
    profile = along(drive, lambda time_s: off(time_s) - brake(time_s))
    return Effect("trolley_acceleration", parameters, adding(pivot_acceleration=profile))


def slewing(rng: Generator, rig: Rig, size: float) -> Effect:
    """The crane turns and the rope with it; on three cranes of ten the pivot is not above the slew ring."""
    rate_rad_s, where = size * signed(rng, 0.03, 0.09), rng.uniform(0, 2 * np.pi)
    inward_m_s2 = float(rng.uniform(0.02, 0.1)) if rng.random() < 0.3 else 0.0

    def turn(time_s: Array) -> Array:
        angle = where + rate_rad_s * time_s
        return -inward_m_s2 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)

    def apply(scene: Scene, _run: Generator) -> Scene:
        scene = scene.with_mechanics(spin_rad_s=scene.mechanics.spin_rad_s + rate_rad_s)
        if inward_m_s2 == 0:
            return scene
        return scene.with_mechanics(pivot_acceleration=(*scene.mechanics.pivot_acceleration, turn))

    return Effect("slewing", {"rate_rad_s": rate_rad_s, "radius_m": inward_m_s2 / rate_rad_s**2}, apply)


def double_pendulum(rng: Generator, rig: Rig, size: float) -> Effect:
    rigging_m = float(rng.uniform(0.15, 0.4)) * rig.length_m
    rigging_m = min(rigging_m, 0.9 * (rig.length_m - rig.position_m))
    ratio, initial_deg = float(rng.uniform(0.04, 0.2)), size * float(rng.uniform(1.5, 6.0))

    def apply(scene: Scene, run: Generator) -> Scene:
        lean = horizontal(run, np.radians(initial_deg))
        return scene.with_mechanics(hook=Hook(rigging_m, ratio)).with_start(rigging_tilt_rad=lean)

    parameters = {"rigging_length_m": rigging_m, "hook_mass_ratio": ratio, "initial_deg": initial_deg}
    return Effect("double_pendulum", parameters, apply)


def housing_position(rng: Generator, rig: Rig, size: float) -> Effect:
    error_m = size * signed(rng, 0.06, 0.18) * rig.length_m
    if not 0.08 * rig.length_m < rig.position_m + error_m < 0.97 * rig.length_m:
        error_m = -error_m
    error_m = float(np.clip(error_m, 0.05 * rig.length_m - rig.position_m, 0.97 * rig.length_m - rig.position_m))

    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_mechanics(position_m=scene.mechanics.position_m + error_m)

    return Effect("housing_position", {"error_m": error_m}, apply)


def rope_length(rng: Generator, rig: Rig, size: float) -> Effect:
    relative = size * signed(rng, 0.006, 0.03)

    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_mechanics(length_m=scene.mechanics.length_m * (1 + relative))

    return Effect("rope_length", {"relative_error": relative}, apply)


def rope_stretch(rng: Generator, rig: Rig, size: float) -> Effect:
    """Of three ropes, two stretch above the pivot's sheave (the housing moves with the load), one evenly below it."""
    spring = Spring(float(rng.uniform(1.2, 3.0)), float(rng.uniform(0.004, 0.02)))
    amplitude_m, share = size * float(rng.uniform(0.002, 0.008)), float(rng.choice([1.0, 1.0, rig.rho]))

    def apply(scene: Scene, run: Generator) -> Scene:
        start_m = amplitude_m * float(run.choice([-1, 1]))
        return scene.with_mechanics(spring=spring, share=share).with_start(stretch_m=start_m)

    parameters = {
        "frequency_hz": spring.frequency_hz,
        "damping_ratio": spring.damping_ratio,
        "amplitude_m": amplitude_m,
        "share": share,
    }
    return Effect("rope_stretch", parameters, apply)


def housing_spin(rng: Generator, rig: Rig, size: float) -> Effect:
    rate_deg_s = size * signed(rng, 1.5, 6.0)

    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_mechanics(spin_rad_s=scene.mechanics.spin_rad_s + np.radians(rate_deg_s))

    return Effect("housing_spin", {"rate_deg_s": rate_deg_s}, apply)


def impact(rng: Generator, rig: Rig, size: float) -> Effect:
    """Half of them between two even samples, half felt by one or a few."""
    change = horizontal(rng, size * rng.uniform(0.1, 0.35))
    start_s, contact_s = rng.uniform(32, 50), rng.uniform(0.02, 0.06)
    if rng.random() < 0.5:
        start_s, contact_s = (np.floor(start_s * rig.rate_hz) + 0.375) / rig.rate_hz, 0.25 / rig.rate_hz
    force = (change[0] / contact_s, change[1] / contact_s)
    parameters = {"delta_v_m_s": change, "start_s": start_s, "contact_s": contact_s}
    return Effect("impact", parameters, adding(load_acceleration=along(force, pulse(start_s, contact_s))))


def load_change(rng: Generator, rig: Rig, size: float) -> Effect:
    """Half of the load is set down: the centre of what hangs is elsewhere, the housing stays."""
    shift_m, start_s = size * signed(rng, 0.02, 0.06) * rig.length_m, rng.uniform(32, 50)
    shift_m = max(shift_m, 0.5 * (rig.position_m - rig.length_m))

    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_mechanics(release=Release(start_s, shift_m))

    return Effect("load_change", {"shift_m": shift_m, "start_s": start_s}, apply)


def _rise_s(rng: Generator, low_s: float, high_s: float) -> float:
    """Half of the edges are sharp."""
    return float(rng.choice([0.0, rng.uniform(low_s, high_s)]))


MECHANICS: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        viscous_damping,
        quadratic_drag,
        coulomb_friction,
        steady_wind,
        wind_gust,
        hoisting,
        trolley_acceleration,
        slewing,
        double_pendulum,
        housing_position,
        rope_length,
        rope_stretch,
        housing_spin,
        impact,
        load_change,
    )
}
