"""Weeks of service on a rope with known truth: free swings and rests, by Cartesian equations of motion integrated here.

    p'' = F - (F . n) n - v^2/L n,  F = g + wind - (c + d |v|) v,  n = p/L       the load, on a rope of length L
    f = (r/L p'' + e'' - g) / |g|                                            at r from the pivot, e beside the rope
    reading = offset + S Mount f + noise + flicker + drift with temperature  z of the housing up the rope

The rope does not twist: the housing's axes are the world's, turned by the least rotation to the rope. The wind leans the rope by
an angle that is drawn for each day.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from tests.gateway.bench.planted.thermal import Values

G_M_S2 = 9.80665
RATE_HZ = 20.0
DAY_S = 86_400.0


@dataclass(frozen=True, slots=True)
class Installed:
    """A housing on a rope with its sensor."""

    length_m: float = 12.0
    above_load_m: float = 6.0
    """The true place; what is believed may differ."""
    scale: Values = field(default_factory=lambda: np.zeros(3))
    """Errors of the scale factors, relative."""
    cross: Values = field(default_factory=lambda: np.zeros((3, 3)))
    """Errors between the axes, relative, zero diagonal."""
    offset_g: Values = field(default_factory=lambda: np.zeros(3))
    mount_rad: Values = field(default_factory=lambda: np.zeros(2))
    """Angles of the housing against the rope about x and y."""
    beside_m: Values = field(default_factory=lambda: np.zeros(2))
    offset_g_per_c: Values = field(default_factory=lambda: np.zeros(3))
    spreader: bool = False
    """The housing stands level on a body that does not turn with the rope."""

    @property
    def response(self) -> Values:
        """Readings by specific force in the rope's frame, (3, 3)."""
        about_x, about_y = self.mount_rad
        cross = np.array([[0.0, 0.0, about_y], [0.0, 0.0, -about_x], [-about_y, about_x, 0.0]])
        mounted = np.eye(3) + cross + cross @ cross / 2
        return np.asarray((np.diag(1 + self.scale) + self.cross) @ mounted)

    def deviations(self, found: list["Recorded"]) -> dict[str, float]:
        """Return what a fit should find in recordings, over those of an ideal sensor, by its names; without a steady lean.

        A scale is what the correction takes off, 1 - 1/K, of an axis across over the root of that along.
        """
        offset_g = self.offset_g + self.offset_g_per_c * (np.mean([each.temperature_c.mean() for each in found]) - 15)
        response = self.response
        across, along = offset_g[:2] + response[:2, 2], offset_g[2] + response[2, 2] - 1
        line = np.linalg.solve(response[:2, :2].T, response[2, :2])
        per_m = float(np.mean([1 / each.length_m for each in found]))
        windless = across + line * self.above_load_m * per_m - self.beside_m * per_m
        x, y = (1 - np.sqrt(1 + self.scale[2]) / (1 + self.scale[:2])).tolist()
        pairs = {"across": across, "windless": windless, "offset": across + line}
        return {
            "scale_x": x, "scale_y": y, "scale_y_over_x": y - x, "along_g": float(along),
            "mount_about_x_rad": float(line[1]), "mount_about_y_rad": -float(line[0]),
            **{f"{name}_{axis}_g": float(pair[k]) for name, pair in pairs.items() for k, axis in enumerate("xy")},
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Weeks:
    """What happens on a crane, standard deviations where nothing else is said."""

    days: int = 28
    swings_a_day: int = 3
    amplitude_rad: tuple[float, float] = (0.03, 0.11)
    """Smallest and largest swing at its begin."""
    periods: tuple[float, float] = (9.0, 24.0)
    hoist: float = 0.15
    """Largest change of the rope's length between swings, relative."""
    damping: tuple[float, float] = (0.002, 0.008)
    lean_rad: float = 0.005
    """Lean of a day, each direction."""
    steady_lean_rad: tuple[float, float] = (0.0, 0.0)
    directions_rad: tuple[float, float] = (0.0, np.pi)
    """Range of the swings' directions."""
    ellipse: float = 0.4
    """Largest minor axis over the major one."""
    white_g: float = 1.1e-4
    """Noise of a reading at 20 Hz: 25 µg/√Hz in two thirds of the band."""
    flicker_g: float = 1.2e-5
    gust: float = 0.0005
    """Change of the wind within a swing, over gravity."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """A piece of a recording."""

    time_s: Values
    raw_g: Values
    temperature_c: Values
    length_m: float
    """Length of the rope."""


def draw_installed(random: np.random.Generator) -> Installed:
    """Return a sensor with errors of an uncalibrated part on a rope of 8 to 25 m, its housing a third to two thirds up."""
    length_m = random.uniform(8.0, 25.0)
    return Installed(
        length_m=length_m,
        above_load_m=length_m * random.uniform(0.35, 0.65),
        scale=random.normal(0, 0.01, 3),
        cross=random.normal(0, 0.002, (3, 3)) * (1 - np.eye(3)),
        offset_g=random.normal(0, 0.01, 3),
        mount_rad=random.normal(0, 0.01, 2),
        beside_m=random.normal(0, 0.01, 2),
        offset_g_per_c=random.normal(0, 1e-4, 3),
    )


def weeks_of_service(random: np.random.Generator, crane: Installed, weeks: Weeks) -> list[Recorded]:
    """Return swings that decay, each followed by a rest of 90 s a minute later, day by day in order of time."""
    count = weeks.days * weeks.swings_a_day
    day = np.repeat(np.arange(weeks.days), weeks.swings_a_day)
    lean = random.normal(0, weeks.lean_rad, (weeks.days, 2))
    lean = lean[day] + weeks.steady_lean_rad
    length_m = crane.length_m * random.uniform(1 - weeks.hoist, 1 + weeks.hoist, count)
    period_s = 2 * np.pi * np.sqrt(length_m / G_M_S2)
    duration_s = period_s * random.uniform(*weeks.periods, count)
    force_g = _swings(random, crane, weeks, lean, length_m, float(duration_s.max()))
    hour = np.sort(random.uniform(7, 17, (weeks.days, weeks.swings_a_day)), axis=1).ravel()
    begin_s = day * DAY_S + 3600 * hour
    found = []
    for number in range(count):
        samples = round(duration_s[number] * RATE_HZ)
        for start_s, force in (
            (begin_s[number], force_g[number, :samples]),
            (
                begin_s[number] + duration_s[number] + 60.0,
                np.tile(_rest(crane, lean[number]), (round(90 * RATE_HZ), 1)),
            ),
        ):
            time_s = start_s + np.arange(len(force)) / RATE_HZ
            warm_c = 15 + 4 * np.sin(2 * np.pi * time_s / (40 * DAY_S)) + 5 * np.sin(2 * np.pi * (time_s / DAY_S - 0.4))
            found.append(Recorded(time_s, _read(random, crane, weeks, force, warm_c), warm_c, float(length_m[number])))
    return found


def _rest(crane: Installed, lean: Values) -> Values:
    """Return the specific force at rest in the rope's frame under a wind of so much over gravity, (3,), |f| = 1 + lean^2/2.

    Gravity and wind together are along the rope; the accelerometer reads the reaction to gravity alone.
    """
    n = np.array([lean[0], lean[1], -1.0])
    if crane.spreader:
        return np.array([0.0, 0.0, 1.0])
    return np.asarray(_frame((n / np.linalg.norm(n))[None])[0] @ np.array([0.0, 0.0, 1.0]))


def _frame(n: Values) -> Values:
    """Return the axes of the rope's frame as rows, (m, 3, 3), for directions to the load (m, 3): the least turn from plumb."""
    x, y, z = n.T[0], n.T[1], -n.T[2]
    share = 1 / (1 + z)
    first = np.column_stack([1 - x * x * share, -x * y * share, x])
    second = np.column_stack([-x * y * share, 1 - y * y * share, y])
    return np.stack([first, second, -n], axis=1)


def _swings(
    random: np.random.Generator, crane: Installed, weeks: Weeks, lean: Values, length_m: Values, duration_s: float
) -> Values:
    """Return the specific force in the rope's frame, (swings, samples, 3), integrated by Runge-Kutta."""
    count = len(length_m)
    rate_1_s = np.sqrt(G_M_S2 / length_m)
    damping = 2 * rate_1_s * random.uniform(*weeks.damping, count)
    drag = random.uniform(0.0, 0.002, count)
    amplitude = random.uniform(*weeks.amplitude_rad, count)
    minor = amplitude * random.uniform(-weeks.ellipse, weeks.ellipse, count)
    towards = random.uniform(*weeks.directions_rad, count)
    major_axis = np.column_stack([np.cos(towards), np.sin(towards)])
    start = lean + amplitude[:, None] * major_axis
    n = np.column_stack([start, -np.sqrt(1 - (start**2).sum(axis=1))])
    speed = (minor * rate_1_s * length_m)[:, None] * np.column_stack([-major_axis[:, 1], major_axis[:, 0], 0 * minor])
    speed -= (speed * n).sum(axis=1)[:, None] * n
    gust = random.normal(0, weeks.gust, (count, 2))
    gust_rate, gust_phase = rate_1_s * random.uniform(0.05, 0.25, count), random.uniform(0, 2 * np.pi, count)

    step_s, samples = 1 / RATE_HZ, round(duration_s * RATE_HZ) + 1  # a hundredth of a period: good to a millionth
    half_steps = np.arange(2 * samples + 1)[:, None] * step_s / 2
    blow = lean.T[:, None] + gust.T[:, None] * np.sin(gust_rate * half_steps + gust_phase)
    wind = G_M_S2 * np.stack([*blow, -np.ones_like(half_steps * gust_rate)], axis=1)  # half steps, 3, swings

    def acceleration(force: Values, position: Values, velocity: Values) -> Values:
        """Return the acceleration under gravity and wind; all are of shape (3, swings)."""
        n = position / length_m
        speed2 = (velocity * velocity).sum(axis=0)
        force = force - (damping + drag * np.sqrt(speed2)) * velocity
        return np.asarray(force - ((force * n).sum(axis=0) + speed2 / length_m) * n)

    position, velocity = length_m * n.T, speed.T
    path, pulled = np.empty((samples, 3, count)), np.empty((samples, 3, count))
    for place in range(samples):
        begin, middle, end = wind[2 * place : 2 * place + 3]
        a1 = acceleration(begin, position, velocity)
        path[place], pulled[place] = position, a1
        v2 = velocity + step_s / 2 * a1
        a2 = acceleration(middle, position + step_s / 2 * velocity, v2)
        v3 = velocity + step_s / 2 * a2
        a3 = acceleration(middle, position + step_s / 2 * v2, v3)
        v4 = velocity + step_s * a3
        a4 = acceleration(end, position + step_s * v3, v4)
        position = position + step_s / 6 * (velocity + 2 * v2 + 2 * v3 + v4)
        velocity = velocity + step_s / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    path, pulled = path.transpose(2, 0, 1), pulled.transpose(2, 0, 1)
    place_share = 1 - crane.above_load_m / length_m
    force = np.empty_like(path)
    for number in range(count):
        frame = _frame(path[number] / length_m[number])
        if crane.spreader:
            frame = np.broadcast_to(np.eye(3), frame.shape)
        beside = np.einsum("nji,j->ni", frame[:, :2], crane.beside_m)
        spun = np.gradient(np.gradient(beside, 1 / RATE_HZ, axis=0), 1 / RATE_HZ, axis=0)
        moved = (1.0 if crane.spreader else place_share[number]) * pulled[number] + spun
        force[number] = np.einsum("nij,nj->ni", frame, moved + np.array([0, 0, G_M_S2])) / G_M_S2
    return force


def _read(
    random: np.random.Generator, crane: Installed, weeks: Weeks, force_g: Values, temperature_c: Values
) -> Values:
    """Return the readings of forces in the rope's frame, (n, 3)."""
    offset_g = crane.offset_g + np.outer(temperature_c - 15, crane.offset_g_per_c)
    noise = weeks.white_g * random.standard_normal(force_g.shape)
    return np.asarray(offset_g + force_g @ crane.response.T + noise + weeks.flicker_g * _flicker(random, len(force_g)))


def _flicker(random: np.random.Generator, count: int) -> Values:
    """Return noise with a spectrum of 1/f from an hour to 1 Hz, about unit size within minutes, (count, 3)."""
    times_s = np.geomspace(1.0, 3600.0, 7)
    total = np.zeros((count, 3))
    for tau_s in times_s:
        keep = np.exp(-1 / (RATE_HZ * tau_s))
        state = random.standard_normal(3)
        steps = np.sqrt(1 - keep**2) * random.standard_normal((count, 3))
        total += lfilter([1.0], [1.0, -keep], steps, axis=0, zi=keep * state[None])[0]
    return np.asarray(total / np.sqrt(len(times_s)))
