"""Effects of the catalogue that change what the sensor makes of the motion."""

from collections.abc import Callable

import numpy as np

from tests.blind.mechanics import Array, Clamp
from tests.blind.scene import Draw, Effect, Rig, Scene, changing_sensor, horizontal, signed
from tests.blind.sensor import Lag

Generator = np.random.Generator


def lever_arm(rng: Generator, rig: Rig, size: float) -> Effect:
    """A sensor on the side of its housing, 1 to 5 cm from the rope's line."""
    beside_m = horizontal(rng, size * rng.uniform(0.01, 0.05))

    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_mechanics(beside_m=beside_m)

    return Effect("lever_arm", {"offset_m": beside_m}, apply)


def housing_rocking(rng: Generator, rig: Rig, size: float) -> Effect:
    """A clamp that yields, about the two axes not equally: 2 to 6 degrees for a force of 1 g across the rope."""
    deg_per_g = size * rng.uniform(2.0, 6.0) * rng.uniform(0.7, 1.3, 2)
    below_m = float(rng.uniform(0.03, 0.08))
    # A spring k = 2 m h^2 w^2 with the weight m g h below it turns by m h g/(k + m h g) per g.
    rates = np.sqrt(rig.gravity_m_s2 * (1 / np.radians(deg_per_g) - 1) / (2 * below_m))
    about_y_hz, about_x_hz = (rates / (2 * np.pi)).tolist()
    clamp = Clamp(rocking_hz=(about_x_hz, about_y_hz), below_m=below_m)

    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_mechanics(clamp=clamp)

    return Effect("housing_rocking", {"deg_per_g": deg_per_g.tolist()}, apply)


def housing_torsion(rng: Generator, rig: Rig, size: float) -> Effect:
    """The rope twists to and fro with the housing; how far differs from run to run."""
    frequency_hz, damping_ratio = float(rng.uniform(0.02, 0.3)), float(rng.uniform(0.0, 0.03))
    amplitude_deg = size * float(rng.uniform(3, 15))
    clamp = Clamp(torsion_hz=frequency_hz, torsion_damping_ratio=damping_ratio)

    def apply(scene: Scene, run: Generator) -> Scene:
        twist_rad, phase = np.radians(amplitude_deg) * run.uniform(0.7, 1.0), run.uniform(0, 2 * np.pi)
        rate_rad_s = -2 * np.pi * frequency_hz * twist_rad * np.sin(phase)
        twisted = scene.with_start(twist_rad=float(twist_rad * np.cos(phase)), twist_rate_rad_s=float(rate_rad_s))
        return twisted.with_mechanics(clamp=clamp)

    parameters = {"frequency_hz": frequency_hz, "damping_ratio": damping_ratio, "amplitude_deg": amplitude_deg}
    return Effect("housing_torsion", parameters, apply)


def axis_offset(rng: Generator, rig: Rig, size: float) -> Effect:
    offset_g = _three(rng, 0.005 * size, 0.025 * size)

    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_sensor(offset_g=tuple(np.add(scene.sensor.offset_g, offset_g)))

    return Effect("axis_offset", {"offset_g": offset_g}, apply)


def scale_error(rng: Generator, rig: Rig, size: float) -> Effect:
    relative = _three(rng, 0.008 * size, 0.03 * size)
    return Effect("scale_error", {"relative": relative}, _with_axes(np.diag(1 + np.array(relative))))


def cross_axis(rng: Generator, rig: Rig, size: float) -> Effect:
    """Symmetric on seven sensors of ten (axes that are not square to each other), else six numbers of their own."""
    xy, xz, yz = _three(rng, 0.005 * size, 0.03 * size)
    yx, zx, zy = (xy, xz, yz) if rng.random() < 0.7 else _three(rng, 0.005 * size, 0.03 * size)
    axes = np.array([[1.0, xy, xz], [yx, 1.0, yz], [zx, zy, 1.0]])
    parameters = {"xy": xy, "xz": xz, "yz": yz, "yx": yx, "zx": zx, "zy": zy}
    return Effect("cross_axis", parameters, _with_axes(axes))


def mount_misalignment(rng: Generator, rig: Rig, size: float) -> Effect:
    """A turn of the sensor about an axis across the rope; one housing in three hangs well askew."""
    angle_deg = (signed(rng, 0.3 * size, 1.5 * size), signed(rng, 0.3 * size, 1.5 * size))
    if rng.random() < 1 / 3:
        angle_deg = horizontal(rng, size * rng.uniform(10, 30))
    x, y = np.radians(angle_deg)
    skew = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    angle = np.hypot(x, y)  # Rodrigues; at rest the readings are about (-x, -y, 1)
    mount = np.eye(3) + np.sin(angle) / angle * skew + (1 - np.cos(angle)) / angle**2 * skew @ skew
    return Effect("mount_misalignment", {"deg": angle_deg}, changing_sensor(mount=mount))


def thermal_drift(rng: Generator, rig: Rig, size: float) -> Effect:
    mg_per_c = _three(rng, 0.5 * size, 3.0 * size)
    return Effect(
        "thermal_drift", {"mg_per_c": mg_per_c}, changing_sensor(drift_g_per_c=tuple(np.array(mg_per_c) / 1000))
    )


def lowpass_lag(rng: Generator, rig: Rig, size: float) -> Effect:
    """One pole on eight sensors of ten, else two; a smaller effect is a higher cutoff."""
    lag = Lag(float(rng.uniform(0.35, 1.2)) / size**0.5, int(rng.choice([1, 2], p=[0.8, 0.2])))
    return Effect("lowpass_lag", {"cutoff_hz": lag.cutoff_hz, "poles": lag.poles}, changing_sensor(lag=lag))


def clipping(rng: Generator, rig: Rig, size: float) -> Effect:
    """A full scale that the axial reading passes at the bottom of each swing."""
    top_g = 2 * rig.rho * (1 - np.cos(rig.amplitude_rad))
    full_scale_g = 1 + top_g * (1 - min(0.95, size * float(rng.uniform(0.35, 0.85))))
    return Effect("clipping", {"full_scale_g": full_scale_g}, changing_sensor(full_scale_g=full_scale_g))


def quantization(rng: Generator, rig: Rig, size: float) -> Effect:
    lsb_g = max(size * float(rng.uniform(0.0015, 0.006)), (2.5 + size) * rig.noise_g)
    return Effect("quantization", {"lsb_g": lsb_g}, changing_sensor(lsb_g=lsb_g))


def sample_hold(rng: Generator, rig: Rig, size: float) -> Effect:
    """A sensor of 8 to 25 readings per second in a file of 50 rows per second; half of them average over their interval."""
    rows = float(rng.uniform(2.0, 6.0)) if rng.random() < 0.5 else float(rng.integers(2, 7))
    averages = bool(rng.random() < 0.5)
    held = changing_sensor(hold_s=rows / rig.rate_hz, averages=averages)
    return Effect("sample_hold", {"rows": rows, "averages": averages}, held)


def clock_drift(rng: Generator, rig: Rig, size: float) -> Effect:
    relative = size * signed(rng, 0.003, 0.015)
    return Effect("clock_drift", {"relative": relative}, changing_sensor(clock_relative=relative))


def sample_loss(rng: Generator, rig: Rig, size: float) -> Effect:
    fraction = size * float(rng.uniform(0.01, 0.05))
    return Effect("sample_loss", {"fraction": fraction}, changing_sensor(loss_fraction=fraction))


def vibration(rng: Generator, rig: Rig, size: float) -> Effect:
    """A machine shakes the housing: one line in the spectrum; half of them to and fro, half on an ellipse."""
    frequency_hz, direction = float(rng.uniform(8, 22)), rng.normal(size=3)
    amplitude_g = max(size * float(rng.uniform(0.0015, 0.01)), (1 + size) * rig.noise_g)
    by_axis_g = amplitude_g * direction / np.linalg.norm(direction)
    lags = rng.choice([0.0, 1.0]) * rng.uniform(0, 2 * np.pi, 3)

    def apply(scene: Scene, run: Generator) -> Scene:
        phases = lags + run.uniform(0, 2 * np.pi)

        def shake(time_s: Array) -> Array:
            shaken: Array = by_axis_g * np.sin(2 * np.pi * frequency_hz * time_s[:, None] + phases)
            return shaken

        return scene.with_sensor(shaking=(*scene.sensor.shaking, shake))

    return Effect("vibration", {"frequency_hz": frequency_hz, "amplitude_g": amplitude_g}, apply)


def _three(rng: Generator, low: float, high: float) -> tuple[float, float, float]:
    return signed(rng, low, high), signed(rng, low, high), signed(rng, low, high)


def _with_axes(axes: Array) -> Callable[[Scene, Generator], Scene]:
    def apply(scene: Scene, _run: Generator) -> Scene:
        return scene.with_sensor(axes=axes @ scene.sensor.axes)

    return apply


SENSOR: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        axis_offset,
        scale_error,
        cross_axis,
        mount_misalignment,
        thermal_drift,
        lowpass_lag,
        clipping,
        quantization,
        clock_drift,
        sample_loss,
        vibration,
        lever_arm,
        housing_rocking,
        housing_torsion,
        sample_hold,
    )
}
