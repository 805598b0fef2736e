"""Simulated recordings whose condition is known at every instant; one seed, one recording."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.block import DeviceInfo, SampleBlock
from devices.pendulum.pendulum import start_motion
from devices.pendulum.small_swing import STANDARD_GRAVITY_M_S2
from devices.simulated.crane import Crane, GroundTruth
from devices.simulated.device import SimulatedCrane
from devices.simulated.schedule import Gust, Hoist, Schedule, TrolleyMove

Array = NDArray[np.float64]

SECONDS = 45.0
BLOCK_S = 0.1
WINDOW_S = 2.0
START_NS = 1_767_225_600_000_000_000
KINDS = (
    "rest",
    "rest",
    "lean",
    "swing",
    "swing",
    "trolley",
    "hoist",
    "swing_hoist",
    "gust",
    "impact",
    "clipped",
    "shake",
)


class Clock:
    """Stands still: the device is only asked what it is."""

    def now_ns(self) -> int:
        """Gateway time."""
        return START_NS

    def sleep_s(self, seconds: float) -> None:
        """Nobody sleeps here."""


@dataclass(frozen=True, slots=True)
class Recording:
    """Blocks, the configuration that they are read under, and the truth per sample."""

    kind: str
    info: DeviceInfo
    table: dict[str, Any]
    blocks: list[SampleBlock]
    time_s: Array
    force_g: Array
    """Of the crane alone: no noise, sensor errors, impacts or vibration, shape (n, 3)."""
    driven: dict[str, NDArray[np.bool_]]
    """Cause by cause: whether it acts, shape (n,)."""
    push_g: Array
    """What drives the load, as the housing feels it at once, shape (n,)."""
    period_s: float


def make(seed: int) -> Recording:
    """The recording of a seed."""
    random = np.random.default_rng([seed, 77])
    kind = KINDS[seed % len(KINDS)]
    rate_hz = float(random.choice([50.0, 100.0, 200.0]))
    length_m, rho = random.uniform(4.0, 40.0), random.uniform(0.02, 1.0)
    time_s = np.arange(round(SECONDS * rate_hz)) / rate_hz
    events = _events(kind, random, length_m, rho)
    crane = Crane(
        length_m=length_m,
        position_m=rho * length_m,
        events=events,
        motion=_start(kind, random, length_m),
        damping_ratio=random.choice([0.0, 0.002, 0.01]),
    )
    truth, force_g = crane.truth(time_s), crane.specific_force_m_s2(time_s) / crane.gravity_m_s2
    if kind == "lean":
        force_g = force_g @ _turned(random)
    crane_force_g = force_g.copy()
    driven = {"trolley": truth.trolley, "wind": truth.gust, "hoisting": truth.hoisting}
    driven |= {name: np.zeros(len(time_s), dtype=bool) for name in ("impact", "clipped", "vibration")}
    if kind in ("impact", "clipped"):
        for at in random.integers(round(5 * rate_hz), len(time_s) - 10, 4):
            size_g = random.uniform(0.4, 1.2) if kind == "impact" else 4.0
            ringing = np.exp(-np.arange(8) * 25 / rate_hz) * np.cos(np.arange(8) * 1.5)
            force_g[at : at + 8] += size_g * ringing[:, None] * _direction(random)
            driven[kind][at] = True
    if kind == "shake":
        begin_s = random.uniform(5, 25)
        shaken = (time_s > begin_s) & (time_s < begin_s + random.uniform(6, 15))
        wave = np.sin(2 * np.pi * random.uniform(11.0, 0.45 * rate_hz) * time_s) * random.uniform(0.012, 0.12)
        force_g += (wave * shaken)[:, None] * _direction(random)
        driven["vibration"] = shaken
    device = SimulatedCrane(
        odr_hz=rate_hz, block_samples=1, length_m=length_m, position_m=1.0, clock=Clock(), crane=crane, seed=seed
    )
    stated_g = device.part.noise_g
    noisy_g = force_g + random.normal(0.0, stated_g * random.choice([0.0, 1.0, 2.0]), force_g.shape)
    blocks = _blocks(device, time_s, noisy_g, random)
    believed_m = length_m * random.uniform(0.88, 1.12)
    place = {"above_load_m": min((1 - rho) * length_m, 0.98 * believed_m)}
    table = {"device": {"odr_hz": rate_hz}, "rope": {"length_m": believed_m}, "housing": place}
    return Recording(
        kind,
        device.open(),
        table,
        blocks,
        time_s,
        crane_force_g,
        driven,
        _push_g(events, time_s, truth),
        period_s=2 * np.pi * np.sqrt(float(truth.length_m.max()) / crane.gravity_m_s2),
    )


def _events(
    kind: str, random: np.random.Generator, length_m: float, rho: float
) -> Sequence[TrolleyMove | Gust | Hoist]:
    begin_s, azimuth_rad = random.uniform(4, 20), random.uniform(-np.pi, np.pi)
    if kind == "trolley":
        ramp_s = random.uniform(1.5, 5.0)
        return [TrolleyMove(begin_s, random.uniform(2 * ramp_s, 15), ramp_s, random.uniform(0.3, 2.0), azimuth_rad)]
    if kind == "gust":
        return [Gust(begin_s, random.uniform(3, 10), random.uniform(0.1, 0.6), azimuth_rad)]
    if kind in ("hoist", "swing_hoist"):
        by_m = random.uniform(1.0, 8.0)
        if random.random() < 0.5:
            by_m = -min(by_m, 0.6 * rho * length_m)
        return [Hoist(begin_s, abs(by_m) / random.uniform(0.2, 0.8) + 1.0, by_m)]
    return []


def _start(kind: str, random: np.random.Generator, length_m: float) -> Array:
    if kind not in ("swing", "swing_hoist") and not (kind in ("trolley", "gust", "impact") and random.random() < 0.3):
        return start_motion(0.0, 0.0, 0.0, 0.0)
    angle_rad = np.radians(np.exp(random.uniform(np.log(0.4), np.log(15.0))))
    azimuth_rad, round_share = random.uniform(-np.pi, np.pi), random.uniform(0, 1) * random.integers(0, 2)
    x, y, rate = np.cos(azimuth_rad), np.sin(azimuth_rad), angle_rad * np.sqrt(9.80665 / length_m) * round_share
    return start_motion(angle_rad * x, angle_rad * y, -rate * y, rate * x)


def _turned(random: np.random.Generator) -> Array:
    lean_rad, azimuth_rad = np.radians(random.uniform(0.5, 12)), random.uniform(-np.pi, np.pi)
    c, s = np.cos(lean_rad), np.sin(lean_rad)
    about_y = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    c, s = np.cos(azimuth_rad), np.sin(azimuth_rad)
    return np.asarray(about_y @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))


def _push_g(events: Sequence[TrolleyMove | Gust | Hoist], time_s: Array, truth: GroundTruth) -> Array:
    """Trolley: what the load's inertia leaves of it at the housing; wind: what the rope hands on; hoist: along the rope."""
    drive = Schedule(events, float(truth.length_m[0])).at(time_s)
    across = (1 - truth.rho[:, None]) * drive.pivot_acceleration_m_s2 + truth.rho[:, None] * drive.force_m_s2
    push_m_s2 = np.hypot(np.linalg.norm(across, axis=1), drive.length_acceleration_m_s2[:, 0])
    return np.asarray(push_m_s2 / STANDARD_GRAVITY_M_S2)


def _direction(random: np.random.Generator) -> Array:
    vector = random.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def _blocks(device: SimulatedCrane, time_s: Array, force_g: Array, random: np.random.Generator) -> list[SampleBlock]:
    temperature_c = np.full(len(time_s), device.part.errors.reference_temperature_c)
    raw = device.part.counts(force_g, temperature_c, random)
    time_ns = START_NS + np.rint(time_s * 1e9).astype(np.int64)
    n = round(BLOCK_S * device.part.odr_hz)
    return [SampleBlock(time_ns[i : i + n], raw[i : i + n]) for i in range(0, len(raw), n)]
