"""Sessions of the other bench methods with known truth: rests on faces and anywhere, full turns, laser pairs, girder ends.

reading = offset + S up + noise            S: sensitive axes in the housing times their scale factors, g per g
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tests.gateway.bench.planted.thermal import UP, Values

RATE_HZ = 50.0
FACE_NAMES = ("px", "nx", "py", "ny", "pz", "nz")


@dataclass(frozen=True, slots=True)
class BenchSensor:
    """A sensor with its errors."""

    offset_g: Values
    axes: Values
    noise_g: float

    def read(self, random: np.random.Generator, up: Values) -> Values:
        """Return readings in g, (n, 3), for specific forces (n, 3)."""
        return np.asarray(self.offset_g + up @ self.axes.T + self.noise_g * random.standard_normal(up.shape))


def draw_sensor(random: np.random.Generator) -> BenchSensor:
    """Return a sensor of the size of data sheets: 30 mg, 2 %, half a degree of misalignment."""
    cross = random.normal(0, 0.008, (3, 3)) * (1 - np.eye(3))
    return BenchSensor(
        offset_g=random.normal(0, 0.03, 3),
        axes=np.diag(random.normal(1, 0.02, 3)) @ (np.eye(3) + cross),
        noise_g=random.uniform(0.0003, 0.002),
    )


def rest(random: np.random.Generator, sensor: BenchSensor, up: Values, seconds: float = 8.0) -> Values:
    """Return the readings of one rest."""
    return sensor.read(random, np.tile(up, (round(seconds * RATE_HZ), 1)))


def tilted(random: np.random.Generator, up: Values, sigma_deg: float) -> Values:
    """Return a vertical that is placed with this standard deviation about each axis."""
    off = np.asarray(up + np.cross(random.normal(0, np.radians(sigma_deg), 3), up))
    return np.asarray(off / np.linalg.norm(off))


def faces(random: np.random.Generator, sensor: BenchSensor, placement_deg: float = 0.08) -> dict[str, Values]:
    """Return the readings of a rest on each face, by `FACE_NAMES`."""
    return {
        name: rest(random, sensor, tilted(random, up, placement_deg)) for name, up in zip(FACE_NAMES, UP, strict=True)
    }


def poses(random: np.random.Generator, sensor: BenchSensor, count: int = 14) -> dict[str, Values]:
    """Return rests in attitudes all round: the faces and directions between them, held by hand to some degrees."""
    between = [(1, 1, 0), (-1, 1, 1), (0, -1, 1), (1, -1, -1), (-1, 0, -1), (1, 0, 1), (-1, -1, 0), (1, 1, -1)]
    directions = np.vstack([UP, np.array(between, dtype=float)])[:count]
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return {f"pose{number:02d}": rest(random, sensor, tilted(random, up, 3.0)) for number, up in enumerate(directions)}


def turn(
    random: np.random.Generator, sensor: BenchSensor, about: int, *, level_deg: float = 0.0, step_deg: float = 10.0
) -> tuple[Values, Values]:
    """Return angles, deg, and mean readings, g, of a full turn about an axis of the housing (Łuczak n.d., eq. 11 and 12)."""
    sine, cosine = {0: (1, 2), 1: (0, 2), 2: (0, 1)}[about]
    angle_deg = np.arange(0, 360, step_deg)
    angle = np.radians(angle_deg + random.normal(0, 0.02, len(angle_deg)))
    up = np.zeros((len(angle), 3))
    up[:, sine], up[:, cosine] = np.sin(angle), np.cos(angle)
    up *= np.cos(np.radians(level_deg))
    up[:, about] = np.sin(np.radians(level_deg))
    mount = random.normal(0, np.radians(0.05), 3)
    up = up + np.cross(mount, up)
    quiet = replace(sensor, noise_g=sensor.noise_g / 7)
    return angle_deg, quiet.read(random, up)


def laser_pairs(random: np.random.Generator, a_z_off_g: float, distance_mm: float, count: int = 8) -> Values:
    """Return displacements, mm, and raw relative angles, deg, (n, 2) (Zhu et al. 2020, eq. 11 and 19)."""
    actual_deg = np.linspace(-4.0, 4.0, count) + random.uniform(-0.2, 0.2, count)
    half = np.sqrt(0.5)  # of the variance is that of the zero, which all pairs share
    raw_deg = actual_deg * np.exp(-a_z_off_g) + half * 0.001 * (random.normal(0, 1, count) + random.normal())
    d_mm = distance_mm * np.tan(np.radians(actual_deg)) + half * 0.05 * (random.normal(0, 1, count) + random.normal())
    return np.column_stack([d_mm, raw_deg])


def girder_end(random: np.random.Generator, sign: int, rotation_rad: float, axis: int = 0) -> tuple[Values, Values]:
    """Return time and readings of one end: 20 s unloaded, 20 s loaded; the inward axis `sign * axis` sinks by the rotation."""
    time_s = np.arange(800) / 20
    lean = random.normal(0, 0.01, 2)
    angle = np.where(time_s > 20, -rotation_rad, 0.0) * sign
    force = np.column_stack([lean[0] + np.sin(angle), np.full(800, lean[1]), np.cos(angle)])
    if axis == 1:
        force = force[:, [1, 0, 2]]
    return time_s, force + 3e-4 * random.standard_normal((800, 3))


def write_table(path: Path, columns: Mapping[str, Values] | Iterable[tuple[str, Values]]) -> Path:
    """Write a CSV file of columns, each of shape (n,)."""
    named = dict(columns)
    rows = np.column_stack(list(named.values()))
    path.write_text(
        ",".join(named) + "\n" + "\n".join(",".join(f"{value:.7g}" for value in row) for row in rows) + "\n"
    )
    return path


def write_readings(
    path: Path, raw: Values, unit: str = "g", *, time_s: Values | None = None, temperature_c: Values | None = None
) -> Path:
    """Write readings as the project's CSV."""
    time = np.arange(len(raw)) / RATE_HZ if time_s is None else time_s
    columns = {"time_s": time} | {f"a{axis}_{unit}": raw[:, place] for place, axis in enumerate("xyz")}
    return write_table(path, columns if temperature_c is None else columns | {"temperature_c": temperature_c})
