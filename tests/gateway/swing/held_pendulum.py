"""Exact pendulums under hands: held or carried, released, swinging freely, caught."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.pendulum.small_swing import small_swing_period_s

Array = NDArray[np.float64]
GRAVITY_M_S2 = 9.80665
STEPS_PER_PERIOD = 80


@dataclass(frozen=True)
class HeldRecording:
    """A drawn recording, and when its load was let go and caught."""

    time_s: Array
    force_g: Array
    released_s: float
    caught_s: float
    period_s: float
    """Of a small swing."""
    length_m: float
    rho: float
    amplitude_deg: float
    description: str


def swing(amplitude_rad: Array, sideways: Array, damping: Array, periods: float) -> tuple[Array, Array]:
    """Return times in 1/w0, shape (k,), and direction, acceleration and housing's x axis of n loads, shape (k, n, 3, 3).

    Spherical pendulums on ropes of length 1 in gravity 1, released at an amplitude (n,), pushed `sideways`; Runge-Kutta.
    """
    zero = np.zeros_like(amplitude_rad)
    sine, cosine = np.sin(amplitude_rad), np.cos(amplitude_rad)
    state = np.stack(
        [np.stack([sine, zero, -cosine]), np.stack([zero, sideways * sine, zero]), np.stack([cosine, zero, sine])]
    ).transpose(0, 2, 1)
    step = 2 * np.pi / STEPS_PER_PERIOD
    count = int(periods * STEPS_PER_PERIOD) + 2
    found = np.empty((count, len(amplitude_rad), 3, 3))
    down = np.array([0.0, 0.0, -1.0])

    def rate(state: Array) -> Array:
        q, v, x = state
        pull = down - (q @ down)[:, None] * q
        acceleration = pull - (v**2).sum(axis=1, keepdims=True) * q - 2 * damping[:, None] * v
        turn = (q * x).sum(axis=1, keepdims=True) * v - (v * x).sum(axis=1, keepdims=True) * q  # (q x v) x x
        return np.stack([v, acceleration, turn])

    for k in range(count):
        first = rate(state)
        found[k] = np.stack([state[0], first[1], state[2]], axis=1)
        second = rate(state + step / 2 * first)
        third = rate(state + step / 2 * second)
        state = state + step / 6 * (first + 2 * second + 2 * third + rate(state + step * third))
        state[0] /= np.linalg.norm(state[0], axis=1, keepdims=True)
    return np.asarray(step * np.arange(count), dtype=np.float64), found


def readings_g(motion: Array, rho: float) -> tuple[Array, Array]:
    """Return specific force along the rope, shape (k, 3), and what x and y read when still at the same place, (k, 2)."""
    direction, acceleration, x = motion[:, 0], motion[:, 1], motion[:, 2]
    y = np.cross(-direction, x)
    force = rho * acceleration + np.array([0.0, 0.0, 1.0])
    axes = np.stack([x, y, -direction], axis=1)
    return np.einsum("kij,kj->ki", axes, force), np.stack([x[:, 2], y[:, 2]], axis=1)


def drawn_recordings(count: int, seed: int, *, held: bool = True) -> Iterator[HeldRecording]:
    """Yield recordings with drawn lines, rates, swings and steps; without `held` the free swing alone."""
    rng = np.random.default_rng(seed)
    amplitude_rad = np.radians(np.exp(rng.uniform(np.log(2), np.log(90), count)))
    sideways = np.where(rng.random(count) < 0.3, rng.uniform(0, 0.4, count), 0.0)
    damping = np.exp(rng.uniform(np.log(3e-4), np.log(8e-3), count))
    periods = rng.uniform(5, 18, count)
    time_w0, motions = swing(amplitude_rad, sideways, damping, float(periods.max()) + 1)
    for i in range(count):
        yield _drawn(rng, time_w0, motions[:, i], float(amplitude_rad[i]), float(periods[i]), held=held)


def _drawn(
    rng: np.random.Generator, time_w0: Array, motion: Array, amplitude_rad: float, periods: float, *, held: bool
) -> HeldRecording:
    length_m = float(np.exp(rng.uniform(np.log(0.2), np.log(30))))
    period_s = small_swing_period_s(length_m, GRAVITY_M_S2)
    rate_1_s = 2 * np.pi / period_s
    rate_hz = float(rng.choice([10, 20, 30, 100, 4000] if length_m > 0.3 else [15, 20, 30, 100]))
    rho = float(rng.choice([rng.uniform(0, 1), 1.0, 0.02], p=[0.8, 0.1, 0.1]))
    step_g, noise_g = float(rng.choice([1e-6, 0.004, 0.016])), float(np.exp(rng.uniform(np.log(3e-4), np.log(6e-3))))
    before_s, after_s = rng.uniform(1.0, 4.0, 2) * (0.3 + 0.7 * min(period_s, 3.0)) * held
    duration_s = periods * period_s
    time_s = np.arange(0, before_s + duration_s + after_s, 1 / rate_hz)
    swinging_g, still_g = readings_g(motion, rho)
    elapsed_s = time_s - before_s
    force_g = np.stack([np.interp(elapsed_s * rate_1_s, time_w0, axis) for axis in swinging_g.T], axis=1)
    before, after = elapsed_s < 0, elapsed_s > duration_s
    if before.any():
        force_g[before] = _before_release(rng, time_s[before] / before_s, amplitude_rad)
    if after.any():
        caught = int(np.searchsorted(time_w0, duration_s * rate_1_s))
        speed = (still_g[caught] - still_g[caught - 1]) / (time_w0[1] - time_w0[0])
        force_g[after] = _after_catch(
            rng, (elapsed_s[after] - duration_s) * rate_1_s, rate_1_s, still_g[caught], speed, rho
        )
    askew_rad = np.radians(rng.uniform(0, 30)) * (rng.random() < 0.5)
    force_g = force_g @ _turned(rng, askew_rad).T + rng.normal(0.0, noise_g, force_g.shape)
    return HeldRecording(
        time_s,
        np.asarray(np.round(force_g / step_g) * step_g),
        before_s,
        before_s + duration_s,
        period_s,
        length_m,
        rho,
        float(np.degrees(amplitude_rad)),
        f"{np.degrees(amplitude_rad):.0f} deg, {length_m:.2f} m, rho {rho:.2f}, {rate_hz:g} Hz, steps {step_g:g} g, "
        f"noise {noise_g:.4f} g, askew {np.degrees(askew_rad):.0f} deg, {periods:.0f} periods",
    )


def is_visible(recording: HeldRecording) -> bool:
    """Return whether the swing turns back at six times the noise and the standard uncertainty of the steps."""
    amplitude_rad = np.radians(recording.amplitude_deg)
    across = (1 - recording.rho) * np.sin(amplitude_rad)
    axial = (1 + 2 * recording.rho) * (1 - np.cos(amplitude_rad)) / 2
    steps_g = np.diff(np.unique(recording.force_g[:, 2])).min()
    noise_g = np.diff(recording.force_g, n=6, axis=0).std() / np.sqrt(924)
    return bool(max(across, axial) > 6 * max(steps_g / np.sqrt(12) * np.sqrt(3), noise_g))


def smooth_step(share: Array) -> Array:
    """Return the path of least jerk from 0 to 1."""
    x = np.clip(share, 0.0, 1.0)
    return np.asarray(x**3 * (10 - 15 * x + 6 * x**2))


def _before_release(rng: np.random.Generator, share: Array, amplitude_rad: float) -> Array:
    """Return readings of a load that is held, or carried and held; `share` of the time until the release, shape (n,)."""
    path = rng.choice(["held", "carried and held", "carried"])
    angle_rad = np.full(len(share), amplitude_rad)
    if path != "held":
        duration = rng.uniform(0.4, 0.8) if path == "carried and held" else 0.98
        angle_rad = amplitude_rad * smooth_step((share - (0.2 if path == "carried and held" else 0.0)) / duration)
    tremor_g = rng.normal(0.0, rng.uniform(0.001, 0.006), (len(share), 3))
    return np.stack([np.sin(angle_rad), 0 * angle_rad, np.cos(angle_rad)], axis=1) + tremor_g


def _after_catch(
    rng: np.random.Generator, time_w0: Array, rate_1_s: float, still_g: Array, speed: Array, rho: float
) -> Array:
    """Return readings of a load that is stopped and held, lowered or brought upright; times since the catch in 1/w0."""
    path = rng.choice(["held", "lowered", "upright"])
    stop_w0 = min(rng.uniform(0.1, 0.35) * rate_1_s, 0.6 * np.pi)
    end_g = still_g + 0.4 * stop_w0 * speed
    if path == "upright":
        stop_w0, end_g = rng.uniform(0.4, 0.8) * np.pi, np.zeros(2)
    end_g = end_g * min(1.0, 0.97 / max(float(np.linalg.norm(end_g)), 1e-9))
    x = np.clip(time_w0 / stop_w0, 0.0, 1.0)[:, None]
    across = (2 * x**3 - 3 * x**2 + 1) * still_g + (x**3 - 2 * x**2 + x) * stop_w0 * speed + (3 - 2 * x) * x**2 * end_g
    curvature = (12 * x - 6) * still_g + (6 * x - 4) * stop_w0 * speed + (6 - 12 * x) * end_g
    braking_g = rho * curvature / stop_w0**2 * (x < 1)
    if path == "lowered":
        across = across * (1 - smooth_step((time_w0 - stop_w0 - 0.3) / (rng.uniform(0.8, 2) * rate_1_s)))[:, None]
    upright = np.sqrt(np.clip(1 - (across**2).sum(axis=1), 0.0, 1.0))
    bumps_g = rng.normal(0.0, 1.0, (len(time_w0), 3)) * (rng.uniform(0.01, 0.1) * (x < 1) + 0.002)
    return np.concatenate([across + braking_g, upright[:, None]], axis=1) + bumps_g


def _turned(rng: np.random.Generator, askew_rad: float) -> Array:
    """Return the rotation of a housing about a drawn horizontal axis, after one about the rope."""
    about, turn = rng.uniform(0, 2 * np.pi, 2)
    k = np.array([[0, 0, np.sin(about)], [0, 0, -np.cos(about)], [-np.sin(about), np.cos(about), 0]])
    askew = np.eye(3) + np.sin(askew_rad) * k + (1 - np.cos(askew_rad)) * k @ k
    around = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    return np.asarray(askew @ around)
